"""`SeamCurve`: a smooth curve through points, parametrised by arc length, with a normal everywhere.

Between points that are not evenly spaced a Catmull-Rom spline needs the centripetal parameter: with it, and no other of
its family, there are no cusps and no self-intersections between two points (C. Yuksel, S. Schaefer, J. Keyser:
Parameterization and applications of Catmull-Rom curves. Computer-Aided Design 43 (2011), 747-755), and a long straight
part between short ones stays nearly straight.
"""

from __future__ import annotations

import math
from bisect import bisect_right

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from cinegen.arrays import Array, Indices
from cinegen.sensor import SensorError

CORNER = math.radians(30.0)
"""Larger changes of direction of the line through the points are corners, where the curve is not smooth."""

_STEEP = math.radians(5.0)  # smallest angle between the curve and its normal
_OPPOSITE = math.radians(175.0)  # largest angle between successive normals: beyond, the rotation is ambiguous
_SAME = 1e-9  # m, and of unit normals: less is no difference
_UNEVEN = 1e-6  # largest deviation of the speed along a curve from 1
_FINEST, _MOST = 512, 1 << 19  # largest number of parts between two points, and of a curve

# Gauss quadrature with three abscissae, on 0 to 1.
_ABSCISSAE = 0.5 + math.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


class PointError(SensorError):
    """A point that a curve can't go through.

    Attributes:
        index: of the point, from 0.
        message: what is wrong with it.
    """

    def __init__(self, index: int, message: str) -> None:
        self.index, self.message = index, message
        super().__init__(f"point {index + 1}: {message}")

    def __reduce__(self) -> tuple[type[PointError], tuple[int, str]]:
        return type(self), (self.index, self.message)


class SeamCurve:
    """A curve through points with a continuous tangent; its normal rotates at constant rate from point to point.

    Args:
        points: (n, 3) m, at least two, successive ones different.
        normals: (n, 3) of length 1.
        numbers: (n,) numbers of the points in errors.
        before: (3,) m, a point before the first, for a smooth start; none unless given.
        behind: (3,) m, a point after the last, likewise.

    Attributes:
        length: arc length, m.

    Raises:
        PointError: successive normals are opposite, or the curve is parallel to its normal.
    """

    def __init__(
        self, points: Array, normals: Array, numbers: Indices, before: Array | None = None, behind: Array | None = None
    ) -> None:
        self._along, self._cubics = _by_length(_catmull_rom(points, before, behind))
        self._parts = len(self._cubics) // (len(points) - 1)  # between two points
        self._knots: list[float] = self._along.tolist()
        self.length = self._knots[-1]
        self._spans = np.diff(self._along[:: self._parts])
        self._angles, self._normals = _turns(normals, numbers)
        self._check_sides(numbers)

    def _check_sides(self, numbers: Indices) -> None:
        """Check that the curve is nowhere parallel to its normal."""
        spans = np.arange(len(self._cubics)) // self._parts
        angles = self._angles[spans] * (self._along[:-1] - self._along[spans * self._parts]) / self._spans[spans]
        first, aside = np.moveaxis(self._normals[spans], 1, 0)
        normals = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * aside
        _, tangent, normal = self.at(self.length)
        apart = np.linalg.norm(np.cross(np.vstack([self._cubics[:, 2], tangent]), np.vstack([normals, normal])), axis=1)
        for i in np.flatnonzero(apart < math.sin(_STEEP))[:1]:
            which = round(float(i) / self._parts)  # the nearest
            raise PointError(int(numbers[which]), "the seam is parallel to its normal here: a tool can't point at it")

    def at(self, along: float) -> tuple[Array, Array, Array]:
        """Return point (3,) m, unit tangent (3,) and normal (3,) at an arc length (m), clipped to the curve's."""
        i = min(max(bisect_right(self._knots, along) - 1, 0), len(self._cubics) - 1)
        d = min(max(along, 0.0), self.length) - self._knots[i]
        a, b, c, e = self._cubics[i]
        point = ((a * d + b) * d + c) * d + e
        tangent = (3.0 * d * a + 2.0 * b) * d + c
        k = i // self._parts
        angle = self._angles[k] * (self._knots[i] - self._knots[k * self._parts] + d) / self._spans[k]
        first, aside = self._normals[k]
        return point, tangent / math.sqrt(tangent @ tangent), math.cos(angle) * first + math.sin(angle) * aside


