"""`extent`: how long, large or spacious that part of a region is which is reached, or where a condition holds.

A cell counts as a whole, by what was found at its middle. So the sum of all cells that count is wrong by no more than
the cells that the true border goes through. Where the border is flat over a cell and its neighbours, these have a
neighbour, across a side, an edge or a corner, that is of the other kind: let n >= 0 be the border's normal, in widths
of a cell; it cuts a cell where it passes its middle within sum(n) / 2, and so leaves the middle of the neighbour across
the corner that n points to, at sum(n), on its other side. So the true extent lies between that of the cells that count
without those that have such a neighbour, and that of all cells that count with all neighbours. (These are the inner and
the outer Jordan sums of what is seen: erosion and dilation by a cell; J. Serra, "Image analysis and mathematical
morphology", 1982.)

That assumes that nothing, and no gap in it, is thinner than a cell: what falls between all middles is not seen. Nothing
is known, and nothing counts, beyond the region. Its own edge adds nothing to the bound; where the true border meets it,
less than half a cell may be cut off without being seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.workspace.errors import MapError
from cinegen.workspace.region import Region
from cinegen.workspace.settled import How
from cinegen.workspace.storage.dataset import specification_of

if TYPE_CHECKING:
    import xarray

Bools = NDArray[np.bool_]

_AT_ONCE = 4_000_000  # cells in memory


@dataclass(frozen=True)
class Extent:
    """Of a part of a region, in what its cells are measured: m, m^2, m^3, each times rad for each turn.

    Attributes:
        value: the sum of the cells that count.
        low: without those on the border.
        high: with those beyond the border that touch it, and with all that nobody has looked at.
        unit: of these.
        cells: how many count.
    """

    value: float
    low: float
    high: float
    unit: str
    cells: int

    @property
    def error(self) -> float:
        """What the value can be wrong by, to either side, if nothing is thinner than a cell."""
        return max(self.value - self.low, self.high - self.value)

    def __str__(self) -> str:
        """The value with as many digits as the error leaves."""
        if not self.error:
            return f"{self.value:.4g} {self.unit}"
        digits = max(0, 1 - math.floor(math.log10(self.error)))
        size = f"{self.value:.{digits}f} ± {self.error:.{digits}f}"
        return f"{size} {self.unit}" if digits < 7 else f"{self.value:.4g} ± {self.error:.2g} {self.unit}"

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        return {"value": self.value, "error": self.error, "low": self.low, "high": self.high, "unit": self.unit,
                "cells": self.cells}  # fmt: skip


def extent(dataset: xarray.Dataset, where: xarray.DataArray | None = None) -> Extent:
    """The extent of what a map shows as reached, or of where a condition holds.

    Args:
        dataset: a map, finished or not.
        where: bool, of the map's cells, such as `dataset.sigma_1 > 0.1`; `dataset.reachable` unless given.

    Raises:
        MapError: this is no map; or a condition on something else.
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
        raise MapError(f"a condition is true or false, and this is {where.dtype}: write dataset.sigma_1 > 0.1")
    where, settled = where.transpose(*region.names), dataset["settled"]

    def slab(rows: slice) -> tuple[Bools, Bools]:
        return where[rows].values, settled[rows].values == How.NOT_YET

    return _measured(region, spec.region.unit(spec.mechanism), slab)


def bounds(region: Region, counts: Bools, unknown: Bools | None = None) -> tuple[Bools, Bools]:
    """Cells that are whole in what counts, and cells that any of it may be in, if nothing is thinner than a cell.

    Args:
        region: which.
        counts: of the region's shape, the cells that count.
        unknown: likewise, cells of which it is not known; none unless given.
    """
    around = _is_round(region)
    maybe = counts if unknown is None else counts | unknown
    surely = counts if unknown is None else counts & ~unknown
    return ~_grown(~surely, around), _grown(maybe, around)


def extent_of(region: Region, unit: str, counts: Bools, low: Bools, high: Bools) -> Extent:
    """The extent of cells that count, between two others (`bounds`), all of the region's shape.

    Args:
        region: which.
        unit: of what its cells measure, see `Region.unit`.
        counts: the cells.
        low: those that surely count as a whole.
        high: those that may.
    """
    value, least, most = (_sum(list(region.sizes), cells) for cells in (counts, low & counts, high | counts))
    return Extent(value, least, most, unit, int(counts.sum()))


def _measured(region: Region, unit: str, slab: Any) -> Extent:
    """In slabs along the first axis, so that a large map needs no more memory than a small one."""
    first, rows = region.axes[0], max(1, _AT_ONCE * region.shape[0] // region.size)
    is_round, *around = _is_round(region)
    sums, cells = np.zeros(3), 0
    for start in range(0, first.count, rows):
        stop = min(start + rows, first.count)
        before, after = max(0, start - 1), min(first.count, stop + 1)
        inside, unknown = slab(slice(before, after))
        if is_round:  # the cells at both ends are neighbours
            ends = [slab(slice(k % first.count, k % first.count + 1)) for k in (start - 1, stop)]
            parts = [ends[0]] * (start == 0) + [(inside, unknown)] + [ends[1]] * (stop == first.count)
            inside, unknown = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
            before -= start == 0
        mine = slice(start - before, stop - before)
        inside = inside & ~unknown
        kept = ~_grown(~inside, [False, *around])[mine]
        most = _grown(inside | unknown, [False, *around])[mine]
        sizes = [region.sizes[0][start:stop], *region.sizes[1:]]
        counted = inside[mine]
        sums += [_sum(sizes, cells_of) for cells_of in (counted, counted & kept, most)]
        cells += int(counted.sum())
    return Extent(float(sums[0]), float(sums[1]), float(sums[2]), unit, cells)


def _is_round(region: Region) -> list[bool]:
    """For each axis whether it is a whole turn about a centre, whose two ends are one."""
    return [axis.name == "azimuth" and axis.high - axis.low > 2.0 * math.pi - 1e-9 for axis in region.axes]


def _grown(cells: Bools, around: list[bool]) -> Bools:
    """With all neighbours, across sides, edges and corners."""
    found = cells
    for axis, is_round in enumerate(around):
        there = np.moveaxis(found, axis, 0)
        grown = there.copy()
        grown[1:] |= there[:-1]
        grown[:-1] |= there[1:]
        if is_round:
            grown[0] |= there[-1]
            grown[-1] |= there[0]
        found = np.moveaxis(grown, 0, axis)
    return found


def _sum(sizes: list[NDArray[np.float64]], cells: Bools) -> float:
    """Of the products of sizes."""
    found: NDArray[np.float64] = cells.astype(float)
    for one in reversed(sizes):
        found = found @ one
    return float(found)
