"""Tasks of a synthesis: what varies, what the node must reach, what is optimised, and what must hold.

Task files are read by `cinegen.design.synthesis.task_file`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cinegen.arrays import Array
from cinegen.design.amounts import Amounts
from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from cinegen.design.synthesis.quantities import QUANTITIES
from cinegen.design.synthesis.region import Reach

FLOOR = 0.01
"""Least distance to singularities of both types unless the task gives one: the smallest singular value, and the inverse
of the largest, dimensionless."""

STARTS = 8
FRONT = 9


def check_free(parameters: Parameters) -> None:
    """Raise a `DesignError` if a free parameter is the variable of a joint, or has no bounds."""
    for free in parameters.free:
        if free.joint:
            raise DesignError(f"{free.name} is the variable of {free.joint}, which moves: the task can't choose it")
    loose = [name for name, b in zip(parameters.names, parameters.bounds, strict=True) if not np.isfinite(b).all()]
    if loose:
        raise DesignError(f"{', '.join(loose)}: without bounds: give them in [parameters], as low..high")


@dataclass(frozen=True)
class DesignObjective:
    """One thing that is optimised.

    Attributes:
        quantity: a key of `QUANTITIES`.
        over: "worst" or "mean" over the targets; the mean of torques is their root mean square.
        of: patterns of the parameters that `size` adds.
    """

    quantity: str
    over: str = "worst"
    of: tuple[str, ...] = ()

    @property
    def is_maximised(self) -> bool:
        """True where a larger value is better."""
        return QUANTITIES[self.quantity].better == "maximise"

    @property
    def text(self) -> str:
        """The objective as people read it."""
        of = f" of {', '.join(self.of)}" if self.of else f", {self.over}" if QUANTITIES[self.quantity].pointwise else ""
        return f"{QUANTITIES[self.quantity].better} {self.quantity}{of}"


@dataclass(frozen=True)
class DesignLoad:
    """A load that the mechanism holds at rest, in all configurations.

    Attributes:
        payload: mass at the node's origin, kg.
        wrench: force (N) and moment (N m) on the node at its origin, in the world's axes.
        gravity: acceleration in the world, m/s2; empty for that of the mechanism.
    """

    payload: float = 0.0
    wrench: tuple[float, ...] = (0.0,) * 6
    gravity: tuple[float, ...] = ()


@dataclass(frozen=True)
class DesignErrors:
    """Errors whose effect is the accuracy; see `cinegen.design.Tolerances`."""

    sigma: Amounts = ()
    play: Amounts = ()
    encoder: Amounts = ()


@dataclass(frozen=True)
class DesignClearance:
    """Distances that the bars of the mechanism must keep from each other and from obstacles.

    Attributes:
        least: between surfaces, m.
        radius: of the bars along the parameters from each node to its children, m.
        obstacles: capsules: both ends of the axis (3,) in the world, and the radius, m.
    """

    least: float
    radius: float = 0.0
    obstacles: tuple[tuple[tuple[float, ...], tuple[float, ...], float], ...] = ()


@dataclass(frozen=True)
class SynthesisTask:
    """Parameters, targets, objectives and constraints of a synthesis.

    Attributes:
        parameters: range (low, high) of each parameter that varies, by pattern: m and rad.
        reach: where the node must get to.
        objectives: one, or several for a Pareto front.
        ties: see `cinegen.design.ties`.
        node: that reaches; empty for the last of the file.
        singular_values: least and greatest singular value, dimensionless.
        joint_limits: whether all joints must be within their limits.
        proved: whether the region must be proved with the result (`cinegen.prove`), not only checked at points.
        size: patterns of lengths and the most that their sum may be, m; None without.
        most: largest value of further quantities: `condition`, `mass` (kg), `accuracy` (m), and `torque` as typed.
        clearance: None where bars may meet.
        load: that actuated joints hold.
        errors: for the accuracy.
        starts: number of local optimisations: from the file's values, then a Sobol sequence within the ranges.
        front: number of points of a Pareto front.
        written: keys and values of the file.
    """

    parameters: Mapping[str, tuple[float, float] | str]
    reach: Reach
    objectives: tuple[DesignObjective, ...]
    ties: tuple[str, ...] = ()
    node: str = ""
    singular_values: tuple[float, float] = (FLOOR, 1.0 / FLOOR)
    joint_limits: bool = True
    proved: bool = False
    size: tuple[tuple[str, ...], float] | None = None
    most: Mapping[str, float | str] = field(default_factory=dict)
    clearance: DesignClearance | None = None
    load: DesignLoad = DesignLoad()
    errors: DesignErrors = DesignErrors()
    starts: int = STARTS
    front: int = FRONT
    written: Mapping[str, Any] = field(default_factory=dict, compare=False)

    @property
    def grows(self) -> bool:
        """True where the region's scale is an objective."""
        return self.uses("region")

    def uses(self, quantity: str) -> bool:
        """Return whether a quantity is an objective or is bounded."""
        return quantity in self.most or any(objective.quantity == quantity for objective in self.objectives)


@dataclass(frozen=True)
class Precision:
    """Precision points of a linkage.

    Attributes:
        parameters: range (low, high) of each parameter that varies, by pattern: m and rad.
        targets: (points, rows) coordinates and angles, or values of joints, m and rad.
        ties: see `cinegen.design.ties`.
        node: that passes points or poses; empty for the last of the file.
        rows: components of the node's twist in the world that are given.
        joints: input and output of a function, instead of a node.
        starts: number of starts at most.
    """

    parameters: Mapping[str, tuple[float, float] | str]
    targets: Array
    ties: tuple[str, ...] = ()
    node: str = ""
    rows: tuple[int, ...] = (0, 1)
    joints: tuple[str, ...] = ()
    starts: int = 200
