"""Tasks of a solver: added, blended, removed and copied at run time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeVar, overload

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError
from cinegen.ik.barrier import Range
from cinegen.ik.control.objectives import ObjectiveControl
from cinegen.ik.equations import task_rank
from cinegen.ik.given_task import AnyTask, GivenTask, Task, is_task
from cinegen.ik.setup import set_up_solver, set_up_solver_tasks
from cinegen.ik.state import State
from cinegen.ik.step import Layout, Step
from cinegen.ik.task import FrameTask
from cinegen.ik.tasks.blend import Blend
from cinegen.ik.tasks.values import is_count
from cinegen.ik.thresholds import ERROR_CAP
from cinegen.joints import kinematic_data
from cinegen.model.plausible import FAR_TARGET, check_lengths
from raff2urdf.residual import log

WRITE, BIND = 1, 2
"""What the next tick does: write what was set of tasks, or also bind them to the kernel's memory anew."""

AddedTask = TypeVar("AddedTask", bound="Task | Range")


class TaskControl(ObjectiveControl):
    """Control of a solver's tasks at run time."""

    __slots__ = ("_blends", "_changed", "_python_tasks", "_ranks", "_record", "_tasks", "_user", "_written")

    _tasks: list[AnyTask]
    _python_tasks: list[tuple[int, GivenTask]]  # tasks in Python, with their index among all
    _blends: list[Blend]
    _ranks: dict[tuple[object, ...], int]
    _changed: int  # whether tasks must be written into the kernel's memory, or bound to it
    _written: tuple[AnyTask, ...]  # those that it refers to
    _user: int  # 0, or the thread that is in a method
    _record: Array

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
            node: name of a base, link or frame; or alone a task of another kind (`cinegen.ik.tasks.kinds`), any object
                that follows the protocol `Task`, or a `Range`.
            target: pose in the world; the present pose unless given.
            translation: number of constrained translations, 0 to 3; see `FrameTask.translation`.
            rotation: number of constrained rotations, 0 to 3; see `FrameTask.rotation`.
            weight: weight of the task where several tasks can't all be met; only proportions matter.
            axes: frame whose axes the rows are expressed in: "target", "world" or the name of a node.
            offset: point (3,) or pose on the node, in the node's frame (m), that follows the target; the node's own
                frame unless given.
            weights: (6,) weights of the translations along, then the rotations about, x, y and z of `axes`, in place of
                `translation` and `rotation`; an axis of weight 0 is not constrained. See `FrameTask.weights`.
            priority: level of the task; 0 is served first, larger numbers in the motion that it leaves.

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
        task.measure, task.find_frame = self._error_of, self.mechanism.frame_id
        self._check_thread()
        task.user, task.changed = self, self._mark_changed
        self._tasks.append(task)
        self._changed = BIND
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
        if any(task is other for other in self.tasks):
            raise CinegenError(f"{task!r} is one of this solver's tasks already")
        in_python = GivenTask(task, self.state)
        in_python.changed = self._mark_changed
        self._check_thread()
        self._tasks.append(in_python)
        self._changed = BIND
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
        if seconds != 0.0 and any(task is other for other in self.tasks):
            if not isinstance(task, FrameTask):
                raise CinegenError("the weight of a task in Python can't fade: leave out seconds")
            self.blend(task, seconds=seconds, weight=0.0)
            return
        self._check_thread()
        self._blends = [blend for blend in self._blends if blend.task is not task]
        for i, other in enumerate(self.tasks):
            if other is task:
                self._check_thread()
                self._tasks.pop(i).changed = _nothing
                self._changed = BIND
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
        if self._latest is not None and self._changed != BIND and task in self._tasks:
            return Step(self._latest, self._layout).errors[self._tasks.index(task)]
        if not task.is_valid():
            return math.nan, math.nan
        return task.distances(self.mechanism, self._q)

    def _mark_changed(self, binds: bool) -> None:
        self._changed = BIND if binds else self._changed or WRITE

    def _write_tasks(self) -> None:
        """Write the tasks into the kernel's memory, which is allocated again if their number or rows have changed."""
        changed, self._changed = self._changed, 0  # what another thread sets from here on is written in the next tick
        if changed == WRITE and not any([task.write() for task in self.frame_tasks]):
            return
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
        self._python_tasks = [(i, task) for i, task in enumerate(self._tasks) if isinstance(task, GivenTask)]
        levels = tuple(int(task.memory.level) for task in self._tasks)
        self._layout = Layout(self._joints.held, tasks, levels, fields, self._dt)
        self._earlier, self._latest = None, None
        self._written = tuple(self._tasks)

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
                rank = task_rank(self._joints.held, self._joints.held.structure.system, tasks)
            except Exception as error:  # of a task in Python: the loop must go on
                self._catch(f"a task of {self.mechanism.name}", error)
                return sum(task.rows for task in tasks)
            if key != tuple(_place(task) for task in tasks):  # another thread has changed one
                return rank
            self._ranks[key] = rank
        return self._ranks[key]

    @property
    def target_velocities(self) -> tuple[pin.Motion, ...]:
        """Velocity of each task's target between the last two ticks, in the world: its origin's, m/s, and rad/s.

        It is 0 where a target followed a twist, is new, or was moved further than a tick follows.
        """
        return tuple(self._target_velocity(i, task) for i, task in enumerate(self._tasks))

    def _target_velocity(self, i: int, task: AnyTask) -> pin.Motion:
        earlier, latest = self._earlier, self._latest
        if earlier is None or latest is None or self._changed == BIND or isinstance(task, GivenTask):
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
        if [_kind(copy) for copy in self.tasks] != [_kind(task) for task in tasks]:
            for copy in self.tasks:
                self.remove_task(copy)
            for task in tasks:
                if isinstance(task, FrameTask):
                    self.add_task(
                        task.node, weights=task.weights, axes=task.axes, offset=task.offset, priority=task.priority
                    )
                else:
                    self.add_task(task)
        for copy, task in zip(self.tasks, tasks, strict=True):
            if isinstance(copy, FrameTask) and isinstance(task, FrameTask):
                copy.weight, copy.target = task.weight, task.target
                if task.twist is not None:
                    copy.twist = task.twist

    def _evaluate_given(self) -> None:
        """Evaluate the tasks in Python for this tick."""
        state = State(self.mechanism, self.q, self.dt, (), self._data)
        for i, task in self._python_tasks:
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
        for i, task in self._python_tasks:
            if not task.is_valid():
                continue
            try:
                task.evaluate_error(state)
            except Exception as error:  # the loop must go on
                task.memory.given_error[:] = np.inf  # no such step
                self._catch(self._source("task", i, task.task), error)


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


def _nothing(binds: bool) -> None:
    """Do nothing, in place of the callback of a task that was removed."""
