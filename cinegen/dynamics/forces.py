"""`forces`: what the actuated joints must give, what the joints must bear, and which of it statics determines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.dynamics import plain
from cinegen.dynamics.inverse_dynamics import InverseDynamics
from cinegen.dynamics.loads import LoadedTree, Payload
from cinegen.dynamics.rates import Motion
from cinegen.dynamics.reactions import Reaction, coupling_torques, reactions
from cinegen.errors import UnknownNameError
from cinegen.html import table
from cinegen.ik.singular_values import passive_singular_values
from cinegen.jit.one_thread import in_one_thread
from cinegen.model import Mechanism
from cinegen.singularities import Singularity, SingularityType, singularity
from cinegen.singularities.singularity import SINGULAR
from cinegen.tolerances import NEAR_SINGULAR
from cinegen.typed_json import as_json
from raff2urdf.errors import counted

_MOVES = 0.1
"""A joint whose part in a motion is larger, as a fraction of the largest, is named."""


@dataclass(frozen=True, eq=False, repr=False)
class Forces:
    """The forces in a mechanism at a configuration and motion.

    Attributes:
        mechanism: as given.
        q: (nq,) configuration.
        v: (nv,) velocity.
        a: (nv,) acceleration.
        gravity: (3,) acceleration, m/s^2, in the world.
        torques: (actuated,) of the actuated joints, N m and N, in the order of `mechanism.actuated`: the shortest ones
            where actuation is redundant (forces are compared with torques by the characteristic length); NaN if none
            hold the load.
        band: (actuated,) by how much these may differ either way, N m and N, since Coulomb friction of joints at rest
            is undetermined; NaN likewise.
        resting: the joints with Coulomb friction that are at rest: it takes any value up to its limit, and none counts.
        prestress: (k, actuated) independent torques, N m and N, that do no work on any motion of the mechanism: any
            multiple may be added to `torques`, and only stresses the mechanism. Each is of length 1 once forces are
            multiplied by the characteristic length.
        reactions: of all joints, then of all loops, for these torques.
        couplings: torque (N m) or force (N) of each coupling on each of its joints; NaN where undetermined.
        uncontrolled: (k, nv) independent motions, m and rad, with all actuated joints locked.
        redundant: number of loop and coupling equations that depend on others.
        singular_value: smallest singular value of the passive joints, dimensionless (type 2); infinite without any.
        singularity: the analysis of the singularity that is near, or of what no torques hold; else None.
        notes: what the file gives and these forces leave out, such as springs.
    """

    mechanism: Mechanism
    q: Array
    v: Array
    a: Array
    gravity: Array
    torques: Array
    band: Array
    resting: tuple[str, ...]
    prestress: Array
    reactions: tuple[Reaction, ...]
    couplings: dict[str, dict[str, float]]
    uncontrolled: Array
    redundant: int
    singular_value: float
    singularity: Singularity | None
    notes: tuple[str, ...]

    @property
    def is_held(self) -> bool:
        """True if some torques of the actuated joints hold the load."""
        return bool(np.isfinite(self.torques).all())

    @property
    def power(self) -> float:
        """Mechanical power of all actuated joints, W."""
        return float(self.torques @ self.v[plain.actuated_columns(self.mechanism)])

    @property
    def used(self) -> Array:
        """(actuated,) torques as a fraction of the effort limits; 0 for joints without one."""
        return np.asarray(np.abs(self.torques) / self.mechanism.limits.effort[plain.actuated_columns(self.mechanism)])

    @cached_property
    def undetermined(self) -> tuple[str, ...]:
        """Names of the joints, loops and couplings of whose reactions statics does not determine all components."""
        free = [name for name, parts in self.couplings.items() if self.is_held and np.isnan(list(parts.values())).any()]
        return (*(reaction.name for reaction in self.reactions if reaction.stresses.any()), *free)

    def __repr__(self) -> str:
        return f"<Forces in {self.mechanism.name[:60]}: {self.message[:200]}>"

    def _repr_html_(self) -> str:
        rows = [
            [name, *(f"{x:.4g}" for x in pair), self.unit_of(name)]
            for name, *pair in zip(self.mechanism.actuated, self.torques, self.used, strict=True)
        ]
        return table(self.message, ("actuated joint", "torque or force", "part of its limit", "unit"), rows)

    def reaction(self, name: str) -> Reaction:
        """Return the reaction of a joint or loop.

        Raises:
            UnknownNameError: there is none of that name.
        """
        by_name = {reaction.name: reaction for reaction in self.reactions}
        if name not in by_name:
            raise UnknownNameError("joint or loop", name, tuple(by_name))
        return by_name[name]

    def unit_of(self, joint: str) -> str:
        """Return "N" for a prismatic joint, else "N m"."""
        return "N" if self.mechanism.is_prismatic(joint) else "N m"

    @property
    def message(self) -> str:
        """The finding, but for the numbers, as a text."""
        parts = [self._holding]
        if self.mechanism.floating and self.is_held:
            force, moment = np.linalg.norm(self.reactions[0].wrench.reshape(2, 3), axis=1)
            parts.append(
                f"the base floats: a force of {force:.4g} N and a moment of {moment:.4g} N m hold it, which no "
                "actuated joint gives"
            )
        if len(self.prestress) and self.is_held:
            more = f"{counted(len(self.prestress), 'independent combination')} of torques"
            does = "do" if len(self.prestress) > 1 else "does"
            parts.append(
                f"actuation is redundant: {more} {does} no work and only stress{'es' * (len(self.prestress) == 1)} the "
                "mechanism (pre-stress); the torques are the shortest that hold the load"
            )
        if self.resting:
            are, its = ("is", "its") if len(self.resting) == 1 else ("are", "their")
            parts.append(
                f"{', '.join(self.resting)} {are} at rest: {its} Coulomb friction is undetermined and left out, and "
                "changes each torque by its band at most, either way"
            )
        if self.undetermined:
            parts.append(
                f"the mechanism is over-constrained: {self.redundant} of its {self.mechanism.structure.system.rows} "
                "equations of loops and couplings depend on the others, and statics does not determine all reactions "
                f"of {len(self.undetermined)} joints, loops and couplings: they depend on "
                "elasticity and on errors of manufacture"
            )
        return "; ".join(parts)

    @property
    def _holding(self) -> str:
        if self.singularity is None:
            return f"{'the actuated joints' if self.mechanism.actuated else 'its bodies'} hold the load"
        near, value = self.singularity, f"smallest singular value {self.singular_value:.2g}"
        moves, is_at = near.uncontrolled, not self.is_held or self.singular_value <= SINGULAR
        can, cannot = ("can", "can't") if is_at else ("can nearly", "can hardly")
        if not moves.order or near.near in (SingularityType.NONE, SingularityType.TYPE_1):
            motions = self.uncontrolled if len(self.uncontrolled) else near.motions
            motion = np.abs(motions).max(axis=0, initial=0.0) / self.mechanism.scale
            names = [name for name, x in zip(self.mechanism.columns, motion, strict=True) if x > _MOVES * motion.max()]
            why = f"{', '.join(names)} {can} move with all actuated joints locked"
        else:
            why = (
                f"with all actuated joints locked {near.node} {can} make {moves.text()}, and these joints "
                f"{cannot} support "
                f"{near.unsupported.text() if moves.order == 1 else moves.complement_text()}"
            )
        if self.is_held:
            where = "at" if is_at else "near"
            return f"the actuated joints hold the load, but {where} a type 2 singularity ({value}): {why}"
        return f"no torques of the actuated joints hold the load: {why} ({value})"

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: N, N m, W, m and rad; null for what is not determined."""
        names, limits = self.mechanism.actuated, self.mechanism.limits
        return as_json(
            self, "message", "gravity", "power", "resting", "prestress", "couplings", "undetermined", "singular_value",
            held=self.is_held,
            torques=[
                {"joint": name, "value": torque, "band": band, "unit": self.unit_of(name),
                 "limit": limits[name].effort, "part_of_limit": part}
                for name, torque, band, part in zip(names, self.torques, self.band, self.used, strict=True)
            ],
            reactions=[reaction.as_dict() for reaction in self.reactions],
            redundant_equations=self.redundant, notes=self.notes,
        )  # fmt: skip


