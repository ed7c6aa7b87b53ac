"""Options of how a robot's file is read, which `cinegen.load`, `to_raff` and the commands pass on to the readers.

A new option is a field of `ReadOptions`, a parameter of `cinegen.load` and `to_raff`, and a flag in
`raff2urdf.command.read_flags`. A reader that honours it calls `met`, so that an option without effect is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.graphics.names import Packages


@dataclass(frozen=True)
class ReadOptions:
    """Options of how a file is read.

    Attributes:
        packages: folders of ROS packages, by name.
        xacro_args: arguments of a file in xacro, by name.
        swap_limits: exchange lower and upper limits of a URDF where the lower one is above the upper one.

    Raises:
        RaffError: the folder of a package does not exist.
    """

    packages: Mapping[str, str | Path] = field(default_factory=dict)
    xacro_args: Mapping[str, str] = field(default_factory=dict)
    swap_limits: bool = False
    _used: set[tuple[str, str]] = field(default_factory=set, init=False, repr=False, compare=False)
    _known: dict[str, dict[str, None]] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name, folder in self.packages.items():
            if not Path(folder).expanduser().is_dir():
                raise RaffError(f"--package {name}={folder}: there is no such folder: name the folder of the package")

    @property
    def search(self) -> Packages:
        """The search for packages, with those that are given."""
        return Packages({name: Path(folder).expanduser().absolute() for name, folder in self.packages.items()})

    def met(self, option: str, *names: str, known: bool = True) -> None:
        """Note that a file has what an option is about.

        Args:
            option: `package`, `xacro-arg` or `swap-limits`.
            names: of packages or arguments; none for an option without a name.
            known: whether errors may propose the names.
        """
        self._used.update((option, name) for name in names or ("",))
        if known:
            self._known.setdefault(option, {}).update(dict.fromkeys(names))

    def check(self, *files: object) -> None:
        """Check that every option had an effect.

        Args:
            files: that were read with them, for the error.

        Raises:
            RaffError: an option had no effect on any of the files.
        """
        listed = ", ".join(map(str, files))
        for option, values, what in (
            ("package", self.packages, "names no package"),
            ("xacro-arg", self.xacro_args, "has no argument"),
        ):
            for name, value in values.items():
                if (option, name) not in self._used:
                    near = did_you_mean(name, list(self._known.get(option, ()))) or ": leave it out"
                    raise RaffError(f"--{option} {name}={value} has no effect: {listed} {what} '{name}'{near}")
        if self.swap_limits and ("swap-limits", "") not in self._used:
            raise RaffError(
                f"--swap-limits has no effect: no joint of {listed} has a lower limit above its upper one: leave it out"
            )
