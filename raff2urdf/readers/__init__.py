"""Read robots from other formats, as the text of a URDF and the contents of a constraints file.

Loops of a URDF are in a sidecar file next to it: `<stem>.constraints.json`, or a `robot.yaml`. SDF and MJCF declare
theirs themselves. A new format is a new module here, and a line in `READERS`; a new dialect of loops in URDFs is a new
module, and a name in `LOOP_SOURCES`.
"""

from __future__ import annotations

import warnings
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from raff2urdf.errors import RaffWarning
from raff2urdf.files import STANDARD, read_bytes
from raff2urdf.readers.xml_file import error_at, parse_xml, read_text

if TYPE_CHECKING:  # each format is imported when it is read
    from raff2urdf.constraints import Constraints

Description = tuple[str, "Constraints | None"]
"""The text of a URDF, and the contents of its constraints file; None if nothing more is known."""

ENDINGS = (".urdf", ".xml", ".sdf", ".world", ".mjcf")
"""Endings of files that are read here. They hold XML; the root element determines the format."""


def holds_xml(path: Path) -> bool:
    """Return whether a file is read here: by its ending; of standard input (`-`) by its first character."""
    return path.suffix.lower() in ENDINGS or (path == STANDARD and read_bytes(path).lstrip()[:1] == b"<")


def read(path: Path, robot: str | None = None, ignore_loops: bool = False) -> Description:
    """Read the robot of a URDF, SDF or MJCF.

    Args:
        path: of the file.
        robot: which robot of a file with several; the first by default.
        ignore_loops: leave all loops open; one warning lists them.

    Raises:
        RaffError: the file, or its sidecar file, can't be read or is wrong: where and why. A URDF declares loops or
            couplings that are not read, and `ignore_loops` is false.
    """
    text = read_text(path)
    root = parse_xml(text, str(path))
    kind = str(root.tag)
    if kind not in READERS:
        known = ", ".join(f"<{word}>" for word in READERS)
        why = _OTHER_ROOTS.get(kind, f"this is not a robot (known: {known})")
        raise error_at(str(path), root, f"its first element is <{kind}>: {why}")
    urdf, constraints, ignored = READERS[kind](text, path, robot, ignore_loops)
    if not ignore_loops:
        return urdf, constraints
    from raff2urdf.constraints import without_loops

    ignored += [f"loop '{loop['name']}'" for loop in constraints["loops"]] if constraints else []
    if ignored:
        message = f"{path}: left out, as requested; every joint moves independently: {', '.join(ignored)}"
        warnings.warn(message, RaffWarning, stacklevel=4)
    return urdf, without_loops(constraints) if constraints else None


_Found = tuple[str, "Constraints | None", list[str]]
"""A description, and the declarations in the file that were ignored."""


def _urdf(text: str, path: Path, robot: str | None, ignore_loops: bool) -> _Found:
    from raff2urdf.errors import RaffError
    from raff2urdf.readers import declared_loops, sidecar
    from raff2urdf.readers.urdf import parse, xacro_hint

    name, values, misplaced = str(path), None, None
    declared: list[declared_loops.Declaration] = []
    if ignore_loops:
        text, declared = declared_loops.without_second_parents(text, name)
    tree = parse(text, name)
    declared += declared_loops.find(tree)
    found = next(filter(None, (import_module(source).loops_of(path, text) for source in LOOP_SOURCES)), None)
    if found is not None:
        text, values = found
    else:
        misplaced = sidecar.misplaced(path, text)
    if ignore_loops:
        if values is not None:  # its loops are listed themselves
            declared = [declaration for declaration in declared if declaration.dialect != declared_loops.COMMENT]
        ignored = [declared_loops.listed(declared)] if declared else []
        return text, values, ignored + ([f"the loops of {misplaced.file}"] if misplaced else [])
    if misplaced:
        raise RaffError(misplaced.refusal(path))
    closed = len(values["loops"]) if values else 0
    lost = declared_loops.unread(declared, closed)
    certain = [declaration for declaration in lost if declaration.certain]
    if certain:
        raise RaffError(f"{declared_loops.refusal(certain, path, closed)}{xacro_hint(tree, name)}")
    if lost:
        also = f". Also not read: {declared_loops.listed(lost[1:], 3)}" if lost[1:] else ""
        warnings.warn(f"{name}:{lost[0].line}: {lost[0].text}{also}", RaffWarning, stacklevel=5)
    return text, values, []


def _sdf(text: str, path: Path, robot: str | None, ignore_loops: bool) -> _Found:
    from raff2urdf.readers import sdf

    return sdf.read(text, str(path), robot)


def _mjcf(text: str, path: Path, robot: str | None, ignore_loops: bool) -> _Found:
    from raff2urdf.readers import mjcf

    return mjcf.read(path)


_OTHER_ROOTS = {
    "mujocoinclude": "this is a part of a robot: load the file that includes it",
    "gazebo": "this is not SDF 1.4 or later: convert it with Gazebo's `gz sdf --convert`",
}

READERS = {"robot": _urdf, "sdf": _sdf, "mujoco": _mjcf}

LOOP_SOURCES = ("raff2urdf.readers.sidecar", "raff2urdf.readers.robot_yaml")
"""Modules that read the loops of a URDF, the first that finds some; a new dialect is a new module and a name here.

Each has `loops_of(path, text)`, which returns the URDF's text, with joints replaced if the dialect asks for it, and the
contents of a constraints file; None if the URDF has no loops in this dialect."""
