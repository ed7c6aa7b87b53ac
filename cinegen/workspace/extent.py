"""`extent`: the length, area or volume of the reachable part of a region, or of the part where a condition holds.

A cell counts as a whole, by the value at its middle. So the sum of all cells that count is wrong by no more than the
cells that the true border goes through. Where the border is flat over a cell and its neighbours, these have a
neighbour, across a side, an edge or a corner, that is of the other kind: let n >= 0 be the border's normal, in widths
of a cell; it cuts a cell where it passes its middle within sum(n) / 2, and so leaves the middle of the neighbour across
the corner that n points to, at sum(n), on its other side. So the true extent lies between that of the cells that count
without those that have such a neighbour, and that of all cells that count with all neighbours. (These are the inner and
the outer Jordan sums of what is seen: erosion and dilation by a cell; J. Serra, "Image analysis and mathematical
morphology", 1982.)

That assumes that nothing, and no gap in it, is thinner than a cell: what lies between all middles is not seen. Nothing
counts beyond the region. Its own edge adds nothing to the bound; where the true border meets it, less than half a cell
may be cut off without being seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import maximum_filter

from cinegen.arrays import Array, Bools, Indices
from cinegen.typed_json import as_json
from cinegen.workspace.cells import CellStatus
from cinegen.workspace.errors import MapError
from cinegen.workspace.region import Region
from cinegen.workspace.specification import specification_of
from raff2urdf.quantities import shown_unit

if TYPE_CHECKING:
    import xarray


_AT_ONCE = 4_000_000  # cells in memory


@dataclass(frozen=True)
class Extent:
    """Extent of a part of a region, in the unit of its cells: m, m^2, m^3, each times rad for each rotation.

    Attributes:
        value: sum of the cells that count.
        low: without those at the border.
        high: with those that touch them, and with all cells that are not evaluated.
        unit: of these.
        cells: number of cells that count.
    """

    value: float
    low: float
    high: float
    unit: str
    cells: int

    @property
    def error(self) -> float:
        """Largest error of the value to either side, if nothing is thinner than a cell."""
        return max(self.value - self.low, self.high - self.value)

    def __str__(self) -> str:
        """Return the value with as many digits as the error leaves, in the units that users see."""
        scale, unit = shown_unit(self.unit)
        value, error = scale * self.value, scale * self.error
        if not error:
            return f"{value:.4g} {unit}"
        digits = max(0, 1 - math.floor(math.log10(error)))
        size = f"{value:.{digits}f} ± {error:.{digits}f}"
        return f"{size} {unit}" if digits < 7 else f"{value:.4g} ± {error:.2g} {unit}"

    def as_dict(self) -> dict[str, Any]:
        """Return JSON values."""
        return as_json(self, "value", "error", "low", "high", "unit", "cells")


def extent(dataset: xarray.Dataset, where: xarray.DataArray | None = None) -> Extent:
    """Return the extent of the reachable part of a map, or of the part where a condition holds.

    Args:
        dataset: a map, complete or not.
        where: bool, over the map's cells, such as `dataset.sigma_1 > 0.1`; `dataset.reachable` unless given.

    Raises:
        MapError: the dataset is not a map, or the condition is not over its cells.
    """
    spec = specification_of(dataset)
    region = spec.region
    where = dataset["reachable"] if where is None else where
    if set(where.dims) != set(region.names) or any(where.sizes[name] != dataset.sizes[name] for name in region.names):
        raise MapError(
            f"a condition over {', '.join(map(str, where.dims)) or 'nothing'}: make it of this map's own cells, over "
            f"{', '.join(region.names)}, such as dataset.sigma_1 > 0.1"
        )
    if where.dtype != bool:
        raise MapError(f"a condition is true or false, not {where.dtype}: write for instance dataset.sigma_1 > 0.1")
    counts, status = where.transpose(*region.names), dataset["status"].transpose(*region.names)
    return _in_slabs(
        region, region.unit(spec.mechanism),
        lambda rows: (counts[rows].values, status[rows].values == CellStatus.NOT_EVALUATED),
    )  # fmt: skip


def bounds(periodic: Sequence[bool], counts: Bools, unknown: Bools) -> tuple[Bools, Bools]:
    """Return the cells that count for certain as a whole, and those that may count in part, if nothing is thinner than
    a cell.

    Args:
        periodic: for each axis of a grid whether its ends meet.
        counts: (grid's shape) bool, the cells that count.
        unknown: (grid's shape) bool, the cells of which it is not known.
    """
    modes = ["wrap" if ends_meet else "constant" for ends_meet in periodic]

    def dilated(cells: Bools) -> Bools:
        return np.asarray(maximum_filter(cells, size=3, mode=modes))

    return ~dilated(unknown | ~counts), dilated(counts | unknown)


def extent_of(region: Region, unit: str, counts: Bools, low: Bools, high: Bools) -> Extent:
    """Return the extent of cells that count between two others (`bounds`), all (*region.shape) bool.

    Args:
        region: the grid.
        unit: of the size of its cells, see `Region.unit`.
        counts: the cells that count.
        low: the cells that count for certain.
        high: the cells that may count.
    """
    value, least, most = (_sum(region.sizes, cells) for cells in (counts, low & counts, high | counts))
    return Extent(value, least, most, unit, int(counts.sum()))


def _in_slabs(region: Region, unit: str, slab: Callable[[Indices], tuple[Bools, Bools]]) -> Extent:
    """Return the extent, computed slab by slab along the first axis, so that large maps take no more memory.

    Args:
        region: the grid.
        unit: of the size of its cells.
        slab: returns for some rows of the first axis which cells count, and which are unknown.
    """
    count, thickness = region.shape[0], max(1, _AT_ONCE * region.shape[0] // region.size)
    first, *others = region.periodic
    sums, cells = np.zeros(3), 0
    for start in range(0, count, thickness):
        stop = min(start + thickness, count)
        rows = np.arange(start - 1, stop + 1)  # with those next to it
        rows = rows % count if first else rows[(rows >= 0) & (rows < count)]
        counts, unknown = slab(rows)
        low, high = bounds([False, *others], counts, unknown)
        inside = slice(int(first or start > 0), None)
        counts, low, high = (part[inside][: stop - start] for part in (counts & ~unknown, low, high))
        sizes = (region.sizes[0][start:stop], *region.sizes[1:])
        sums += [_sum(sizes, part) for part in (counts, low & counts, high | counts)]
        cells += int(counts.sum())
    return Extent(float(sums[0]), float(sums[1]), float(sums[2]), unit, cells)


def _sum(sizes: tuple[Array, ...], cells: Bools) -> float:
    total: Array = cells.astype(float)
    for lengths in reversed(sizes):
        total = total @ lengths
    return float(total)
