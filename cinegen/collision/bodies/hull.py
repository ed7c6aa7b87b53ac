"""The convex hull of points, and one with fewer corners around it.

A distance between hulls of thousands of corners takes twice as long as between hulls of 50; with a hundred it is no
longer. Corners can't simply be left out: what remains would no longer hold the points. So a hull is cut out of a box,
by one face of the exact one after another, always the one above which most still stands. As every cut is along a face,
all points stay inside, and how far what is left stands out is known. (So J. E. Kelley, "The cutting-plane method for
solving convex programs", J. SIAM 8, 1960, cuts around a convex set.)
"""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection

Array = NDArray[np.float64]

CLOSE = 0.01
"""How far a hull with fewer corners may be from the points' own, in parts of its extent to either side."""

_FEW = 256  # corners that cost no more than fewer would
_MOST = 90  # corners up to which is cut, where it comes not so near
_ROUNDED = 1e-6  # of the size: what is added, as where faces are nearly parallel Qhull knows corners to 1e-8 at best
_THIN = 1e-5  # of the size: what a sheet without thickness is given to either side


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex polyhedron: all x with normals x <= offsets.

    Attributes:
        corners: (n, 3) m.
        normals: (faces, 3) unit vectors outward.
        offsets: (faces,) m.
        volume: m3.
    """

    corners: Array
    normals: Array
    offsets: Array
    volume: float

    @property
    def shape(self) -> coal.Convex:
        """As coal measures it."""
        corners = coal.StdVec_Vec3s()
        corners.extend(list(self.corners))
        return coal.Convex.convexHull(corners, True, "Qt")


def hull(points: Array) -> Hull:
    """The convex hull of points (n, 3), m; those that lie in a plane, or on a line, are made a little thick."""
    found = ConvexHull(_thick(points) if _is_thin(points) else points)
    corners = found.points[found.vertices]
    normals = found.equations[:, :3]
    return Hull(corners, normals, (corners @ normals.T).max(axis=0), float(found.volume))


def with_fewer_corners(exact: Hull) -> Hull:
    """A hull around a hull, with no more than some 90 corners: `CLOSE` to it, if that can be had with so few."""
    if len(exact.corners) <= _FEW:
        return exact
    middle = exact.corners.mean(axis=0)  # inside
    axes, extents = _principal(exact.corners)
    seen = (exact.corners - middle) @ axes / extents  # about as long as it is wide and high, or Qhull would fail
    equations = ConvexHull(seen).equations
    normals, offsets = equations[:, :3], (seen @ equations[:, :3].T).max(axis=0)
    sides = np.vstack([np.eye(3), -np.eye(3)])
    cut = HalfspaceIntersection(np.column_stack([sides, -(seen @ sides.T).max(axis=0)]), np.zeros(3), incremental=True)
    while len(cut.intersections) <= _MOST:
        above = cut.intersections @ normals.T - offsets
        corner, face = np.unravel_index(int(above.argmax()), above.shape)
        if above[corner, face] <= CLOSE:
            break
        cut.add_halfspaces(np.append(normals[face], -offsets[face])[None])
    corners = middle + (1.0 + _ROUNDED) * (extents * cut.intersections) @ axes.T
    cut.close()
    return hull(corners)


def _principal(points: Array) -> tuple[Array, Array]:
    """The principal axes of points (n, 3), as columns (3, 3), and how far the points reach along each (3,), m."""
    seen = points - points.mean(axis=0)
    axes = np.linalg.eigh(seen.T @ seen)[1]
    return axes, np.ptp(seen @ axes, axis=0)


def _is_thin(points: Array) -> bool:
    """Whether points (n, 3) have next to no extent in some direction: Qhull would refuse them, or coal would crash."""
    extents = _principal(points)[1]
    return bool(extents.min() <= _THIN * extents.max())


def _thick(points: Array) -> Array:
    """Points (n, 3), each moved a little six ways."""
    thin = _THIN * (float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0)
    ways = np.vstack([np.eye(3), -np.eye(3)]) * thin
    moved: Array = (points[:, None] + ways).reshape(-1, 3)
    return moved
