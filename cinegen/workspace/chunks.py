"""Chunks of a map's grid: their shapes, their cells, and a path through these.

Chunks and the cells of a chunk are numbered with the last axis fastest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cinegen.arrays import Indices

Shape = Sequence[int]

_ROUNDING = 1e-9


def chunk_shape(shape: Shape, most: int, cube: bool) -> tuple[int, ...]:
    """Return the number of cells along each axis of a chunk.

    Args:
        shape: number of cells along each axis of the grid.
        most: number of cells of a chunk, at most.
        cube: whether the chunk is as long as it is wide: cells learn from their neighbours, which are near in it. Else
            it is of whole lines, as far as they fit: a path through it has few corners.
    """
    width = [1] * len(shape)
    order = sorted(range(len(shape)), key=lambda k: shape[k]) if cube else reversed(range(len(shape)))
    for left, k in zip(range(len(shape), 0, -1), order, strict=True):
        room = most // math.prod(width)
        wide = max(1, min(shape[k], int(room ** (1.0 / left) + _ROUNDING) if cube else room))
        width[k] = -(-shape[k] // -(-shape[k] // wide))  # chunks of about the same size
    return tuple(width)


def chunk_counts(shape: Shape, chunk_shape: Shape) -> tuple[int, ...]:
    """Return the number of chunks along each axis."""
    return tuple(-(-count // width) for count, width in zip(shape, chunk_shape, strict=True))


def chunk_cells(chunk: int, shape: Shape, chunk_shape: Shape) -> tuple[slice, ...]:
    """Return the cells of a chunk, given by its number, along each axis."""
    index = map(int, np.unravel_index(chunk, chunk_counts(shape, chunk_shape)))
    return tuple(
        slice(i * width, min((i + 1) * width, n)) for i, n, width in zip(index, shape, chunk_shape, strict=True)
    )


def back_and_forth(shape: Shape) -> Indices:
    """Return (n,) the numbers of all cells in an order in which each is next to the one before."""
    order = np.zeros((1,), dtype=np.intp)
    for count in shape:
        grown = order[:, None] * count + np.arange(count)
        grown[1::2] = grown[1::2, ::-1]
        order = grown.ravel()
    return order
