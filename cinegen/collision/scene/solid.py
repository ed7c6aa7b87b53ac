"""Convex solids, which obstacles are made of."""

from __future__ import annotations

from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

Array = NDArray[np.float64]

HEIGHT = 4.0
"""m, from the bottom to the top of what is drawn in the plane: half above it, half below. Distances between shapes that
are much taller lose digits."""


class Solid(NamedTuple):
    """A convex solid: its shape, and where that stands in the frame of the obstacle."""

    placement: pin.SE3
    shape: coal.ShapeBase


def prism(corners: Array, height: float) -> Solid:
    """An upright one.

    Args:
        corners: (n, 2) of a convex polygon in the plane z = 0, counter-clockwise, m.
        height: m, half above that plane, half below.
    """
    n = len(corners)
    lids = [np.column_stack([corners, np.full(n, z)]) for z in (-height / 2.0, height / 2.0)]
    inner, ahead = np.arange(1, n - 1), np.arange(2, n)
    i, following = np.arange(n), np.roll(np.arange(n), -1)
    triangles = [
        (np.zeros_like(inner), ahead, inner),
        (np.full_like(inner, n), n + inner, n + ahead),
        (i, following, n + following),
        (i, n + following, n + i),
    ]
    return Solid(pin.SE3.Identity(), _convex(np.vstack(lids), np.hstack(triangles).T))


def hull(points: Array) -> Solid:
    """The convex hull of points (n, 3), m.

    Raises:
        scipy.spatial.QhullError: they lie in one plane.
    """
    found = ConvexHull(points)
    a, b, c = points[found.simplices].transpose(1, 0, 2)
    inward = (np.cross(b - a, c - a) * found.equations[:, :3]).sum(axis=1) < 0.0
    found.simplices[inward] = found.simplices[inward][:, ::-1]
    corners = np.sort(found.vertices)
    return Solid(pin.SE3.Identity(), _convex(points[corners], np.searchsorted(corners, found.simplices)))


def _convex(corners: Array, triangles: NDArray[np.intp]) -> coal.Convex:
    """From corners (n, 3) and triangles (m, 3) of them, counter-clockwise as seen from outside."""
    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    points.extend(list(corners))
    faces.extend([coal.Triangle(*corners) for corners in triangles.tolist()])
    return coal.Convex(points, faces)
