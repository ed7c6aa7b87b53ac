"""Pluecker lines, and screws: a line with a pitch, the velocity of a rigid motion, or a force with its couple.

A line through the point p along the unit direction d is (d, m) with the moment m = p x d, the same for every p on it,
and d.m = 0. Two lines (d, m) and (e, n) meet, at a point or at infinity, where their mutual moment d.n + e.m vanishes
(J. Pluecker, "On a new geometry of space", Phil. Trans. Royal Society 155, 1865). A screw (w, v) of six numbers has the
pitch h = w.v / w.w and the axis (w, v - h w); it is a line where h = 0 (R. S. Ball, "A treatise on the theory of
screws", Cambridge 1900). As a twist, w is the angular velocity and v the velocity of the point at the origin. A force
along a line (d, m) does no work on it where d.v + m.w = 0: then they are reciprocal. Lengths are in the caller's unit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError

KLEIN = np.kron([[0.0, 1.0], [1.0, 0.0]], np.eye(3))
"""(6, 6) K, with x.K.y the mutual moment of two lines x and y, or the power of the wrench x on the twist y."""
KLEIN.setflags(write=False)


class PlueckerError(CinegenError):
    """Points, directions or lines from which the result can't be made; the message names the reason."""


@dataclass(frozen=True, eq=False, repr=False)
class PlueckerLine:
    """A directed line; made by `PlueckerLine.through` or `PlueckerLine.along`.

    Attributes:
        direction: (3,) unit vector d.
        moment: (3,) m = p x d about the origin, for any point p of the line.
        point: (3,) the point of the line at which it was made, such as the middle of a leg.
    """

    direction: Array
    moment: Array
    point: Array

    @classmethod
    def through(cls, a: ArrayLike, b: ArrayLike) -> PlueckerLine:
        """Return the line from the point a (3,) to the point b (3,), made at the middle between them.

        Raises:
            PlueckerError: the points coincide, or are not finite.
        """
        start, end = _vector("a point", a), _vector("a point", b)
        if np.linalg.norm(end - start) <= 1e-14 * max(np.linalg.norm(start), np.linalg.norm(end)):
            raise PlueckerError(f"no line goes through {start} and {end}: the two points are one; give two that differ")
        return cls.along(0.5 * (start + end), end - start)

    @classmethod
    def along(cls, point: ArrayLike, direction: ArrayLike) -> PlueckerLine:
        """Return the line through a point (3,) along a direction (3,) of any size.

        Raises:
            PlueckerError: the direction is zero, or something is not finite.
        """
        start, along = _vector("a point", point), _vector("a direction", direction)
        largest = float(np.abs(along).max())
        if largest == 0.0:
            raise PlueckerError("a line's direction is zero; give one that is not")
        along = along / largest  # so that tiny or huge ones do not under- or overflow
        along /= np.linalg.norm(along)
        return cls(along, np.cross(start, along), start)

    def __repr__(self) -> str:
        return f"<PlueckerLine through {_shown(self.point)} along {_shown(self.direction)}>"

    @property
    def coordinates(self) -> Array:
        """(6,) the Pluecker vector (direction, moment)."""
        return np.concatenate([self.direction, self.moment])

    def nearest(self, point: ArrayLike) -> Array:
        """Return the point (3,) of the line that is nearest to a point q (3,): q + d x (m - q x d)."""
        q = np.asarray(point, dtype=float)
        return np.asarray(q + np.cross(self.direction, self.moment - np.cross(q, self.direction)))


@dataclass(frozen=True, eq=False, repr=False)
class LineAtInfinity:
    """The line that all planes with one normal share. It meets exactly the lines that are parallel to these planes; to
    rotate about it is to translate along the normal. Its Pluecker vector is (0, normal).

    Attributes:
        normal: (3,) unit vector.
    """

    normal: Array

    def __repr__(self) -> str:
        return f"<LineAtInfinity of planes with normal {_shown(self.normal)}>"

    @property
    def coordinates(self) -> Array:
        """(6,) the Pluecker vector (0, normal)."""
        return np.concatenate([np.zeros(3), self.normal])


AnyLine = PlueckerLine | LineAtInfinity


@dataclass(frozen=True, eq=False, repr=False)
class Screw:
    """A twist or a wrench: a rotation about an axis and `pitch` along it per radian.

    Attributes:
        axis: of the rotation. At infinity for a pure translation, which is along the axis's `normal`.
        pitch: length per radian, positive for a right-hand thread; 0 for a pure rotation, infinite for a translation.
    """

    axis: AnyLine
    pitch: float

    def __repr__(self) -> str:
        return f"<Screw of pitch {self.pitch:.4g} about {self.axis!r}>"

    @property
    def coordinates(self) -> Array:
        """(6,) (w, v), w a unit vector and v = p x w + h w the origin's velocity; (0, normal) for a translation."""
        screw = self.axis.coordinates
        if isinstance(self.axis, PlueckerLine):
            screw[3:] += self.pitch * self.axis.direction
        return screw


@dataclass(frozen=True, eq=False, repr=False)
class ProjectivePoint:
    """A point, perhaps at infinity.

    Attributes:
        xyz: (3,) its coordinates; the unit direction towards it if it is at infinity.
        at_infinity: whether it is, as the point that parallel lines share.
    """

    xyz: Array
    at_infinity: bool = False

    def __repr__(self) -> str:
        return f"<ProjectivePoint {'at infinity, towards' if self.at_infinity else 'at'} {_shown(self.xyz)}>"


