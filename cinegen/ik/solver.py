"""The resolved-rate solver: frames of a mechanism follow targets, with all loops closed at every tick."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from functools import partial
from threading import get_ident
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError
from cinegen.exception_log import ExceptionLog
from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.memory import SolverMemory
from cinegen.ik._kernels.tick import tick
from cinegen.ik.branch import regular_neighbour
from cinegen.ik.control.rates import checked_period
from cinegen.ik.control.tasks import BIND, TaskControl
from cinegen.ik.given_task import GivenTask
from cinegen.ik.joint_settings import ACCELERATION, JointSettings
from cinegen.ik.setup import set_up_solver
from cinegen.ik.step import Step
from cinegen.ik.task import FrameTask
from cinegen.ik.thresholds import (
    BAD_TARGET,
    BEGIN,
    CLEARANCE_NEEDED,
    DONE,
    ERRORS_NEEDED,
    PROPOSED,
    RANK_NEEDED,
    SINGULAR,
)
from cinegen.jit.foreign import SE3_DISTANCE
from cinegen.jit.one_thread import other_thread
from cinegen.jit.starting import InterpretedKernel, start
from cinegen.loops.setup import null_space, set_up_screws
from cinegen.model import Mechanism
from cinegen.model.plausible import check_configuration
from cinegen.tolerances import CLOSURE


class Linearisation(NamedTuple):
    """Jacobians with which a tick began; all dimensionless.

    Attributes:
        tasks: (rows, n) of the tasks.
        motions: (k, n + .) orthonormal basis of the motions that all loops allow, those of the cut joints last.
        passive: (., passive joints) columns of the passive joints, and of those that were cut, in the screw matrix of
            the loops (`Structure.passive_matrix`).
        task_rank: generic rank of the tasks.
    """

    tasks: Array
    motions: Array
    passive: Array
    task_rank: int


class Solver(TaskControl):
    """Resolved-rate solver of one mechanism. It owns the configuration q.

    A solver may be used by one thread at a time; the mechanism may be shared. Its methods raise in a second thread that
    calls one meanwhile, `step` too: no status could be right there, since a tick and what another thread reads or
    writes would share one memory. The first thread goes on unharmed.

    A floating base moves like any joint: hold it by tasks, or by `lock("base")`.

    Joints can be locked at any time (`lock`, `unlock`, `locked`), have other limits than the model's
    (`position_limits`, `velocity_limits`, `acceleration_limits`), and weights in the motion that tasks leave free
    (`joint_weights`).

    Args:
        mechanism: mechanism to move.
        dt: period of a tick, s.
        q: (nq,) initial configuration with closed loops; the home configuration unless given.
        gain: rate at which pose errors decay, 1/s; see `Solver.gain`.
        acceleration: limits of the joint accelerations, rad/s^2 and m/s^2: one number for all joints but a floating
            base, or a mapping by joint name; see `acceleration_limits`. Accelerations are unlimited unless given.
        keep_branch: whether no tick passes a toggle of the actuated joints; see `Solver.keep_branch`.

    Attributes:
        exception_log: exceptions of objectives and barriers, each logged once; see `ExceptionLog`.
        linearisation: Jacobians with which the last tick began; empty unless they are kept.

    Raises:
        ConfigurationError: q has a wrong shape or is not finite.
        UnknownNameError: `acceleration` names a joint that does not exist.
        CinegenError: q leaves loops open, or was meant in degrees or mm; dt, gain or an acceleration is not positive;
            or dt is longer than 10 s.
        AttributeError: an attribute is set that a solver does not have.
    """

    __slots__ = (
        "__weakref__", "_handle", "_joints", "_keeps_linearisation", "_q", "_refused_at", "_tick",
        "linearisation", "mechanism",
    )  # fmt: skip

    def __init__(
        self,
        mechanism: Mechanism,
        dt: float,
        q: ArrayLike | None = None,
        gain: float = math.inf,
        acceleration: float | Mapping[str, float] | None = None,
        keep_branch: bool = False,
    ) -> None:
        self._user = 0
        self._tick = start(tick, SolverMemory, install=partial(setattr, self, "_tick"))
        self.mechanism = mechanism
        self._model = mechanism.model
        self._data = None
        self._tasks = []
        self._python_tasks = []
        self._blends = []
        self._objectives = ()
        self._detour = None
        self._barriers = ()
        self._blocked = False
        self.exception_log = ExceptionLog()
        self._caught = ()
        self._ranks = {}
        self._memory = SolverMemory()
        self._dt = self._memory.dt = checked_period(dt)
        self._handle = self._memory.handle
        self._joints = JointSettings(mechanism)
        self._lifted = False, False
        self._keeps_linearisation = False
        self.gain = gain
        if acceleration is not None and not isinstance(acceleration, Mapping):
            acceleration = dict.fromkeys(mechanism.joints, acceleration)
        self._joints.set_columns(ACCELERATION, acceleration)
        self._changed = BIND
        self._write_tasks()
        self._q = self._memory.q
        self._changed = BIND
        self._earlier = None
        self._latest = None
        self._keeps_branch = False
        self.keep_branch = keep_branch
        self.linearisation = Linearisation(np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0)), 0)
        self._refused_at = np.zeros(0)
        self.q = mechanism.q_home if q is None else q

    def __repr__(self) -> str:
        tasks = ", ".join(task.node if isinstance(task, FrameTask) else repr(task) for task in self.tasks) or "none"
        return f"<Solver of {self.mechanism.name}: dt {self.dt:g} s, tasks: {tasks}>"

    @contextlib.contextmanager
    def _used(self) -> Iterator[None]:
        """Context in which the solver's memory is used, as by `step`."""
        if self._user:
            raise other_thread(self, ", and not from within its own tick")
        self._user = get_ident()
        try:
            yield
        finally:
            self._user = 0

    def _check_thread(self) -> None:
        """Refuse to change what another thread reads in `step`: call it directly before the change."""
        caller = get_ident()
        if self._user and self._user != caller:  # no other thread comes in between, as in `step`
            raise other_thread(self)

    @property
    def q(self) -> Array:
        """(nq,) configuration, a copy. Setting it moves the mechanism there at once, at rest.

        Raises:
            ConfigurationError: set to an array of wrong shape, or one that is not finite.
            CinegenError: set to a configuration with open loops, or one that was meant in degrees or mm.
        """
        return self._q.copy()

    @q.setter
    def q(self, q: ArrayLike) -> None:
        full = self.mechanism.structure.checked(q)
        check_configuration(self.mechanism, full)
        closure = self.mechanism.closure(full)
        if closure > CLOSURE:
            raise CinegenError(
                f"q leaves loops of {self.mechanism.name} open by {closure:.2g} rad or characteristic lengths: "
                "use mechanism.close(q)"
            )
        with self._used():
            self._put(full, closure)
            if self.locked and not self._joints.holds(full):
                self._joints.hold(self.locked, full)
                self._rewrite_joints(True)

    def _put(self, q: Array, closure: float) -> None:
        memory = self._memory
        memory.q[:], memory.closure, memory.is_at_q, memory.phase = q, closure, 0, BEGIN
        memory.last[:] = memory.drift[:] = memory.secondary[:] = 0.0
        memory.secondary_scale = memory.turn_scale = 1.0
        if self._changed != BIND:  # tasks forget what they followed
            for task in self._tasks:
                task.memory.is_followed = 0
            memory.is_warm = 0
            self._earlier, self._latest = None, None

    def lift_limits(self, position: bool) -> None:
        """Remove the limits of velocity, and those of position if that is asked for."""
        with self._used():
            if self._changed:
                self._write_tasks()
            self._lifted = True, position
            self._joints.write(self._memory, self._lifted)

    def _rewrite_joints(self, relocked: bool) -> None:
        """Write what was set of the joints into the kernel's memory; all of it anew if other joints are locked."""
        if relocked:
            set_up_solver(self._memory, self._joints.held)
            self._ranks.clear()
            self._changed = BIND
        self._joints.write(self._memory, self._lifted)

    @property
    def v(self) -> Array:
        """(nv,) joint velocities of the last tick, rad/s and m/s; 0 after `q` was set."""
        return np.asarray(self._memory.last * self.mechanism.scale / self.dt)

    def copy_state(self, other: Solver) -> None:
        """Take over the configuration, valid tasks, objectives, gain, locks, limits and weights of joints of another
        solver, and the memory of its last tick.

        With the same dt and without barriers and blends, which are not copied, the ticks that follow are those of the
        other solver, bit for bit.

        Args:
            other: solver of the same mechanism; it does not change.

        Raises:
            CinegenError: another thread uses one of the two.
        """
        with self._used(), other._used():
            self._copy_state(other)

    def _copy_state(self, other: Solver) -> None:
        valid = [task for task in other._tasks if task.is_valid()]
        self._copy_joints(other)
        self.copy_tasks([task.task if isinstance(task, GivenTask) else task for task in valid])
        if self._changed:
            self._write_tasks()
        fresh, memory, ratio = self._memory, other._memory, self.dt / other.dt
        self.gain, self.keep_branch = other.gain, other.keep_branch
        self._q[:], self._objectives, self._detour = other._q, other._objectives, other._detour
        self.exception_log = other.exception_log  # the same objectives: none of their exceptions is logged twice
        for name in ("closure", "secondary_scale", "damping_threshold", "ticks"):
            setattr(fresh, name, getattr(memory, name))
        fresh.tasks_are_suspended, fresh.is_warm = memory.tasks_are_suspended, 0
        for name in ("last", "drift", "secondary"):  # of the last tick
            getattr(fresh, name)[:] = getattr(memory, name) * ratio
        for copy, task in zip(self._tasks, valid, strict=True):
            copy.memory.aim[:], copy.memory.is_followed = task.memory.aim, task.memory.is_followed
            copy.memory.kept_error[:] = task.memory.kept_error
        if other._changed != BIND and len(valid) == len(other.tasks):
            fresh.level_scale[:], fresh.level_rank[:] = memory.level_scale, memory.level_rank
            fresh.level_last[:] = memory.level_last * ratio
            for name in ("is_warm", "signature", "task_rank"):
                setattr(fresh, name, getattr(memory, name))
            fresh.left[:] = memory.left
        fresh.is_at_q, fresh.phase = 0, BEGIN

    @property
    def keeps_linearisation(self) -> bool:
        """True if each tick keeps its `linearisation`; False by default. It may be set at any time."""
        return self._keeps_linearisation

    @keeps_linearisation.setter
    def keeps_linearisation(self, keeps: bool) -> None:
        with self._used():
            self._keeps_linearisation, self._memory.is_watched = keeps, int(keeps)
            if keeps:
                set_up_screws(self._memory, self._joints.held.structure.screws)

    def _linearise(self) -> Linearisation:
        """Return the Jacobians with which the tick began; a trial overwrites those of the loops."""
        memory = self._memory
        tasks = memory.task_jacobian[: memory.active_rows]
        rank = min(memory.task_rank, len(tasks), memory.mobility)
        passive = memory.screw_matrix[:, self._joints.held.structure.screws.passive]
        return Linearisation(tasks.copy(), null_space(memory), passive, rank)

    @property
    def is_compiled(self) -> bool:
        """True if ticks run as machine code; False while that is being compiled, and Python computes the same."""
        return not isinstance(self._tick, InterpretedKernel) or self._tick.machine_code is not None

    # --- one tick ------------------------------------------------------------------------------------------------

    def step(self) -> Step:
        """Compute one tick of dt. No value makes it raise; `Step.status` reports what happened.

        Raises:
            CinegenError: another thread is using the solver, whose tick this would corrupt.
        """
        if self._user:  # Python changes threads only at calls and jumps back: not before the next line
            raise other_thread(self, ", and not from within its own tick")
        self._user = get_ident()
        try:
            return self._step()
        finally:
            self._user = 0

    def _step(self) -> Step:
        """Compute one tick; for subclasses that do something before or after it."""
        self._evaluate()
        keeps = self._keeps_linearisation
        request = self._tick(self._handle)
        while request != DONE:
            if request == CLEARANCE_NEEDED:
                self._memory.clear_part = self._clear()
            elif request == ERRORS_NEEDED:
                self._evaluate_errors()
            elif request == RANK_NEEDED:
                self._rank()
            elif request == PROPOSED:
                self.linearisation, keeps = self._linearise(), False
            else:  # it is done, and refused
                self._leave_bifurcation()
                break
            request = self._tick(self._handle)
        if keeps:  # nothing was proposed
            self.linearisation = self._linearise()
        record = self._record.copy()
        self._earlier, self._latest = self._latest, record
        caught, self._caught = self._caught, ()
        if record[m.STATUS] == BAD_TARGET:
            return Step(record, self._layout, caught, tuple(task.problem for task in self._tasks))
        return Step(record, self._layout, caught)

    def _evaluate(self) -> None:
        """Evaluate what is programmed in Python for this tick."""
        if self._blends:
            self._advance_blends()
        if self._changed:
            self._write_tasks()
        objectives = self._objectives if self._detour is None else self._detour
        if objectives:
            self._evaluate_objectives(objectives)
        if self._barriers:
            self._evaluate_barriers()
        if self._python_tasks:
            self._evaluate_given()
        if SE3_DISTANCE is None:  # targets may have been changed in place
            for task in self.frame_tasks:
                task.read_target()

    def _leave_bifurcation(self) -> None:
        """Replace a refused tick by a motion along a branch of closed configurations if several meet at q. It is at
        most as long as a tick may be."""
        q, memory = self._q.copy(), self._memory
        guarded = self._barriers or self._keeps_branch
        if not self.mechanism.loops or guarded or np.array_equal(q, self._refused_at):
            return
        self._refused_at = q
        is_number = memory.q_index >= 0
        at = memory.q_index[is_number]
        reach = (memory.longest_step * memory.scale)[is_number]
        lower, upper = np.full(len(q), -np.inf), np.full(len(q), np.inf)
        lower[at] = np.minimum(q[at], np.maximum(memory.lower[is_number], q[at] - reach))
        upper[at] = np.maximum(q[at], np.minimum(memory.upper[is_number], q[at] + reach))
        near = regular_neighbour(self._joints.held, q, lower, upper)
        if near is not None:
            self._put(near, self.mechanism.closure(near))
            memory.record_q[:], memory.record_v[:] = near, self.mechanism.difference(q, near) / self.dt
            memory.report[m.STATUS], memory.report[m.CLOSURE] = SINGULAR, memory.closure
            memory.report[m.ERRORS_KNOWN] = 0.0  # they are computed on access
