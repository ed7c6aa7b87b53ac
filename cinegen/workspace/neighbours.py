"""Which cells of a piece are next to each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.intp]


def neighbours(shape: Sequence[int]) -> Ints:
    """(n, 2 axes) numbers of the cells next to each, the last axis fastest; -1 where there is none."""
    number = np.arange(int(np.prod(shape))).reshape(shape)
    found = []
    for axis in range(len(shape)):
        for step in (-1, 1):
            moved = np.roll(number, -step, axis)
            edge = [slice(None)] * len(shape)
            edge[axis] = slice(0, 1) if step < 0 else slice(-1, None)
            moved[tuple(edge)] = -1
            found.append(moved.ravel())
    return np.column_stack(found)


def to_and_fro(shape: Sequence[int]) -> Ints:
    """Numbers of a grid's cells, each next to the one before: every other line goes backwards."""
    order = np.zeros((1,), dtype=np.intp)
    for count in shape:
        grown = order[:, None] * count + np.arange(count)
        grown[1::2] = grown[1::2, ::-1]
        order = grown.ravel()
    return order
