"""Robots that others have described, as a URDF's text and what that can't say.

A URDF may have a file beside it that closes its loops: `<stem>.constraints.json`, or a `robot.yaml`. SDF and MJCF close
theirs themselves. A new format is a new module here, and a line in `READERS`.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from raff2urdf.errors import RaffError, RaffWarning
from raff2urdf.readers.xml_file import parse_xml, read_text

if TYPE_CHECKING:  # each format is imported where it is read
    from raff2urdf.constraints import Constraints

Description = tuple[str, "Constraints | None"]
"""A URDF's text, and what it can't say; None where nothing more is known."""

ENDINGS = (".urdf", ".xml", ".sdf", ".world", ".mjcf")
"""Of files that are read here. They hold XML; what it describes is told by its first element."""


def read(path: Path, robot: str | None = None, ignore_loops: bool = False) -> Description:
    """The robot of a URDF, SDF or MJCF.

    Args:
        path: of the file.
        robot: which, where the file holds several; the first unless said.
        ignore_loops: leave all loops open; one warning lists them.

    Raises:
        RaffError: the file, or one beside it, can't be read or is wrong: where and why. A URDF declares loops or
            couplings that are not read, and `ignore_loops` is false.
    """
    text = read_text(path)
    root = parse_xml(text, str(path))
    kind = str(root.tag)
    if kind not in READERS:
        known = ", ".join(f"<{word}>" for word in READERS)
        why = _NO_ROBOTS.get(kind, f"this is no robot (known: {known})")
        raise RaffError(f"{path}:{root.sourceline}: its first element is <{kind}>: {why}")
    urdf, constraints, ignored = READERS[kind](text, path, robot, ignore_loops)
    if not ignore_loops:
        return urdf, constraints
    from raff2urdf.constraints import opened

    ignored += [f"loop '{loop['name']}'" for loop in constraints["loops"]] if constraints else []
    if ignored:
        message = f"{path}: left out, as asked; every joint moves on its own: {', '.join(ignored)}"
        warnings.warn(message, RaffWarning, stacklevel=4)
    return urdf, opened(constraints) if constraints else None


_Found = tuple[str, "Constraints | None", list[str]]
"""A description, and what was ignored in the file, in words."""


def _urdf(text: str, path: Path, robot: str | None, ignore_loops: bool) -> _Found:
    from raff2urdf import constraints
    from raff2urdf.readers import declared_loops, robot_yaml, sidecar
    from raff2urdf.readers.successive import moving
    from raff2urdf.readers.urdf import links, parse, unmade

    name, said, misplaced = str(path), None, None
    declared: list[declared_loops.Declaration] = []
    if ignore_loops:
        text, declared = declared_loops.without_second_parents(text, name)
    tree = parse(text, name)
    declared += declared_loops.find(tree)
    known = [str(link.get("name")) for link in links(tree)]
    own, gepetto = sidecar.constraints_of(path), robot_yaml.beside(path)
    if own.exists():
        types = moving(text, name)
        said = constraints.load(own, (known, list(types)), types)
    elif gepetto is not None:
        text, said = robot_yaml.read(gepetto, text, name)
    else:
        misplaced = sidecar.misplaced(path, tree.get("name", ""), known, moving(text, name))
    if ignore_loops:
        if said is not None:  # its loops are listed themselves
            declared = [declaration for declaration in declared if declaration.dialect != declared_loops.COMMENT]
        ignored = [declared_loops.listed(declared)] if declared else []
        return text, said, ignored + ([f"the loops of {misplaced.file}"] if misplaced else [])
    if misplaced:
        raise RaffError(misplaced.refusal(path))
    closed = len(said["loops"]) if said else 0
    lost = declared_loops.unread(declared, closed)
    sure = [declaration for declaration in lost if declaration.certain]
    if sure:
        raise RaffError(f"{declared_loops.refusal(sure, name, own.name, closed)}{unmade(tree, name)}")
    if lost:
        also = f". Also not read: {declared_loops.listed(lost[1:], 3)}" if lost[1:] else ""
        warnings.warn(f"{name}:{lost[0].line}: {lost[0].text}{also}", RaffWarning, stacklevel=5)
    return text, said, []


def _sdf(text: str, path: Path, robot: str | None, ignore_loops: bool) -> _Found:
    from raff2urdf.readers import sdf

    return *sdf.read(text, str(path), robot), []


def _mjcf(text: str, path: Path, robot: str | None, ignore_loops: bool) -> _Found:
    from raff2urdf.readers import mjcf

    return *mjcf.read(path), []


_NO_ROBOTS = {
    "mujocoinclude": "this is no robot, but a part of one: load the file that includes it",
    "gazebo": "this is no robot of SDF 1.4 or later: Gazebo's `gz sdf --convert` makes one of it",
}

READERS = {"robot": _urdf, "sdf": _sdf, "mujoco": _mjcf}
