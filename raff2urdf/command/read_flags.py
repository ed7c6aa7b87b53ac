"""Options of commands that load robots' files: `--package`, `--xacro-arg`, `--swap-limits`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from raff2urdf.command.command_line import UsageError, flag, option
from raff2urdf.errors import RaffError

if TYPE_CHECKING:  # it imports lxml, which help does not need
    from raff2urdf.readers.options import ReadOptions


@dataclass(frozen=True)
class ReadFlags:
    """Options of how a file is read, as `expand` makes them options of a command."""

    package: list[str] = option(
        "NAME=FOLDER", "folder of a ROS package, for package:// and $(find); may be repeated", (), "--package"
    )
    xacro_arg: list[str] = option("NAME=VALUE", "argument of a file in xacro; may be repeated", (), "--xacro-arg")
    swap_limits: bool = flag("--swap-limits", "exchange limits of a URDF where the lower one is above the upper one")

    def options(self) -> ReadOptions:
        """Return what the readers need.

        Raises:
            UsageError: an option is no NAME=VALUE.
            RaffError: the folder of a package does not exist.
        """
        from raff2urdf.readers.options import ReadOptions

        packages = _pairs("--package", "arm_description=../arm_description", self.package)
        return ReadOptions(packages, _pairs("--xacro-arg", "prefix=left_", self.xacro_arg), self.swap_limits)


def loop_kinds_of(texts: Sequence[str] | None) -> dict[str, str]:
    """Return the names and kinds of loops that options `--loop NAME=KIND` name.

    Raises:
        RaffError: a text is no NAME=KIND.
    """
    loops = {}
    for text in texts or ():
        name, equals, kind = text.rpartition("=")
        if not equals:
            raise RaffError(f"--loop {text}: write NAME=KIND, for example --loop link5-link11=ball")
        loops[name] = kind
    return loops


def _pairs(option: str, example: str, texts: Sequence[str]) -> dict[str, str]:
    pairs: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name and equals):
            raise UsageError(f"{option} {text}: write NAME=VALUE, for example {option} {example}")
        if name in pairs:
            raise UsageError(f"{option} {text}: '{name}' is given twice: leave one out")
        pairs[name] = value
    return pairs
