"""Where moments are taken and by which length they are divided: lines, points and planes without unit, and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.singularities.lines.line import Line, LineAtInfinity, LineError
from cinegen.singularities.lines.screw import Screw

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Point:
    """A point, perhaps at infinity.

    Attributes:
        xyz: (3,) where; the unit direction towards it where it is at infinity.
        at_infinity: whether it is, as the point that parallel lines share.
    """

    xyz: Array
    at_infinity: bool = False


@dataclass(frozen=True, eq=False)
class Plane:
    """The points x with normal.x = offset.

    Attributes:
        normal: (3,) unit vector.
        offset: of the plane from the origin, along the normal.
    """

    normal: Array
    offset: float


@dataclass(frozen=True, eq=False)
class Frame:
    """The origin (3,) about which moments are taken, and the characteristic length that divides them."""

    origin: Array
    length: float

    @classmethod
    def of(cls, lines: Sequence[Line], length: float, origin: Array | None = None) -> Frame:
        """The frame of some lines. Where no origin is given it is the centroid of the points at which the lines were
        made, for legs that of their middles. So nothing depends on where, in the caller's axes, the lines are.

        Raises:
            LineError: there are no lines, or the length is not positive.
        """
        if not lines:
            raise LineError("no lines were given")
        if not (length > 0.0 and math.isfinite(length)):
            raise LineError(f"a characteristic length of {length} was given; give a positive one")
        if origin is None:
            origin = np.mean([line.point for line in lines], axis=0)
        return cls(np.asarray(origin, dtype=float), float(length))

    def coordinates(self, lines: Sequence[Line]) -> Array:
        """(n, 6) the lines' (d, (m - o x d) / length)."""
        d = np.array([line.direction for line in lines])
        m = np.array([line.moment for line in lines])
        return np.hstack([d, (m - np.cross(self.origin, d)) / self.length])

    def line(self, vector: Array, known: float) -> Line | LineAtInfinity:
        """The line nearest to a vector (6,) of this frame; at infinity where its direction is less than `known` of it.
        Its sense is such that the largest component is positive."""
        d, m = vector[:3], vector[3:]
        size = float(np.linalg.norm(d))
        if size <= known * float(np.linalg.norm(vector)):
            return LineAtInfinity(_upward(m) / np.linalg.norm(m))
        point = np.cross(d, m) / size**2  # of the axis: it drops what is of m along d
        return Line.along(self.origin + self.length * point, _upward(d))

    def screw(self, vector: Array, known: float, rotates: bool = False) -> Screw:
        """The screw of a vector (6,) of this frame; a pure rotation where it is said to be one, a translation where its
        axis is at infinity as far as the vector is known."""
        axis = self.line(vector, known)
        if isinstance(axis, LineAtInfinity):
            return Screw(axis, math.inf)
        w, v = vector[:3], vector[3:]
        return Screw(axis, 0.0 if rotates else self.length * float(w @ v / (w @ w)))

    def point(self, homogeneous: Array, known: float) -> Point:
        """The point of homogeneous coordinates (4,), (x, weight), in this frame; at infinity where the weight is less
        than `known` of them."""
        x, weight = homogeneous[:3], homogeneous[3]
        if abs(weight) <= known * np.linalg.norm(homogeneous):
            return Point(_upward(x) / np.linalg.norm(x), at_infinity=True)
        return Point(self.origin + self.length * x / weight)

    def plane(self, homogeneous: Array) -> Plane:
        """The plane n.x = c of coordinates (4,), (n, c), in this frame; n is not zero."""
        normal, offset = homogeneous[:3], homogeneous[3]
        size = sense(normal) * np.linalg.norm(normal)
        return Plane(normal / size, float(self.length * offset / size + normal @ self.origin / size))


def sense(vector: Array) -> float:
    """1 or -1: what makes the largest component of a vector positive, for a vector or its opposite mean the same."""
    return -1.0 if vector[np.argmax(np.abs(vector))] < 0.0 else 1.0


def _upward(vector: Array) -> Array:
    return sense(vector) * vector
