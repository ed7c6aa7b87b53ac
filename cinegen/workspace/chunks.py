"""Chunks of a map's grid: how it is divided, which cells a chunk has, and which of them are neighbours.

Chunks and the cells of a chunk are numbered with the last axis fastest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.intp]
Shape = Sequence[int]


def cube_shape(shape: Shape, most: int) -> tuple[int, ...]:
    """Return the number of cells along each axis of a chunk that is as long as it is wide.

    Cells learn from their neighbours, which are near in such a chunk.

    Args:
        shape: number of cells along each axis of the grid.
        most: number of cells of a chunk, at most.
    """
    width = [1] * len(shape)
    growing = set(range(len(width)))
    while growing:
        k = min(growing, key=lambda k: (width[k], -k))
        wider = min(2 * width[k], shape[k])
        if wider == width[k] or math.prod(width) // width[k] * wider > most:
            growing.discard(k)
        else:
            width[k] = wider
    for k in reversed(range(len(width))):  # the last axes take what is left
        width[k] = max(1, min(shape[k], width[k] * (most // math.prod(width)) or 1))
    return _even(shape, width)


def line_shape(shape: Shape, most: int) -> tuple[int, ...]:
    """Return the same for a chunk of whole lines, as far as they fit: a path through it has few corners."""
    width = [1] * len(shape)
    for k in reversed(range(len(width))):
        width[k] = max(1, min(shape[k], most // math.prod(width)))
    return _even(shape, width)


def _even(shape: Shape, width: Shape) -> tuple[int, ...]:
    """Return chunks of about the same size: no wider, and no more of them."""
    return tuple(-(-n // -(-n // wide)) for n, wide in zip(shape, width, strict=True))


def chunk_counts(shape: Shape, chunk_shape: Shape) -> tuple[int, ...]:
    """Return the number of chunks along each axis."""
    return tuple(-(-count // width) for count, width in zip(shape, chunk_shape, strict=True))


def chunk_cells(chunk: int, shape: Shape, chunk_shape: Shape) -> tuple[slice, ...]:
    """Return the cells of a chunk, given by its number, along each axis."""
    index = map(int, np.unravel_index(chunk, chunk_counts(shape, chunk_shape)))
    return tuple(
        slice(i * width, min((i + 1) * width, n)) for i, n, width in zip(index, shape, chunk_shape, strict=True)
    )


def neighbours(shape: Shape) -> Ints:
    """Return (n, 2 axes) the numbers of the cells next to each cell; -1 at the edge."""
    padded = np.pad(np.arange(math.prod(shape)).reshape(shape), 1, constant_values=-1)
    inner = (slice(1, -1),) * len(shape)
    return np.column_stack(
        [np.roll(padded, step, axis)[inner].ravel() for axis in range(len(shape)) for step in (1, -1)]
    )


def back_and_forth(shape: Shape) -> Ints:
    """Return (n,) the numbers of all cells in an order in which each is next to the one before."""
    order = np.zeros((1,), dtype=np.intp)
    for count in shape:
        grown = order[:, None] * count + np.arange(count)
        grown[1::2] = grown[1::2, ::-1]
        order = grown.ravel()
    return order
