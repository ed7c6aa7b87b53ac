"""Simple polygons of the plane: validity, and decomposition into convex ones."""

from __future__ import annotations

import mapbox_earcut
import numpy as np

from cinegen.arrays import Array
from cinegen.collision.scene_table import LEAST

_Piece = list[int]  # indices of corners, counterclockwise

_MOST = 2000  # points: each edge is tested against each other
_STRAIGHT = 1e-12  # cross product of edges at a straight corner, for a polygon of size 1


def polygon_error(points: Array) -> str | None:
    """Return why points (n, 2), m, are not the corners of a simple polygon, which neither crosses nor touches itself;
    None if they are."""
    count = len(points)
    if count < 3:
        return f"must be at least 3, not {count}"
    if count > _MOST:
        return f"are {count}: the largest number is {_MOST}"
    following = np.roll(points, -1, axis=0)
    for i in np.flatnonzero(np.linalg.norm(following - points, axis=1) < LEAST).tolist():
        return f"repeat {points[i].tolist()} (points {i + 1} and {(i + 1) % count + 1})"
    if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] < LEAST:
        return "enclose no area: they are on one line"
    met = _first_intersection(points, following)
    if met is None:
        return None
    i, j = met
    return f"cross or touch each other: the side from point {i + 1} meets the side from point {j + 1}"


def _first_intersection(start: Array, end: Array) -> tuple[int, int] | None:
    """Return the numbers of two sides of a polygon that have a point in common, except for the common corner of
    neighbours; None if there are none.

    Sides i and j meet if neither lies wholly on one side of the other's line, by the signs of the cross products
    e_i x (p_j - p_i) at the two ends of j, and their bounding boxes overlap (which decides for sides on one line).

    Args:
        start: (n, 2) first points of the sides p, m, in order.
        end: (n, 2) their second points; e = end - start.
    """
    side = end - start
    of_start = _cross(side[:, None], start[None] - start[:, None])  # [i, j]: of the start of side j and line i
    of_end = _cross(side[:, None], end[None] - start[:, None])
    slack = 1e-12 * np.linalg.norm(side, axis=1)[:, None] * (np.ptp(start, axis=0).max() or 1.0)
    on_one_side = (np.minimum(of_start, of_end) > slack) | (np.maximum(of_start, of_end) < -slack)
    low, high = np.minimum(start, end), np.maximum(start, end)
    meet = ~on_one_side & ~on_one_side.T
    meet &= ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(axis=2)
    i = np.arange(len(start))
    meet[i, i] = False
    following = np.roll(i, -1)
    back = (np.abs(_cross(side, side[following])) <= slack[:, 0]) & ((side * side[following]).sum(axis=1) < 0.0)
    meet[i, following] = meet[following, i] = back  # neighbours share a corner, and must not run back
    pairs = np.argwhere(np.triu(meet))
    return None if len(pairs) == 0 else (int(pairs[0][0]), int(pairs[0][1]))


def convex_pieces(points: Array) -> list[Array]:
    """Return convex polygons (k, 2), counterclockwise, that fill a simple polygon (n, 2), m, without overlap.

    The polygon is triangulated, then cuts between two pieces that are convex together are removed (S. Hertel and K.
    Mehlhorn, "Fast triangulation of simple polygons", FCT 1983): at most four times as many pieces as necessary.
    """
    size = float(np.ptp(points, axis=0).max())
    plane = np.ascontiguousarray((points - points[0]) / size)
    ears = mapbox_earcut.triangulate_float64(plane, np.array([len(plane)], dtype=np.uint32)).reshape(-1, 3)
    triangles = (
        ear if _cross(plane[ear[1]] - plane[ear[0]], plane[ear[2]] - plane[ear[0]]) > 0 else ear[::-1] for ear in ears
    )
    return [points[_corners(piece, plane)] for piece in _merged([ear.tolist() for ear in triangles], plane)]


def _merged(pieces: list[_Piece], plane: Array) -> list[_Piece]:
    """Return the pieces without the cuts between two that are convex together."""
    owner = {side: piece for piece in pieces for side in _sides(piece)}
    for i, j in [(i, j) for i, j in owner if i < j and (j, i) in owner]:
        first, second = owner[i, j], owner[j, i]
        # around the first from j to i, then around the second back to j
        at, back = first.index(j), second.index(i)
        joined = first[at:] + first[:at] + (second[back:] + second[:back])[1:-1]
        if (_corner_crosses(joined, plane) >= -_STRAIGHT).all():
            for side in _sides(joined):
                owner[side] = joined
            del owner[i, j], owner[j, i]
    return list({id(piece): piece for piece in owner.values()}.values())


def _sides(piece: _Piece) -> list[tuple[int, int]]:
    return list(zip(piece, piece[1:] + piece[:1], strict=True))


def _corners(piece: _Piece, plane: Array) -> _Piece:
    """Return a piece without the points on its straight sides."""
    crosses = _corner_crosses(piece, plane)
    kept = [corner for corner, cross in zip(piece, crosses, strict=True) if cross > _STRAIGHT]
    return kept if len(kept) >= 3 else piece


def _corner_crosses(piece: _Piece, plane: Array) -> Array:
    """Return the cross product of the two sides at each corner, positive at a left turn."""
    corners = plane[piece]
    return _cross(corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners)


def _cross(a: Array, b: Array) -> Array:
    """Return the cross products of vectors of the plane (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
