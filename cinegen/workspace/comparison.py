"""`compare`: what two maps over the same coordinates have in common, and how they differ where both reach.

They are compared cell by cell on a common grid: their own where it is the same; else the part that both cover, in cells
as wide as those of the coarser one, each looked up in both maps at its middle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.html import table
from cinegen.typed_json import as_json
from cinegen.workspace.cells import CellStatus
from cinegen.workspace.errors import MapError
from cinegen.workspace.extent import Extent, bounds, extent_of
from cinegen.workspace.region import GridAxis, Region
from cinegen.workspace.specification import MapSpecification, specification_of
from raff2urdf.quantities import shown_unit

if TYPE_CHECKING:
    import xarray


_SAME = 1e-9  # of a cell's width


@dataclass(frozen=True, eq=False, repr=False)
class QuantityDifference:
    """Difference of a quantity, second map minus first, in cells that both reach.

    Attributes:
        unit: of the quantity; "1" if dimensionless.
        description: of the quantity.
        values: (*region.shape); NaN where a map does not reach, or is infinite.
    """

    unit: str
    description: str
    values: Array

    @cached_property
    def range(self) -> tuple[float, float, float]:
        """Minimum, median and maximum; NaN if there is no cell."""
        known = self.values[np.isfinite(self.values)]
        least, median, most = np.quantile(known, (0.0, 0.5, 1.0)) if known.size else (math.nan,) * 3
        return float(least), float(median), float(most)

    @property
    def text(self) -> str:
        """The range for people."""
        least, median, most = self.range
        if not math.isfinite(median):
            return "there is no cell that both maps reach and where it is finite"
        scale, unit = (1.0, "") if self.unit == "1" else shown_unit(self.unit)
        text = f"{scale * least:+.3g} to {scale * most:+.3g}, median {scale * median:+.3g}"
        return f"{text} {unit}".rstrip()

    def __str__(self) -> str:
        return f"second minus first: {self.text}"

    def __repr__(self) -> str:
        return f"<QuantityDifference {self}>"

    def as_dict(self) -> dict[str, Any]:
        """Return JSON values."""
        return as_json(self, "unit", **dict(zip(("min", "median", "max"), self.range, strict=True)))


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Two maps on a common grid.

    Attributes:
        names: of both maps, different where they can be.
        region: the common grid, with the fixed coordinates of the first map.
        units: m or rad, of each axis of the grid.
        cells: two (*region.shape) bool, the cells that each map reaches.
        first: extent of what the first map reaches, on this grid.
        second: of what the second map reaches.
        only_first: of what only the first map reaches.
        only_second: of what only the second map reaches.
        both: of what both reach.
        differences: by name, of each quantity that both maps have.
        remarks: other differences between the two specifications.
    """

    names: tuple[str, str]
    region: Region
    units: tuple[str, ...]
    cells: tuple[Bools, Bools]
    first: Extent
    second: Extent
    only_first: Extent
    only_second: Extent
    both: Extent
    differences: Mapping[str, QuantityDifference]
    remarks: tuple[str, ...]

    @property
    def extents(self) -> dict[str, Extent]:
        """The extents by a label for people."""
        first, second = self.names
        return {first: self.first, second: self.second, f"only {first}": self.only_first,
                f"only {second}": self.only_second, "both": self.both}  # fmt: skip

    def __repr__(self) -> str:
        first, second = (name[:50] for name in self.names)
        return f"<Comparison of {first} and {second} on {self.region!r}>"

    @property
    def _rows(self) -> dict[str, Extent | QuantityDifference]:
        return {**self.extents, **self.differences}

    def __str__(self) -> str:
        """Return lines for people."""
        ranges = ", ".join(map(_range, self.region.axes, self.units))
        shape, wide = " x ".join(map(str, self.region.shape)), max(map(len, self._rows))
        lines = [f"{self.names[0]} and {self.names[1]}: {shape} cells over {ranges}"]
        lines += [f"  {remark}" for remark in self.remarks]
        return "\n".join([*lines, *(f"  {name:<{wide}}  {row}" for name, row in self._rows.items())])

    def _repr_html_(self) -> str:
        return table(repr(self), ("", "reachable, or difference"), self._rows.items())

    def as_dict(self) -> dict[str, Any]:
        """Return JSON values, m and rad."""
        return {
            "maps": list(self.names),
            "over": {axis.name: [axis.low, axis.high, axis.count] for axis in self.region.axes},
            "remarks": list(self.remarks),
            "extents": {name: getattr(self, name).as_dict()
                        for name in ("first", "second", "only_first", "only_second", "both")},
            "differences": {name: difference.as_dict() for name, difference in self.differences.items()},
        }  # fmt: skip


def _range(axis: GridAxis, unit: str) -> str:
    scale, shown = shown_unit(unit)
    return f"{axis.name} {scale * axis.low:.4g} to {scale * axis.high:.4g} {shown}"


