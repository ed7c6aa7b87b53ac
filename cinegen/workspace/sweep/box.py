"""`WantedBox`: the part of a region that a task needs; `BoxGrid`: points in it at which a map is judged."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, reduce

import numpy as np
from numpy.typing import NDArray

from cinegen.workspace.errors import MapError
from cinegen.workspace.region import GridAxis, Region
from raff2urdf.errors import did_you_mean

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

_EDGE = 1e-9  # of a cell's width: a box that ends on a border does not touch the next cell
_WHOLE = 1e-6  # of a cell's width: less is not cut off


@dataclass(frozen=True)
class WantedBox:
    """Ranges of a region's axes; an axis that is not named is wanted over its whole length.

    Attributes:
        ranges: lower and upper end by the name of the axis, m or rad.

    Raises:
        MapError: a range is empty.
    """

    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, (low, high) in self.ranges.items():
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise MapError(f"wanted box: {name} from {low:g} to {high:g} is no range: give the lower end first")

    def cells(self, region: Region) -> tuple[slice, ...]:
        """Return the cells that the box touches, for each axis.

        Raises:
            MapError: the box names an axis that the region does not have, or goes beyond it.
        """
        for name in self.ranges:
            if name not in region.names:
                raise MapError(f"wanted box: the maps have no axis '{name}'{did_you_mean(name, region.names)}")
        return tuple(self._touched(axis) for axis in region.axes)

    def grid(self, region: Region) -> BoxGrid:
        """Return points in the whole box, also on its faces.

        Raises:
            MapError: as `cells`.
        """
        return BoxGrid(region, self.cells(region), tuple(self._range(axis) for axis in region.axes))

    def _range(self, axis: GridAxis) -> tuple[float, float]:
        return self.ranges.get(axis.name, (axis.low, axis.high))

    def _touched(self, axis: GridAxis) -> slice:
        low, high = self._range(axis)
        first, last = ((end - axis.low) / axis.width for end in (low, high))
        if first < -_EDGE or last > axis.count + _EDGE:
            raise MapError(
                f"wanted box: {axis.name} from {low:g} to {high:g} goes beyond the maps, which end at {axis.low:g} "
                f"and {axis.high:g}: make the maps larger"
            )
        return slice(max(0, math.floor(first + _EDGE)), min(axis.count, math.ceil(last - _EDGE)))


@dataclass(frozen=True)
class BoxGrid:
    """The middles of the parts of cells that are in a box, and points on its faces, edges and corners next to them.

    Points and cells are numbered with the last axis fastest.

    Attributes:
        region: the grid of the map.
        cells: the cells that the box touches, for each axis.
        ranges: lower and upper end of the box for each axis, m or rad.
    """

    region: Region
    cells: tuple[slice, ...]
    ranges: tuple[tuple[float, float], ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of points along each axis."""
        return tuple(len(values) for values in self._axes)

    @property
    def size(self) -> int:
        """Number of points."""
        return math.prod(self.shape)

    @cached_property
    def values(self) -> Array:
        """(n, axes) coordinates of the points, m or rad."""
        return np.column_stack([values.ravel() for values in np.meshgrid(*self._axes, indexing="ij")])

    @cached_property
    def middles(self) -> Ints:
        """(cells,) number of the point in the middle of the part of each cell that is in the box."""
        numbers = np.arange(self.size).reshape(self.shape)
        return numbers[(slice(1, -1),) * len(self.shape)].ravel()

    @cached_property
    def cut(self) -> NDArray[np.bool_]:
        """(cells,) whether only a part of each cell is in the box."""
        return np.asarray((self.values[self.middles] != self.region.values(self.cells)).any(axis=1))

    @cached_property
    def sizes(self) -> Array:
        """(cells,) size of the part of each cell that is in the box, in the unit of `Region.sizes`."""
        along = [
            sizes[cells] * np.diff(borders) / axis.width
            for axis, cells, sizes, borders in zip(
                self.region.axes, self.cells, self.region.sizes, self._borders, strict=True
            )
        ]
        return np.asarray(reduce(np.multiply.outer, along)).ravel()

    @property
    def edges(self) -> Ints:
        """(m, 2) numbers of neighbouring points, the smaller one first."""
        numbers, pairs = np.arange(self.size).reshape(self.shape), []
        for axis in range(len(self.shape)):
            moved = np.moveaxis(numbers, axis, 0)
            pairs.append(np.column_stack([moved[:-1].ravel(), moved[1:].ravel()]))
        return np.concatenate(pairs)

    @cached_property
    def _axes(self) -> tuple[Array, ...]:
        found = []
        for axis, cells, borders in zip(self.region.axes, self.cells, self._borders, strict=True):
            whole = np.diff(borders) >= (1.0 - _WHOLE) * axis.width
            middles = np.where(whole, axis.middles(cells), 0.5 * (borders[:-1] + borders[1:]))
            found.append(np.r_[borders[0], middles, borders[-1]])
        return tuple(found)

    @cached_property
    def _borders(self) -> tuple[Array, ...]:
        """Borders of the cells along each axis, cut off at the box."""
        parts = zip(self.region.axes, self.cells, self.ranges, strict=True)
        return tuple(np.clip(axis.borders[cells.start : cells.stop + 1], *ends) for axis, cells, ends in parts)
