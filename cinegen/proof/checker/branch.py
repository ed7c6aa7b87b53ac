"""Boxes on one branch: equation 7 of docs/proof.md."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from flint import arb, arb_mat

from cinegen.proof.checker.balls import column, upper
from cinegen.proof.checker.box import Box, BoxResult
from cinegen.proof.checker.equations import Robot
from cinegen.proof.checker.tube import middle

_STEPS = 12  # of Newton's method on a face
_UP, _LEAST = arb(1 + 2.0**-20), arb(2.0**-56)  # more than rounding does to radii


class Node(NamedTuple):
    """A box that is halved along an axis."""

    axis: int
    parts: tuple[Any, Any]


class Link:
    """The tube of a box."""

    def __init__(self, robot: Robot, box: Box, numbers: Mapping[str, list[float]]) -> None:
        self.robot, self.low, self.high, k = robot, box.low, box.high, len(robot.unknown)
        self.centre, self.radius = middle(box.low, box.high)
        self.x, self.y = ([arb(a) for a in numbers[name]] for name in "xy")
        self._along = arb_mat(robot.width, len(numbers["along"]) // robot.width, numbers["along"])
        self._inverse, self._defect, self._resolvent = (
            arb_mat(k, k, numbers[name]) for name in ("inverse", "defect", "resolvent")
        )

    def at(self, p: Sequence[arb]) -> list[arb]:
        """Return X at a pose."""
        eps = [(a - c) / r for a, c, r in zip(p, self.centre, self.radius, strict=True)]
        eps += [a * b for i, a in enumerate(eps) for b in eps[i:]]
        return [x + s for x, s in zip(self.x, (self._along * column(eps)).entries(), strict=False)]

    def meets(self, x: Sequence[arb], p: Sequence[arb], other: Link) -> bool:
        """Return whether the configuration of this box at a pose is that of the other."""
        for _ in range(_STEPS):
            x = [a.mid() for a in x]
            point = self.robot.point(x, p)
            residual = self.robot.residual(point, self.robot.parts(point, 0))
            step = (self._inverse * column([residual[i] for i in self.robot.data["rows"]])).entries()
            size = column([abs(a).upper() for a in step])
            away = upper(self._resolvent * column([a * _UP + _LEAST for a in size.entries()]))
            solved = (size + self._defect * away).entries()
            inside = all(abs(a - b) < y for a, b, y in zip(x, self.at(p), self.y, strict=True))
            inside = inside and all(a <= b for a, b in zip(solved, away.entries(), strict=True))
            ends = zip(x, other.at(p), away.entries(), other.y, strict=True)
            near = [abs(a - b) + v < w for a, b, v, w in ends]
            if inside and all(near):
                return True
            x = [a - s for a, s in zip(x, step, strict=True)]
        return False


def branch(robot: Robot, root: Any, boxes: Sequence[Box], findings: Mapping[int, BoxResult]) -> set[int]:
    """Return the numbers of the boxes on the branch of the start.

    Args:
        robot: the equations.
        root: the region: a `Node`, or a box's number.
        boxes: all boxes.
        findings: by the number of the box.
    """
    links = {i: Link(robot, boxes[i], result.link) for i, result in findings.items() if result.link}
    meeting, apart = ({i: list[int]() for i in links} for _ in range(2))
    for first, second, axis in _faces(root, links):  # all of them: a branch may not close on itself
        a, b = links[first], links[second]
        ends = zip(a.low, b.low, a.high, b.high, strict=True)
        p = [((arb(max(x, y)) + arb(min(u, v))) / 2).mid() for x, y, u, v in ends]
        p[axis] = arb(a.high[axis])
        neighbours = meeting if a.meets(a.at(p), p, b) else apart
        neighbours[first].append(second)
        neighbours[second].append(first)
    start, lost = robot.data["start"], set[int]()
    pose, x = list(map(float, start["pose"])), [arb(v) / u for v, u in zip(start["x"], robot.units, strict=False)]
    for i, link in links.items():
        if not all(a <= v <= b for a, v, b in zip(link.low, pose, link.high, strict=True)):
            continue
        while i not in lost and link.meets(x, [arb(v) for v in pose], link):
            joined, border = {i}, [i]
            while border:
                new = set(meeting[border.pop()]) - joined - lost
                joined |= new
                border += new
            wrong = {b for a in joined for b in apart[a] if b in joined}
            if not wrong:
                return joined
            lost |= wrong - {i} or wrong
    return set()


def _faces(node: Any, links: Mapping[int, Link]) -> Iterator[tuple[int, int, int]]:
    """Yield the pairs of boxes below a node that share a face, and the axis across it."""
    if isinstance(node, Node):
        yield from _between(*node.parts, node.axis, links)
        for part in node.parts:
            yield from _faces(part, links)


def _between(a: Any, b: Any, axis: int, links: Mapping[int, Link]) -> Iterator[tuple[int, int, int]]:
    if isinstance(a, Node):
        for part in a.parts[1:] if a.axis == axis else a.parts:
            yield from _between(part, b, axis, links)
    elif isinstance(b, Node):
        for part in b.parts[:1] if b.axis == axis else b.parts:
            yield from _between(a, part, axis, links)
    elif a in links and b in links:
        ends = zip(links[a].low, links[b].low, links[a].high, links[b].high, strict=True)
        if all(max(x, y) < min(u, v) for i, (x, y, u, v) in enumerate(ends) if i != axis):
            yield a, b, axis
