"""A map's values without a file: those of all its chunks."""

import math

import numpy as np

from cinegen.workspace import GridAxis, MapSpecification, Region
from cinegen.workspace.chunks import chunk_cells, chunk_counts, chunk_shape
from cinegen.workspace.evaluator import ChunkEvaluator


def mapped(spec: MapSpecification, most: int = 10**6) -> dict[str, np.ndarray]:
    """By name (*shape, ...), in chunks of at most so many cells."""
    evaluator, region = ChunkEvaluator(spec), spec.region
    chunks = chunk_shape(region.shape, most, cube=True)
    layers: dict[str, np.ndarray] = {}
    for chunk in range(math.prod(chunk_counts(region.shape, chunks))):
        cells = chunk_cells(chunk, region.shape, chunks)
        for name, values in evaluator.values(cells).items():
            whole = layers.setdefault(name, np.zeros((*region.shape, *values.shape[1:]), values.dtype))
            whole[cells] = values.reshape(*(s.stop - s.start for s in cells), *values.shape[1:])
    return layers


def over(*axes: tuple[str, float, float, int], at=None, **more) -> Region:
    """A region over axes (name, low, high, count)."""
    return Region(tuple(GridAxis(*axis) for axis in axes), at or {}, **more)


def middles(region: Region) -> tuple[np.ndarray, ...]:
    """Of all cells, for each axis an array of the region's shape."""
    return tuple(np.meshgrid(*(axis.middles() for axis in region.axes), indexing="ij"))