def compare(first: xarray.Dataset, second: xarray.Dataset) -> Comparison:
    """Compare two maps. They may be of different robots and settings; `Comparison.remarks` lists the differences.

    Args:
        first: a map; cells that are not evaluated count as unknown.
        second: another map over the same coordinates.

    Raises:
        MapError: they are over other coordinates, in other units, or have no cell in common.
    """
    spec, other = specification_of(first), specification_of(second)
    region = _common(spec, other)
    unit = region.unit(spec.mechanism)
    a, b = (_looked_up(dataset, region) for dataset in (first, second))
    in_a, in_b = a["reachable"].values, b["reachable"].values
    (a_low, a_high), (b_low, b_high) = (
        bounds(region.periodic, cells["reachable"].values, cells["status"].values == CellStatus.NOT_EVALUATED)
        for cells in (a, b)
    )
    differences = {}
    for name in spec.quantities:
        attributes = first[name].attrs
        if name not in other.quantities or attributes["units"] != second[name].attrs["units"]:
            continue
        with np.errstate(invalid="ignore"):
            values = np.where(in_a & in_b, b[name].values.astype(float) - a[name].values.astype(float), np.nan)
        values[~np.isfinite(values)] = np.nan
        differences[name] = QuantityDifference(attributes["units"], attributes["long_name"], values)
    parts = {
        "first": (in_a, a_low, a_high), "second": (in_b, b_low, b_high),
        "only_first": (in_a & ~in_b, a_low & ~b_high, a_high & ~b_low),
        "only_second": (in_b & ~in_a, b_low & ~a_high, b_high & ~a_low),
        "both": (in_a & in_b, a_low & b_low, a_high & b_high),
    }  # fmt: skip
    extents = {name: extent_of(region, unit, *part) for name, part in parts.items()}
    cells, remarks = (in_a, in_b), _remarks(spec, other)
    units = region.units(spec.mechanism)
    return Comparison(_names(first, second), region, units, cells, differences=differences, remarks=remarks, **extents)


def _common(spec: MapSpecification, other: MapSpecification) -> Region:
    """Return a grid that both maps fill.

    Raises:
        MapError: there is none.
    """
    first, second = spec.region, other.region
    if set(first.names) != set(second.names):
        raise MapError(
            f"a map over {', '.join(first.names)} can't be compared with one over {', '.join(second.names)}: make both "
            "over the same coordinates"
        )
    units = first.unit(spec.mechanism), second.unit(other.mechanism)
    if units[0] != units[1]:
        raise MapError(f"one map's cells are measured in {units[0]}, the other's in {units[1]}: they can't be compared")
    radii = [region.at.get("radius") for region in (first, second)]
    if "elevation" in first.names and "radius" not in first.names and radii[0] != radii[1]:
        raise MapError(f"maps of spheres of radius {radii[0]} and {radii[1]} m: make both at the same radius")
    axes = []
    for axis in first.axes:
        same = second.axes[second.names.index(axis.name)]
        low, high = max(axis.low, same.low), min(axis.high, same.high)
        width = max(axis.width, same.width)
        if high - low < width * (1.0 - _SAME):
            raise MapError(
                f"{axis.name} goes from {axis.low:g} to {axis.high:g} in one map and from {same.low:g} to "
                f"{same.high:g} in the other: they have no cell in common"
            )
        count = math.floor((high - low) / width + _SAME * axis.count + _SAME)
        axes.append(GridAxis(axis.name, low, min(low + count * width, high), count))
    return Region(tuple(axes), first.at, first.orientation, first.centre, first.ends)


def _looked_up(dataset: xarray.Dataset, common: Region) -> xarray.Dataset:
    """Return a map's values on a common grid: in each cell those of the map's cell that its middle is in."""
    middles = {axis.name: axis.middles() for axis in common.axes}
    values: xarray.Dataset = dataset.drop_dims("joint").transpose(*common.names)
    return values.sel(middles, method="nearest").load()


def _names(first: xarray.Dataset, second: xarray.Dataset) -> tuple[str, str]:
    """Return the names of the robots where they are different, else of the files, else with their order."""
    robots = [str(dataset.attrs["robot"]) for dataset in (first, second)]
    files = [Path(dataset.encoding.get("source", "")).stem.removesuffix("-map") for dataset in (first, second)]
    for a, b in (robots, files):
        if a and b and a != b:
            return a, b
    return f"first {robots[0]}", f"second {robots[1]}"


def _remarks(spec: MapSpecification, other: MapSpecification) -> tuple[str, ...]:
    """Return the differences between two specifications, apart from their grids and quantities."""
    differences, known = spec.differences(other), ("quantities", *spec.region.names)
    return tuple(f"{name}: {first} and {second}" for name, first, second in differences if name not in known)
