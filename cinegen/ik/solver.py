"""The resolved-rate solver: frames of a mechanism follow targets, with all loops closed at every tick."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from threading import get_ident
from typing import Any, NamedTuple, TypeVar, overload

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError
from cinegen.exception_log import ExceptionLog
from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.memory import MOST_FLAGS, SolverMemory
from cinegen.ik._kernels.tick import tick
from cinegen.ik.barrier import Barrier, Bounds, Range
from cinegen.ik.blend import Blend
from cinegen.ik.branch import passes_toggle, regular_neighbour
from cinegen.ik.equations import task_rank
from cinegen.ik.given_task import AnyTask, GivenTask, Task, is_task
from cinegen.ik.joints import ACCELERATION, JointControl, JointSettings
from cinegen.ik.objectives import Objective
from cinegen.ik.setup import make_room_for_barriers, set_up_solver, set_up_solver_tasks
from cinegen.ik.state import State
from cinegen.ik.step import Layout, Step
from cinegen.ik.task import FrameTask, is_count
from cinegen.ik.thresholds import (
    BAD_TARGET,
    BEGIN,
    CLEARANCE_NEEDED,
    DONE,
    ERROR_CAP,
    ERRORS_NEEDED,
    PROPOSED,
    RANK_NEEDED,
    SINGULAR,
    STEP_CAP,
)
from cinegen.jit.foreign import SE3_DISTANCE
from cinegen.jit.one_thread import other_thread
from cinegen.jit.starting import InterpretedKernel, start
from cinegen.joints import kinematic_data
from cinegen.loops.arrays import null_space, set_up_screws
from cinegen.model import Mechanism
from cinegen.model.plausible import FAR_TARGET, check_configuration, check_lengths
from cinegen.tolerances import CLOSURE
from raff2urdf.residual import log

LONGEST = 10.0
"""Longest period of a tick, s: more was meant as a rate."""
AddedTask = TypeVar("AddedTask", bound="Task | Range")

_FASTEST = 1e100  # rad/s or m/s: no objective means more


class Linearisation(NamedTuple):
    """Jacobians with which a tick began; all dimensionless.

    Attributes:
        tasks: (rows, n) of the tasks.
        motions: (k, n + .) orthonormal basis of the motions that all loops allow, those of the cut joints last.
        passive: (., passive joints) columns of the passive joints, and of those that were cut, in the screw matrix of
            the loops (`Mechanism.screw_matrix`).
        task_rank: generic rank of the tasks.
    """

    tasks: Array
    motions: Array
    passive: Array
    task_rank: int


class Solver(JointControl):
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
        "__weakref__", "_barriers", "_blends", "_blocked", "_caught", "_changed", "_data", "_detour", "_dt", "_earlier",
        "_gain", "_given", "_handle", "_joints", "_keeps_branch", "_keeps_linearisation", "_latest",
        "_layout", "_lifted", "_memory", "_model", "_objectives", "_q", "_ranks", "_record", "_refused_at", "_tasks",
        "_tick", "_user", "exception_log", "linearisation", "mechanism",
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
        self._data: pin.Data | None = None  # for tasks in Python and ranges
        self._tasks: list[AnyTask] = []
        self._given: list[tuple[int, GivenTask]] = []
        self._blends: list[Blend] = []
        self._objectives: tuple[Objective, ...] = ()
        self._detour: tuple[Objective, ...] | None = None  # objectives that replace them, until they are set
        self._barriers: tuple[Barrier, ...] = ()
        self._blocked = False  # a barrier failed in this tick
        self.exception_log = ExceptionLog()
        self._caught: tuple[Exception, ...] = ()  # in this tick
        self._ranks: dict[tuple[object, ...], int] = {}
        self._memory = SolverMemory()
        self._dt = self._memory.dt = _checked_period(dt)
        self._handle = self._memory.handle
        self._joints = JointSettings(mechanism)
        self._lifted = False, False  # limits of velocity, and of position, are ignored
        self._keeps_linearisation = False
        self.gain = gain
        if acceleration is not None and not isinstance(acceleration, Mapping):
            acceleration = dict.fromkeys(mechanism.joints, acceleration)
        self._joints.set_columns(ACCELERATION, acceleration)
        self._write_tasks()
        self._q = self._memory.q
        self._changed = True
        self._earlier: Array | None = None  # records of the last two ticks: they tell how fast targets move
        self._latest: Array | None = None
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
        """Refuse to change lists that another thread reads in `step`: call it directly before the change."""
        caller = get_ident()
        if self._user and self._user != caller:  # no other thread comes in between, as in `step`
            raise other_thread(self)

    @property
    def dt(self) -> float:
        """Period of a tick, s; may be set at any time. Velocities continue: the step of the last tick, and what limits
        the next one, are scaled.

        Raises:
            CinegenError: set to a time that is not positive, or longer than 10 s.
        """
        return self._dt

    @dt.setter
    def dt(self, dt: float) -> None:
        if dt == self._dt:
            return
        with self._used():
            self._scale_to(dt)

    def _scale_to(self, dt: float) -> None:
        memory, ratio = self._memory, _checked_period(dt) / self._dt
        self._dt = memory.dt = dt
        self.gain = self._gain
        for steps in (memory.last, memory.drift, memory.secondary):
            steps *= ratio
        self._joints.write(memory, self._lifted)
        self._layout: Layout = replace(self._layout, dt=dt)
        self._earlier = None

    @property
    def gain(self) -> float:
        """Rate at which pose errors decay, 1/s; may be set at any time.

        A tick corrects the fraction 1 - exp(-gain dt) of each error, so the decay does not depend on dt. With an
        infinite gain, the default, a tick corrects all of it, as far as limits allow.

        Raises:
            CinegenError: set to a value that is not above 0.
        """
        return self._gain

    @gain.setter
    def gain(self, gain: float) -> None:
        if not gain > 0.0:
            raise CinegenError(f"gain must be above 0 (1/s), not {gain}")
        self._gain = float(gain)
        self._memory.gain = -math.expm1(-self._gain * self.dt)

    @property
    def tick_gain(self) -> float:
        """Fraction of an error that one tick corrects: 1 - exp(-gain dt)."""
        return float(self._memory.gain)

    @property
    def damping_threshold(self) -> float:
        """Dimensionless singular value, without the weights of tasks, below which motion is damped; 0.05 by default.

        A larger value makes motion near singularities slower and smoother. It may be set at any time.

        Raises:
            CinegenError: set to a value outside (0, 1].
        """
        return float(self._memory.damping_threshold)

    @damping_threshold.setter
    def damping_threshold(self, near: float) -> None:
        if not 0.0 < near <= 1.0:
            raise CinegenError(f"damping_threshold must be in (0, 1], not {near}")
        self._memory.damping_threshold = near

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
        if not self._changed:  # tasks forget what they followed
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
            self._changed = True
        self._joints.write(self._memory, self._lifted)

    # --- tasks ---------------------------------------------------------------------------------------------------

    @property
    def tasks(self) -> tuple[FrameTask | Task, ...]:
        """Tasks in the order in which they were added."""
        return tuple(task.task if isinstance(task, GivenTask) else task for task in self._tasks)

    @property
    def frame_tasks(self) -> tuple[FrameTask, ...]:
        """Tasks that are frames, in the order in which they were added."""
        return tuple(task for task in self._tasks if isinstance(task, FrameTask))

    @overload
    def add_task(self, node: AddedTask) -> AddedTask: ...

    @overload
    def add_task(
        self,
        node: str,
        target: pin.SE3 | None = None,
        translation: int = 3,
        rotation: int = 3,
        weight: float = 1.0,
        axes: str = "target",
        offset: pin.SE3 | ArrayLike | None = None,
        weights: ArrayLike | None = None,
        priority: int = 0,
    ) -> FrameTask: ...

    def add_task(
        self,
        node: Any,
        target: pin.SE3 | None = None,
        translation: int = 3,
        rotation: int = 3,
        weight: float = 1.0,
        axes: str = "target",
        offset: pin.SE3 | ArrayLike | None = None,
        weights: ArrayLike | None = None,
        priority: int = 0,
    ) -> Any:
        """Add a task: a frame on a node follows a target pose. Set `task.target` or `task.twist` to move it.

        Args:
            node: name of a base, link or frame; or, alone, a task of another kind (`cinegen.ik.kinds`), any object that
                follows the protocol `Task`, or a `Range`.
            target: pose in the world; the present pose unless given.
            translation: number of constrained translations, 0 to 3; see `FrameTask.translation`.
            rotation: number of constrained rotations, 0 to 3; see `FrameTask.rotation`.
            weight: weight of the task where several tasks can't all be met; only proportions matter.
            axes: frame whose axes the rows are expressed in: "target", "world" or the name of a node.
            offset: point (3,) or pose on the node, in the node's frame (m), that follows the target; the node's own
                frame unless given.
            weights: (6,) weights of the translations along, then the rotations about, x, y and z of `axes`, in place of
                `translation` and `rotation`; an axis of weight 0 is not constrained. See `FrameTask.weights`.
            priority: level of the task; 0 is served first, larger numbers in the freedom that it leaves.

        Returns:
            the task.

        Raises:
            UnknownNameError: no such node.
            CinegenError: translation or rotation is not 0 to 3, weight is not positive and finite, weights are not six
                finite numbers of at least 0 or given besides translation or rotation, target is no SE3, offset is
                neither an SE3 nor three finite numbers, or a length was meant in mm.
        """
        if not isinstance(node, str):
            return self._add_given(node)
        frame = self.mechanism.frame_id(node)
        if not (is_count(translation) and is_count(rotation)):
            raise CinegenError(f"a task constrains 0 to 3 translations and rotations, not {translation} and {rotation}")
        if not 0.0 < weight < np.inf:
            raise CinegenError(f"a task's weight must be positive and finite, not {weight}")
        if weights is not None and (translation, rotation) != (3, 3):
            raise CinegenError("weights select the constrained axes: leave out translation and rotation")
        if axes not in ("target", "world"):
            self.mechanism.frame_id(axes)
        task = FrameTask(
            node, pin.SE3.Identity(), translation, rotation, weight, axes, frame, offset, weights, priority
        )
        check_lengths(self.mechanism, f"offset on '{node}'", task.offset.translation)
        if target is None:
            target = self.mechanism.placement(self._q, node) * task.offset
        if not isinstance(target, pin.SE3):
            raise CinegenError(f"a task's target is a pinocchio.SE3, not {type(target).__name__}")
        check_lengths(self.mechanism, f"target of '{node}'", target.translation, FAR_TARGET)
        task.target = target
        if not task.memory.is_valid:
            raise CinegenError(f"a task's weights are six finite numbers of at least 0, not {weights!r:.80}")
        task.changed, task.measure, task.find_frame = self._mark_changed, self._error_of, self.mechanism.frame_id
        self._check_thread()
        self._tasks.append(task)
        self._changed = True
        return task

    def _add_given(self, task: Any) -> Any:
        if self._data is None:
            self._data = kinematic_data(self._model)
        if isinstance(task, Range):
            self.barriers = (*self._barriers, task)
            return task
        if not is_task(task):
            raise CinegenError(
                f"add_task takes the name of a node, or an object with priority, weight, error(state) and "
                f"jacobian(state), not {task!r:.80}"
            )
        if any(task is own for own in self.tasks):
            raise CinegenError(f"{task!r} is one of this solver's tasks already")
        given = GivenTask(task, self.state)
        given.changed = self._mark_changed
        self._check_thread()
        self._tasks.append(given)
        self._changed = True
        return task

    def blend(
        self, task: FrameTask, target: pin.SE3 | None = None, seconds: float = 0.5, weight: float | None = None
    ) -> None:
        """Move a task smoothly to another target or weight during the following ticks.

        A target or weight that is set meanwhile ends its interpolation. Another blend of the same task replaces this.

        Args:
            task: task that follows a pose.
            target: final pose in the world; unchanged unless given.
            seconds: duration.
            weight: final weight; unchanged unless given. A task whose weight reaches 0 is removed.

        Raises:
            CinegenError: the task is not one of this solver's or follows a twist; or seconds, target or weight is
                negative or not finite.
        """
        if task not in self._tasks:
            raise CinegenError(f"the task of '{task.node}' is not one of this solver's")
        blend = Blend(task, seconds, target, weight)
        self._check_thread()
        self._blends = [other for other in self._blends if other.task is not task] + [blend]

    def remove_task(self, task: FrameTask | Task | Range, seconds: float = 0.0) -> None:
        """Remove a task. Does nothing if it has been removed already.

        Args:
            task: task to remove.
            seconds: time in which its weight fades to 0 first, so that the motion stays smooth.

        Raises:
            CinegenError: seconds is negative or not finite, or task is no task.
        """
        if isinstance(task, Range):
            self.barriers = [barrier for barrier in self._barriers if barrier is not task]
            return
        if not (isinstance(task, FrameTask) or is_task(task)):
            raise CinegenError(f"remove_task takes a task that add_task returned, not {task!r:.80}")
        if seconds != 0.0 and any(task is own for own in self.tasks):
            if not isinstance(task, FrameTask):
                raise CinegenError("the weight of a task in Python can't fade: leave out seconds")
            self.blend(task, seconds=seconds, weight=0.0)
            return
        self._check_thread()
        self._blends = [blend for blend in self._blends if blend.task is not task]
        for i, own in enumerate(self.tasks):
            if own is task:
                self._check_thread()
                self._tasks.pop(i).changed = _nothing
                self._changed = True
                break

    def _advance_blends(self) -> None:
        for blend in self._blends[:]:
            if not blend.advance(self.dt):
                self._blends.remove(blend)
                if blend.removes:
                    self.remove_task(blend.task)

    def _suspend_tasks(self, waits: bool) -> None:
        """Suspend all tasks, so that the objectives alone move the mechanism (for solvers that recover)."""
        self._memory.tasks_are_suspended = waits
        if not waits:
            self._memory.has_secondary = 0

    def _error_of(self, task: FrameTask) -> tuple[float, float]:
        """Return what the last tick left of a task's error; at the present configuration if there was none since."""
        if self._latest is not None and not self._changed and task in self._tasks:
            return Step(self._latest, self._layout).errors[self._tasks.index(task)]
        if not task.is_valid():
            return math.nan, math.nan
        return task.distances(self.mechanism, self._q)

    def _mark_changed(self) -> None:
        self._changed = True

    def _write_tasks(self) -> None:
        """Write the tasks into the kernel's memory, which is allocated again for their number."""
        memory = self._memory
        if memory.joints == 0:  # it is not set up
            set_up_solver(memory, self._joints.held)
            self._joints.write(memory, self._lifted)
        set_up_solver_tasks(memory, self._joints.held, self._tasks)
        tasks = tuple(
            (task.node, *task.valid_axes_and_offset) if isinstance(task, FrameTask) else (repr(task), "world", None)
            for task in self._tasks
        )
        self._record, fields = memory.block("record")
        self._given = [(i, task) for i, task in enumerate(self._tasks) if isinstance(task, GivenTask)]
        levels = tuple(int(task.memory.level) for task in self._tasks)
        self._layout = Layout(self._joints.held, tasks, levels, fields, self._dt)
        self._earlier, self._latest = None, None
        self._changed = False

    def _rank(self) -> None:
        """Compute the generic rank of the valid tasks."""
        memory, before = self._memory, 0
        for level in range(memory.levels):
            tasks = [task for task in self._tasks if task.is_valid() and task.memory.level <= level]
            rank = self._rank_of(tasks)
            memory.level_rank[level], before = rank - before, rank
        memory.task_rank, memory.is_warm = int(memory.level_rank[0]), 0

    def _rank_of(self, tasks: Sequence[AnyTask]) -> int:
        key = tuple(_place(task) for task in tasks)
        if key not in self._ranks:
            try:
                self._ranks[key] = task_rank(self._joints.held, self._joints.held.structure.system, tasks)
            except Exception as error:  # of a task in Python: the loop must go on
                self._catch(f"a task of {self.mechanism.name}", error)
                return sum(task.rows for task in tasks)
        return self._ranks[key]

    # --- copies for a look-ahead ---------------------------------------------------------------------------------

    @property
    def v(self) -> Array:
        """(nv,) joint velocities of the last tick, rad/s and m/s; 0 after `q` was set."""
        return np.asarray(self._memory.last * self.mechanism.scale / self.dt)

    @property
    def target_velocities(self) -> tuple[pin.Motion, ...]:
        """Velocity of each task's target between the last two ticks, in the world: its origin's, m/s, and rad/s.

        It is 0 where a target followed a twist, is new, or was moved further than a tick follows.
        """
        return tuple(self._target_velocity(i, task) for i, task in enumerate(self._tasks))

    def _target_velocity(self, i: int, task: AnyTask) -> pin.Motion:
        earlier, latest = self._earlier, self._latest
        if earlier is None or latest is None or self._changed or isinstance(task, GivenTask):
            return pin.Motion.Zero()
        if task.twist is not None:
            return pin.Motion.Zero()
        if task.memory.is_followed:  # a twist
            return pin.Motion.Zero()
        (before, was_active), (now, is_active) = (
            (self._layout.get(record, "record_aims")[i], self._layout.get(record, "record_tasks")[i, 1])
            for record in (earlier, latest)
        )
        if not (was_active and is_active) or (before == now).all():
            return pin.Motion.Zero()
        linear = now[3] - before[3]
        angular = log(now[:3].T @ before[:3])
        if not max(np.abs(linear).max() / self.mechanism.length, np.abs(angular).max()) <= ERROR_CAP:
            return pin.Motion.Zero()
        return pin.Motion(linear / self.dt, angular / self.dt)

    def copy_tasks(self, tasks: Sequence[FrameTask | Task]) -> None:
        """Replace the tasks by copies of another solver's; tasks of the same frames keep what they have followed.

        Args:
            tasks: valid tasks of a solver of the same mechanism.
        """
        if [_kind(own) for own in self.tasks] != [_kind(task) for task in tasks]:
            for own in self.tasks:
                self.remove_task(own)
            for task in tasks:
                if isinstance(task, FrameTask):
                    self.add_task(
                        task.node, weights=task.weights, axes=task.axes, offset=task.offset, priority=task.priority
                    )
                else:
                    self.add_task(task)
        for own, task in zip(self.tasks, tasks, strict=True):
            if isinstance(own, FrameTask) and isinstance(task, FrameTask):
                own.weight, own.target = task.weight, task.target
                if task.twist is not None:
                    own.twist = task.twist

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
        own, memory, ratio = self._memory, other._memory, self.dt / other.dt
        self.gain, self.keep_branch = other.gain, other.keep_branch
        self._q[:], self._objectives, self._detour = other._q, other._objectives, other._detour
        self.exception_log = other.exception_log  # the same objectives: none of their exceptions is logged twice
        for name in ("closure", "secondary_scale", "damping_threshold", "ticks"):
            setattr(own, name, getattr(memory, name))
        own.tasks_are_suspended, own.is_warm = memory.tasks_are_suspended, 0
        for name in ("last", "drift", "secondary"):  # of the last tick
            getattr(own, name)[:] = getattr(memory, name) * ratio
        for copy, task in zip(self._tasks, valid, strict=True):
            copy.memory.aim[:], copy.memory.is_followed = task.memory.aim, task.memory.is_followed
            copy.memory.kept_error[:] = task.memory.kept_error
        if not other._changed and len(valid) == len(other.tasks):
            own.level_scale[:], own.level_rank[:] = memory.level_scale, memory.level_rank
            own.level_last[:] = memory.level_last * ratio
            for name in ("is_warm", "signature", "task_rank"):
                setattr(own, name, getattr(memory, name))
            own.left[:] = memory.left
        own.is_at_q, own.phase = 0, BEGIN

    @property
    def keeps_linearisation(self) -> bool:
        """True if each tick keeps its `linearisation`; False by default. It may be set at any time."""
        return self._keeps_linearisation

    @keeps_linearisation.setter
    def keeps_linearisation(self, keeps: bool) -> None:
        with self._used():
            self._keeps_linearisation, self._memory.is_watched = keeps, int(keeps)
            if keeps:
                set_up_screws(self._memory, self._joints.held.structure.screws, len(self.mechanism.couplings))

    def _linearise(self) -> Linearisation:
        """Return the Jacobians with which the tick began; a trial overwrites those of the loops."""
        memory = self._memory
        tasks = memory.task_jacobian[: memory.active_rows]
        rank = min(memory.task_rank, len(tasks), memory.mobility)
        passive = memory.screw_matrix[:, self._joints.held.structure.passive_screws]
        return Linearisation(tasks.copy(), null_space(memory), passive, rank)

    # --- redundancy ----------------------------------------------------------------------------------------------

    @property
    def objectives(self) -> tuple[Objective, ...]:
        """Objectives whose velocities, added, act in the null space that loops and tasks leave; may be set at any
        time.

        Objectives do not disturb tasks. One that raises in a tick, or returns no finite velocity of shape (nv,), is
        left out in that tick: the step's `failed_objectives` and `exceptions` report it, and the logger "cinegen" gets
        the traceback once.

        Raises:
            CinegenError: set to an object without a method `velocity`, or to one that does not fit this mechanism.
                Other exceptions of the first call are only logged: the objective may work in a later tick.
        """
        return self._objectives

    @objectives.setter
    def objectives(self, objectives: Iterable[Objective]) -> None:
        given, state = tuple(objectives), self.state
        for i, objective in enumerate(given):
            if not callable(getattr(objective, "velocity", None)):
                raise CinegenError(f"an objective has a method `velocity`; {objective!r} has none")
            try:
                objective.velocity(state)
            except CinegenError:
                raise
            except Exception as error:
                self.exception_log.report(self._source("objective", i, objective), error)
        self._objectives, self._detour = given, None

    @property
    def state(self) -> State:
        """State of the solver now, as tasks in Python, objectives and barriers are given it; it does not change."""
        return State(self._joints.limited, self.q, self.dt, self.tasks)

    @property
    def _tick_state(self) -> State:
        """The same for one tick: its data are used again in the next."""
        return State(self._joints.limited, self.q, self.dt, self.tasks, self._data)

    # --- barriers ------------------------------------------------------------------------------------------------

    @property
    def barriers(self) -> tuple[Barrier, ...]:
        """Barriers that neither tasks nor objectives cross; may be set at any time.

        A barrier that raises, or returns invalid bounds, stops all motion in that tick. The step's `exceptions` report
        it, and the logger "cinegen" gets the traceback once.

        Raises:
            CinegenError: set to an object without the methods `bounds` and `clear`.
        """
        return self._barriers

    @barriers.setter
    def barriers(self, barriers: Iterable[Barrier]) -> None:
        given = tuple(barriers)
        for barrier in given:
            if not (callable(getattr(barrier, "bounds", None)) and callable(getattr(barrier, "clear", None))):
                raise CinegenError(f"a barrier has the methods `bounds` and `clear`; {barrier!r} lacks one")
        self._barriers = given
        self._memory.barriers, self.keep_branch = 0, self._keeps_branch

    @property
    def keep_branch(self) -> bool:
        """True if no tick passes a toggle of the actuated joints (type 2), where two branches of closed configurations
        meet; False by default. Steps that would pass one are shortened, and refused in the end: the status is BARRED
        then. It may be set at any time. A tick takes longer; see also `Step.branch_changed`."""
        return self._keeps_branch

    @keep_branch.setter
    def keep_branch(self, keeps: bool) -> None:
        self._keeps_branch = bool(keeps)
        self._memory.is_guarded = bool(self._barriers) or (self._keeps_branch and self.mechanism.is_constrained)

    def _evaluate_barriers(self) -> None:
        """Collect the barriers' bounds for this tick."""
        state, memory, mechanism = self._tick_state, self._memory, self.mechanism
        rows: list[Array] = []
        most: list[Array] = []
        self._blocked = False
        for i, barrier in enumerate(self._barriers):
            try:
                bounds = _checked(barrier.bounds(state), self._model.nv)
                rows.append(bounds.rows * (mechanism.scale / mechanism.length))
                most.append(bounds.most * (self.dt / mechanism.length))
            except Exception as error:  # the loop must go on
                self._blocked = True
                self._catch(self._source("barrier", i, barrier), error)
        count = 0 if self._blocked else sum(map(len, most))
        if count > memory.barrier_capacity:
            make_room_for_barriers(memory, count)
        memory.barriers = count
        if count:
            memory.barrier_rows[:count] = np.vstack(rows)
            memory.barrier_room[:count] = np.concatenate(most)
            if self.locked:
                memory.barrier_rows[:count, self._joints.held.structure.held_columns] = 0.0

    def _clear(self) -> float:
        """Return the fraction of the step to the trial configuration that barriers allow."""
        if self._blocked:
            return 0.0
        state, least = self._tick_state, np.inf
        for i, barrier in enumerate(self._barriers):
            try:
                part = float(barrier.clear(state, self._memory.trial.copy()))
                if not part >= 0.0:
                    raise ValueError(f"clear(state, q) returned {part}: return a number from 0 to 1")
                least = min(least, part)
            except Exception as error:  # the loop must go on
                self._blocked = True
                self._catch(self._source("barrier", i, barrier), error)
        if self._keeps_branch and least > 0.0 and passes_toggle(self._joints.held, self._q, self._memory.trial.copy()):
            least = min(least, 0.5)
        return 0.0 if self._blocked else least

    def _evaluate_objectives(self, objectives: tuple[Objective, ...]) -> None:
        """Add up the velocities of objectives for this tick."""
        state, total, left_out = self._tick_state, np.zeros(self._model.nv), 0
        for i, objective in enumerate(objectives):
            try:
                velocity = np.asarray(objective.velocity(state), dtype=float)
                if velocity.shape != total.shape:
                    raise ValueError(f"velocity(state) returned shape {velocity.shape}: return {total.shape}")
                if not np.abs(velocity).max(initial=0.0) < _FASTEST:
                    i_bad = int(np.argmin(np.abs(velocity) < _FASTEST))
                    raise ValueError(f"velocity(state)[{i_bad}] is {velocity[i_bad]}: return finite rad/s and m/s")
            except Exception as error:  # the loop must go on
                self._catch(self._source("objective", i, objective), error)
                left_out |= 1 << min(i, MOST_FLAGS)
            else:
                total += velocity
        total *= self.dt / self.mechanism.scale
        if self.locked:
            total[self._joints.held.structure.held_columns] = 0.0
        total *= STEP_CAP / max(STEP_CAP, np.abs(total).max(initial=0.0))
        memory = self._memory
        memory.secondary_wanted[:] = total
        memory.has_secondary, memory.failed_objectives = 1, left_out

    def _source(self, kind: str, i: int, what: object) -> str:
        """Return which objective or barrier an exception comes from."""
        return f"{kind} {i} ({type(what).__name__}) of {self.mechanism.name}"

    def _catch(self, source: str, error: Exception) -> None:
        """Keep an exception for the step of this tick, and log it."""
        self._caught += (error,)
        self.exception_log.report(source, error)

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
        if self._blends:
            self._advance_blends()
        if self._changed:
            self._write_tasks()
        objectives = self._objectives if self._detour is None else self._detour
        if objectives:
            self._evaluate_objectives(objectives)
        if self._barriers:
            self._evaluate_barriers()
        if self._given:
            self._evaluate_given()
        if SE3_DISTANCE is None:  # targets may have been changed in place
            for task in self.frame_tasks:
                task.read_target()
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

    def _evaluate_given(self) -> None:
        """Evaluate the tasks in Python for this tick."""
        state = State(self.mechanism, self.q, self.dt, (), self._data)
        for i, task in self._given:
            task.problem = ""
            try:
                task.evaluate(state)
            except Exception as error:  # the loop must go on
                task.problem = f"{task.task!r:.80}: {error}"
                self._catch(self._source("task", i, task.task), error)
        if self._changed:  # a priority; what was evaluated stays
            self._write_tasks()

    def _evaluate_errors(self) -> None:
        """Evaluate the errors of the tasks in Python at a trial."""
        state = State(self.mechanism, self._memory.trial.copy(), self.dt, (), self._data)
        for i, task in self._given:
            if not task.is_valid():
                continue
            try:
                task.evaluate_error(state)
            except Exception as error:  # the loop must go on
                task.memory.given_error[:] = np.inf  # no such step
                self._catch(self._source("task", i, task.task), error)

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


