"""`dexterity`: how well a mechanism moves inside a box, at worst and on average.

The mean of 1/condition over a box is Gosselin and Angeles' global conditioning index of it ("A global performance index
for the kinematic optimization of robotic manipulators", ASME J. Mechanical Design 113, 1991).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.batch import Sampler
from cinegen.singularities.ball_joints import balls
from cinegen.workspace.measured import Cells, measured
from cinegen.workspace.settled import How, Settled
from cinegen.workspace.sweep.field import Field

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """Of a quantity over a box; not a number where nothing of it is reached.

    Attributes:
        worst: the least, at the cells' middles and on the box's borders.
        mean: of the cells' middles, by what cells measure.
    """

    worst: float
    mean: float


@dataclass(frozen=True)
class Dexterity:
    """Inside a box, of the configurations that are led all over it.

    Attributes:
        reached: which part of the box is, 0 to 1, by the middles of cells.
        whole: whether all of it is, its borders too.
        sigma_1: the smallest singular value of type 1, without unit.
        conditioning: 1/condition of how motors move the node: 1 at best, 0 where it is singular.
        sigma_2: the least singular value of type 2; infinite where nothing is passive.
    """

    reached: float
    whole: bool
    sigma_1: Spread
    conditioning: Spread
    sigma_2: float


def dexterity(field: Field) -> Dexterity:
    """Of what was led all over a box."""
    reached, sizes = field.reached, np.zeros(field.lattice.size)
    inner = field.lattice.middles
    sizes[inner] = field.lattice.sizes
    cells, q = _cells(field), field.q[reached]
    with np.errstate(divide="ignore"):
        conditioning = 1.0 / measured("condition", cells).astype(float)
    rows = field.passive
    second = [rows.sigma(rows.of(one)[None])[0] for one in q] if rows is not None else []
    return Dexterity(
        1.0 if reached[inner].all() else float(sizes[reached].sum() / sizes.sum()),
        bool(reached.all()),
        _spread(measured("sigma_1", cells).astype(float), sizes[reached]),
        _spread(np.nan_to_num(conditioning, nan=0.0), sizes[reached]),
        float(min(second, default=math.inf)),
    )


def _cells(field: Field) -> Cells:
    """The points that are reached, as a map's cells are measured."""
    spec, q = field.spec, field.q[field.reached]
    sampler = Sampler(spec.mechanism, spec.node, *spec.counted, balls(spec.mechanism))
    return Cells(spec, Settled(q, np.full(len(q), How.NEIGHBOUR, np.uint8)), sampler.at(q))


def _spread(values: Array, sizes: Array) -> Spread:
    if not len(values):
        return Spread(math.nan, math.nan)
    return Spread(float(values.min()), float(np.average(values, weights=sizes)))
