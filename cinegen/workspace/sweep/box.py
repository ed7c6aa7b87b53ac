"""`WantedBox`: the part of a region that a task needs; `BoxGrid`: points in it at which a map is judged."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce

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

    def grid(self, region: Region) -> BoxGrid:
        """Return points in the whole box, also on its faces.

        Raises:
            MapError: the box names an axis that the region does not have, or goes beyond it.
        """
        for name in self.ranges:
            if name not in region.names:
                raise MapError(f"wanted box: the maps have no axis '{name}'{did_you_mean(name, region.names)}")
        return BoxGrid(region, [self.ranges.get(axis.name, (axis.low, axis.high)) for axis in region.axes])


class BoxGrid:
    """The middles of the parts of cells that are in a box, and points on its faces, edges and corners next to them.

    Points and cells are numbered with the last axis fastest.

    Args:
        region: the grid of the map.
        ranges: lower and upper end of the box for each axis, m or rad.

    Attributes:
        cells: the cells that the box touches, for each axis.
        shape: number of points along each axis.
        values: (n, axes) coordinates of the points, m or rad.
        middles: (cells,) number of the point in the middle of the part of each cell that is in the box.
        cut: (cells,) whether only a part of each cell is in the box.
        sizes: (cells,) size of the part of each cell that is in the box, in the unit of `Region.sizes`.
        edges: (m, 2) numbers of neighbouring points, the smaller one first.

    Raises:
        MapError: the box goes beyond the region.
    """

    def __init__(self, region: Region, ranges: Sequence[tuple[float, float]]) -> None:
        self.cells = tuple(map(_touched, region.axes, ranges))
        axes, along = [], []
        for axis, cells, sizes, ends in zip(region.axes, self.cells, region.sizes, ranges, strict=True):
            borders = np.clip(axis.borders[cells.start : cells.stop + 1], *ends)
            widths = np.diff(borders)
            whole = widths >= (1.0 - _WHOLE) * axis.width
            middles = np.where(whole, axis.middles(cells), 0.5 * (borders[:-1] + borders[1:]))
            axes.append(np.r_[borders[0], middles, borders[-1]])
            along.append(sizes[cells] * widths / axis.width)
        self.shape = tuple(map(len, axes))
        self.values: Array = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
        self.sizes = np.asarray(reduce(np.multiply.outer, along)).ravel()
        numbers = np.arange(len(self.values)).reshape(self.shape)
        self.middles: Ints = numbers[(slice(1, -1),) * len(axes)].ravel()
        self.cut = (self.values[self.middles] != region.values(self.cells)).any(axis=1)
        rows = [np.moveaxis(numbers, k, 0) for k in range(len(axes))]
        pairs = [np.column_stack([row[:-1].ravel(), row[1:].ravel()]) for row in rows]
        self.edges: Ints = np.concatenate(pairs)


def _touched(axis: GridAxis, ends: tuple[float, float]) -> slice:
    """Return the cells of an axis that a range touches.

    Raises:
        MapError: the range goes beyond the axis.
    """
    first, last = ((end - axis.low) / axis.width for end in ends)
    if first < -_EDGE or last > axis.count + _EDGE:
        raise MapError(
            f"wanted box: {axis.name} from {ends[0]:g} to {ends[1]:g} goes beyond the maps, which end at {axis.low:g} "
            f"and {axis.high:g}: make the maps larger"
        )
    return slice(max(0, math.floor(first + _EDGE)), min(axis.count, math.ceil(last - _EDGE)))
