"""`compare`: what two maps over the same coordinates have in common, and how they differ where both reach.

They are compared cell by cell on a grid that both can fill: their own where it is the same; else the part that both
cover, in cells as wide as those of the coarser one, each looked up in either map at its middle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.workspace.errors import MapError
from cinegen.workspace.extent import Extent, bounds, extent_of
from cinegen.workspace.region import GridAxis, Region
from cinegen.workspace.settled import How
from cinegen.workspace.specification import MapSpecification
from cinegen.workspace.storage.dataset import specification_of

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

_SAME = 1e-9  # of a cell's width


@dataclass(frozen=True, eq=False)
class Difference:
    """How a quantity differs, the second map's less the first's, in cells that both reach.

    Attributes:
        unit: of the quantity; "1" where it has none.
        words: what it is.
        values: of the common grid's shape; not a number where one of both does not reach, or is infinite.
    """

    unit: str
    words: str
    values: Array

    @cached_property
    def spread(self) -> tuple[float, float, float]:
        """The least, the median and the largest; not numbers where there is no cell."""
        known = self.values[np.isfinite(self.values)]
        if not known.size:
            return math.nan, math.nan, math.nan
        return float(known.min()), float(np.median(known)), float(known.max())

    def __str__(self) -> str:
        """In words."""
        least, median, most = self.spread
        if not math.isfinite(median):
            return "there is no cell in which both reach and it has a bound"
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"second less first: {least:+.3g} to {most:+.3g}, median {median:+.3g}{unit}"

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it."""
        spread = dict(zip(("least", "median", "most"), self.spread, strict=True))
        return {"unit": self.unit, **{name: x if math.isfinite(x) else None for name, x in spread.items()}}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two maps on a grid that both fill.

    Attributes:
        names: of both, different where they can be.
        region: the common grid, with what the first map holds.
        cells: of the region's shape, where each map reaches.
        first: extent of what the first reaches, on this grid.
        second: of what the second reaches.
        only_first: of what the first alone reaches.
        only_second: of what the second alone reaches.
        both: of what both reach.
        differences: by the name of each quantity that both have.
        remarks: what is not the same of them.
    """

    names: tuple[str, str]
    region: Region
    cells: tuple[Bools, Bools]
    first: Extent
    second: Extent
    only_first: Extent
    only_second: Extent
    both: Extent
    differences: Mapping[str, Difference]
    remarks: tuple[str, ...]

    @property
    def extents(self) -> dict[str, Extent]:
        """By what they are of."""
        one, other = self.names
        return {one: self.first, other: self.second, f"{one} alone": self.only_first,
                f"{other} alone": self.only_second, "both": self.both}  # fmt: skip

    def __str__(self) -> str:
        """Lines for people."""
        ranges = ", ".join(f"{axis.name} {axis.low:.4g} to {axis.high:.4g}" for axis in self.region.axes)
        shape = " x ".join(map(str, self.region.shape))
        wide = max(len(name) for name in (*self.extents, *self.differences))
        lines = [f"{self.names[0]} and {self.names[1]}: {shape} cells over {ranges}"]
        lines += [f"  {remark}" for remark in self.remarks]
        lines += [f"  {name:<{wide}}  {extent}" for name, extent in self.extents.items()]
        for name, difference in self.differences.items():
            lines.append(f"  {name:<{wide}}  {difference}")
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it, m and rad."""
        return {
            "maps": list(self.names),
            "over": {axis.name: [axis.low, axis.high, axis.count] for axis in self.region.axes},
            "remarks": list(self.remarks),
            "extents": {
                "first": self.first.as_dict(), "second": self.second.as_dict(),
                "only first": self.only_first.as_dict(), "only second": self.only_second.as_dict(),
                "both": self.both.as_dict(),
            },
            "differences": {name: difference.as_dict() for name, difference in self.differences.items()},
        }  # fmt: skip


