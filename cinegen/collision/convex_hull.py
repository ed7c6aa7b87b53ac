"""The convex hull of points, and a simplified hull with fewer corners that contains it.

A distance between hulls of thousands of corners takes twice as long as between hulls of 50; with a hundred it takes no
longer. Corners cannot simply be dropped: the rest would not contain the points. So a box is cut by one face of the
exact hull after another, always by the one that most of the remaining polyhedron exceeds. Each cut is along a face, so
all points stay inside, and the excess that is left is known (J. E. Kelley, "The cutting-plane method for solving convex
programs", J. SIAM 8, 1960).
"""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
from scipy.spatial import ConvexHull, HalfspaceIntersection

from cinegen.arrays import Array

CLOSE = 0.01
"""Largest excess of a simplified hull over the exact one, as a fraction of its extent."""

_FEW = 256  # corners that are not simplified: fewer are not faster
_MOST = 90  # corners at which cutting stops, even if the excess is larger than CLOSE
_ROUNDING = 1e-6  # of the size: added, because Qhull computes corners of nearly parallel faces to 1e-8 at best
_THIN = 1e-5  # of the size: half the thickness given to flat points


@dataclass(frozen=True, eq=False)
class Hull:
    """Convex polyhedron: all x with normals x <= offsets.

    Attributes:
        corners: (n, 3) m.
        normals: (faces, 3) outward unit normals.
        offsets: (faces,) m.
        volume: m^3.
    """

    corners: Array
    normals: Array
    offsets: Array
    volume: float

    @property
    def shape(self) -> coal.Convex:
        """Shape for coal."""
        corners = coal.StdVec_Vec3s()
        corners.extend(list(self.corners))
        return coal.Convex.convexHull(corners, True, "Qt")


def hull(points: Array) -> Hull:
    """Return the convex hull of points (n, 3), m. Points on a plane or a line are given a small thickness."""
    qhull = ConvexHull(_thick(points) if is_flat(points) else points)
    corners = qhull.points[qhull.vertices]
    normals = qhull.equations[:, :3]
    offsets = np.einsum("fkj,fj->fk", qhull.points[qhull.simplices], normals).max(axis=1)  # the others are behind
    return Hull(corners, normals, offsets, float(qhull.volume))


def prism(corners: Array, height: float) -> Hull:
    """Return the upright prism on a convex polygon (n, 2) in the plane z = 0, m, half above that plane, half below."""
    return hull(np.vstack([np.column_stack([corners, np.full(len(corners), z)]) for z in (-height / 2, height / 2)]))


def simplified(exact: Hull) -> Hull:
    """Return a hull that contains a hull, with about 90 corners at most; within `CLOSE` of it, if that is possible."""
    if len(exact.corners) <= _FEW:
        return exact
    middle = exact.corners.mean(axis=0)
    axes, extents = _principal(exact.corners)
    scaled = (exact.corners - middle) @ axes / extents  # equal extents, or Qhull would fail
    equations = ConvexHull(scaled).equations
    normals, offsets = equations[:, :3], (scaled @ equations[:, :3].T).max(axis=0)
    sides = np.vstack([np.eye(3), -np.eye(3)])
    cut = HalfspaceIntersection(
        np.column_stack([sides, -(scaled @ sides.T).max(axis=0)]), np.zeros(3), incremental=True
    )
    while len(cut.intersections) <= _MOST:
        above = cut.intersections @ normals.T - offsets
        corner, face = np.unravel_index(int(above.argmax()), above.shape)
        if above[corner, face] <= CLOSE:
            break
        cut.add_halfspaces(np.append(normals[face], -offsets[face])[None])
    corners = middle + (1.0 + _ROUNDING) * (extents * cut.intersections) @ axes.T
    cut.close()
    return hull(corners)


def _principal(points: Array) -> tuple[Array, Array]:
    """Return the principal axes of points (n, 3), as columns (3, 3), and the extent of the points along each (3,),
    m."""
    centred = points - points.mean(axis=0)
    axes = np.linalg.eigh(centred.T @ centred)[1]
    return axes, np.ptp(centred @ axes, axis=0)


def is_flat(points: Array) -> bool:
    """Return whether points (n, 3) have almost no extent in some direction: Qhull would refuse them, or coal crash."""
    extents = _principal(points)[1]
    return bool(extents.min() <= _THIN * extents.max())


def _thick(points: Array) -> Array:
    """Return copies of points (n, 3), each moved slightly along six directions."""
    thin = _THIN * (float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0)
    moves = np.vstack([np.eye(3), -np.eye(3)]) * thin
    moved: Array = (points[:, None] + moves).reshape(-1, 3)
    return moved
