"""Elementary geometry of Pluecker lines: angles, distances, common points and planes, transversals of four lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cinegen.singularities.line_varieties import span
from cinegen.singularities.pluecker import (
    AnyLine,
    LineFrame,
    LinePlane,
    PlueckerError,
    PlueckerLine,
    ProjectivePoint,
    fit_plane,
    fit_point,
)

INCIDENT = 1e-9
"""How far (characteristic lengths, rad) lines may be from meeting, or from being parallel, and count as such."""

_PARALLEL = 1e-12  # sine of an angle below which a distance is that of parallel lines: the other loses its digits


def mutual_moment(a: AnyLine, b: AnyLine) -> float:
    """Return the Klein form (reciprocal product) of two lines, d.n + e.m, in units of length. For finite lines it is
    plus or minus their distance times the sine of their angle."""
    x, y = a.coordinates, b.coordinates
    return float(x[:3] @ y[3:] + x[3:] @ y[:3])


def angle(a: PlueckerLine, b: PlueckerLine) -> float:
    """Return the angle between two lines without regard to their sense, in [0, pi/2] rad."""
    return float(np.arctan2(_sine(a, b), abs(a.direction @ b.direction)))


def distance(a: PlueckerLine, b: PlueckerLine) -> float:
    """Return the shortest distance of two lines: |mutual moment| / sine of their angle, or |d x (q - p)| for parallel
    ones with the points p and q."""
    sine = _sine(a, b)
    if sine > _PARALLEL:
        return abs(mutual_moment(a, b)) / sine
    start = a.nearest(np.zeros(3))
    return float(np.linalg.norm(b.nearest(start) - start))


def are_parallel(a: PlueckerLine, b: PlueckerLine, tolerance: float = INCIDENT) -> bool:
    """Return whether the sine of their angle is at most `tolerance`; a line is parallel to itself."""
    return _sine(a, b) <= tolerance


def are_coplanar(a: PlueckerLine, b: PlueckerLine, length: float, tolerance: float = INCIDENT) -> bool:
    """Return whether two lines lie in one plane, that is, meet or are parallel: their mutual moment is at most
    `tolerance` of the characteristic `length`."""
    return abs(mutual_moment(a, b)) <= tolerance * length


def meet(a: PlueckerLine, b: PlueckerLine, length: float, tolerance: float = INCIDENT) -> bool:
    """Return whether two lines share a finite point: their distance is at most `tolerance` of the characteristic
    `length`."""
    return distance(a, b) <= tolerance * length


def _sine(a: PlueckerLine, b: PlueckerLine) -> float:
    return float(np.linalg.norm(np.cross(a.direction, b.direction)))


def common_point(lines: Sequence[PlueckerLine], length: float, tolerance: float = INCIDENT) -> ProjectivePoint | None:
    """Return the point that all lines share, at infinity if they are parallel; None if there is none.

    A point (x, w) of homogeneous coordinates lies on (d, m) where x x d = w m and x.m = 0. Of lines that are all one it
    is any of their points.

    Args:
        lines: one or more.
        length: the characteristic length.
        tolerance: how far it may be from each, in characteristic lengths.
    """
    frame = LineFrame.of(lines, length)
    fit = fit_point(frame.coordinates(lines))
    return frame.point(fit.homogeneous, tolerance) if fit.residual <= tolerance else None


def common_plane(lines: Sequence[PlueckerLine], length: float, tolerance: float = INCIDENT) -> LinePlane | None:
    """Return the plane n.x = c in which all lines lie; None if there is none.

    It contains (d, m) where n x m + c d = 0 and n.d = 0. Of lines that are all one it is any plane through them.

    Args:
        lines: one or more.
        length: the characteristic length.
        tolerance: how far each may be from lying in it, in characteristic lengths and rad.
    """
    frame = LineFrame.of(lines, length)
    fit = fit_plane(frame.coordinates(lines))
    return frame.plane(fit.homogeneous) if fit.residual <= tolerance else None


@dataclass(frozen=True, eq=False)
class Transversals:
    """The real lines that meet four lines.

    Attributes:
        lines: two, one (counted twice) or none; none if there are infinitely many.
        infinitely_many: whether there are.
    """

    lines: tuple[AnyLine, ...]
    infinitely_many: bool


def transversals(lines: Sequence[PlueckerLine], length: float, tolerance: float = INCIDENT) -> Transversals:
    """Return the lines that meet four lines.

    The reciprocal complement of four independent lines is spanned by two screws; the transversals are the lines among
    their combinations (O. Veblen and J. W. Young, "Projective geometry", 1910). Four lines that are dependent leave
    three screws or more, and infinitely many transversals.

    Args:
        lines: four.
        length: the characteristic length.
        tolerance: how accurate the lines are, in characteristic lengths and rad.

    Raises:
        PlueckerError: there are not four lines.
    """
    if len(lines) != 4:
        raise PlueckerError(f"transversals of {len(lines)} lines were asked for; give four")
    frame = LineFrame.of(lines, length)
    spanned = span(frame.coordinates(lines), 4)
    if spanned.values[-1] <= tolerance:
        return Transversals((), infinitely_many=True)
    directors, known = spanned.directors(tolerance), spanned.known(tolerance)
    if directors is None:
        return Transversals((), infinitely_many=True)
    return Transversals(tuple(frame.line(np.asarray(vector), known) for vector in directors), infinitely_many=False)