def forces(
    mechanism: Mechanism,
    q: ArrayLike,
    v: Motion | None = None,
    a: Motion | None = None,
    payloads: Sequence[Payload] = (),
    gravity: ArrayLike | None = None,
    node: str | None = None,
    massless: bool = False,
) -> Forces:
    """Return the forces in a mechanism: torques of its actuated joints, reactions of its joints, and what of that is
    determined. For many configurations, or in a control loop, see `InverseDynamics`.

    Args:
        mechanism: any.
        q: (nq,) loops closed.
        v: (nv,) velocity, or that of actuated joints by name; 0 unless given.
        a: acceleration, likewise.
        payloads: bodies on nodes, and wrenches on them.
        gravity: (3,) acceleration, m/s^2, in the world; the mechanism's if None.
        node: by whose motion singularities are described; the mechanism's end by default.
        massless: whether links without mass count as having none.

    Raises:
        ConfigurationError: q, v or a is no array of that shape.
        ClosureError: loops are open at q.
        MotionError: v or a open loops, or those of actuated joints contradict each other.
        MassError: links have no mass where one is needed, or an inertia that no body can have.
        UnknownNameError: no such node or actuated joint.
        PayloadError: gravity is no acceleration.
    """
    return forces_at(InverseDynamics(mechanism, payloads, gravity, massless), q, v, a, node)


