"""A simple polygon cut into convex ones: by its ears, then cuts are taken away wherever what they part is convex.

S. Hertel and K. Mehlhorn, "Fast triangulation of simple polygons", FCT 1983: never more than four times as many pieces
as are needed.
"""

from __future__ import annotations

import mapbox_earcut
import numpy as np
from numpy.typing import NDArray

from cinegen.collision.scene.outline import area, cross

Array = NDArray[np.float64]
Piece = list[int]  # corners by their number, counter-clockwise


def convex_pieces(points: Array) -> list[Array]:
    """Convex polygons (k, 2), counter-clockwise, that fill a polygon and don't overlap.

    Args:
        points: (n, 2) of a simple polygon, in either direction, m.
    """
    size = float(np.ptp(points, axis=0).max())
    plane = np.ascontiguousarray((points - points[0]) / size)
    ears = mapbox_earcut.triangulate_float64(plane, np.array([len(plane)], dtype=np.uint32)).reshape(-1, 3)
    pieces: list[Piece] = [ear.tolist() for ear in ears]
    pieces = [piece if area(plane[piece]) > 0.0 else piece[::-1] for piece in pieces]
    return [points[_corners(piece, plane)] for piece in _merged(pieces, plane)]


def _merged(pieces: list[Piece], plane: Array) -> list[Piece]:
    """Pieces with every cut left out between two that are convex together."""
    whose = {side: piece for piece in pieces for side in _sides(piece)}
    for i, j in [(i, j) for i, j in whose if i < j and (j, i) in whose]:
        one, other = whose[i, j], whose[j, i]
        # round the one from j to i, then round the other back to j
        at, there = one.index(j), other.index(i)
        joined = one[at:] + one[:at] + (other[there:] + other[:there])[1:-1]
        if _is_convex(joined, plane):
            for side in _sides(joined):
                whose[side] = joined
            del whose[i, j], whose[j, i]
    return list({id(piece): piece for piece in whose.values()}.values())


def _sides(piece: Piece) -> list[tuple[int, int]]:
    return list(zip(piece, piece[1:] + piece[:1], strict=True))


def _turns(piece: Piece, plane: Array) -> Array:
    """At each corner: the sine of the turn to the left, times the lengths of its sides."""
    corners = plane[piece]
    return cross(corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners)


_STRAIGHT = 1e-12  # of a turn, where the polygon is one long


def _is_convex(piece: Piece, plane: Array) -> bool:
    return bool((_turns(piece, plane) >= -_STRAIGHT).all())


def _corners(piece: Piece, plane: Array) -> Piece:
    """A piece without what lies on its straight sides."""
    turns = _turns(piece, plane)
    kept = [corner for corner, turn in zip(piece, turns, strict=True) if turn > _STRAIGHT]
    return kept if len(kept) >= 3 else piece
