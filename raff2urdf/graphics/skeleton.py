"""Bars and markers along a robot's Kleinfinger parameters: what collides and weighs of links that have no graphics.

(`raff2urdf.graphics.bodies` draws them.) Each node gets bars to its children: along the three straight parts of the
path to a joint (epsilon along its z, d along the common perpendicular, r along the child's z), straight to what is
fixed to it. A marker is at its own joint: a cylinder about the axis of a revolute one; a box, and a rod that slides in
its parent's tube or a rail of its parent, for a prismatic one; a ball for a ball, universal or planar one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from raff2urdf.arrays import Array, ArrayLike
from raff2urdf.placement import along, translation
from raff2urdf.raff.document import Document, JointType, RaffFrame, RaffLink, RaffNode, RaffPart, RaffRobot
from raff2urdf.raff.kleinfinger import Kleinfinger, transform
from raff2urdf.tree import home, kleinfinger, limits

if TYPE_CHECKING:  # takes half a second
    from yourdfpy import Geometry

# One for each branch of the tree. People with any colour vision can distinguish them, and pages use none for a status.
BRANCHES = (
    *((0.16, 0.35, 0.44), (0.66, 0.55, 0.35), (0.66, 0.62, 0.83)),
    *((0.42, 0.73, 0.69), (0.47, 0.29, 0.16), (0.39, 0.33, 0.3)),
)
BASE = (0.45, 0.47, 0.5)
JOINT = (0.2, 0.22, 0.25)
Shape = tuple["Geometry", Array]
"""A shape, and its placement (4, 4) on its link."""
MARK = "cinegen:skeleton"
"""Beginning of the names of a URDF's collision shapes that are bars and markers, rather than shapes of the robot."""

_THINNEST = 0.002  # of a robot's size: radius of bars, which would not be seen otherwise
_FARTHEST = 100.0  # of the sum of a robot's lengths: limits beyond stand for none, as 1e6 does in many files


class SkeletonDrawing:
    """Bars and markers of the nodes of one robot, each in its own frame."""

    def __init__(self, document: Document, robot: RaffRobot) -> None:
        self.document, self.robot = document, robot
        self.parameters = {part.number: kleinfinger(document, part.parameters) for part in robot.parts}
        lengths = _lengths(self.parameters.values())
        placed = {0: np.eye(4)}
        for part in robot.outward:
            placed[part.number] = placed[part.pred] @ transform(self.parameters[part.number])
        size = float(np.ptp([placement[:3, 3] for placement in placed.values()], axis=0).max())
        self.radius = max(0.06 * median(lengths), _THINNEST * size)
        self.farthest = _FARTHEST * math.fsum(lengths)
        branch, last = {0: 0}, 0
        self.colours = {0: BASE}
        for part in robot.outward:
            forks = part is not robot.children[part.pred][0]
            last += forks  # every fork begins a branch of another colour
            branch[part.number] = last if forks else branch[part.pred]
            self.colours[part.number] = BRANCHES[branch[part.number] % len(BRANCHES)]

    def draw(self, node: RaffNode) -> list[Shape]:
        """Return the shapes of one node, in its own frame."""
        shapes = list(self._joint(node))
        for child in self.robot.children.get(node.number, []):
            shapes += self._bars_to(child)
        if not shapes and not isinstance(node, RaffFrame):
            shapes.append(_ball(np.zeros(3), 1.2, self.radius))
        return shapes

    def bars(self, node: RaffNode, radius: float) -> list[Shape]:
        """Return the node's bars to its children, all of one radius (m), in its own frame: as a body, not a drawing."""
        corners = [self.corners(child) for child in self.robot.children.get(node.number, [])]
        return [bar for path in corners for start, end in pairwise(path) for bar in _bar(start, end, 1.0, radius)]

    def corners(self, child: RaffPart) -> list[Array]:
        """Return the corners (3,) of the bars from a node's origin to a child's joint, m, in the node's frame."""
        gamma, epsilon, _, d, _, r = self.parameters[child.number]
        corners = [np.zeros(3), np.array([0.0, 0.0, epsilon])]
        corners.append(corners[-1] + d * np.array([math.cos(gamma), math.sin(gamma), 0.0]))
        if isinstance(child, RaffFrame) or child.type is not JointType.PRISMATIC:
            corners.append(corners[-1] + r * self._axis(child))
        straight = isinstance(child, RaffFrame) or child.type is JointType.FIXED
        return [corners[0], corners[-1]] if straight else corners

    def _joint(self, node: RaffNode) -> Iterator[Shape]:
        if isinstance(node, RaffLink) and node.own_joint is not None and node.type is not JointType.PRISMATIC:
            yield _ball(np.zeros(3), 2.0, self.radius)  # a joint of several variables
        elif isinstance(node, RaffLink) and node.type is JointType.REVOLUTE:
            half = np.array([0.0, 0.0, 1.6 * self.radius])
            yield from _bar(-half, half, 1.5, self.radius)
        elif isinstance(node, RaffLink) and node.type is JointType.PRISMATIC:
            size = np.array([2.6, 2.6, 3.2]) * self.radius
            yield _shape("box", rounded(size, self.radius), np.eye(4))
            *_, rod = self.telescope_of(node)
            yield from _bar(np.array([0.0, 0.0, -rod]), np.zeros(3), 0.6, self.radius)

    def _bars_to(self, child: RaffPart) -> Iterator[Shape]:
        """Yield bars from the node's origin to a child's joint."""
        thickness = 0.6 if isinstance(child, RaffFrame) else 1.0
        corners = self.corners(child)
        drawn = [corners[0]]
        for corner in corners[1:]:
            if np.abs(corner - drawn[-1]).max() > 0.5 * self.radius:
                yield from _bar(drawn[-1], corner, thickness, self.radius)
                drawn.append(corner)
        for corner in drawn[1:-1]:
            yield _ball(corner, thickness, self.radius)
        if isinstance(child, RaffLink) and child.type is JointType.PRISMATIC:
            start, end = (corners[-1] + at * self._axis(child) for at in self.telescope_of(child)[:2])
            yield from _bar(start, end, 1.0, self.radius)

    def telescope_of(self, link: RaffLink) -> tuple[float, float, float]:
        """Return what `telescope` does of a prismatic link; limits that are nowhere near the robot are none."""
        return telescope(home(self.document, link), *self._limits(link))

    def stroke(self, link: RaffLink) -> tuple[float, float]:
        """Return the range of a prismatic link that is drawn, m: its limits, or around where it is written."""
        return _finite(home(self.document, link), *self._limits(link))

    def _limits(self, link: RaffLink) -> tuple[float, float]:
        low, high = limits(self.document, link)
        return (low if abs(low) < self.farthest else -math.inf), (high if abs(high) < self.farthest else math.inf)

    def _axis(self, child: RaffPart) -> Array:
        """Return the z axis (3,) of a child."""
        gamma, alpha = self.parameters[child.number].gamma, self.parameters[child.number].alpha
        return np.array([math.sin(gamma) * math.sin(alpha), -math.cos(gamma) * math.sin(alpha), math.cos(alpha)])