@in_one_thread
def forces_at(
    dynamics: InverseDynamics, q: ArrayLike, v: Motion | None = None, a: Motion | None = None, node: str | None = None
) -> Forces:
    """Return the forces at a configuration, as `forces` does."""
    mechanism, tree = dynamics.mechanism, dynamics.tree
    name = mechanism.end if node is None else node
    mechanism.frame_id(name)
    checked = mechanism.structure.checked(q)
    dynamics.check_closed(checked)
    if v is not None or a is not None:
        tree.check_masses(dynamics.counts_massless)
    all_v, all_a = dynamics.motion(checked, v, a)
    balance = plain.balance(tree, checked, all_v, all_a)
    columns = plain.actuated_columns(mechanism)
    torques = balance.efforts / tree.step[columns] if balance.is_held else np.full(len(columns), np.nan)
    resting, band = _at_rest(tree, balance, all_v)
    values = passive_singular_values(mechanism, checked) if mechanism.structure.passive_rank else np.zeros(0)
    least = float(values[-1]) if len(values) else np.inf
    is_near = least <= NEAR_SINGULAR or not balance.is_held
    uncontrolled = np.zeros((len(balance.motions.uncontrolled), mechanism.model.nv))
    uncontrolled[:, plain.columns_of(mechanism)] = balance.motions.uncontrolled
    return Forces(
        mechanism, checked.copy(), all_v, all_a, tree.gravity, torques, band, resting,
        balance.motions.prestress / tree.step[columns], reactions(tree, balance), coupling_torques(tree, balance),
        uncontrolled * mechanism.scale, balance.motions.stresses.shape[1], least,
        singularity(mechanism, checked, name) if is_near else None, dynamics.notes,
    )  # fmt: skip


def _at_rest(tree: LoadedTree, balance: plain.Balance, v: Array) -> tuple[tuple[str, ...], Array]:
    """Return the joints at rest with Coulomb friction, and the band (actuated,) of the torques: see `Forces`."""
    mechanism, moving = tree.mechanism, plain.columns_of(tree.mechanism)
    sizes = np.where(tree.moves(v), 0.0, tree.model.upperDryFrictionLimit) * mechanism.scale
    step = tree.step[plain.actuated_columns(mechanism)]
    band = np.zeros(len(step)) if balance.is_held else np.full(len(step), np.nan)
    for size, row in zip(sizes[moving], balance.motions.basis, strict=True):
        band += np.abs(balance.motions.efforts(size * row)) / step if size else 0.0
    return tuple(name for name, size in zip(mechanism.columns, sizes, strict=True) if size), band
