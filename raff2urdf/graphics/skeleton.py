"""Bars and markers along a robot's Kleinfinger parameters: what collides and weighs of links that have no graphics.

(`raff2urdf.graphics.bodies` draws them.) Each node gets bars to its children: along the three straight parts of the
path to a joint (epsilon along its z, d along the common perpendicular, r along the child's z), straight to what is
fixed to it. A marker is at its own joint: a cylinder about the axis of a revolute one; a box, and a rod that slides in
its parent's tube or a rail of its parent, for a prismatic one; a ball for a ball, universal or planar one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from raff2urdf.arrays import ArrayLike
from raff2urdf.placement import cross
from raff2urdf.raff.document import Document, JointType, RaffFrame, RaffLink, RaffNode, RaffPart, RaffRobot
from raff2urdf.raff.kleinfinger import Kleinfinger, transform
from raff2urdf.tree import home, kleinfinger, limits

if TYPE_CHECKING:  # takes half a second
    from yourdfpy import Visual

# One for each branch of the tree. People with any colour vision can distinguish them, and pages use none for a status.
BRANCHES = (
    *((0.16, 0.35, 0.44), (0.66, 0.55, 0.35), (0.66, 0.62, 0.83)),
    *((0.42, 0.73, 0.69), (0.47, 0.29, 0.16), (0.39, 0.33, 0.3)),
)
BASE = (0.45, 0.47, 0.5)
JOINT = (0.2, 0.22, 0.25)
MARK = "cinegen:skeleton"
"""Beginning of the names of a URDF's collision shapes that are bars and markers, rather than shapes of the robot."""

_THINNEST = 0.002  # of a robot's size: radius of bars, which would not be seen otherwise
_FARTHEST = 100.0  # of the sum of a robot's lengths: limits beyond stand for none, as 1e6 does in many files


@dataclass(frozen=True, slots=True)
class _Style:
    radius: float  # m, of a bar
    colour: tuple[float, float, float]


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

    def draw(self, node: RaffNode) -> list[Visual]:
        """Return the shapes of one node, in its own frame."""
        style = _Style(self.radius, self.colours[node.number])
        shapes = list(self._joint(node, style))
        for child in self.robot.children.get(node.number, []):
            shapes += self._bars_to(child, style)
        if not shapes and not isinstance(node, RaffFrame):
            shapes.append(_ball(np.zeros(3), 1.2, style))
        return shapes

    def bars(self, node: RaffNode, radius: float) -> list[Visual]:
        """Return the node's bars to its children, all of one radius (m), in its own frame: as a body, not a drawing."""
        style = _Style(radius, self.colours[node.number])
        corners = [self.corners(child) for child in self.robot.children.get(node.number, [])]
        return [bar for path in corners for start, end in pairwise(path) for bar in _bar(start, end, 1.0, style)]

    def corners(self, child: RaffPart) -> list[np.ndarray]:
        """Return the corners (3,) of the bars from a node's origin to a child's joint, m, in the node's frame."""
        gamma, epsilon, _, d, _, r = self.parameters[child.number]
        corners = [np.zeros(3), np.array([0.0, 0.0, epsilon])]
        corners.append(corners[-1] + d * np.array([math.cos(gamma), math.sin(gamma), 0.0]))
        if isinstance(child, RaffFrame) or child.type is not JointType.PRISMATIC:
            corners.append(corners[-1] + r * self._axis(child))
        straight = isinstance(child, RaffFrame) or child.type is JointType.FIXED
        return [corners[0], corners[-1]] if straight else corners

    def _joint(self, node: RaffNode, style: _Style) -> Iterator[Visual]:
        marker = _Style(style.radius, JOINT)
        if isinstance(node, RaffLink) and node.own_joint is not None and node.type is not JointType.PRISMATIC:
            yield _ball(np.zeros(3), 2.0, marker)  # a joint of several variables
            return
        if not isinstance(node, RaffLink) or node.type is JointType.FIXED:
            return
        if node.type is JointType.REVOLUTE:
            half = np.array([0.0, 0.0, 1.6 * style.radius])
            yield from _bar(-half, half, 1.5, marker)
        else:
            size = np.array([2.6, 2.6, 3.2]) * style.radius
            yield _visual("box", rounded(size, style.radius), np.eye(4), marker)
            *_, rod = self.telescope_of(node)
            yield from _bar(np.array([0.0, 0.0, -rod]), np.zeros(3), 0.6, style)

    def _bars_to(self, child: RaffPart, style: _Style) -> Iterator[Visual]:
        """Yield bars from the node's origin to a child's joint."""
        thickness = 0.6 if isinstance(child, RaffFrame) else 1.0
        corners = self.corners(child)
        drawn = [corners[0]]
        for corner in corners[1:]:
            if np.abs(corner - drawn[-1]).max() > 0.5 * style.radius:
                yield from _bar(drawn[-1], corner, thickness, style)
                drawn.append(corner)
        for corner in drawn[1:-1]:
            yield _ball(corner, thickness, style)
        if isinstance(child, RaffLink) and child.type is JointType.PRISMATIC:
            start, end = (corners[-1] + at * self._axis(child) for at in self.telescope_of(child)[:2])
            yield from _bar(start, end, 1.0, style)

    def telescope_of(self, link: RaffLink) -> tuple[float, float, float]:
        """Return what `telescope` does of a prismatic link; limits that are nowhere near the robot are none."""
        return telescope(home(self.document, link), *self._limits(link))

    def stroke(self, link: RaffLink) -> tuple[float, float]:
        """Return the range of a prismatic link that is drawn, m: its limits, or around where it is written."""
        return _finite(home(self.document, link), *self._limits(link))

    def _limits(self, link: RaffLink) -> tuple[float, float]:
        low, high = limits(self.document, link)
        return (low if abs(low) < self.farthest else -math.inf), (high if abs(high) < self.farthest else math.inf)

    def _axis(self, child: RaffPart) -> np.ndarray:
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


