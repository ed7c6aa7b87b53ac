"""`measured`: a quantity of cells that are settled; each is one function here, and one line of `QUANTITIES`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.batch import Evaluations
from cinegen.workspace.quantities import QUANTITIES
from cinegen.workspace.settled import Settled
from cinegen.workspace.specification import MapSpecification

if TYPE_CHECKING:
    from cinegen.collision.clearance import Clearance

Array = NDArray[np.float64]
Values = NDArray[Any]

_SLOWLY = 1.0  # rad/s or m/s, of motors whose speed nothing limits
_SINGULAR = 1e12  # of a condition: what is beyond is rounding
_WEAKLY = 1.0  # N m or N, of motors whose effort nothing limits


class Cells:
    """What is known of a piece's cells, for quantities to be computed from.

    Attributes:
        specification: which asks.
        settled: the configurations.
        evaluations: what they are like.
    """

    def __init__(self, spec: MapSpecification, settled: Settled, evaluations: Evaluations) -> None:
        self.spec, self.settled, self.evaluations = spec, settled, evaluations

    @cached_property
    def by_motors(self) -> Array:
        """(n, counted, motors) how motors move the node, in its own axes, without unit."""
        mechanism, (straight, turn) = self.spec.mechanism, self.spec.counted
        scale = mechanism.scale[[mechanism.v_index(name) for name in mechanism.actuated]]
        units = np.repeat([1.0 / mechanism.length, 1.0], 3)[:, None] * scale
        return np.asarray((self.evaluations.jacobians * units)[:, : straight + turn])

    @cached_property
    def by_motors_values(self) -> Array:
        """(n, rank) singular values of these, largest first; without loops those of the node."""
        if not self.spec.mechanism.loops and len(self.spec.mechanism.actuated) == self.spec.mechanism.model.nv:
            return self.evaluations.singular_values[:, : self.spec.rank]
        return _singular_values(self.by_motors)[:, : self.spec.rank]

    @cached_property
    def determined(self) -> Array:
        """(n, 6, motors) the node's velocity by the motors', in its own axes; NaN where they don't determine it."""
        mechanism, model = self.spec.mechanism, self.spec.mechanism.model
        chain = model.supports[model.frames[mechanism.frame_id(self.spec.node)].parentJoint]
        moving = {model.names[joint] for joint in chain if joint > int(mechanism.floating)}
        if not mechanism.loops and not moving <= set(mechanism.actuated):  # of loops the Jacobians say it themselves
            return np.full_like(self.evaluations.jacobians, np.nan)
        return self.evaluations.jacobians

    @cached_property
    def along(self) -> Array:
        """(n, 3) the specification's direction, in the node's own axes."""
        return np.asarray(self.evaluations.placements[:, :3, :3].transpose(0, 2, 1) @ np.asarray(self.spec.along))


def _singular_values(matrices: Array) -> Array:
    """Of (n, rows, columns); not a number where a matrix is not finite."""
    good = np.isfinite(matrices).all(axis=(1, 2))
    found = np.full((len(matrices), min(matrices.shape[1:])), np.nan)
    if good.any():
        found[good] = np.linalg.svd(matrices[good], compute_uv=False)
    return found


def _solutions(cells: Cells) -> Values:
    if cells.settled.solutions is not None:
        return cells.settled.solutions
    raise AssertionError("solutions were not counted")


def _sigma_1(cells: Cells) -> Values:
    return cells.evaluations.singular_values[:, cells.spec.rank - 1]


def _sigma_2(cells: Cells) -> Values:
    return cells.evaluations.second


def _condition(cells: Cells) -> Values:
    values = cells.by_motors_values
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.asarray(values[:, 0] / values[:, -1])
    return np.where(found > _SINGULAR, np.inf, found)


def _manipulability(cells: Cells) -> Values:
    return np.asarray(np.prod(cells.by_motors_values, axis=1))


def _margin(cells: Cells) -> Values:
    limits, q = cells.spec.mechanism.limits, cells.evaluations.q
    low, high = limits.lower, limits.upper
    limited = np.isfinite(low) & np.isfinite(high) & (high > low) & _moving(cells.spec)
    if not limited.any():
        return np.where(np.isfinite(q[:, 0]), 1.0, np.nan)
    q, low, high = q[:, limited], low[limited], high[limited]
    return np.asarray((np.minimum(q - low, high - q) / (0.5 * (high - low))).min(axis=1))


def _moving(spec: MapSpecification) -> NDArray[np.bool_]:
    """(nq,) whether a number of the configuration has to do with where the node is: fingers behind it have not."""
    mechanism = spec.mechanism
    model, system = mechanism.model, mechanism.system
    ends = [model.frames[mechanism.frame_id(spec.node)].parentJoint]
    for first, _, second, _ in system.anchors:
        ends += [first, second]
    found = np.zeros(model.nq, dtype=bool)
    for joint in {joint for end in ends for joint in model.supports[end] if joint > 0}:
        found[model.joints[joint].idx_q : model.joints[joint].idx_q + model.joints[joint].nq] = True
    return found


def _velocity(cells: Cells) -> Values:
    from cinegen.workspace.capability import fastest

    return fastest(cells.determined, cells.along, _limits(cells.spec, "speed"))


def _force(cells: Cells) -> Values:
    from cinegen.workspace.capability import strongest

    return strongest(cells.determined, cells.along, _limits(cells.spec, "effort"))


def _limits(spec: MapSpecification, of: str) -> Array:
    """(motors,) what the robot's description allows them, 1 where it says nothing."""
    mechanism = spec.mechanism
    columns = [mechanism.v_index(name) for name in mechanism.actuated]
    limits = mechanism.limits
    given, unsaid = (limits.velocity, _SLOWLY) if of == "speed" else (limits.effort, _WEAKLY)
    return np.where(np.isfinite(given), given, unsaid)[columns]


def _solid_angle(cells: Cells) -> Values:
    assert cells.settled.solid_angle is not None
    return cells.settled.solid_angle


def _clearance(cells: Cells) -> Values:
    clearance = _clearance_of(cells.spec)
    return np.array([clearance.least(q) if np.isfinite(q[0]) else np.nan for q in cells.evaluations.q])


@lru_cache(maxsize=2)
def _clearance_of(spec: MapSpecification) -> Clearance:
    """Kept from piece to piece: shapes take a while."""
    from cinegen.collision import scene_of, surroundings

    assert spec.scene is not None
    return surroundings(scene_of(dict(spec.scene), spec.folder, mechanism=spec.mechanism))[0]


_MEASURES: dict[str, Callable[[Cells], Values]] = {
    "solutions": _solutions,
    "sigma_1": _sigma_1,
    "sigma_2": _sigma_2,
    "condition": _condition,
    "manipulability": _manipulability,
    "margin": _margin,
    "velocity": _velocity,
    "force": _force,
    "solid_angle": _solid_angle,
    "clearance": _clearance,
}


def measured(name: str, cells: Cells) -> Values:
    """(n,) a quantity of `QUANTITIES`, as it is stored."""
    return np.asarray(_MEASURES[name](cells), dtype=QUANTITIES[name].dtype)
