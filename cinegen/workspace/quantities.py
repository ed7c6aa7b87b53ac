"""Quantities of a map's cells: their names, units and formulas; each is one entry of `QUANTITIES`.

Singular values are those of `cinegen.singularity`, dimensionless: lengths are divided by the mechanism's characteristic
length, which makes them commensurable with angles. They are of the node's motions in `MapSpecification.counted`.
Every map also has `reachable`, `status` and `configuration`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.arrays import Array, Bools
from cinegen.workspace import loads
from cinegen.workspace.accuracy import accuracy
from cinegen.workspace.cells import UNBOUNDED, bounded

if TYPE_CHECKING:
    from cinegen.collision.clearance import Clearance
    from cinegen.workspace.cells import Cells
    from cinegen.workspace.specification import MapSpecification

Values = NDArray[Any]

_UNIT_LIMIT = 1.0  # rad/s, m/s, N m or N: of actuated joints whose speed or effort is not limited
_SINGULAR = 1e12  # condition numbers beyond are rounding
_NO_EFFORT = 1e-12  # N m or N for 1 N: less is rounding


def _actuated_singular_values(cells: Cells) -> Array:
    """Return the singular values (n, rank), largest first, of the node's motions by the actuated joints; NaN where
    these do not determine them."""
    spec, mechanism, done = cells.spec, cells.spec.mechanism, cells.evaluations
    if not mechanism.is_constrained and len(mechanism.actuated) == mechanism.model.nv:
        return done.singular_values[:, : spec.rank]
    matrices = cells.jacobians[:, : sum(spec.counted)]
    singular_values = np.full((len(matrices), min(matrices.shape[1:])), np.nan)
    determined = bounded(matrices)
    if determined.any():
        singular_values[determined] = np.linalg.svd(matrices[determined], compute_uv=False)
    return singular_values[:, : spec.rank]


def _condition(cells: Cells) -> Values:
    values = _actuated_singular_values(cells)
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.asarray(values[:, 0] / values[:, -1])
        unbounded = (np.abs(cells.jacobians) >= UNBOUNDED).any(axis=(1, 2))
    return np.where(unbounded | (condition > _SINGULAR), np.inf, condition)


def _margin(cells: Cells) -> Values:
    limits, q = cells.spec.mechanism.limits, cells.evaluations.q
    low, high = limits.lower, limits.upper
    limited = np.isfinite(low) & np.isfinite(high) & (high > low) & _moves_node(cells.spec)
    if not limited.any():
        return np.where(np.isfinite(q[:, 0]), 1.0, np.nan)
    q, low, high = q[:, limited], low[limited], high[limited]
    return np.asarray((np.minimum(q - low, high - q) / (0.5 * (high - low))).min(axis=1))


def _moves_node(spec: MapSpecification) -> Bools:
    """Return (nq,) true for joint variables on which the pose of the node depends: not for those of fingers."""
    mechanism = spec.mechanism
    model, system = mechanism.model, mechanism.structure.system
    ends = [model.frames[mechanism.frame_id(spec.node)].parentJoint]
    for first, _, second, _ in system.anchors:
        ends += [first, second]
    moves = np.zeros(model.nq, dtype=bool)
    for joint in {joint for end in ends for joint in model.supports[end] if joint > 0}:
        moves[model.joints[joint].idx_q : model.joints[joint].idx_q + model.joints[joint].nq] = True
    return moves


def _velocity(cells: Cells) -> Values:
    """Return (n,) the largest u . J w, m/s, for joint speeds w within their limits; NaN where J is undetermined.

    It is the largest component of the node's velocity along u: the node may translate sideways and rotate meanwhile.
    """
    return np.asarray(_projections(cells) @ _actuated(cells.spec, cells.spec.mechanism.limits.velocity))


def _force(cells: Cells) -> Values:
    """Return (n,) the largest force f, N, along u that efforts within their limits balance: |J^T u| f <= limits.

    It is infinite where the structure bears it alone, and NaN where J is undetermined.
    """
    efforts, limits = _projections(cells), _actuated(cells.spec, cells.spec.mechanism.limits.effort)
    with np.errstate(divide="ignore", invalid="ignore"):
        forces = np.where(efforts > _NO_EFFORT, limits / efforts, np.inf).min(axis=1)
    return np.where(np.isfinite(efforts).all(axis=1), forces, np.nan)


def _projections(cells: Cells) -> Array:
    """Return |J^T u| (n, actuated), u the specification's direction; NaN in each row where J is undetermined."""
    spec, mechanism, model = cells.spec, cells.spec.mechanism, cells.spec.mechanism.model
    jacobians = cells.evaluations.jacobians[:, :3]
    chain = model.supports[model.frames[mechanism.frame_id(spec.node)].parentJoint]
    moving = {model.names[joint] for joint in chain if joint > int(mechanism.floating)}
    if not mechanism.is_constrained and not moving <= set(mechanism.actuated):
        return np.full((len(jacobians), len(mechanism.actuated)), np.nan)
    along = cells.evaluations.placements[:, :3, :3].transpose(0, 2, 1) @ np.asarray(spec.along)  # in the node's axes
    with np.errstate(invalid="ignore"):
        projections = np.abs((jacobians.transpose(0, 2, 1) @ along[:, :, None])[:, :, 0])
    return np.where(cells.is_controlled[:, None], projections, np.nan)


