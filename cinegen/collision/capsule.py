"""The tightest capsule around points.

A capsule is the set of all points within its radius of a segment. Around a given axis it must be as wide as the
farthest point; a slightly larger radius lets its round ends contain more points, and makes it shorter. The axis is
found by a small search.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import coal
import numpy as np
import pinocchio as pin
from scipy.optimize import minimize

from cinegen.arrays import Array, Indices

_DIRECTIONS = 200  # over a half-sphere, 8 degrees apart: starts of the search
_OUTERMOST = 400  # directions whose extreme points determine the capsule closely enough for the search
_STEPS = (0.1, 0.02, 0.005)  # rad, or fractions of the size: initial steps of the successive searches
_ROUNDING = 1e-12  # of the radius


@dataclass(frozen=True, eq=False)
class BoundingCapsule:
    """All points within `radius` of a segment. Lengths in m.

    Attributes:
        middle: (3,) of the segment.
        axis: (3,) unit vector along the segment.
        radius: radius.
        length: length of the segment; 0 makes a ball.
    """

    middle: Array
    axis: Array
    radius: float
    length: float

    @property
    def volume(self) -> float:
        """Volume, m^3."""
        return math.pi * self.radius * self.radius * (self.length + 4.0 / 3.0 * self.radius)

    @property
    def placement(self) -> pin.SE3:
        """Pose of the shape, whose z axis is the capsule's axis."""
        return pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), self.axis).matrix(), self.middle)

    @property
    def shape(self) -> coal.ShapeBase:
        """Shape for coal."""
        return coal.Capsule(self.radius, self.length) if self.length > 0.0 else coal.Sphere(self.radius)


def bounding_capsule(points: Array) -> BoundingCapsule:
    """Return a capsule that contains all points (n, 3), m, n >= 1: the tightest found by a search that starts from the
    best of many directions."""
    size = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    origin = points.mean(axis=0)
    outer = (points[_outermost(points)] - origin) / size
    principal = np.linalg.eigh(outer.T @ outer)[1].T
    frames = (*((axis, perpendicular(axis)) for axis in principal), *_half_sphere(_DIRECTIONS))
    best, frame = min(frames, key=lambda pair: _fitted(outer, pair[0], _centre(outer, pair[1]), 0.0).volume)
    centre = _centre(outer, frame) @ frame

    def capsule(x: Array, points: Array) -> BoundingCapsule:
        axis = best + frame @ x[:2]
        return _fitted(points, axis / np.linalg.norm(axis), frame @ (centre + x[2:4]), abs(float(x[4])))

    solution = np.zeros(5)
    for step in _STEPS:  # a new simplex continues where the previous one stagnated
        start = solution + np.vstack([np.zeros(5), step * np.diag([1.0, 1.0, 0.2, 0.2, 0.5])])
        options = {"initial_simplex": start, "xatol": 1e-5, "fatol": 1e-7}
        solution = minimize(lambda x: capsule(x, outer).volume, solution, method="Nelder-Mead", options=options).x
    fitted = capsule(solution, (points - origin) / size)  # around all points
    middle, half = origin + size * fitted.middle, size * fitted.length / 2.0
    # the radius is measured again after rounding
    height = np.clip((points - middle) @ fitted.axis, -half, half)
    radius = float(np.linalg.norm(points - middle - height[:, None] * fitted.axis, axis=1).max())
    return BoundingCapsule(middle, fitted.axis, radius * (1.0 + _ROUNDING), 2.0 * half)


def _fitted(points: Array, axis: Array, through: Array, wider: float) -> BoundingCapsule:
    """Return the shortest capsule around points (n, 3) with an axis through a point, whose radius exceeds the least
    possible one by the fraction `wider`."""
    offsets = points - through
    height = offsets @ axis
    square = np.einsum("ij,ij->i", offsets, offsets) - height * height
    widest = float(square.max()) * (1.0 + wider) ** 2
    ends = np.sqrt(np.maximum(widest - square, 0.0))  # how far from a point the segment may end
    low, high = float((height + ends).min()), float((height - ends).max())
    return BoundingCapsule(through + 0.5 * (low + high) * axis, axis, math.sqrt(max(widest, 0.0)), max(high - low, 0.0))


def _centre(points: Array, frame: Array) -> Array:
    """Return the centre (3,) of the bounding rectangle of points (n, 3) in the plane of two unit vectors (3, 2)."""
    projected = points @ frame
    middle: Array = frame @ (0.5 * (projected.min(axis=0) + projected.max(axis=0)))
    return middle


def perpendicular(axis: Array) -> Array:
    """Return two unit vectors (3, 2) perpendicular to an axis and to each other."""
    smallest = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(axis, smallest)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first)])


def _outermost(points: Array) -> Indices:
    """Return the indices of the points (n, 3) that are extreme in some of many directions."""
    if len(points) <= _OUTERMOST:
        return np.arange(len(points))
    heights = points @ np.column_stack([axis for axis, _ in _half_sphere(_OUTERMOST // 2)])
    return np.unique([heights.argmax(axis=0), heights.argmin(axis=0)])


@cache
def _half_sphere(count: int) -> tuple[tuple[Array, Array], ...]:
    """Return unit vectors (3,) evenly over a half-sphere, by the golden angle; each with two unit vectors (3, 2)
    perpendicular to it."""
    z = (np.arange(count) + 0.5) / count
    angle = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
    vectors = np.column_stack([np.sqrt(1.0 - z * z) * np.cos(angle), np.sqrt(1.0 - z * z) * np.sin(angle), z])
    return tuple((axis, perpendicular(axis)) for axis in vectors)
