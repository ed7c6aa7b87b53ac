"""Pluecker lines: a line of space as six numbers, and how two of them lie to each other.

A line through the point p along the unit direction d is (d, m) with the moment m = p x d, the same for every p on it,
and d.m = 0. Two lines (d, m) and (e, n) meet, at a point or at infinity, where their mutual moment d.n + e.m
vanishes (J. Pluecker, "On a new geometry of space", Phil. Trans. Royal Society 155, 1865). All lengths are in the
caller's unit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.errors import CinegenError

Array = NDArray[np.float64]

INCIDENT = 1e-9
"""How far (characteristic lengths, rad) lines may be from meeting, or from being parallel, and count as such."""

_PARALLEL = 1e-12  # sine of an angle below which a distance is that of parallel lines: the other loses its digits


class LineError(CinegenError):
    """Points, directions or lines that do not make what was asked for."""


@dataclass(frozen=True, eq=False)
class Line:
    """A line, with a sense along it; made by `Line.through` or `Line.along`.

    Attributes:
        direction: (3,) unit vector d.
        moment: (3,) m = p x d about the origin, for any point p of the line.
        point: (3,) the point of the line at which it was made: it says where on the line one is interested in it.
    """

    direction: Array
    moment: Array
    point: Array

    @classmethod
    def through(cls, a: ArrayLike, b: ArrayLike) -> Line:
        """The line from the point a (3,) to the point b (3,), made at the middle between them.

        Raises:
            LineError: the points coincide, or are not finite.
        """
        start, end = _vector("a point", a), _vector("a point", b)
        if np.linalg.norm(end - start) <= 1e-14 * max(np.linalg.norm(start), np.linalg.norm(end)):
            raise LineError(f"no line goes through {start} and {end}: the two points are one; give two that differ")
        return cls.along(0.5 * (start + end), end - start)

    @classmethod
    def along(cls, point: ArrayLike, direction: ArrayLike) -> Line:
        """The line through a point (3,) along a direction (3,) of any size.

        Raises:
            LineError: the direction is zero, or something is not finite.
        """
        start, way = _vector("a point", point), _vector("a direction", direction)
        largest = float(np.abs(way).max())
        if largest == 0.0:
            raise LineError("a line's direction is zero; give one that points somewhere")
        way = way / largest  # so that tiny or huge ones do not under- or overflow
        way /= np.linalg.norm(way)
        return cls(way, np.cross(start, way), start)

    @property
    def coordinates(self) -> Array:
        """(6,) the Pluecker vector (direction, moment)."""
        return np.concatenate([self.direction, self.moment])

    def nearest(self, point: ArrayLike) -> Array:
        """(3,) the point of the line that is nearest to a point q (3,): q + d x (m - q x d)."""
        q = np.asarray(point, dtype=float)
        return np.asarray(q + np.cross(self.direction, self.moment - np.cross(q, self.direction)))

    def moved(self, rotation: Array, translation: ArrayLike) -> Line:
        """The line after x -> R x + t, with R (3, 3) a rotation and t (3,): (R d, R m + t x R d)."""
        shift = np.asarray(translation, dtype=float)
        direction = rotation @ self.direction
        moment = rotation @ self.moment + np.cross(shift, direction)
        return Line(direction, moment, rotation @ self.point + shift)


@dataclass(frozen=True, eq=False)
class LineAtInfinity:
    """What all planes with one normal share. It meets exactly the lines that are parallel to these planes; to turn
    about it is to translate along the normal. Its Pluecker vector is (0, normal).

    Attributes:
        normal: (3,) unit vector.
    """

    normal: Array

    @property
    def coordinates(self) -> Array:
        """(6,) the Pluecker vector (0, normal)."""
        return np.concatenate([np.zeros(3), self.normal])


def mutual_moment(a: Line | LineAtInfinity, b: Line | LineAtInfinity) -> float:
    """The Klein form (reciprocal product) of two lines: d.n + e.m, in units of length. For finite lines it is plus or
    minus their distance times the sine of their angle."""
    x, y = a.coordinates, b.coordinates
    return float(x[:3] @ y[3:] + x[3:] @ y[:3])


def angle(a: Line, b: Line) -> float:
    """Between two lines without regard to their sense, in [0, pi/2] rad."""
    return float(np.arctan2(_sine(a, b), abs(a.direction @ b.direction)))


def distance(a: Line, b: Line) -> float:
    """The shortest way between two lines: |mutual moment| / sine of their angle, or |d x (q - p)| for parallel ones
    with the points p and q."""
    sine = _sine(a, b)
    if sine > _PARALLEL:
        return abs(mutual_moment(a, b)) / sine
    start = a.nearest(np.zeros(3))
    return float(np.linalg.norm(b.nearest(start) - start))


def are_parallel(a: Line, b: Line, tolerance: float = INCIDENT) -> bool:
    """Whether the sine of their angle is at most `tolerance`; a line is parallel to itself."""
    return _sine(a, b) <= tolerance


def are_coplanar(a: Line, b: Line, length: float, tolerance: float = INCIDENT) -> bool:
    """Whether two lines lie in one plane, that is, meet or are parallel: their mutual moment is at most `tolerance`
    of the characteristic `length`."""
    return abs(mutual_moment(a, b)) <= tolerance * length


def meet(a: Line, b: Line, length: float, tolerance: float = INCIDENT) -> bool:
    """Whether two lines share a finite point: their distance is at most `tolerance` of the characteristic `length`."""
    return distance(a, b) <= tolerance * length


def _sine(a: Line, b: Line) -> float:
    return float(np.linalg.norm(np.cross(a.direction, b.direction)))


def _vector(what: str, given: ArrayLike) -> Array:
    vector = np.asarray(given, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise LineError(f"{what} of a line is {given!r}; give three finite numbers")
    return vector
