"""Slips of the pen: the one edit with which loops that are open as written are closed as written.

A robot is often drawn closed: its home is exact, and one number has the wrong sign, another unit or one digit more, two
numbers are exchanged, or a parent, an end of a loop or its kind is wrong. Then one edit, of all that people need,
closes every loop at home as written, but for rounding. That hardly happens by accident: a loop has two equations at
least, and few edits are tried.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.closure import RANK, rank
from raff2urdf.placement import inverse
from raff2urdf.raff.document import LoopKind
from raff2urdf.residual import ROWS, loop_residual

OPEN = 0.02
"""rad, or sizes: loops that are open by less as written are drawn closed, by rounded numbers."""

_CLOSED = 0.01  # rad or sizes: home in whole degrees
_FITTED = 1e-3  # likewise, of a number that is chosen to close it
_EXACT, _ALIKE = 1e-6, 3.0  # gaps below, or within such a factor of the least, are as good as that
_LARGEST = 1000  # parts
_MOST = 100_000  # evaluations of a loop: about a second
_SHOWN = 3


DRAWN_OPEN = "the loops are open as written, and were closed elsewhere; "
"""Before the edits of `Fault.ELSEWHERE`."""


class Fault(Enum):
    """A fault of a robot: loops can't be closed; or they are open as written and closed elsewhere, so that fewer edits
    are likely; or they are closed as written and hold all joints."""

    OPEN = auto()
    ELSEWHERE = auto()
    FROZEN = auto()


@dataclass(frozen=True)
class DrawnPart:
    """A node, or the end of a loop on its node: placed on its parent by numbers.

    Attributes:
        parent: name of the part that it is placed on; None of a root.
        numbers: as written, by their words.
        place: returns the placement (4, 4), m, that such numbers give.
        lengths: the words that are lengths; the others are angles.
        turn: a revolution: 360 or 2 pi.
        screw: (6,) the velocity and angular velocity with which a joint moves it, in its own axes; None if none does.
        joints: other joints instead of its own: how a file is edited, and the screw.
        variable: the word that is the variable of its joint, which needs no edit to be changed.
        edited: returns how a file is edited: of the words that change, or of `parent`.
        parents: the parts that could be its parent; of an end of a loop, the nodes that it could be on.
    """

    parent: str | None
    numbers: Mapping[str, float]
    place: Callable[[Mapping[str, float]], Array]
    lengths: frozenset[str] = frozenset()
    turn: float = math.tau
    screw: Array | None = None
    variable: str | None = None
    edited: Callable[[Mapping[str, float | str]], str] = str
    parents: tuple[str, ...] = ()
    joints: tuple[tuple[str, Array], ...] = ()


@dataclass(frozen=True)
class DrawnLoop:
    """A loop: names of the parts that are its ends, its kind, and how a file is edited to have another kind."""

    first: str
    second: str
    kind: LoopKind
    edited: Callable[[LoopKind], str] | None = None


class _Edit(NamedTuple):
    """An edit: parts that it moves, by the placement (4, 4) of each; a part's other parent; loops of other kinds; parts
    with other joints, by the screw of each."""

    text: Callable[[], str]
    moves: Mapping[str, Array] = {}
    parent: tuple[str, str] | None = None
    kinds: Mapping[int, LoopKind] = {}
    screws: Mapping[str, Array] = {}


def slips(parts: Mapping[str, DrawnPart], loops: Sequence[DrawnLoop], is_drawn: bool, fault: Fault) -> str | None:
    """Return the edits, each of which repairs a fault, as a text; None if none is found, or the fault is not there.

    Args:
        parts: every part by its name, parents before their children.
        loops: between them.
        is_drawn: whether the file states a home, so that nodes do not coincide in it by accident.
        fault: of the robot.
    """
    if not loops or len(parts) > _LARGEST:
        return None
    drawing = _Drawing(parts, loops)
    if fault is Fault.FROZEN:
        edits = [] if drawing.open else [edit.text() for edit in _freeing(drawing)][:_SHOWN]
        return f"one edit lets the loops move: {', or '.join(edits)}" if edits else None
    if not drawing.open:
        return None
    budget, repairs = _MOST, list[tuple[float, str]]()
    for is_likely, group in _groups(drawing, is_drawn, fault is Fault.ELSEWHERE):
        budget -= len(loops) * len(group)
        if budget < 0 or (repairs and not is_likely):
            break
        best = min(group, key=drawing.gap, default=None)
        gap = math.inf if best is None else drawing.gap(best)
        if best is not None and gap <= (_CLOSED if is_likely else _FITTED) and drawing.mobile(best):
            repairs.append((gap, best.text()))
    least = min((gap for gap, _ in repairs), default=0.0)
    edits = [text for gap, text in repairs if gap <= max(_ALIKE * least, _EXACT)][:_SHOWN]
    return f"one edit closes the loops as written: {', or '.join(edits)}" if edits else None


class _Drawing:
    """A robot as written: where all parts are in the world."""

    def __init__(self, parts: Mapping[str, DrawnPart], loops: Sequence[DrawnLoop]) -> None:
        self.parts, self.loops = parts, loops
        local = {name: part.place(part.numbers) for name, part in parts.items()}
        self.placed, self.above = dict[str, Array](), dict[str, frozenset[str]]()
        for name, part in parts.items():
            self.placed[name] = self.parent(name) @ local[name]
            self.above[name] = frozenset([name]) | (self.above[part.parent] if part.parent else frozenset())
        steps = [float(np.linalg.norm(placement[:3, 3])) for placement in local.values()]
        self.size = float(np.median([step for step in steps if step > 0.0] or [1.0]))
        self.local, self.ends = local, [(self.placed[loop.first], self.placed[loop.second]) for loop in loops]
        gaps = [self._gap(*ends, loop.kind) for loop, ends in zip(loops, self.ends, strict=True)]
        self.order = sorted(range(len(loops)), key=gaps.__getitem__, reverse=True)  # what is open is checked first
        self.open = [i for i in self.order if gaps[i] > OPEN]

    def parent(self, name: str) -> Array:
        """Return the placement (4, 4) of a part's parent."""
        parent = self.parts[name].parent
        return np.eye(4) if parent is None else self.placed[parent]

    def _gap(self, first: Array, second: Array, kind: LoopKind) -> float:
        apart = inverse(first) @ second
        far = float(np.linalg.norm(apart[: 2 if kind is LoopKind.PRISMATIC else 3, 3])) / self.size
        return far if far > _CLOSED else max(far, float(np.abs(loop_residual(kind, apart, self.size)[0]).max()))

    def gap(self, edit: _Edit) -> float:
        """Return the largest gap of any loop after an edit; infinite where it is too large."""
        largest, steps = 0.0, {name: placed @ inverse(self.placed[name]) for name, placed in edit.moves.items()}
        for i in self.order:
            loop, (first, second) = self.loops[i], self.ends[i]
            for name, step in steps.items():
                first = step @ first if name in self.above[loop.first] else first
                second = step @ second if name in self.above[loop.second] else second
            largest = max(largest, self._gap(first, second, edit.kinds.get(i, loop.kind)))
            if largest > _CLOSED:
                return math.inf
        return largest

    def mobile(self, edit: _Edit) -> int:
        """Return the number of joints that can move without opening a loop, as written after an edit.

        The column of a joint in a loop's Jacobian is the derivative of the loop's residual, times the joint's screw
        seen from the loop's first end: with + if the joint moves the second end, with - if it moves the first; joints
        that move both or neither have none. A joint can move if it has a part in the null space of all rows.
        """
        above = [self._above(end, edit) for loop in self.loops for end in (loop.first, loop.second)]
        between = [first ^ second for first, second in zip(above[::2], above[1::2], strict=True)]
        screws = {name: part.screw for name, part in self.parts.items() if part.screw is not None}
        screws.update(edit.screws)
        moving = [name for name in screws if any(name in path for path in between)]
        rows = []
        for i, loop in enumerate(self.loops):
            first, second = (
                self._moved(end, above[2 * i + j], edit) for j, end in enumerate((loop.first, loop.second))
            )
            kind = edit.kinds.get(i, loop.kind)
            derivative = loop_residual(kind, inverse(first) @ second, self.size)[1]
            columns = np.zeros((6, len(moving)))
            for column, name in enumerate(moving):
                if name in between[i]:
                    sign = 1.0 if name in above[2 * i + 1] else -1.0
                    placed = self._moved(name, self._above(name, edit), edit)
                    columns[:, column] = sign * _seen(screws[name], inverse(first) @ placed)
            rows.append(derivative @ columns)
        jacobian = np.vstack(rows)
        free = np.linalg.svd(jacobian)[2][rank(jacobian) :]
        return int(np.count_nonzero(np.abs(free).max(axis=0, initial=0.0) > RANK))

    def _above(self, name: str, edit: _Edit) -> frozenset[str]:
        """Return a part and those above it after an edit."""
        if edit.parent is None or edit.parent[0] not in self.above[name]:
            return self.above[name]
        part, parent = edit.parent
        return (self.above[name] - self.above[part]) | {part} | self.above[parent]

    def _moved(self, name: str, above: frozenset[str], edit: _Edit) -> Array:
        """Return the placement (4, 4) of a part, below others, after an edit."""
        placement = self.placed[name]
        for part, placed in edit.moves.items():
            placement = placed @ inverse(self.placed[part]) @ placement if part in above else placement
        return placement