def telescope(home: float, low: float, high: float) -> tuple[float, float, float]:
    """Return what is drawn along a prismatic joint, m: both ends of the parent's tube on the axis, on which the joint's
    origin is 0, and the length of the rod, backwards from the moving part. It is negative where that is at negative
    values.

    Rod and tube overlap, or touch, at every value within the limits. Neither protrudes beyond the other's end if two
    pieces can do that: where the upper limit is at most twice the lower one. Otherwise each is half the upper limit,
    which protrudes least. A joint that reaches 0 has no rod, but a rail along its whole range.

    Args:
        home: m, from which a limit follows that is infinite.
        low: lower limit, m.
        high: upper limit, m.
    """
    low, high = _finite(home, low, high)
    if low <= 0.0 <= high:
        return low, high, 0.0
    sign, near, far = (1.0, low, high) if low > 0.0 else (-1.0, -high, -low)
    most = max(near, far / 2.0)
    return 0.0, sign * min(0.55 * far, most), sign * min(0.62 * far, most)


def _finite(home: float, low: float, high: float) -> tuple[float, float]:
    """Return limits; around a value where they are infinite."""
    nearest, farthest = sorted((0.62 * home, 1.17 * home))
    low = min(nearest, high) if math.isinf(low) else low
    return low, max(farthest, low) if math.isinf(high) else high


def _lengths(parameters: Iterable[Kleinfinger]) -> list[float]:
    """Return the lengths (m) of a robot's straight parts; 1 if it has none."""
    lengths = [abs(length) for p in parameters for length in (p.epsilon, p.d, p.r)]
    return [length for length in lengths if length > 1e-12] or [1.0]


def _bar(start: Array, end: Array, thickness: float, radius: float) -> Iterator[Shape]:
    """Yield a cylinder from one point to another, of a thickness in radii; nothing if they coincide."""
    length = math.sqrt(math.fsum(x * x for x in (end - start).tolist()))
    if length >= 1e-6 * radius:
        placed = along(rounded((start + end) / 2.0, radius), end - start)
        yield _shape("cylinder", (digits(thickness * radius), digits(length)), placed)


def _ball(centre: Array, thickness: float, radius: float) -> Shape:
    return _shape("sphere", (digits(thickness * radius),), translation(rounded(centre, radius)))


def _shape(kind: str, sizes: ArrayLike, placed: Array) -> Shape:
    from raff2urdf.writers.urdf_object import geometry

    return geometry(kind, sizes), placed


def rounded(values: Array, radius: float) -> Array:
    """Return values (n,) to a millionth of a bar's radius: no rounding errors such as 1e-17 in the file."""
    step = 10.0 ** (math.floor(math.log10(radius)) - 6)
    return np.array([digits(step * round(value / step)) for value in values.tolist()])


def digits(value: float) -> float:
    """Return a number to nine digits."""
    return float(f"{value:.9g}")
