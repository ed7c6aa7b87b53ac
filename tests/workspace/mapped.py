"""A map's values without a file: what its pieces come to, put together."""

from __future__ import annotations

import numpy as np

from cinegen.workspace import GridAxis, MapSpecification, Region
from cinegen.workspace.region import piece, pieces
from cinegen.workspace.work import Surveyor


def mapped(spec: MapSpecification, most: int = 10**6) -> dict[str, np.ndarray]:
    """By name (*shape, ...), in pieces of at most so many cells."""
    surveyor, region = Surveyor(spec), spec.region
    chunks = region.blocks(most)
    found: dict[str, np.ndarray] = {}
    for index in pieces(region.shape, chunks):
        cells = piece(index, region.shape, chunks)
        for name, values in surveyor.values(cells).items():
            whole = found.setdefault(name, np.zeros((*region.shape, *values.shape[1:]), values.dtype))
            whole[cells] = values.reshape(*(s.stop - s.start for s in cells), *values.shape[1:])
    return found


def over(*axes: tuple[str, float, float, int], at=None, **more) -> Region:
    """A region over axes (name, low, high, count)."""
    return Region(tuple(GridAxis(*axis) for axis in axes), at or {}, **more)


def middles(region: Region) -> tuple[np.ndarray, ...]:
    """Of all cells, for each axis an array of the region's shape."""
    return tuple(np.meshgrid(*(axis.middles() for axis in region.axes), indexing="ij"))
