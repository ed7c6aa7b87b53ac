"""`InverseDynamics`: the torques that actuated joints must give, for one configuration or many."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike, Bools
from cinegen.dynamics import plain
from cinegen.dynamics._kernels.masses import find_masses
from cinegen.dynamics._kernels.memory import DynamicsMemory
from cinegen.dynamics._kernels.torques import HELD, OPEN, find_torques
from cinegen.dynamics.errors import MotionError
from cinegen.dynamics.loads import LoadedTree, Payload
from cinegen.dynamics.rates import CONSISTENT, Motion, check_gaps, joint_rates, rates_of, rows_of
from cinegen.dynamics.reactions import Reaction, axes_of_reaction, reactions
from cinegen.dynamics.setup import load, memory_of
from cinegen.errors import CinegenError, ClosureError, ConfigurationError, UnknownNameError
from cinegen.jit.compiled import prepare
from cinegen.jit.one_thread import OneThread, in_one_thread
from cinegen.jit.starting import start
from cinegen.model import Mechanism
from cinegen.tolerances import CLOSURE
from raff2urdf.readers.uncounted import is_uncounted, note_of


class InverseDynamics(OneThread):
    """Inverse dynamics of a mechanism, with or without loops.

    For one thread at a time: another one that asks meanwhile gets a `CinegenError`. The mechanism may be shared.

    A floating base moves as v and a prescribe, whatever force that takes.

    Args:
        mechanism: any; its model has the masses of its links.
        payloads: bodies on nodes, and wrenches.
        gravity: (3,) acceleration, m/s^2, in the world; the mechanism's if None.
        massless: whether links without mass count as having none; else they are refused where masses are needed.
        friction: whether the friction of joints counts. Coulomb friction of a joint at rest is undetermined, and left
            out: see `Forces.band`.

    Attributes:
        mechanism: as given.
        tree: its tree, with the loads.

    Raises:
        UnknownNameError: no such node.
        PayloadError: gravity is no acceleration.
        MassError: there is gravity, and links have no mass, or an inertia that no body can have.
        CinegenError: an actuated joint has more than one variable.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        payloads: Sequence[Payload] = (),
        gravity: ArrayLike | None = None,
        massless: bool = False,
        friction: bool = True,
    ) -> None:
        self.mechanism, self.tree = mechanism, LoadedTree(mechanism, payloads, gravity, friction)
        self.counts_massless, self._counts_friction = massless, friction
        for name in mechanism.actuated:
            if mechanism.model.joints[mechanism.model.getJointId(name)].nv != 1:
                raise CinegenError(
                    f"joint '{name}' of {mechanism.name} has more than one variable: its torque can't be computed"
                )
        if self.tree.gravity.any():
            self.tree.check_masses(massless)
        self._names = {name: mechanism.v_index(name) for name in mechanism.actuated}
        self._rest = np.zeros(mechanism.model.nv)
        self._undetermined = dict[str, Bools]()
        self._memory, self._many = memory_of(self.tree), memory_of(self.tree)
        self._single = {
            name: np.zeros(self._memory.shape(name), self._memory.fields[name].dtype)
            for name, field in self._memory.fields.items()
            if field.is_foreign
        }
        for name, values in self._single.items():
            self._memory.point_at(name, values)
        self._is_compiled = not self._memory.others and bool(mechanism.model.nv)
        self._find: Callable[[int], None] = start(
            find_torques, DynamicsMemory, install=partial(setattr, self, "_find")
        )  # fmt: skip

    @in_one_thread
    def set_loads(self, payloads: Sequence[Payload] = (), gravity: ArrayLike | None = None) -> None:
        """Replace the payloads and gravity, as in the constructor; in 0.1 ms, where a new object takes 3.

        Raises:
            UnknownNameError, PayloadError, MassError: as the constructor; then the loads stay.
        """
        tree = LoadedTree(self.mechanism, payloads, gravity, self._counts_friction)
        if tree.gravity.any():
            tree.check_masses(self.counts_massless)
        self.tree = tree
        for memory in (self._memory, self._many):
            load(memory, tree)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on what forces leave out: of the mechanism's file, such as springs, and unknown masses."""
        unknown = note_of({"masses": self.tree.lacking if self.counts_massless else ()})
        return (*filter(is_uncounted, self.mechanism.source.notes), *unknown)

    @property
    def notes_at_rest(self) -> tuple[str, ...]:
        """The same notes, and one on Coulomb friction, which forces at rest leave out."""
        rubbing = np.flatnonzero(self.tree.model.upperDryFrictionLimit).tolist()
        return (*self.notes, *note_of({"Coulomb friction at rest": [self.mechanism.columns[k] for k in rubbing]}))

    def __repr__(self) -> str:
        carried = f", {len(self.tree.payloads)} payloads" if self.tree.payloads else ""
        return f"<InverseDynamics of {self.mechanism.name[:60]}{carried}>"

    @in_one_thread
    def torques(self, q: ArrayLike, v: Motion | None = None, a: Motion | None = None) -> Array:
        """Return the torques and forces (actuated,) of the actuated joints, N m and N, in the order of
        `mechanism.actuated`: the shortest ones where actuation is redundant, NaN where none hold the load.

        Forces are compared with torques by the characteristic length. `forces` explains the result.

        Args:
            q: (nq,) loops closed.
            v: (nv,) velocity, or that of actuated joints by name; 0 unless given.
            a: acceleration, likewise.

        Raises:
            ConfigurationError: q, v or a is no array of that shape.
            ClosureError: loops are open at q.
            MotionError: v or a open loops, or those of actuated joints contradict each other.
            MassError: links have no mass, and there are velocities or accelerations.
            UnknownNameError: no such actuated joint.
        """
        full = self.mechanism.structure.checked(q)
        all_v, all_a, completes = self._motion(v, a)
        memory, single = self._memory, self._single
        if self._is_compiled:
            memory.moves, memory.completes = int(all_v is not None), int(completes)
            single["given_q"][0] = full
            if all_v is not None and all_a is not None:
                single["given_v"][0], single["given_a"][0] = all_v, all_a
            self._find(memory.handle)
            status = int(single["statuses"][0])
            if status == HELD:
                check_gaps(self.mechanism, single["gaps"][0], completes)
                return np.array(single["torques"][0])
            if status == OPEN:
                raise self.open_loops(single["gaps"][0, 0])
        return self._plain(full, all_v, all_a, completes)[0]

    def torques_of(
        self, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None, actuated: bool = False
    ) -> Array:
        """Return the torques and forces (count, actuated) at many configurations, as `torques` does; NaN where loops
        are open, too.

        Args:
            q: (count, nq).
            v: (count, nv) velocities; 0 unless given.
            a: (count, nv) accelerations; 0 unless given.
            actuated: whether v and a are (count, actuated), those of the actuated joints alone.

        Raises:
            ConfigurationError: q, v or a has a wrong shape, or numbers that are not finite.
            MotionError: v or a open loops somewhere, or contradict each other.
            MassError: links have no mass, and there are velocities or accelerations.
        """
        return self._at_many(q, v, a, actuated, None)[0]

    def reactions_of(
        self, name: str, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None, actuated: bool = False
    ) -> Array:
        """Return the reactions (count, 6) of a joint or loop at many configurations, as `forces` does: force (N), then
        moment (N m), in the same frames. They are NaN where no torques hold the load or loops are open, and in the
        components that statics does not determine in nearly all configurations (`undetermined_of`).

        Args:
            name: of the joint or loop.
            q, v, a, actuated: as `torques_of` takes them.

        Raises:
            UnknownNameError: there is none of that name.
            ConfigurationError, MotionError, MassError: as `torques_of`.
        """
        unknown = self.undetermined_of(name)
        _, wrenches = self._at_many(q, v, a, actuated, name)
        wrenches[:, unknown] = np.nan
        return wrenches

    @in_one_thread
    def undetermined_of(self, name: str) -> Bools:
        """Return (6,) true for the components of the reaction of a joint or loop that statics does not determine in
        nearly all configurations: in one of `Structure.samples` at least.

        Raises:
            UnknownNameError: there is none of that name.
        """
        if name not in self._undetermined:
            unknown = np.zeros(6, dtype=bool)
            for q in (self.mechanism.q_home, *self.mechanism.structure.samples):
                unknown |= self._reaction(name, self.balance(q, self._rest, self._rest)).stresses.any(axis=1)
            self._undetermined[name] = unknown
        return self._undetermined[name]

    def _reaction(self, name: str, balance: plain.Balance) -> Reaction:
        """Return the reaction of a joint or loop for a balance, the last one that was computed."""
        every = {reaction.name: reaction for reaction in reactions(self.tree, balance)}
        if name not in every:
            raise UnknownNameError("joint or loop", name, tuple(every))
        return every[name]

    @in_one_thread
    def _at_many(
        self, q: ArrayLike, v: ArrayLike | None, a: ArrayLike | None, actuated: bool, name: str | None
    ) -> tuple[Array, Array]:
        """Return the torques (count, actuated) and, of the joint or loop of that name, the reactions (count, 6)."""
        configurations = rows_of(self.mechanism, "q", q, self.mechanism.model.nq)
        count = len(configurations)
        torques, reaction = np.full((count, len(self._names)), np.nan), np.full((count, 6), np.nan)
        moves = v is not None or a is not None
        if moves:
            self._need_masses()
        all_v, all_a = (rates_of(self.mechanism, what, rows, count, actuated) for what, rows in (("v", v), ("a", a)))
        completes = actuated and moves
        results, gaps = np.full(count, -1), np.zeros((count, 3))
        if self._is_compiled and count:
            memory = self._many
            memory.count, memory.moves, memory.completes = count, int(moves), int(completes)
            arrays = {
                "given_q": configurations, "given_v": all_v, "given_a": all_a,
                "torques": torques, "statuses": results, "gaps": gaps, "reaction": reaction,
            }  # fmt: skip
            for field, values in arrays.items():
                memory.point_at(field, values)
            joint = self._ask(name)
            self._find(memory.handle)
            if joint:
                turned = axes_of_reaction(self.tree.model, joint)
                reaction[:] = (reaction.reshape(-1, 2, 3) @ turned).reshape(-1, 6)
        for i in np.flatnonzero((results != HELD) & (results != OPEN)).tolist():
            if self.mechanism.closure(configurations[i]) <= CLOSURE:
                v_i, a_i = (all_v[i], all_a[i]) if moves else (None, None)
                torques[i], balance = self._plain(configurations[i], v_i, a_i, completes)
                if name is not None:
                    reaction[i] = self._reaction(name, balance).wrench
        for i in np.flatnonzero((results == HELD) & (gaps[:, 1:].max(axis=1) > CONSISTENT)).tolist():
            check_gaps(self.mechanism, gaps[i], completes)
        return torques, reaction

    def _ask(self, name: str | None) -> int:
        """Ask the kernel for the reaction of a joint or loop, or of none; return the joint's number, 0 for a loop."""
        memory, model, system = self._many, self.tree.model, self.mechanism.structure.system
        loops = [loop.name for loop in system.loops]
        memory.asked_loop = loops.index(name) if name in loops else -1
        joint = 0 if name is None or memory.asked_loop >= 0 else int(model.getJointId(name))
        memory.asked_joint = joint
        if joint:
            for i, (first, _, second, _) in enumerate(system.anchors):
                memory.passed_on[i] = float(joint in model.supports[first]) - float(joint in model.supports[second])
        return joint

    @in_one_thread
    def motion(self, q: ArrayLike, v: Motion | None = None, a: Motion | None = None) -> tuple[Array, Array]:
        """Return the velocity and the acceleration (nv,) of all joints of the closed mechanism, given those of all or
        of the actuated ones, as `torques` takes them.

        Raises:
            ConfigurationError, ClosureError, MotionError, UnknownNameError: as `torques`.
        """
        full = self.mechanism.structure.checked(q)
        all_v, all_a, completes = self._motion(v, a, needs_masses=False)
        if all_v is None or all_a is None:
            return self._rest.copy(), self._rest.copy()
        self.check_closed(full)
        motions = plain.motions_at(self.tree, full)
        return self._closed_motion(full, all_v, all_a, completes, motions)

    @in_one_thread
    def balance(self, q: Array, v: Array, a: Array) -> plain.Balance:
        """Return the balance in plain numpy, for v and a (nv,) that keep the loops closed (see `motion`)."""
        return plain.balance(self.tree, q, v, a)

    @in_one_thread
    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return the inertia (actuated, actuated) seen at the actuated joints, kg m^2, kg m and kg: the torques that
        accelerate the closed mechanism from rest, by the accelerations of its actuated joints.

        Raises:
            ConfigurationError: q is no configuration.
            ClosureError: loops are open at q.
            MotionError: the actuated joints do not determine the motion at q, or depend on each other.
            MassError: links have no mass.
        """
        full = self.mechanism.structure.checked(q)
        self.check_closed(full)
        self._need_masses()
        motions, columns = plain.motions_at(self.tree, full), plain.actuated_columns(self.mechanism)
        count, mobility = motions.actuated.shape
        if len(motions.uncontrolled) or count != mobility:
            more = "do not determine the motion" if len(motions.uncontrolled) else "depend on each other"
            raise MotionError(f"{self.mechanism.name}: the actuated joints {more} there: they have no mass matrix")
        moving = plain.columns_of(self.mechanism)
        tree = pin.crba(self.tree.model, self.tree.data, full)
        scaled = motions.basis * self.mechanism.scale[moving, None]
        by_joint = scaled @ np.linalg.inv(motions.actuated) / self.tree.step[columns]
        full_matrix = np.triu(tree) + np.triu(tree, 1).T
        return np.asarray(by_joint.T @ full_matrix[moving, moving] @ by_joint)

    @in_one_thread
    def mass_matrices_of(self, q: ArrayLike) -> Array:
        """Return the inertias (count, actuated, actuated) at many configurations (count, nq), as `mass_matrix` does;
        NaN where loops are open.

        Raises:
            ConfigurationError: q has a wrong shape, or numbers that are not finite.
            MotionError, MassError: as `mass_matrix`.
        """
        configurations = rows_of(self.mechanism, "q", q, self.mechanism.model.nq)
        self._need_masses()
        count, size = len(configurations), len(self._names)
        masses, results = np.full((count, size, size), np.nan), np.full(count, -1)
        if self._is_compiled and count:
            memory = self._many
            memory.count = count
            for field, values in {"given_q": configurations, "masses": masses, "statuses": results}.items():
                memory.point_at(field, values)
            prepare(find_masses, DynamicsMemory)(memory.handle)
        for i in np.flatnonzero((results != HELD) & (results != OPEN)).tolist():
            if self.mechanism.closure(configurations[i]) <= CLOSURE:
                masses[i] = self.mass_matrix(configurations[i])
        return masses

    # --- errors -------------------------------------------------------------------------------------------------------

    def check_closed(self, q: Array) -> None:
        """Raise a `ClosureError` if loops are open at q (nq,)."""
        gap = self.mechanism.closure(q)
        if gap > CLOSURE:
            raise self.open_loops(gap)

    def open_loops(self, gap: float, when: str = "") -> ClosureError:
        """Return the error for loops that are open by a gap."""
        return ClosureError(
            f"{self.mechanism.name}: {when}loops are open by {gap:.2g} (rad or characteristic lengths): close(q) first"
        )

    def _need_masses(self) -> None:
        self.tree.check_masses(self.counts_massless)

    # --- motions ------------------------------------------------------------------------------------------------------

    def _motion(
        self, v: Motion | None, a: Motion | None, needs_masses: bool = True
    ) -> tuple[Array | None, Array | None, bool]:
        """Return velocities and accelerations (nv,), None for none; and whether they are those of actuated joints."""
        if v is None and a is None:
            return None, None, False
        if needs_masses:
            self._need_masses()
        by_name = [isinstance(rates, Mapping) for rates in (v, a) if rates is not None]
        if any(by_name) != all(by_name):
            raise ConfigurationError("give v and a both by name, or both for all joints")
        return joint_rates(self.mechanism, "v", v), joint_rates(self.mechanism, "a", a), all(by_name)

    def _closed_motion(
        self, q: Array, v: Array, a: Array, completes: bool, motions: plain.Motions
    ) -> tuple[Array, Array]:
        if completes:
            v, a, *gaps = plain.complete(self.tree, q, v, a, motions)
        else:
            gaps = list(plain.openings(self.tree, q, v, a, motions))
        check_gaps(self.mechanism, np.array([0.0, *gaps]), completes)
        return v, a

    def _plain(self, q: Array, v: Array | None, a: Array | None, completes: bool) -> tuple[Array, plain.Balance]:
        """Return the torques (actuated,) and the balance."""
        self.check_closed(q)
        motions = plain.motions_at(self.tree, q)
        if v is None or a is None:
            v = a = self._rest
        else:
            v, a = self._closed_motion(q, v, a, completes, motions)
        balance = plain.balance(self.tree, q, v, a, motions)
        if not balance.is_held:
            return np.full(len(self._names), np.nan), balance
        return np.asarray(balance.efforts / self.tree.step[list(self._names.values())]), balance