def _bar(start: np.ndarray, end: np.ndarray, thickness: float, style: _Style) -> Iterator[Visual]:
    """Yield a cylinder from one point to another; nothing if they coincide."""
    vector = end - start
    length = math.sqrt(math.fsum(x * x for x in vector.tolist()))
    if length < 1e-6 * style.radius:
        return
    z = vector / length
    aside = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.6 else np.array([0.0, 1.0, 0.0])
    y = cross(z, aside)
    y /= math.sqrt(math.fsum(x * x for x in y.tolist()))
    placement = _at((start + end) / 2.0, np.column_stack([cross(y, z), y, z]), style)
    yield _visual("cylinder", (digits(thickness * style.radius), digits(length)), placement, style)


def _ball(centre: np.ndarray, thickness: float, style: _Style) -> Visual:
    return _visual("sphere", (digits(thickness * style.radius),), _at(centre, np.eye(3), style), style)


def _visual(kind: str, sizes: ArrayLike, placement: np.ndarray, style: _Style) -> Visual:
    from yourdfpy import Visual

    from raff2urdf.writers.urdf_object import geometry, material_of

    r, g, b = style.colour
    name = f"c{round(255 * r):02x}{round(255 * g):02x}{round(255 * b):02x}"
    return Visual(origin=placement, geometry=geometry(kind, sizes), material=material_of(name, (r, g, b, 1.0)))


def _at(point: np.ndarray, rotation: np.ndarray, style: _Style) -> np.ndarray:
    placement = np.eye(4)
    placement[:3, :3] = rotation
    placement[:3, 3] = rounded(point, style.radius)
    return placement


def rounded(values: np.ndarray, radius: float) -> np.ndarray:
    """Return values (n,) to a millionth of a bar's radius: no rounding errors such as 1e-17 in the file."""
    step = 10.0 ** (math.floor(math.log10(radius)) - 6)
    return np.array([digits(step * round(value / step)) for value in values.tolist()])


def digits(value: float) -> float:
    """Return a number to nine digits."""
    return float(f"{value:.9g}")
