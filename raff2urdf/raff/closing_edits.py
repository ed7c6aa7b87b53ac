"""The edits of a RAFF file that close the loops of a robot as it is drawn: see `raff2urdf.loops.slips`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import partial

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.errors import SourceLocation
from raff2urdf.loops.slips import DrawnLoop, DrawnPart, Fault, slips
from raff2urdf.raff.compound import expanded
from raff2urdf.raff.document import (
    Document,
    JointType,
    LoopKind,
    RaffLink,
    RaffLoop,
    RaffParameters,
    RaffPart,
    RaffRobot,
)
from raff2urdf.raff.kleinfinger import transform
from raff2urdf.raff.writer import number as shown
from raff2urdf.tree import home, kleinfinger

_LENGTHS = frozenset({"r", "d", "epsilon"})
_WORDS = tuple(field.name for field in fields(RaffParameters))
_VARIABLE = {JointType.REVOLUTE: "theta", JointType.PRISMATIC: "r"}
_SCREWS = {JointType.REVOLUTE: np.eye(6)[5], JointType.PRISMATIC: np.eye(6)[2]}


def slips_of(document: Document, robot: RaffRobot, kinds: Mapping[int, LoopKind], fault: Fault) -> str | None:
    """Return the edits of a robot's text, each of which closes all of its loops as written; None if there are none.

    Args:
        document: that holds the robot.
        robot: the robot.
        kinds: of its loops.
        fault: what is wrong.
    """
    parts, simple = {"0": DrawnPart(None, {}, _nowhere)}, expanded(robot)
    for part in simple.outward:
        parts[str(part.number)] = _part(document, robot, part)
    loops = []
    for i, loop in enumerate(robot.loops):
        for end in ("first", "second"):
            edited = partial(_elsewhere, robot, loop, end)
            at = str(getattr(loop, end))
            parts[f"{i} {end}"] = DrawnPart(at, {}, _nowhere, edited=edited, parents=tuple(map(str, robot.nodes)))
        loops.append(DrawnLoop(f"{i} first", f"{i} second", kinds[i], partial(_typed, loop, kinds[i])))
    is_drawn = any(home(document, link) for link in simple.links if link.type is not JointType.FIXED)
    return slips(parts, loops, is_drawn, fault)


def _part(document: Document, robot: RaffRobot, part: RaffPart) -> DrawnPart:
    def place(numbers: Mapping[str, float]) -> Array:
        return transform(kleinfinger(document, RaffParameters(**numbers)))

    def edited(changes: Mapping[str, float | str]) -> str:
        before = {**numbers, "parent": str(part.pred)}
        after, before_it = (_listed({word: of[word] for word in changes}) for of in (changes, before))
        at = part.locations.get("pred" if "parent" in changes else "parameters")
        return _rewritten(after, before_it, f"{part.keyword} {part.number}", at)

    numbers = {word: getattr(part.parameters, word) for word in _WORDS}
    kind = part.type if isinstance(part, RaffLink) else JointType.FIXED
    screw = _SCREWS.get(kind)
    if robot.nodes.get(part.number) != part:  # one of the links that stand for a joint of several variables
        return DrawnPart(str(part.pred), {}, lambda _: place(numbers), screw=screw)
    parents = tuple(map(str, robot.nodes))
    at = part.locations.get("type")
    joints = tuple(
        (_rewritten(f"type {int(other)}", f"type {int(kind)}", f"{part.keyword} {part.number}", at), screw)
        for other, screw in _SCREWS.items()
        if isinstance(part, RaffLink) and other is not kind
    )
    return DrawnPart(
        str(part.pred), numbers, place, _LENGTHS, 360.0, screw, _VARIABLE.get(kind), edited, parents, joints
    )


def _listed(numbers: Mapping[str, float | str]) -> str:
    return " ".join(f"pred {new}" if isinstance(new, str) else f"{word} {shown(new)}" for word, new in numbers.items())


def _nowhere(_: Mapping[str, float]) -> Array:
    return np.eye(4)


def _elsewhere(robot: RaffRobot, loop: RaffLoop, end: str, changes: Mapping[str, float | str]) -> str:
    numbers = int(changes["parent"]), getattr(loop, end)
    after, before = (f"{robot.nodes[number].keyword} {number}" if number else "base" for number in numbers)
    return _rewritten(after, before, "the constraint", loop.locations.get(end))


def _typed(loop: RaffLoop, before: LoopKind, kind: LoopKind) -> str:
    at = loop.locations.get("type") or loop.locations.get("first")
    return _rewritten(f"type {int(kind)}", f"type {int(before)}", "the constraint", at)


def _rewritten(after: str, before: str, where: str, at: SourceLocation | None) -> str:
    line = f" (line {at.line})" if at is not None else ""
    return f"write '{after}' for '{before}' in {where}{line}"
