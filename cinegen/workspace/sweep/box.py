"""`Box`: that part of a region which a task wants."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from cinegen.workspace.errors import MapError
from cinegen.workspace.region import GridAxis, Region
from cinegen.workspace.sweep.lattice import Lattice
from raff2urdf.errors import did_you_mean

_EDGE = 1e-9  # of a cell's width: a box that ends on a border does not touch the next cell


@dataclass(frozen=True)
class Box:
    """Ranges of a region's axes; an axis that is not named is wanted as long as it is.

    Attributes:
        ranges: low and high by the axis' name, m or rad.

    Raises:
        MapError: a range that goes nowhere.
    """

    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, (low, high) in self.ranges.items():
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise MapError(f"wanted box: {name} from {low:g} to {high:g} is no range: give the lower end first")

    def cells(self, region: Region) -> tuple[slice, ...]:
        """The cells that it touches, for each axis.

        Raises:
            MapError: it names an axis that the region does not have, or goes beyond it.
        """
        for name in self.ranges:
            if name not in region.names:
                raise MapError(f"wanted box: the maps have no axis '{name}'{did_you_mean(name, region.names)}")
        return tuple(self._touched(axis) for axis in region.axes)

    def lattice(self, region: Region) -> Lattice:
        """Points all over it, on its borders too.

        Raises:
            MapError: as of `cells`.
        """
        return Lattice(region, self.cells(region), tuple(self._range(axis) for axis in region.axes))

    def _range(self, axis: GridAxis) -> tuple[float, float]:
        return self.ranges.get(axis.name, (axis.low, axis.high))

    def _touched(self, axis: GridAxis) -> slice:
        low, high = self._range(axis)
        first, last = ((end - axis.low) / axis.width for end in (low, high))
        if first < -_EDGE or last > axis.count + _EDGE:
            raise MapError(
                f"wanted box: {axis.name} from {low:g} to {high:g} goes beyond the maps, which end at {axis.low:g} "
                f"and {axis.high:g}: make these larger"
            )
        return slice(max(0, math.floor(first + _EDGE)), min(axis.count, math.ceil(last - _EDGE)))

    def document(self) -> dict[str, list[float]]:
        """As JSON has it, m and rad."""
        return {name: [low, high] for name, (low, high) in sorted(self.ranges.items())}