def _seen(screw: Array, placed: Array) -> Array:
    """Return a screw (6,) of a frame at a placement (4, 4), in the axes and at the origin in which that is given."""
    linear, angular = placed[:3, :3] @ screw[:3], placed[:3, :3] @ screw[3:]
    return np.concatenate([linear + np.cross(placed[:3, 3], angular), angular])


def _groups(drawing: _Drawing, is_drawn: bool, is_closed: bool) -> Iterator[tuple[bool, list[_Edit]]]:
    """Yield edits, the likeliest first, of which the best counts: other values of one number. Those that are not likely
    count only if no other does."""
    concerned = {name for i in drawing.open for name in _between(drawing, drawing.loops[i])}
    chosen = {name: part for name, part in drawing.parts.items() if name in concerned}
    words = [(name, word) for name, part in chosen.items() for word in part.numbers if word != part.variable]
    zeros = [(name, word) for name, word in words if not chosen[name].numbers[word]]
    rigid = all(drawing.loops[i].kind is LoopKind.RIGID for i in drawing.open)
    if rigid:
        yield from ((True, group) for group in _other_kinds(drawing, drawing.open))
    for name, word in words:
        if (name, word) not in zeros:
            yield True, _others(drawing, name, word, is_closed)
    for name, part in chosen.items():
        yield from ((True, [_renumbered(drawing, name, both)]) for both in _exchanged(part))
    if is_drawn or not is_closed:
        yield from ((True, [edit]) for edit in _elsewhere(drawing, chosen))
    if is_closed:
        return
    if not rigid:
        yield from ((True, group) for group in _other_kinds(drawing, drawing.open))
    yield from ((False, _others(drawing, name, word, is_closed)) for name, word in zeros)
    for name, word in words:
        fitted = _fitted(drawing, name, word) if word in chosen[name].lengths else None
        if fitted is not None:
            yield False, [_renumbered(drawing, name, {word: fitted})]


