"""The tightest capsule around points.

A capsule is all that is within its radius of a segment. Around a given axis it must be as wide as the farthest point;
made a little wider, its round ends take in more, and it gets shorter. Which axis is best is a small search.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.optimize import minimize

Array = NDArray[np.float64]

_DIRECTIONS = 200  # over a half-sphere: 8 degrees apart, from where the search goes on
_OUTERMOST = 400  # directions whose outermost points say what the others hardly change
_STEPS = (0.1, 0.02, 0.005)  # rad, or parts of the size: of the searches for the axis
_ROUNDING = 1e-12  # of the radius: what is computed is not exact


@dataclass(frozen=True, eq=False)
class Capsule:
    """All that is within `radius` of a segment. Lengths in m.

    Attributes:
        middle: (3,) of the segment.
        axis: (3,) unit vector along it.
        radius: of the capsule.
        length: of the segment; 0 makes a ball.
    """

    middle: Array
    axis: Array
    radius: float
    length: float

    @property
    def volume(self) -> float:
        """m3."""
        return float(_volume(self.radius, self.length))

    @property
    def placement(self) -> pin.SE3:
        """Of its shape, whose z is the axis."""
        return pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), self.axis).matrix(), self.middle)

    @property
    def shape(self) -> coal.ShapeBase:
        """As coal measures it."""
        return coal.Capsule(self.radius, self.length) if self.length > 0.0 else coal.Sphere(self.radius)


def around(points: Array) -> Capsule:
    """A capsule that holds all points: the tightest that a search finds, from the best of many directions.

    Args:
        points: (n, 3) m, at least one.
    """
    size = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    origin = points.mean(axis=0)
    outer = (points[_outermost(points)] - origin) / size
    principal = np.linalg.eigh(outer.T @ outer)[1].T
    ways = (*((axis, _across(axis)) for axis in principal), *_half_sphere(_DIRECTIONS))
    best, frame = min(ways, key=lambda way: _fitted(outer, way[0], _centre(outer, way[1]), 0.0).volume)
    centre = _centre(outer, frame) @ frame

    def capsule(x: Array, points: Array) -> Capsule:
        axis = best + frame @ x[:2]
        return _fitted(points, axis / np.linalg.norm(axis), frame @ (centre + x[2:4]), abs(float(x[4])))

    found = np.zeros(5)
    for step in _STEPS:  # each start afresh leads on from where the last one got stuck
        start = found + np.vstack([np.zeros(5), step * np.diag([1.0, 1.0, 0.2, 0.2, 0.5])])
        options = {"initial_simplex": start, "xatol": 1e-5, "fatol": 1e-7}
        found = minimize(lambda x: capsule(x, outer).volume, found, method="Nelder-Mead", options=options).x
    fitted = capsule(found, (points - origin) / size)  # now around all of them
    middle, half = origin + size * fitted.middle, size * fitted.length / 2.0
    # measured once more, as it will stand there
    height = np.clip((points - middle) @ fitted.axis, -half, half)
    radius = float(np.linalg.norm(points - middle - height[:, None] * fitted.axis, axis=1).max())
    return Capsule(middle, fitted.axis, radius * (1.0 + _ROUNDING), 2.0 * half)


def _fitted(points: Array, axis: Array, through: Array, wider: float) -> Capsule:
    """The shortest capsule around points (n, 3), on an axis through a point and `wider` than it must be, in parts."""
    seen = points - through
    height = seen @ axis
    square = np.einsum("ij,ij->i", seen, seen) - height * height
    widest = float(square.max()) * (1.0 + wider) ** 2
    ends = np.sqrt(np.maximum(widest - square, 0.0))  # how far from a point the segment may end
    low, high = float((height + ends).min()), float((height - ends).max())
    return Capsule(through + 0.5 * (low + high) * axis, axis, math.sqrt(max(widest, 0.0)), max(high - low, 0.0))


def _centre(points: Array, frame: Array) -> Array:
    """(3,) the middle of points (n, 3) in the plane of two unit vectors (3, 2), by the rectangle around them."""
    seen = points @ frame
    middle: Array = frame @ (0.5 * (seen.min(axis=0) + seen.max(axis=0)))
    return middle


def _across(axis: Array) -> Array:
    """(3, 2) two unit vectors across an axis."""
    smallest = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(axis, smallest)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first)])


def _outermost(points: Array) -> NDArray[np.intp]:
    """The points (n, 3) that are outermost in some of many directions."""
    if len(points) <= _OUTERMOST:
        return np.arange(len(points))
    half = points @ np.column_stack([axis for axis, _ in _half_sphere(_OUTERMOST // 2)])
    return np.unique([half.argmax(axis=0), half.argmin(axis=0)])


@cache
def _half_sphere(count: int) -> tuple[tuple[Array, Array], ...]:
    """Unit vectors (3,) spread evenly over a half-sphere, by the golden angle; with each, two unit vectors (3, 2)
    across it."""
    z = (np.arange(count) + 0.5) / count
    turn = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
    spread = np.column_stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z])
    return tuple((axis, _across(axis)) for axis in spread)


def _volume(radius: float, length: float) -> float:
    """m3 of a capsule."""
    return math.pi * radius * radius * (length + 4.0 / 3.0 * radius)
