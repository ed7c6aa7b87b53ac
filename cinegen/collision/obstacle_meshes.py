"""Obstacles made of triangles, convex or not, closed or open, and of points, which are replaced by voxels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import coal
import numpy as np
import pinocchio as pin
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from cinegen.arrays import Array, Integers
from cinegen.collision.body import Interior, Piece, PlacedShape
from cinegen.collision.convex_hull import hull
from cinegen.collision.links import convex_shape
from cinegen.collision.triangle_mesh import TriangleMesh, tree_of

if TYPE_CHECKING:
    import trimesh


MOST_VOXELS = 200_000
"""Largest number of voxels of an obstacle."""

WIDEST = 2**20
"""Largest extent of voxels, as a multiple of their size."""

_FULL = 0.999  # of its hull's volume, for a convex mesh: files have rounded numbers, and the hull is what is measured
_MOST_PARTS = 64  # that are measured one by one; of more, the closed ones together, and the open ones together
_BLOCK = 1000  # voxels that are measured together, about
_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
_SIDES = (  # direction, and the corners counterclockwise seen from outside
    ((-1, 0, 0), (0, 4, 7, 3)),
    ((1, 0, 0), (1, 2, 6, 5)),
    ((0, -1, 0), (0, 1, 5, 4)),
    ((0, 1, 0), (3, 7, 6, 2)),
    ((0, 0, -1), (0, 3, 2, 1)),
    ((0, 0, 1), (4, 5, 6, 7)),
)


# --- triangles ---------------------------------------------------------------------------------------------------


def mesh_pieces(mesh: trimesh.Trimesh) -> list[Piece]:
    """Return the connected parts of a mesh, m.

    A closed part is solid, an open one a surface without an inside. A convex solid is its hull; any other part has an
    exact tree of its triangles inside of a convex shape.
    """
    parts = list(mesh.split(only_watertight=False, repair=False)) or [mesh]
    for part in parts:
        if part.is_watertight and not part.is_winding_consistent:
            part.fix_normals()
    closed = [part for part in parts if part.is_watertight and part.is_winding_consistent]
    opened = [part for part in parts if not (part.is_watertight and part.is_winding_consistent)]
    if len(parts) > _MOST_PARTS:
        return [_piece(each, each is closed) for each in (closed, opened) if each]
    return [_convex(part) or _piece([part], True) for part in closed] + [_piece([part], False) for part in opened]


def _convex(part: trimesh.Trimesh) -> Piece | None:
    """Return the hull of a closed part; None if it is not convex."""
    whole = hull(np.asarray(part.vertices, dtype=float))
    if abs(part.volume) < _FULL * whole.volume:
        return None
    return Piece(pin.SE3.Identity(), whole.shape, None)


def _piece(parts: Sequence[trimesh.Trimesh], is_solid: bool) -> Piece:
    """Return closed parts, or open ones, as one piece."""
    before = np.cumsum([0, *(len(part.vertices) for part in parts)])
    vertices = np.vstack([part.vertices for part in parts])
    triangles = np.vstack([part.faces + first for part, first in zip(parts, before, strict=False)])
    tree = tree_of(vertices, triangles)
    points = np.array([part.vertices[part.faces[0, 0]] for part in parts], dtype=float)
    return _enclosed(tree, Interior(TriangleMesh(tree).contains if is_solid else _nowhere, points, 0.0))


def _nowhere(point: Array) -> bool:
    """Return False: an open surface contains no point."""
    return False


def _enclosed(tree: coal.BVHModelOBBRSS, interior: Interior) -> Piece:
    """Return a tree of triangles inside of a convex shape."""
    around = convex_shape(tree, pin.SE3.Identity())
    return Piece(*around, PlacedShape(around.placement.inverse(), tree), interior)


# --- points ------------------------------------------------------------------------------------------------------


def voxels_of(points: Array, size: float) -> Integers:
    """Return the indices (m, 3) of the cubes of a grid that contain points (n, 3), each once; the cube (0, 0, 0) has
    one corner at the origin and the opposite one at (size, size, size), m."""
    return np.unique(np.floor(points / size).astype(np.int64), axis=0)


def voxel_pieces(voxels: Integers, size: float) -> list[Piece]:
    """Return solid cubes (see `voxels_of`) as pieces: blocks of about 1000 cubes, each a tree of its outer faces.

    The trees of triangles serve meshes ten times as fast as coal's octree does.
    """
    return [_block(block, size) for block in _blocks(voxels)]


def _blocks(voxels: Integers) -> list[Integers]:
    """Return voxels halved along the longest side of their box, until there are few enough."""
    if len(voxels) <= _BLOCK:
        return [voxels]
    along = voxels[:, int(np.ptp(voxels, axis=0).argmax())]
    first = along < max(float(np.median(along)), along.min() + 0.5)
    return [*_blocks(voxels[first]), *_blocks(voxels[~first])]


def _block(voxels: Integers, size: float) -> Piece:
    keys = _Keys(voxels)
    quads, pairs = [], []
    for side, corners in _SIDES:
        neighbours = keys.find(voxels + side)
        quads.append(voxels[neighbours < 0][:, None] + _CORNERS[list(corners)])
        pairs.append(np.column_stack([np.flatnonzero(neighbours >= 0), neighbours[neighbours >= 0]]))
    vertices, index = np.unique(np.vstack(quads).reshape(-1, 3), axis=0, return_inverse=True)
    square = index.reshape(-1, 4)
    tree = tree_of(size * vertices, np.vstack([square[:, [0, 1, 2]], square[:, [0, 2, 3]]]))
    edges = np.vstack(pairs)
    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(len(voxels), len(voxels)))
    first = np.unique(connected_components(graph, directed=False)[1], return_index=True)[1]

    def contains(point: Array) -> bool:
        return bool(keys.find(np.floor(point / size).astype(np.int64)[None])[0] >= 0)

    return _enclosed(tree, Interior(contains, np.asarray(size * (voxels[first] + 0.5), dtype=float), size))


class _Keys:
    """Numbers of voxels (n, 3), by which they are found again."""

    def __init__(self, voxels: Integers) -> None:
        self._low, self._sizes = voxels.min(axis=0), np.ptp(voxels, axis=0) + 1
        numbers = np.ravel_multi_index(tuple((voxels - self._low).T), tuple(self._sizes))
        self._order = np.argsort(numbers)
        self._sorted = numbers[self._order]

    def find(self, voxels: Integers) -> Integers:
        """Return the indices (m,) of voxels (m, 3), -1 of those that are not there."""
        local = voxels - self._low
        is_near = ((local >= 0) & (local < self._sizes)).all(axis=1)
        numbers = np.ravel_multi_index(tuple(np.where(is_near[:, None], local, 0).T), tuple(self._sizes))
        at = np.minimum(np.searchsorted(self._sorted, numbers), len(self._sorted) - 1)
        return np.where(is_near & (self._sorted[at] == numbers), self._order[at], -1)