def compare(first: xarray.Dataset, second: xarray.Dataset) -> Comparison:
    """What two maps have in common, and how they differ.

    Robots may be different, and so may what is held; `Comparison.remarks` says so.

    Args:
        first: a map; cells that nobody has looked at yet count as unknown.
        second: another, over the same coordinates.

    Raises:
        MapError: they are over other coordinates, in other units, or have no place in common.
    """
    one, other = specification_of(first), specification_of(second)
    region = _common(one, other)
    unit = region.unit(one.mechanism)
    looked_up = [_looked_up(dataset, spec.region, region) for dataset, spec in ((first, one), (second, other))]
    reached = [cells["reachable"].values for cells in looked_up]
    unknown = [cells["settled"].values == How.NOT_YET for cells in looked_up]
    (a, b), ((a_low, a_high), (b_low, b_high)) = reached, map(partial(bounds, region), reached, unknown)
    measured = partial(extent_of, region, unit)
    differences = {}
    for name in one.quantities:
        if name not in other.quantities or first[name].attrs.get("units") != second[name].attrs.get("units"):
            continue
        mine, its = (cells[name].values.astype(float) for cells in looked_up)
        with np.errstate(invalid="ignore"):
            values = np.where(a & b, its - mine, np.nan)
        values[~np.isfinite(values)] = np.nan
        told = first[name].attrs
        differences[name] = Difference(str(told.get("units", "1")), str(told.get("long_name", name)), values)
    return Comparison(
        _names(first, second), region, (a, b),
        measured(a, a_low, a_high), measured(b, b_low, b_high),
        measured(a & ~b, a_low & ~b_high, a_high & ~b_low), measured(b & ~a, b_low & ~a_high, b_high & ~a_low),
        measured(a & b, a_low & b_low, a_high & b_high), differences, _remarks(one, other),
    )  # fmt: skip


def _common(one: MapSpecification, other: MapSpecification) -> Region:
    """A grid that both fill.

    Raises:
        MapError: there is none.
    """
    first, second = one.region, other.region
    if set(first.names) != set(second.names):
        raise MapError(
            f"a map over {', '.join(first.names)} can't be compared with one over {', '.join(second.names)}: make both "
            "over the same coordinates"
        )
    units = first.unit(one.mechanism), second.unit(other.mechanism)
    if units[0] != units[1]:
        raise MapError(f"one map's cells are measured in {units[0]}, the other's in {units[1]}: they can't be compared")
    radii = [region.at.get("radius") for region in (first, second)]
    if "elevation" in first.names and "radius" not in first.names and radii[0] != radii[1]:
        raise MapError(f"maps of spheres of radius {radii[0]} and {radii[1]} m: make both at the same radius")
    axes = []
    for axis in first.axes:
        mine = second.axes[second.names.index(axis.name)]
        low, high = max(axis.low, mine.low), min(axis.high, mine.high)
        width = max(axis.width, mine.width)
        if high - low < width * (1.0 - _SAME):
            raise MapError(
                f"{axis.name} goes from {axis.low:g} to {axis.high:g} in one map and from {mine.low:g} to "
                f"{mine.high:g} in the other: they have no cell in common"
            )
        count = math.floor((high - low) / width + _SAME * axis.count + _SAME)
        axes.append(GridAxis(axis.name, low, min(low + count * width, high), count))
    return Region(tuple(axes), first.at, first.orientation, first.centre, first.ends)


def _looked_up(dataset: xarray.Dataset, region: Region, common: Region) -> xarray.Dataset:
    """What a map says of the cells of another grid: in each what it says of the one that its middle is in."""
    cells = dataset.drop_vars("configuration").transpose(*common.names)
    found: xarray.Dataset = cells.isel({axis.name: _numbers(region, axis) for axis in common.axes})
    return found.load()


def _numbers(region: Region, axis: GridAxis) -> NDArray[np.intp]:
    """(n,) of the cells that an axis' middles are in."""
    mine = region.axes[region.names.index(axis.name)]
    numbers = np.floor((axis.middles() - mine.low) / mine.width + _SAME).astype(np.intp)
    return np.asarray(np.clip(numbers, 0, mine.count - 1))


def _names(first: xarray.Dataset, second: xarray.Dataset) -> tuple[str, str]:
    """Of the robots, where they are different; else of the files; else there is an order at least."""
    robots = [str(dataset.attrs["robot"]) for dataset in (first, second)]
    files = [Path(dataset.encoding.get("source", "")).stem.removesuffix("-map") for dataset in (first, second)]
    for one, other in (robots, files):
        if one and other and one != other:
            return one, other
    return f"first {robots[0]}", f"second {robots[1]}"


def _remarks(one: MapSpecification, other: MapSpecification) -> tuple[str, ...]:
    """What is not the same of two specifications, apart from their grids."""
    found = []
    if one.robot_hash != other.robot_hash:
        found.append("the robots are different")
    pairs: list[tuple[str, Any, Any]] = [
        (name, getattr(one, name), getattr(other, name)) for name in ("node", "limits", "along", "starts", "directions")
    ]
    pairs += [
        (f"region's {name}", getattr(one.region, name), getattr(other.region, name))
        for name in ("orientation", "centre", "ends")
    ]
    for name in sorted({*one.region.at, *other.region.at}):
        pairs.append((name, one.region.at.get(name, "as at home"), other.region.at.get(name, "as at home")))
    found += [f"{name}: {mine} and {its}" for name, mine, its in pairs if mine != its]
    return tuple(found)