@dataclass(frozen=True, eq=False, repr=False)
class LinePlane:
    """The points x with normal.x = offset.

    Attributes:
        normal: (3,) unit vector.
        offset: of the plane from the origin, along the normal.
    """

    normal: Array
    offset: float

    def __repr__(self) -> str:
        return f"<LinePlane with normal {_shown(self.normal)} at {self.offset:.4g} from the origin>"


@dataclass(frozen=True, eq=False)
class LineFrame:
    """The origin (3,) about which moments are taken, and the characteristic length that divides them."""

    origin: Array
    length: float

    @classmethod
    def of(cls, lines: Sequence[PlueckerLine], length: float) -> LineFrame:
        """Return the frame of some lines. Its origin is the centroid of the points at which the lines
        were made, for legs that of their middles. So nothing depends on where, in the caller's axes, the lines are.

        Raises:
            PlueckerError: there are no lines, or the length is not positive.
        """
        if not lines:
            raise PlueckerError("no lines were given")
        if not (length > 0.0 and math.isfinite(length)):
            raise PlueckerError(f"a characteristic length of {length} was given; give a positive one")
        return cls(np.mean([line.point for line in lines], axis=0), float(length))

    def coordinates(self, lines: Sequence[PlueckerLine]) -> Array:
        """Return the lines' (d, (m - o x d) / length), (n, 6)."""
        d = np.array([line.direction for line in lines])
        m = np.array([line.moment for line in lines])
        return np.hstack([d, (m - np.cross(self.origin, d)) / self.length])

    def line(self, vector: Array, known: float) -> AnyLine:
        """Return the line nearest to a vector (6,) of this frame; at infinity if its direction is less than `known` of
        it. Its sense is such that the largest component is positive."""
        d, m = vector[:3], vector[3:]
        size = float(np.linalg.norm(d))
        if size <= known * float(np.linalg.norm(vector)):
            return LineAtInfinity(sense(m) * m / np.linalg.norm(m))
        point = np.cross(d, m) / size**2  # of the axis: it drops what is of m along d
        return PlueckerLine.along(self.origin + self.length * point, sense(d) * d)

    def screw(self, vector: Array, known: float, rotates: bool = False) -> Screw:
        """Return the screw of a vector (6,) of this frame; a pure rotation if `rotates`, a translation if its axis is
        at infinity as far as the vector is known."""
        axis = self.line(vector, known)
        if isinstance(axis, LineAtInfinity):
            return Screw(axis, math.inf)
        w, v = vector[:3], vector[3:]
        return Screw(axis, 0.0 if rotates else self.length * float(w @ v / (w @ w)))

    def point(self, homogeneous: Array, known: float) -> ProjectivePoint:
        """Return the point of homogeneous coordinates (4,), (x, weight), in this frame; at infinity if the weight is
        less than `known` of them."""
        x, weight = homogeneous[:3], homogeneous[3]
        if abs(weight) <= known * np.linalg.norm(homogeneous):
            return ProjectivePoint(sense(x) * x / np.linalg.norm(x), at_infinity=True)
        return ProjectivePoint(self.origin + self.length * x / weight)

    def plane(self, homogeneous: Array) -> LinePlane:
        """Return the plane n.x = c of coordinates (4,), (n, c), in this frame; n is not zero."""
        normal, offset = homogeneous[:3], homogeneous[3]
        size = sense(normal) * np.linalg.norm(normal)
        return LinePlane(normal / size, float(self.length * offset / size + normal @ self.origin / size))


class IncidenceFit(NamedTuple):
    """A point or plane that comes nearest to lying on all lines.

    Attributes:
        homogeneous: (4,) unit vector: (x, weight) of a point, (normal, offset) of a plane.
        residual: of the worst line, dimensionless.
    """

    homogeneous: Array
    residual: float


def fit_point(coordinates: Array) -> IncidenceFit:
    """Return the point that comes nearest to lying on all lines (n, 6)."""
    return _fit(coordinates[:, :3], coordinates[:, 3:])


def fit_plane(coordinates: Array) -> IncidenceFit:
    """Return the plane (n, c) that comes nearest to containing all lines (n, 6): the equations of a point (n, -c), with
    d and m exchanged."""
    fit = _fit(coordinates[:, 3:], coordinates[:, :3])
    return IncidenceFit(fit.homogeneous * [1.0, 1.0, 1.0, -1.0], fit.residual)


def _fit(d: Array, m: Array) -> IncidenceFit:
    """Return the unit vector (x, w) that best solves x x d = w m and x.m = 0 for all lines."""
    rows = np.zeros((len(d), 4, 4))
    rows[:, :3, :3] = -np.cross(d[:, None, :], np.eye(3)).transpose(0, 2, 1)
    rows[:, :3, 3] = -m
    rows[:, 3, :3] = m
    homogeneous = np.linalg.svd(rows.reshape(-1, 4))[2][3]
    return IncidenceFit(homogeneous, float(np.linalg.norm(rows @ homogeneous, axis=1).max()))


def sense(vector: Array) -> float:
    """Return 1 or -1, whichever makes the largest component of a vector positive, for a vector and its opposite that
    mean the same."""
    return -1.0 if vector[np.argmax(np.abs(vector))] < 0.0 else 1.0


def _shown(vector: Array) -> str:
    return f"({', '.join(f'{value:.4g}' for value in vector + 0.0)})"


def _vector(name: str, components: ArrayLike) -> Array:
    vector = np.asarray(components, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise PlueckerError(f"{name} of a line is {components!r}; give three finite numbers")
    return vector