def _checked_period(dt: float) -> float:
    if not (np.isfinite(dt) and dt > 0.0):
        raise CinegenError(f"dt must be a positive time in seconds, not {dt}")
    if dt > LONGEST:
        message = f"dt is the period of a tick in seconds, at most {LONGEST:g}, not {dt:g}: did you mean 1/{dt:g}?"
        raise CinegenError(message)
    return dt


def _checked(bounds: Bounds, nv: int) -> Bounds:
    """Return valid bounds.

    Raises:
        ValueError: a shape is wrong, or a number is not finite.
    """
    rows, most = np.asarray(bounds.rows, dtype=float), np.asarray(bounds.most, dtype=float)
    if most.ndim != 1 or rows.shape != (len(most), nv) or not np.isfinite(rows).all() or np.isnan(most).any():
        raise ValueError(
            f"bounds(state) returned rows {rows.shape} and most {most.shape}: return finite rows (m, {nv}), "
            "and most (m,) without NaN"
        )
    return Bounds(rows, most)


def _kind(task: FrameTask | Task) -> tuple[object, ...]:
    """Return what `copy_tasks` copies by another task."""
    if not isinstance(task, FrameTask):
        return (id(task),)
    return task.node, task.axes, task.weights.tolist(), task.offset, task.priority


def _place(task: AnyTask) -> tuple[object, ...]:
    """Return what the generic rank depends on."""
    if isinstance(task, GivenTask):
        return (task, task.rows)  # the task itself: another one may get its id
    return task.frame, task.axes, *task.offset.homogeneous.ravel().tolist(), *(task.weights > 0.0).tolist()


def _nothing() -> None:
    """Do nothing, in place of the callback of a task that was removed."""
