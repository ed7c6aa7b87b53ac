"""Triangle meshes of coal as arrays: whether one is convex, and whether a point is inside of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import coal
import numpy as np

from cinegen.arrays import Array, Integers
from cinegen.collision.convex_hull import Hull, hull

Surface = tuple[Array, Integers]
"""Corners (n, 3), m, and triangles (m, 3) of them, counter-clockwise as seen from outside. Triangles with a common
corner are parts of one face, flat or smooth."""

_FLAT = 1e-4  # of the size: depth of dents that count as convex
_TINY = 1e-300  # of a triangle without area
_FULL = 1e-3  # of the volume of the hull: a convex mesh may lack that much


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A surface of triangles, closed or not.

    Args:
        mesh: coal's.
    """

    mesh: coal.BVHModelOBBRSS

    @cached_property
    def corners(self) -> Array:
        """(triangles, 3, 3) the corners of each triangle, m."""
        vertices, count = np.array(self.mesh.vertices()), self.mesh.num_tris
        indices = np.array([[triangle[i] for i in range(3)] for triangle in map(self.mesh.tri_indices, range(count))])
        return np.asarray(vertices[indices.reshape(-1, 3)])

    @cached_property
    def hull(self) -> Hull:
        """Convex hull of its vertices."""
        return hull(np.array(self.mesh.vertices()))

    @cached_property
    def is_convex(self) -> bool:
        """True if it is closed, and no dent is deeper than 1e-4 of its size."""
        exact = self.hull
        corners = self.corners - exact.corners.mean(axis=0)
        areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        volume = abs(float(np.einsum("ij,ij->", corners[:, 0], areas))) / 6.0
        if volume < (1.0 - _FULL) * exact.volume:
            return False
        flat = _FLAT * float(np.linalg.norm(np.ptp(exact.corners, axis=0)))
        middles = corners.mean(axis=1)
        depth = (exact.offsets - exact.normals @ exact.corners.mean(axis=0))[:, None] - exact.normals @ middles.T
        return bool((depth.min(axis=0) <= flat).all())

    def contains(self, point: Array) -> bool:
        """Return whether a point (3,), in the frame of the mesh, is inside: the surface winds around it.

        The generalized winding number of A. Jacobson, L. Kavan and O. Sorkine-Hornung, "Robust inside-outside
        segmentation using generalized winding numbers", ACM Transactions on Graphics 32(4), 2013: small holes of the
        surface do not matter.
        """
        a, b, c = np.moveaxis(self.corners - point, 1, 0)
        long_a, long_b, long_c = (np.linalg.norm(each, axis=1) for each in (a, b, c))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        dots = [np.einsum("ij,ij->i", first, second) for first, second in ((a, b), (b, c), (c, a))]
        below = long_a * long_b * long_c + dots[0] * long_c + dots[1] * long_a + dots[2] * long_b
        return abs(float(np.arctan2(volume, below).sum())) > np.pi  # half of the 2 pi of a point inside


def faceted(triangles: Array) -> Surface:
    """Return triangles (m, 3, 3) as a surface on which only those of one plane share corners."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals = (normals / (np.linalg.norm(normals, axis=1, keepdims=True) + _TINY)).round(3)
    corners = triangles.reshape(-1, 3)
    keys = (np.hstack([corners, normals.repeat(3, axis=0)]) + 0.0).astype(np.float32)  # 0.0: there is no -0
    _, first, faces = np.unique(keys.view("V24").ravel(), return_index=True, return_inverse=True)
    return corners[first], faces.reshape(-1, 3)


def tree_of(vertices: Array, triangles: Integers) -> coal.BVHModelOBBRSS:
    """Return coal's tree of boxes over triangles.

    Args:
        vertices: (n, 3) m.
        triangles: (m, 3) indices into these.
    """
    tree = coal.BVHModelOBBRSS()
    tree.beginModel(len(triangles), len(vertices))
    tree.addVertices(np.asarray(vertices, dtype=float))
    tree.addTriangles(np.asarray(triangles, dtype=np.int64))
    tree.endModel()
    return tree
