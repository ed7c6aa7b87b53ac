"""`Structure`: what algorithms need of a mechanism: its loops as equations, ranks, sample configurations."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike, Indices
from cinegen.errors import ConfigurationError
from cinegen.joints import scalar_joints
from cinegen.loops.close import Closer
from cinegen.loops.closed_loops import ClosedLoops, linked
from cinegen.loops.held_loops import HeldLoops
from cinegen.loops.idle import idle_motions, idle_spins
from cinegen.loops.screws import LoopScrews
from raff2urdf import closure
from raff2urdf.loops.idle import Spin

if TYPE_CHECKING:
    from cinegen.model.mechanism import Mechanism

_Result = TypeVar("_Result")

_MOST_MASKS = 64  # sets of locked joints whose columns are kept


class Structure:
    """The equations of a mechanism, and what is computed from it once. Serves several threads at once.

    Args:
        mechanism: whose structure it is: `mechanism.structure`.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._scratch = threading.local()
        self._masks = dict[tuple[str, ...], Array]()
        self._derived: dict[Callable[[Mechanism], Any], Any] = {}

    def __repr__(self) -> str:
        return f"<Structure of {self.mechanism!r}>"

    # --- loops -------------------------------------------------------------------------------------------------------

    @property
    def system(self) -> ClosedLoops:
        """The loops as equations, with scratch data of this thread's own."""
        system: ClosedLoops | None = getattr(self._scratch, "system", None)
        if system is None:
            system = self._scratch.system = self.own_system()
        return system

    def own_system(self) -> ClosedLoops:
        """Return the loops as equations, with scratch data of the caller's own."""
        whole = self.mechanism
        loops = whole.model, whole.loops, whole.length, whole.couplings
        return HeldLoops(*loops, self.held_columns, self.held_at) if whole.held else ClosedLoops(*loops)

    @property
    def closer(self) -> Closer:
        """The compiled algorithm of `Mechanism.close`, with scratch data of this thread's own."""
        closer: Closer | None = getattr(self._scratch, "closer", None)
        if closer is None:
            closer = self._scratch.closer = Closer(self.own_system(), self.mechanism.cluster_ranks)
        return closer

    def mask(self, names: tuple[str, ...]) -> Array:
        """Return (nv,) 1 for the columns of some joints, else 0.

        Raises:
            UnknownNameError: no such joint.
        """
        mask = self._masks.get(names)
        if mask is None:
            mask = np.zeros(self.mechanism.model.nv)
            mask[[column for name in names for column in self.mechanism.columns_of(name)]] = 1.0
            if len(self._masks) < _MOST_MASKS:
                self._masks[names] = mask
        return mask

    @cached_property
    def screws(self) -> LoopScrews:
        """The data with which `Mechanism.screw_matrix` is computed."""
        return LoopScrews(self.own_system(), self.held_at, self.passive_columns)

    @cached_property
    def held_columns(self) -> list[int]:
        """The columns of the joints that are `held`, in a Jacobian."""
        return sorted(column for joint in self.mechanism.held for column in self.mechanism.columns_of(joint))

    @property
    def held_at(self) -> Array:
        """(nq,) a closed configuration in which the locked joints are where they are locked; home without any."""
        return self.mechanism.q_home if self.mechanism.held_q is None else self.mechanism.held_q

    # --- generic properties ------------------------------------------------------------------------------------------

    @cached_property
    def samples(self) -> tuple[Array, ...]:
        """A few closed configurations (nq,), home first: what holds on one of them holds generically."""
        return (self.held_at, *self.mechanism.random_closed(3))

    @cached_property
    def passive_columns(self) -> Indices:
        """The columns of the passive joints (not actuated, not held) in a Jacobian; never those of a free base."""
        whole = self.mechanism
        known = {*whole.actuated, *whole.held}
        passive = [name for name in (*whole.joints, *whole.balls) if name not in known]
        return np.array([column for name in passive for column in whole.columns_of(name)], dtype=np.intp)

    @cached_property
    def passive_rank(self) -> int:
        """The generic rank of these columns of the loops' Jacobian, with couplings as in `passive_matrix`: their number
        unless there are joints that neither actuated joints nor loops determine."""
        if not self.mechanism.is_constrained:
            return 0
        rows = (self.screws.passive_rows(self.system.evaluate(q)[1]) for q in self.samples)
        return max(closure.rank(jacobian[:, self.passive_columns]) for jacobian in rows)

    @cached_property
    def idle(self) -> tuple[Spin, ...]:
        """Idle motions: spins of rods about themselves, which move nothing else (`raff2urdf.loops.idle`)."""
        whole = self.mechanism
        return tuple(idle_spins(self.system, self.samples, (*whole.actuated, *whole.held)))

    @property
    def idle_nodes(self) -> list[list[str]]:
        """The nodes that each idle motion turns about themselves."""
        model = self.mechanism.model
        carrier = {node: int(model.frames[self.mechanism.frame_id(node)].parentJoint) for node in self.mechanism.nodes}
        return [[node for node, joint in carrier.items() if joint in spin.bodies] for spin in self.idle]

    def idle_motions(self, q: Array) -> Array:
        """Return the idle motions (n, nv) at q (nq,), as dimensionless steps of length 1."""
        return idle_motions(self.system, self.idle, q)

    @cached_property
    def idle_joints(self) -> tuple[str, ...]:
        """For each idle motion a joint of one number that takes the largest part in it: locked, it holds the rod. Of a
        ball joint of one piece the ball joint, one of whose axes does."""
        if self.mechanism.spherical is not None:
            return self.mechanism.spherical.merged(self.mechanism.successive.structure.idle_joints)
        joints = {self.mechanism.v_index(name): name for name in self.mechanism.joints}
        at = sorted(joints)
        most = np.abs(self.idle_motions(self.samples[-1])[:, at]).argmax(axis=1) if at else []
        return tuple(joints[at[i]] for i in most)

    @cached_property
    def uncontrolled_dof(self) -> int:
        """Number of independent motions with all actuated joints locked; idle ones don't count."""
        return len(self.passive_columns) - self.passive_rank - len(self.idle)

    def passive_matrix(self, q: Array, system: ClosedLoops | None = None) -> Array:
        """Return the columns of the passive joints in the screw matrix (`LoopScrews.passive_matrix`), singular at type
        2; arguments as of `Mechanism.screw_matrix`."""
        system = self.system if system is None else system
        return self.screws.passive_matrix(system, system.evaluate(q)[1])

    @cached_property
    def scalar_joints(self) -> tuple[Indices, Indices]:
        """Indices in q and in v of the joints that are one number each: all but a free base."""
        return scalar_joints(self.mechanism.model)

    def derived(self, compute: Callable[[Mechanism], _Result]) -> _Result:
        """Return what a function computes from this mechanism; it is computed once and kept with the mechanism."""
        if compute not in self._derived:
            self._derived.setdefault(compute, compute(self.mechanism))
        result: _Result = self._derived[compute]
        return result

    # --- configurations ----------------------------------------------------------------------------------------------

    def checked(self, q: ArrayLike) -> Array:
        """Return q as an array (nq,) of finite numbers.

        Raises:
            ConfigurationError: it has another shape, or a number that is not finite.
        """
        full, nq, name = np.asarray(q, dtype=float), self.mechanism.model.nq, self.mechanism.name
        if full.shape != (nq,):
            raise ConfigurationError(f"a configuration of {name} has {nq} numbers, not {full.shape}")
        if not np.isfinite(full).all():
            raise ConfigurationError(f"a configuration of {name} has numbers that are not finite")
        return full

    def normalized(self, q: Array) -> Array:
        """Return q (nq,) with the quaternions of ball joints of length 1."""
        return np.asarray(pin.normalize(self.mechanism.model, q)) if self.mechanism.balls else q

    def with_locked(self, values: Mapping[str, float], *unaffected: Callable[[Mechanism], Any]) -> Mechanism:
        """Return the same mechanism with some joints locked: both of their limits are the same value. Loops and
        couplings that no other joint moves are left out.

        Args:
            values: joint name -> value, rad or m; loops and couplings that are left out are closed there.
            unaffected: functions whose results (see `derived`) do not depend on limits: they are kept.

        Raises:
            UnknownNameError: no such joint.
        """
        whole = self.mechanism
        model = pin.Model(whole.model)
        at = [whole.q_index(name) for name in values]
        for limit in ("lowerPositionLimit", "upperPositionLimit"):
            limits = np.array(getattr(model, limit))
            limits[at] = list(values.values())
            setattr(model, limit, limits)
        locked = {whole.v_index(name) for name in values}
        groups = zip(linked(self.system.columns), whole.cluster_ranks, strict=True)
        left = [(members, rank) for (members, columns), rank in groups if not locked.issuperset(columns.tolist())]
        kept = {i for members, _ in left for i in members}
        mechanism = replace(
            whole,
            model=model,
            loops=tuple(loop for i, loop in enumerate(whole.loops) if i in kept),
            couplings=tuple(coupling for i, coupling in enumerate(whole.couplings, len(whole.loops)) if i in kept),
            cluster_ranks=tuple(rank for _, rank in left),
        )
        mechanism.structure._derived.update({compute: self.derived(compute) for compute in unaffected})
        return mechanism
