"""Points that lines share and planes in which they lie, finite or not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.singularities.lines.frame import Frame, Plane, Point
from cinegen.singularities.lines.line import INCIDENT, Line

Array = NDArray[np.float64]


class Fit(NamedTuple):
    """What comes nearest to lying on all lines.

    Attributes:
        homogeneous: (4,) unit vector: (x, weight) of a point, (normal, offset) of a plane.
        residual: how far the worst line is from it, without unit.
    """

    homogeneous: Array
    residual: float


def common_point(lines: Sequence[Line], length: float, tolerance: float = INCIDENT) -> Point | None:
    """The point that all lines share, at infinity where they are parallel; None where there is none.

    A point (x, w) of homogeneous coordinates lies on (d, m) where x x d = w m and x.m = 0. Of lines that are all one it
    is any of their points.

    Args:
        lines: one or more.
        length: the characteristic length.
        tolerance: how far it may be from each, in characteristic lengths.
    """
    frame = Frame.of(lines, length)
    fit = fit_point(frame.coordinates(lines))
    return frame.point(fit.homogeneous, tolerance) if fit.residual <= tolerance else None


def common_plane(lines: Sequence[Line], length: float, tolerance: float = INCIDENT) -> Plane | None:
    """The plane n.x = c in which all lines lie; None where there is none.

    It holds (d, m) where n x m + c d = 0 and n.d = 0. Of lines that are all one it is any of the planes through them.

    Args:
        lines: one or more.
        length: the characteristic length.
        tolerance: how far each may be from lying in it, in characteristic lengths and rad.
    """
    frame = Frame.of(lines, length)
    fit = fit_plane(frame.coordinates(lines))
    return frame.plane(fit.homogeneous) if fit.residual <= tolerance else None


def fit_point(coordinates: Array) -> Fit:
    """The point that comes nearest to lying on all lines (n, 6)."""
    return _fit(coordinates[:, :3], coordinates[:, 3:])


def fit_plane(coordinates: Array) -> Fit:
    """The plane (n, c) that comes nearest to holding all lines (n, 6): the equations of a point (n, -c), with d and m
    exchanged."""
    fit = _fit(coordinates[:, 3:], coordinates[:, :3])
    return Fit(fit.homogeneous * [1.0, 1.0, 1.0, -1.0], fit.residual)


def _fit(d: Array, m: Array) -> Fit:
    """The unit vector (x, w) that best solves x x d = w m and x.m = 0 for all lines."""
    rows = np.zeros((len(d), 4, 4))
    rows[:, :3, :3] = -np.cross(d[:, None, :], np.eye(3)).transpose(0, 2, 1)
    rows[:, :3, 3] = -m
    rows[:, 3, :3] = m
    homogeneous = np.linalg.svd(rows.reshape(-1, 4))[2][3]
    return Fit(homogeneous, float(np.linalg.norm(rows @ homogeneous, axis=1).max()))
