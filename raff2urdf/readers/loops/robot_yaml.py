"""Read the sidecar file `robot.yaml` of a URDF, in the format of Gepetto's example-parallel-robots.

    closed_loop: [[A, B], ...]      pairs of frames that coincide, named by their links or by the joints before these
    type: ['6d', ...]               of each: 6d, rigid, or 3d, only the origins
    name_mot: [...]                 the actuated joints
    joint_name: [...]               joints to be replaced ...
    joint_type: ['SPHERICAL', ...]  ... by SPHERICAL, UJOINT_XY (rotations about x, then y, of the joint's own frame)
                                    or FIXED

Such models are exported from CAD: all joints are written as revolute ones, and a loop's two ends are apart.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from lxml import etree

from raff2urdf.constraints import Constraints, loop_entry
from raff2urdf.errors import RaffError, did_you_mean, warn
from raff2urdf.files import note
from raff2urdf.readers.loops import successive
from raff2urdf.readers.loops.sidecar import content_of, plain
from raff2urdf.readers.urdf import ends, joints, root_first
from raff2urdf.readers.urdf_file import parse
from raff2urdf.readers.yaml_file import nodes_of

_KEYS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type")
_DISTINCTIVE = ("closed_loop", "name_mot", "joint_name")
_KINDS = {"6d": "rigid", "3d": "ball"}


def sidecar_of(path: Path) -> Path | None:
    """Return the file of this kind for a URDF: `<stem>.yaml` or `robot.yaml`; None if there is none.

    Other programs write a `<stem>.yaml` of their own: it must contain one of the keys that only this format has.
    """
    named, shared = plain(path).with_suffix(".yaml"), path.with_name("robot.yaml")
    for file in (named, shared):
        note(file)
    if named.is_file() and (named == shared or any(key.encode() in content_of(named) for key in _DISTINCTIVE)):
        return named
    return shared if shared.is_file() else None


def loops_of(urdf: Path, text: str) -> tuple[str, Constraints] | None:
    """Return the URDF with the joints that its file asks for, and the constraints there; None without such a file.

    Args:
        urdf: path of the URDF.
        text: of the URDF.

    Raises:
        RaffError: not a YAML file of this kind; it names a frame or a joint that the URDF lacks; an unknown type; not
            a URDF.
    """
    path, name = sidecar_of(urdf), str(urdf)
    if path is None:
        return None
    lists, tree = _Lists(path), parse(text, name)
    nodes = root_first(tree)
    children = {joint.get("name"): ends(joint)[1] for joint in joints(tree)}  # what a joint's frame moves with
    replaced: dict[str, list[str]] = {}
    by_name = {joint.get("name"): joint for joint in joints(tree)}
    for joint, kind in lists.pairs("joint_name", "joint_type"):
        lists.check_scalars(joint, kind)
        if joint.value not in by_name:  # published files name some that are gone, or spelt otherwise
            message = f"joint '{joint.value}' is not in the URDF: nothing is replaced"
            warn(str(lists.error(joint, message, list(by_name))))
            continue
        replaced[joint.value] = _replace(tree, by_name[joint.value], kind, lists, name)
    replaced |= successive.replace_compound(tree, name, keep_root=True)
    moving = [joint.get("name") for joint in joints(tree) if joint.get("type") not in ("fixed", "floating")]
    actuated = _actuated(lists, moving, replaced)
    loops: list[dict[str, Any]] = []
    for pair, kind in lists.pairs("closed_loop", "type"):
        lists.check_scalars(kind)
        if kind.value.lower() not in _KINDS:
            raise lists.error(kind, f"the type of a loop must be 3d or 6d, not '{kind.value}'")
        frames = list(pair.value) if isinstance(pair, yaml.SequenceNode) else []
        if len(frames) != 2:
            raise lists.error(pair, "a closed loop must be a pair of frames: [frame, frame]")
        lists.check_scalars(*frames)
        for frame in frames:
            if frame.value not in children and frame.value not in nodes:
                raise lists.error(frame, f"the URDF has no joint or link '{frame.value}'", [*children, *nodes])
        first, second = (children.get(frame.value, frame.value) for frame in frames)
        if first == second:
            raise lists.error(pair, f"the loop joins '{first}' to itself: name two different frames")
        loop_name = f"{frames[0].value}-{frames[1].value}"
        again = sum(loop["name"].partition("#")[0] == loop_name for loop in loops)
        own_name = f"{loop_name}#{again + 1}" if again else loop_name
        loops.append(loop_entry(own_name, _KINDS[kind.value.lower()], first, second))
    entries = [{"name": joint, **({"actuated": joint in actuated} if actuated else {})} for joint in moving]
    return etree.tostring(tree, encoding="unicode"), {"nodes": nodes, "joints": entries, "loops": loops}


def _replace(tree: Any, joint: Any, kind: Any, lists: _Lists, name: str) -> list[str]:
    """Replace a joint of the URDF; return the names of the joints that replace it."""
    word = str(kind.value).upper()
    axes = re.fullmatch("UJOINT_([XYZ])([XYZ])", word)
    if word == "FIXED":
        joint.set("type", "fixed")
        return []
    if word == "SPHERICAL":
        return successive.replace(tree, joint, successive.SPHERICAL, name)
    if axes is None or axes[1] == axes[2]:
        raise lists.error(
            kind, f"the type of a joint must be SPHERICAL, FIXED or UJOINT_XY (any two axes), not '{kind.value}'"
        )
    return successive.replace(tree, joint, [successive.ROTATIONS[axis] for axis in axes.groups()], name)


def _actuated(lists: _Lists, moving: list[str], replaced: Mapping[str, list[str]]) -> set[str]:
    """Return the names of the actuated joints; of a joint that was replaced, all that replace it."""
    actuated: set[str] = set()
    for entry in lists.entries("name_mot"):
        lists.check_scalars(entry)
        names = replaced.get(entry.value, [entry.value])
        for joint in names:
            if joint not in moving:
                raise lists.error(entry, f"'{joint}' in name_mot is not a joint that moves", moving)
        actuated |= set(names)
    return actuated


class _Lists:
    """The lists of the YAML file, with the line of each entry."""

    def __init__(self, path: Path) -> None:
        self.path = path
        root = nodes_of(path)
        self.values: dict[str, Any] = {}
        if not isinstance(root, yaml.MappingNode):
            raise RaffError(f"{path}:1: it must hold closed_loop, type and name_mot, each with a list")
        for key, value in root.value:
            self.check_scalars(key)
            if key.value not in _KEYS:
                raise self.error(key, f"unknown key '{key.value}'", list(_KEYS))
            self.values[key.value] = value

    def entries(self, key: str) -> list[Any]:
        """Return the entries of a list; none if it is left out."""
        value = self.values.get(key)
        if value is None or value.value in ("", "null", "~"):
            return []
        if not isinstance(value, yaml.SequenceNode):
            raise self.error(value, f"{key} must be a list")
        return list(value.value)

    def check_scalars(self, *nodes: Any) -> None:
        """Raise RaffError if one of them is a list or a mapping."""
        for node in nodes:
            if not isinstance(node, yaml.ScalarNode):
                raise self.error(node, "this must be a word, not a list")

    def pairs(self, key: str, other: str) -> list[tuple[Any, Any]]:
        """Return the corresponding entries of two lists."""
        first, second = self.entries(key), self.entries(other)
        if len(first) != len(second):
            at = self.values[other if other in self.values else key]
            raise self.error(at, f"{key} has {len(first)} entries, but {other} has {len(second)}: give one for each")
        return list(zip(first, second, strict=True))

    def error(self, node: Any, message: str, known: list[str] | None = None) -> RaffError:
        """Return an error with the node's line, and with similar or known names."""
        near = did_you_mean(str(node.value), known) if known else ""
        return RaffError(f"{self.path}:{node.start_mark.line + 1}: {message}{near}")
