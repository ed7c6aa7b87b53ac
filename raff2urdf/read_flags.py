"""Options of commands that load robots' files: `--package`, `--xacro-arg`, `--swap-limits`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import typer

from raff2urdf.command_line import UsageError

if TYPE_CHECKING:  # it imports lxml, which help does not need
    from raff2urdf.readers.options import ReadOptions


@dataclass(frozen=True)
class ReadFlags:
    """Options of how a file is read, as `expand` makes them options of a command."""

    package: list[str] = typer.Option(
        (), "--package", metavar="NAME=FOLDER", show_default=False,
        help="folder of a ROS package, for package:// and $(find); may be repeated",
    )  # fmt: skip
    xacro_arg: list[str] = typer.Option(
        (), "--xacro-arg", metavar="NAME=VALUE", show_default=False,
        help="argument of a file in xacro; may be repeated",
    )  # fmt: skip
    swap_limits: bool = typer.Option(
        False, "--swap-limits", metavar="", help="exchange limits of a URDF where the lower one is above the upper one"
    )

    def options(self) -> ReadOptions:
        """Return what the readers need.

        Raises:
            UsageError: an option is no NAME=VALUE.
            RaffError: the folder of a package does not exist.
        """
        from raff2urdf.readers.options import ReadOptions

        packages = _pairs("--package", "arm_description=../arm_description", self.package)
        return ReadOptions(packages, _pairs("--xacro-arg", "prefix=left_", self.xacro_arg), self.swap_limits)


def _pairs(option: str, example: str, texts: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name and equals):
            raise UsageError(f"{option} {text}: write NAME=VALUE, for example {option} {example}")
        if name in found:
            raise UsageError(f"{option} {text}: '{name}' is given twice: leave one out")
        found[name] = value
    return found