def _actuated(spec: MapSpecification, limits: Array) -> Array:
    """Return the limits (actuated,) of the actuated joints among those of all (nv,); `_UNIT_LIMIT` where there is
    none."""
    columns = [spec.mechanism.v_index(name) for name in spec.mechanism.actuated]
    return np.where(np.isfinite(limits), limits, _UNIT_LIMIT)[columns]


def _clearance(cells: Cells) -> Values:
    clearance = _clearance_of(cells.spec)
    return np.array([clearance.least(q) if np.isfinite(q[0]) else np.nan for q in cells.evaluations.q])


@lru_cache(maxsize=2)
def _clearance_of(spec: MapSpecification) -> Clearance:
    """Return the obstacles, kept from chunk to chunk: shapes take time to load."""
    from cinegen.collision import clearance_of, scene_of

    assert spec.scene is not None
    return clearance_of(scene_of(dict(spec.scene), spec.folder, mechanism=spec.mechanism), is_exact=True)


class Quantity(NamedTuple):
    """A quantity of a map's cells.

    Attributes:
        unit: "1" if dimensionless.
        description: its definition.
        values: function that returns the values (n,) of cells.
        dtype: type of the stored values.
    """

    unit: str
    description: str
    values: Callable[[Cells], Values | None]
    dtype: str = "float32"

    def of(self, cells: Cells) -> Values:
        """Return the values (n,) of cells, as they are stored."""
        return np.asarray(self.values(cells), dtype=self.dtype)


QUANTITIES = {
    "solutions": Quantity("1", "inverse solutions; over actuated joints, assembly modes",
                          lambda cells: cells.solutions, "int32"),
    "sigma_1": Quantity("1", "smallest singular value of type 1: the node loses a degree of freedom at 0",
                        lambda cells: cells.evaluations.singular_values[:, cells.spec.rank - 1]),
    "sigma_2": Quantity("1", "smallest singular value of type 2: the node is not controlled at 0",
                        lambda cells: cells.evaluations.passive_sigma),
    "condition": Quantity("1", "condition number of the node's motions by the actuated joints, 1 at best", _condition),
    "manipulability": Quantity("1", "Yoshikawa's manipulability: product of all singular values",
                               lambda cells: np.prod(_actuated_singular_values(cells), axis=1)),
    "margin": Quantity("1", "joint-limit margin: 1 in the middle of all ranges, 0 at a limit", _margin),
    "velocity": Quantity("m s-1", "largest component of the node's velocity along the direction", _velocity),
    "force": Quantity("N", "largest force of the node along the direction", _force),
    "torque": Quantity("1", "largest torque or force of an actuated joint at rest under gravity, relative to its limit",
                       loads.torque),
    "payload": Quantity("kg", "largest mass at the node's origin that the actuated joints hold at rest", loads.payload),
    "payload_any": Quantity("kg", "largest mass at the node's origin that the actuated joints hold at rest in whatever "
                            "direction gravity acts", loads.payload_any),
    "reaction_force": Quantity("N", "force in the joint at rest under gravity", loads.reaction_force),
    "reaction_moment": Quantity("N m", "moment in the joint at rest under gravity", loads.reaction_moment),
    "stiffness": Quantity("N m-1", "smallest force on the node by its displacement, in any direction",
                          loads.stiffness),
    "rotational_stiffness": Quantity("N m rad-1", "smallest moment on the node by its rotation, about any axis",
                                     loads.rotational_stiffness),
    "frequency": Quantity("Hz", "lowest natural frequency, actuated joints elastic", loads.frequency),
    "accuracy": Quantity("m", "root mean square error of the node's position by the tolerances, 1 sigma", accuracy),
    "solid_angle": Quantity("sr", "possible directions of the node's z axis (dexterous solid angle)",
                            lambda cells: cells.solid_angle),
    "clearance": Quantity("m", "smallest distance to obstacles and between links", _clearance),
}  # fmt: skip
"""All quantities by name."""

DIRECTED = frozenset({"velocity", "force"})
"""Quantities along a direction."""