def smooth_runs(points: Array, normals: Array) -> list[SeamCurve]:
    """Return successive curves through points: each ends where the next begins, at a corner or an edge.

    At a corner the line changes its direction by more than `CORNER`. An edge is a point that is given twice, with two
    normals. A closed line without a corner at its ends is smooth there, too.

    Args:
        points: (n, 3) m.
        normals: (n, 3) of length 1.

    Raises:
        PointError: a point that a curve can't go through.
        SensorError: fewer than two different points.
    """
    if len(points) < 2:
        raise SensorError("a seam needs two points at least")
    moved = np.linalg.norm(np.diff(points, axis=0), axis=1) > _SAME
    turned = np.linalg.norm(np.diff(normals, axis=0), axis=1) > _SAME
    numbers = np.flatnonzero(np.concatenate([[True], moved | turned]))  # without repetitions
    points, normals = points[numbers], normals[numbers]
    last = len(points) - 1
    if not moved.any():
        raise SensorError("a seam needs two points at least")

    steps = np.diff(points, axis=0)
    edges = np.linalg.norm(steps, axis=1) <= _SAME
    bends = angle(steps[:-1], steps[1:]) > CORNER
    corners, cuts = np.flatnonzero(bends & ~edges[:-1] & ~edges[1:]) + 1, np.flatnonzero(edges)
    starts = np.sort(np.concatenate([[0], corners, cuts + 1]))
    ends = np.sort(np.concatenate([corners, cuts, [last]]))
    closed = (
        bool(np.linalg.norm(points[last] - points[0]) <= _SAME)
        and last > 2
        and not (edges[0] or edges[-1])
        and float(angle(steps[-1], steps[0])) <= CORNER
    )
    curves = []
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        if start == end:
            raise PointError(
                int(numbers[start]),
                "it is where its neighbour is: a point with two normals is an edge, not one with three normals, nor "
                "one at an end",
            )
        part = slice(start, end + 1)
        before = points[-2] if closed and start == 0 else None
        behind = points[1] if closed and end == last else None
        curves.append(SeamCurve(points[part], normals[part], numbers[part], before, behind))
    return curves


def angle(a: Array, b: Array) -> Array:
    """Return the angle between vectors (..., 3), 0 to pi."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))


def _turns(normals: Array, numbers: Indices) -> tuple[Array, Array]:
    """Return the rotation of the normal from each point to the next: first cos(angle) + aside sin(angle).

    Returns:
        The angles (n - 1,), rad, and first and aside (n - 1, 2, 3).
    """
    cosines = np.sum(normals[:-1] * normals[1:], axis=1)
    aside = normals[1:] - cosines[:, None] * normals[:-1]
    sines = np.linalg.norm(aside, axis=1)
    angles = np.arctan2(sines, cosines)
    for i in np.flatnonzero(angles > _OPPOSITE)[:1]:
        raise PointError(int(numbers[i + 1]), "its normal is opposite to that of the point before")
    return angles, np.stack([normals[:-1], aside / np.maximum(sines, 1e-300)[:, None]], axis=1)


def _by_length(spline: CubicHermiteSpline) -> tuple[Array, Array]:
    """Return a curve in small parts, the same number between all points, parametrised by arc length.

    Returns:
        Ends of the parts (m + 1,), m, and the cubics on them (m, 4, 3) in the distance from their beginning, highest
        power first.
    """
    parts, u = 4, spline.x
    while True:
        inside = np.linspace(0.0, 1.0, parts, endpoint=False)
        fine = np.append((u[:-1, None] + np.diff(u)[:, None] * inside).ravel(), u[-1])
        inner = fine[:-1, None] + np.diff(fine)[:, None] * _ABSCISSAE
        lengths = np.diff(fine) * (np.linalg.norm(spline(inner, 1), axis=2) @ _WEIGHTS)
        points, tangents = spline(fine), spline(fine, 1)
        tangents /= np.linalg.norm(tangents, axis=1)[:, None]
        along = np.append(0.0, np.cumsum(lengths))
        curve = CubicHermiteSpline(along, points, tangents)
        speeds = np.linalg.norm(curve(along[:-1, None] + lengths[:, None] * [0.25, 0.5, 0.75], 1), axis=2)
        if np.abs(speeds - 1.0).max() <= _UNEVEN or parts >= _FINEST or len(lengths) >= _MOST:
            return along, np.moveaxis(curve.c, 0, 1).copy()
        parts *= 2


def _catmull_rom(points: Array, before: Array | None, behind: Array | None) -> CubicHermiteSpline:
    """Return the spline with tangents of the parabolas through a point and its neighbours; mirrored at the ends."""
    around = points
    if before is not None:
        around = np.vstack([before, around])
    if behind is not None:
        around = np.vstack([around, behind])
    steps = np.diff(around, axis=0)
    spans = np.sqrt(np.linalg.norm(steps, axis=1))[:, None]
    slopes = steps / spans
    tangents = np.repeat(slopes, 2, axis=0)
    if len(around) > 2:
        inner = (spans[1:] * slopes[:-1] + spans[:-1] * slopes[1:]) / (spans[1:] + spans[:-1])
        tangents = np.vstack([_mirrored(inner[0], slopes[0]), inner, _mirrored(inner[-1], slopes[-1])])
    u = np.append(0.0, np.cumsum(spans))
    part = slice(int(before is not None), len(u) - int(behind is not None))
    return CubicHermiteSpline(u[part], points, tangents[part])


def _mirrored(tangent: Array, chord: Array) -> Array:
    """Return the tangent at the other end of a chord of a circle."""
    return np.asarray(2.0 * (tangent @ chord) / (chord @ chord) * chord - tangent)
