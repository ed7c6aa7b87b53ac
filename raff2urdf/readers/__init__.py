"""Robots that others have described, as a URDF's text and what that can't say.

A URDF may have a file beside it that closes its loops: `<stem>.constraints.json`, or a `robot.yaml`. SDF and MJCF close
theirs themselves. A new format is a new module here, and a line in `READERS`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from raff2urdf.errors import RaffError
from raff2urdf.readers.urdf import parse_xml, read_text

if TYPE_CHECKING:  # each format is imported where it is read
    from raff2urdf.constraints import Constraints

Description = tuple[str, "Constraints | None"]
"""A URDF's text, and what it can't say; None where nothing more is known."""

ENDINGS = (".urdf", ".xml", ".sdf", ".world", ".mjcf")
"""Of files that are read here. They hold XML; what it describes is told by its first element."""


def read(path: Path, robot: str | None = None) -> Description:
    """The robot of a URDF, SDF or MJCF.

    Args:
        path: of the file.
        robot: which, where the file holds several; the first unless said.

    Raises:
        RaffError: the file, or one beside it, can't be read or is wrong: where and why.
    """
    text = read_text(path)
    kind = str(parse_xml(text, str(path)).tag)
    if kind not in READERS:
        known = ", ".join(f"<{word}>" for word in READERS)
        raise RaffError(f"{path}: its first element is <{kind}>: this is no robot (known: {known})")
    return READERS[kind](text, path, robot)


def _urdf(text: str, path: Path, robot: str | None) -> Description:
    from raff2urdf import constraints
    from raff2urdf.readers import robot_yaml

    companion = path.with_suffix(".constraints.json")
    if companion.exists():
        return text, constraints.load(companion)
    gepetto = robot_yaml.beside(path)
    return (text, None) if gepetto is None else robot_yaml.read(gepetto, text, str(path))


def _sdf(text: str, path: Path, robot: str | None) -> Description:
    from raff2urdf.readers import sdf

    return sdf.read(text, str(path), robot)


def _mjcf(text: str, path: Path, robot: str | None) -> Description:
    from raff2urdf.readers import mjcf

    return mjcf.read(path)


READERS = {"robot": _urdf, "sdf": _sdf, "mujoco": _mjcf}
