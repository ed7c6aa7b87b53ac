"""Robots that others have described, as a URDF's text and what that can't say.

A URDF may have a file beside it that closes its loops: `<stem>.constraints.json`, or a `robot.yaml`. SDF and MJCF close
theirs themselves. A new format is a new module here, and a line in `READERS`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from raff2urdf.errors import RaffError
from raff2urdf.readers.xml_file import parse_xml, read_text

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
    root = parse_xml(text, str(path))
    kind = str(root.tag)
    if kind not in READERS:
        known = ", ".join(f"<{word}>" for word in READERS)
        why = _NO_ROBOTS.get(kind, f"this is no robot (known: {known})")
        raise RaffError(f"{path}:{root.sourceline}: its first element is <{kind}>: {why}")
    return READERS[kind](text, path, robot)


def _urdf(text: str, path: Path, robot: str | None) -> Description:
    from raff2urdf import constraints
    from raff2urdf.readers import robot_yaml
    from raff2urdf.readers.successive import names

    companion = path.with_suffix(".constraints.json")
    if companion.exists():
        return text, constraints.load(companion, names(text, str(path)))
    gepetto = robot_yaml.beside(path)
    return (text, None) if gepetto is None else robot_yaml.read(gepetto, text, str(path))


def _sdf(text: str, path: Path, robot: str | None) -> Description:
    from raff2urdf.readers import sdf

    return sdf.read(text, str(path), robot)


def _mjcf(text: str, path: Path, robot: str | None) -> Description:
    from raff2urdf.readers import mjcf

    return mjcf.read(path)


_NO_ROBOTS = {
    "mujocoinclude": "this is no robot, but a part of one: load the file that includes it",
    "gazebo": "this is no robot of SDF 1.4 or later: Gazebo's `gz sdf --convert` makes one of it",
}

READERS = {"robot": _urdf, "sdf": _sdf, "mujoco": _mjcf}