def _elsewhere(drawing: _Drawing, chosen: Mapping[str, DrawnPart]) -> Iterator[_Edit]:
    """Yield parts on other parents."""
    for name, part in chosen.items():
        for parent in part.parents:
            if parent != part.parent and name not in drawing.above[parent]:
                moved = drawing.placed[parent] @ drawing.local[name]
                yield _Edit(partial(part.edited, {"parent": parent}), {name: moved}, (name, parent))


def _freeing(drawing: _Drawing) -> list[_Edit]:
    """Return edits with which most joints can move closed loops, if none can."""
    if drawing.mobile(_Edit(str)):
        return []
    others = ((name, *joint) for name, part in drawing.parts.items() for joint in part.joints)
    edits = [_Edit(text.__str__, screws={name: screw}) for name, text, screw in others]
    edits += [edit for group in _other_kinds(drawing, range(len(drawing.loops))) for edit in group]
    counts = list(map(drawing.mobile, edits))
    return [edit for edit, count in zip(edits, counts, strict=True) if count == max(counts) > 0]


def _between(drawing: _Drawing, loop: DrawnLoop) -> frozenset[str]:
    """Return the parts between the ends of a loop, which they include."""
    return drawing.above[loop.first] ^ drawing.above[loop.second]


def _renumbered(drawing: _Drawing, name: str, words: Mapping[str, float]) -> _Edit:
    part = drawing.parts[name]
    moved = drawing.parent(name) @ part.place({**part.numbers, **words})
    return _Edit(partial(part.edited, words), {name: moved})


