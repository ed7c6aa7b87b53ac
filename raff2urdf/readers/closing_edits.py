"""The edits of a URDF that close its loops with all joints at home as written: see `raff2urdf.loops.slips`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.loops.mobility import loop_kind
from raff2urdf.loops.slips import DrawnLoop, DrawnPart, Fault, slips
from raff2urdf.placement import from_origin, joint_motion
from raff2urdf.raff.document import LoopKind
from raff2urdf.raff.writer import number
from raff2urdf.readers.urdf import axis, ends, joints, root_first, three
from raff2urdf.readers.urdf_file import parse

_XYZ, _RPY = ("x", "y", "z"), ("roll", "pitch", "yaw")
_LENGTHS = frozenset(_XYZ)


def slips_of(urdf: str, constraints: Mapping[str, Any], name: str, dialect: str, fault: Fault) -> str | None:
    """Return the edits of a URDF, each of which closes all of its loops as written; None if there are none.

    Args:
        urdf: its text.
        constraints: as `raff2urdf.constraints` describes, with loops.
        name: the file's, for errors.
        dialect: SDF or MJCF, if that was translated to the URDF: its own numbers are others.
        fault: what is wrong.

    Raises:
        RaffError: no URDF.
    """
    tree = parse(urdf, name)
    home = {entry["name"]: entry.get("home", 0.0) for entry in constraints.get("joints", [])}
    above, nodes = {ends(joint)[1]: joint for joint in joints(tree)}, root_first(tree)
    parts = {nodes[0]: DrawnPart(None, {}, lambda _: np.eye(4))}
    waiting = nodes[1:]
    while waiting:
        ready = [node for node in waiting if ends(above[node])[0] in parts]
        for node in ready:
            parts[node] = _part(above[node], home.get(above[node].get("name"), 0.0), name, nodes)
        waiting = [node for node in waiting if node not in parts]
    loops = []
    for i, entry in enumerate(constraints["loops"]):
        for end in ("first", "second"):
            parts[f"{i} {end}"] = _end(entry, end, nodes)
        loops.append(DrawnLoop(f"{i} first", f"{i} second", loop_kind(entry["kind"]), partial(_typed, entry)))
    for node, part in parts.items() if dialect in ("SDF", "MJCF") else ():
        hinges = tuple(_hinges(node)) if dialect == "MJCF" and part.screw is None and node in above else ()
        place = partial(_still, part.place(part.numbers))
        parts[node] = replace(part, numbers={}, place=place, parents=(), joints=hinges)
    return slips(parts, loops, any(home.values()), fault)


def _hinges(body: str) -> Iterator[tuple[str, Array]]:
    for row in np.eye(3, dtype=int):
        shown = " ".join(map(str, row))
        yield f"add <joint axis=\"{shown}\"/> to body '{body}'", np.concatenate([np.zeros(3), row])


def _still(placed: Array, _: Mapping[str, float]) -> Array:
    return placed


def _part(joint: Any, value: float, name: str, nodes: list[str]) -> DrawnPart:
    kind, placed = joint.get("type"), joint.find("origin")
    motion, screw = np.eye(4), None
    if kind in ("revolute", "continuous", "prismatic"):
        along = axis(joint, name)
        along, slides = along / np.linalg.norm(along), kind == "prismatic"
        motion = joint_motion(slides, along, value)
        screw = np.concatenate([along * slides, along * (not slides)])
    joints = tuple(_other_joints(joint, screw)) if screw is not None else ()
    pairs = [(0.0, 0.0, 0.0)] * 2 if placed is None else [three(placed, word, name) for word in ("xyz", "rpy")]
    numbers = dict(zip((*_XYZ, *_RPY), (*pairs[0], *pairs[1]), strict=True))

    def place(numbers: Mapping[str, float]) -> Array:
        values = list(numbers.values())
        return np.asarray(from_origin(values[:3], values[3:]) @ motion)

    def edited(changes: Mapping[str, float | str]) -> str:
        where = f"joint '{joint.get('name')}'"
        if "parent" in changes:
            return _rewritten(f'<parent link="{changes["parent"]}"/>', f'<parent link="{ends(joint)[0]}"/>', where)
        return _of_origin(numbers, changes, where)

    return DrawnPart(
        ends(joint)[0], numbers, place, _LENGTHS, screw=screw, edited=edited, parents=tuple(nodes), joints=joints
    )


def _other_joints(joint: Any, screw: Array) -> Iterator[tuple[str, Array]]:
    where = f"joint '{joint.get('name')}'"
    axis, slides = joint.find("axis"), joint.get("type") == "prismatic"
    before = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
    for row in np.eye(3, dtype=int):
        after = " ".join(map(str, row))
        yield _rewritten(f'<axis xyz="{after}"/>', f'<axis xyz="{before}"/>', where), np.kron([slides, not slides], row)
    after = "continuous" if slides else "prismatic"
    yield _rewritten(f'type="{after}"', f'type="{joint.get("type")}"', where), np.roll(screw, 3)


def _end(entry: Mapping[str, Any], end: str, nodes: list[str]) -> DrawnPart:
    """Return an end of a loop, of which only the position is sure to be as written."""
    placed, node = np.array(entry[end]["placement"]), entry[end]["node"]
    where = f"loop '{entry['name']}' on {node}"

    def place(numbers: Mapping[str, float]) -> Array:
        moved = placed.copy()
        moved[:3, 3] = list(numbers.values())
        return moved

    def edited(changes: Mapping[str, float | str]) -> str:
        if "parent" in changes:
            return _rewritten(f"link '{changes['parent']}'", f"link '{node}'", f"loop '{entry['name']}'")
        return _of_origin(numbers, changes, where)

    numbers = dict(zip(_XYZ, placed[:3, 3].tolist(), strict=True))
    return DrawnPart(node, numbers, place, _LENGTHS, edited=edited, parents=tuple(nodes))


def _of_origin(numbers: Mapping[str, float], changes: Mapping[str, float | str], where: str) -> str:
    attribute, words = ("xyz", _XYZ) if changes.keys() & _LENGTHS else ("rpy", _RPY)
    shown = (" ".join(number(float(of[word])) for word in words) for of in ({**numbers, **changes}, numbers))
    after, before = (f'{attribute}="{triple}"' for triple in shown)
    return _rewritten(after, before, where)


def _typed(entry: Mapping[str, Any], kind: LoopKind) -> str:
    word = kind.name.lower()
    return _rewritten(word, entry["kind"], f"loop '{entry['name']}' (--loop {entry['name']}={word})")


def _rewritten(after: str, before: str, where: str) -> str:
    return f"write {after} for {before} in {where}"
