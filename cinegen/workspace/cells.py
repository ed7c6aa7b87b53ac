"""Evaluated cells of a chunk: their status, their configurations, and what the quantities are computed from."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cinegen.arrays import Array, Bools

if TYPE_CHECKING:
    from cinegen.ik.batch import Evaluations
    from cinegen.workspace.specification import MapSpecification


UNBOUNDED = 1e10
"""A dimensionless Jacobian beyond is rounding: the actuated joints do not control the node."""


class CellStatus(IntEnum):
    """Status of a cell: reachable or not, and the method that found it."""

    NOT_EVALUATED = 0
    REACHABLE = 1
    """Continued from a neighbouring cell or, over actuated joints, from the cell before."""
    REACHABLE_BY_SEARCH = 2
    """Found from another start."""
    UNREACHABLE_PROVED = 3
    """The links are too short or too long (`ReachBounds`)."""
    UNREACHABLE_NOT_FOUND = 4
    """Neither a neighbour nor any other start leads there."""
    LOOPS_OPEN = 5
    """Over actuated joints: the loops can't be closed on the branch of the home configuration."""
    BEYOND_LIMITS = 6
    """Over actuated joints: a joint is beyond its limits, from each reachable neighbour and from home."""

    @property
    def reachable(self) -> bool:
        """True if such a cell has a configuration."""
        return self in (CellStatus.REACHABLE, CellStatus.REACHABLE_BY_SEARCH)

    @property
    def label(self) -> str:
        """Text for people, such as `unreachable (proved)`."""
        return _LABELS.get(self, self.name.lower().replace("_", " "))


_LABELS = {
    CellStatus.REACHABLE_BY_SEARCH: "reachable (by search)",
    CellStatus.UNREACHABLE_PROVED: "unreachable (proved)",
    CellStatus.UNREACHABLE_NOT_FOUND: "unreachable (not found)",
    CellStatus.LOOPS_OPEN: "unreachable (loops open)",
    CellStatus.BEYOND_LIMITS: "unreachable (beyond limits)",
}


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells with their configurations; arrays have one row for each cell, the last axis of the chunk fastest.

    Attributes:
        spec: specification of the map.
        status: (n,) values of `CellStatus`.
        evaluations: (n,) configurations, placements, Jacobians and singular values; NaN for unreachable cells.
        solutions: (n,) number of inverse solutions that differ in their actuated joints by more than revolutions; over
            actuated joints, number of assembly modes. None unless asked for.
        solid_angle: (n,) sr, directions that the node's z axis can have. None unless asked for.
    """

    spec: MapSpecification
    status: NDArray[np.uint8]
    evaluations: Evaluations
    solutions: NDArray[np.int32] | None = None
    solid_angle: Array | None = None

    @cached_property
    def jacobians(self) -> Array:
        """(n, 6, actuated) the node's Jacobians by the actuated joints, dimensionless."""
        mechanism = self.spec.mechanism
        scale = mechanism.scale[[mechanism.v_index(name) for name in mechanism.actuated]]
        units = np.repeat([1.0 / mechanism.length, 1.0], 3)[:, None] * scale
        return np.asarray(self.evaluations.jacobians * units)

    @cached_property
    def is_controlled(self) -> Bools:
        """(n,) true where the actuated joints determine the node's motion: not at singularities of type 2."""
        return bounded(self.jacobians)


def bounded(jacobians: Array) -> Bools:
    """Return (n,) true where a dimensionless Jacobian (n, ., .) is known."""
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(jacobians) < UNBOUNDED).all(axis=(1, 2)))
