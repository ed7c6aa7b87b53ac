"""`Lattice`: points all over a box, on its borders too, at which a map is judged."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np
from numpy.typing import NDArray

from cinegen.workspace.region import GridAxis, Region

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

_WHOLE = 1e-6  # of a cell's width: a cell of which less is cut off is a whole one


@dataclass(frozen=True)
class Lattice:
    """The middles of what cells have in a box, and points on its faces, edges and corners beside them.

    Points and cells are named by their numbers, the last axis fastest.

    Attributes:
        region: that the cells are of.
        cells: that the box touches, for each axis.
        ranges: of the box, low and high for each axis, m or rad.
    """

    region: Region
    cells: tuple[slice, ...]
    ranges: tuple[tuple[float, float], ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis."""
        return tuple(len(values) for values in self._axes)

    @property
    def size(self) -> int:
        """Points in all."""
        return math.prod(self.shape)

    @cached_property
    def values(self) -> Array:
        """(n, axes) coordinates of the points, m or rad."""
        grid = np.meshgrid(*self._axes, indexing="ij")
        return np.column_stack([values.ravel() for values in grid])

    @cached_property
    def middles(self) -> Ints:
        """(cells,) the point in each cell's middle, or in that of the part of it that is in the box."""
        numbers = np.arange(self.size).reshape(self.shape)
        return numbers[(slice(1, -1),) * len(self.shape)].ravel()

    @cached_property
    def cut(self) -> NDArray[np.bool_]:
        """(cells,) whether only a part of a cell is in the box."""
        return np.asarray((self.values[self.middles] != self.region.values(self.cells)).any(axis=1))

    @cached_property
    def sizes(self) -> Array:
        """(cells,) what each measures inside the box, as of `Region.sizes`."""
        along = [
            sizes[cells] * np.diff(self._borders(k)) / axis.width
            for k, (axis, cells, sizes) in enumerate(zip(self.region.axes, self.cells, self.region.sizes, strict=True))
        ]
        return np.asarray(reduce(np.multiply.outer, along)).ravel()

    @property
    def edges(self) -> Ints:
        """(m, 2) neighbours, the smaller number first."""
        numbers, pairs = np.arange(self.size).reshape(self.shape), []
        for axis in range(len(self.shape)):
            moved = np.moveaxis(numbers, axis, 0)
            pairs.append(np.column_stack([moved[:-1].ravel(), moved[1:].ravel()]))
        return np.concatenate(pairs)

    @cached_property
    def _axes(self) -> tuple[Array, ...]:
        return tuple(self._along(k, axis) for k, axis in enumerate(self.region.axes))

    def _along(self, k: int, axis: GridAxis) -> Array:
        low, high = self.ranges[k]
        borders = self._borders(k)
        whole = np.diff(borders) >= (1.0 - _WHOLE) * axis.width
        middles = np.where(whole, axis.middles(self.cells[k]), 0.5 * (borders[:-1] + borders[1:]))
        return np.concatenate([[low], middles, [high]])

    def _borders(self, k: int) -> Array:
        """Of the cells along an axis, no further than the box."""
        first, last = self.cells[k].start, self.cells[k].stop
        return np.clip(self.region.axes[k].borders[first : last + 1], *self.ranges[k])