def _other_kinds(drawing: _Drawing, loops: Sequence[int]) -> Iterator[list[_Edit]]:
    """Yield kinds of all these loops that leave more free, those that leave least first."""
    for kind in sorted(LoopKind, key=lambda kind: (-ROWS[kind], kind is LoopKind.PRISMATIC)):
        changed = [i for i in loops if ROWS[kind] < ROWS[drawing.loops[i].kind]]
        edits = [edited for i in changed if (edited := drawing.loops[i].edited) is not None]
        if edits and len(edits) == len(loops):
            yield [_Edit(partial(_of_kind, edits, kind), kinds=dict.fromkeys(changed, kind))]


def _of_kind(edits: Sequence[Callable[[LoopKind], str]], kind: LoopKind) -> str:
    return " and ".join(edit(kind) for edit in edits)


def _exchanged(part: DrawnPart) -> Iterator[Mapping[str, float]]:
    """Yield two numbers, exchanged."""
    for first, second in combinations(part.numbers, 2):
        value, other = part.numbers[first], part.numbers[second]
        if value != other and (first in part.lengths) == (second in part.lengths):
            yield {first: other, second: value}


def _others(drawing: _Drawing, name: str, word: str, is_closed: bool) -> list[_Edit]:
    """Return what a number may have been meant as."""
    part = drawing.parts[name]
    value, quarter = part.numbers[word], part.turn / 4.0
    guesses = [-value, value * 360.0 / math.tau, value * math.tau / 360.0]
    if word in part.lengths:
        guesses = [-value, value / 1000.0, value * 1000.0, value / 10.0, value * 10.0, *([] if is_closed else [0.0])]
    elif not is_closed:
        guesses += [0.0, value + 2.0 * quarter, value - quarter, value + quarter]
    return [_renumbered(drawing, name, {word: _rounded(other)}) for other in guesses if other != value]


def _fitted(drawing: _Drawing, name: str, word: str) -> float | None:
    """Return the value of a length with which the loop that is farthest open closes best: the placements of its ends
    are linear in it."""
    part, loop = drawing.parts[name], drawing.loops[drawing.order[0]]
    value = part.numbers[word]
    moved = drawing.parent(name) @ part.place({**part.numbers, word: value + 1.0})
    along = (moved - drawing.placed[name])[:3, 3]  # of everything on this part, for 1
    slope = (float(name in drawing.above[loop.second]) - float(name in drawing.above[loop.first])) * along
    first, second = drawing.ends[drawing.order[0]]
    apart = (second - first)[:3, 3]
    if loop.kind is LoopKind.PRISMATIC:
        apart, slope = (first[:3, :2].T @ vector for vector in (apart, slope))
    square = float(slope @ slope)
    return _rounded(value - float(slope @ apart) / square) if square > 0.0 else None


def _rounded(value: float) -> float:
    return float(f"{value:.12g}")
