"""`dexterity`: how well a mechanism moves inside a box, at worst and on average.

The mean of 1/condition over a box is Gosselin and Angeles' global conditioning index of it ("A global performance index
for the kinematic optimization of robotic manipulators", ASME J. Mechanical Design 113, 1991).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cinegen.study.maps.region import Region

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """Of a quantity over cells; not a number where there are none.

    Attributes:
        worst: the least.
        mean: by what cells measure.
    """

    worst: float
    mean: float


@dataclass(frozen=True)
class Dexterity:
    """Inside a box, over its cells that are reached.

    Attributes:
        reached: which part of the box they are, 0 to 1.
        sigma_1: the smallest singular value of type 1, without unit.
        conditioning: 1/condition of how motors move the node: 1 at best, 0 where it is singular.
        sigma_2: the least singular value of type 2; infinite where nothing is passive.
    """

    reached: float
    sigma_1: Spread
    conditioning: Spread
    sigma_2: float

    @property
    def whole(self) -> bool:
        """Whether each cell is reached."""
        return self.reached == 1.0


def dexterity(dataset: xarray.Dataset, region: Region, cells: tuple[slice, ...]) -> Dexterity:
    """Of a finished map.

    Args:
        dataset: the map, with sigma_1 and condition, and with sigma_2 where something is passive.
        region: of the map.
        cells: of the box, for each axis.
    """
    part = dataset.isel(dict(zip(region.names, cells, strict=True)))
    sizes = reduce(np.multiply.outer, [one[cut] for one, cut in zip(region.sizes, cells, strict=True)])
    reached = part["reachable"].values
    with np.errstate(divide="ignore"):
        conditioning = 1.0 / part["condition"].values.astype(float)
    second = part["sigma_2"].values[reached] if "sigma_2" in part else np.zeros(0)
    return Dexterity(
        1.0 if reached.all() else float(sizes[reached].sum() / sizes.sum()),
        _spread(part["sigma_1"].values.astype(float)[reached], sizes[reached]),
        _spread(np.nan_to_num(conditioning, nan=0.0)[reached], sizes[reached]),
        float(second.min()) if len(second) else math.inf,
    )


def _spread(values: Array, sizes: Array) -> Spread:
    if not len(values):
        return Spread(math.nan, math.nan)
    return Spread(float(values.min()), float(np.average(values, weights=sizes)))
