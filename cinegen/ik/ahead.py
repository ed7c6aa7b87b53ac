"""A second solver that runs ahead of the first, to see where its tasks lead."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik.step import Status
from cinegen.ik.task import FrameTask
from cinegen.ik.thresholds import BEGIN, ERROR_CAP
from cinegen.model import Mechanism
from raff2urdf.residual import log

if TYPE_CHECKING:
    from cinegen.ik.solver import Solver

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Path:
    """What came of running ahead; everything in the ticks is without unit.

    Attributes:
        mechanism: that was moved.
        dt: seconds between two ticks.
        q: (ticks + 1, nq) from the present configuration on.
        steps: (ticks + 2, nv) of all joints: the last one so far first, the one after the path's end last.
        stopped: (ticks + 1, nv) other than 0 where a joint's limit holds the step from there back.
        statuses: (ticks + 1,) of the step from there.
        tasks: (ticks + 1, rows, n) what the motions that all loops allow do to the tasks.
        task_rank: generic, of that.
        passive: (ticks + 1, rows, .) columns of the passive joints in the loops' Jacobian.
    """

    mechanism: Mechanism
    dt: float
    q: Array
    steps: Array
    stopped: Array
    statuses: tuple[Status, ...]
    tasks: Array
    task_rank: int
    passive: Array


class Ahead:
    """Runs ahead of a solver, again and again: making a solver takes as long as many ticks.

    Args:
        twin: of the same mechanism; for this alone. Its dt is the time between two ticks of a path.
    """

    def __init__(self, twin: Solver) -> None:
        self.dt, self._twin = twin.dt, twin
        self._kinds: list[tuple[str, str, int, int, pin.SE3]] = []
        self._notes: list[tuple[Array, Array, Array]] = []
        self._noted = False
        twin._memory.is_watched = 1
        twin._watch = self._note  # type: ignore[method-assign]

    def run(self, solver: Solver, ticks: int, moving: bool) -> Path:
        """Where a solver, which is only looked at, will be.

        Args:
            solver: of the same mechanism.
            ticks: how many.
            moving: whether targets that move go on moving.
        """
        held = [(i, task) for i, task in enumerate(solver.tasks) if task.is_valid()]
        self._mirror(solver, held)
        twin, mechanism = self._twin, solver.mechanism
        courses = []
        for own, (i, task) in zip(twin.tasks, held, strict=True):
            course = _course(solver, i, task) if moving else None
            if course is not None:
                courses.append((own, course))
        memory = twin._memory
        start, last = twin.q, memory.last.copy()
        self._notes = []
        steps = []
        for tick in range(1, ticks + 2):  # one more, for what is known where the last one ends
            for own, course in courses:
                own.target = course.at(tick * self.dt)
            self._noted = False
            steps.append(twin.step())
            if not self._noted:
                self._note()
        first = np.zeros(mechanism.model.nv)
        first[memory.fixed :] = last
        rows, motions, passive = (np.array(part) for part in zip(*self._notes, strict=True))
        if mechanism.loop_rank:
            rows = rows @ motions.transpose(0, 2, 1) @ motions
        return Path(
            mechanism,
            self.dt,
            np.vstack([start, *(step.q for step in steps[:-1])]),
            np.vstack([first, *(step.v * self.dt / mechanism.scale for step in steps)]),
            np.array([step.stopped for step in steps]),
            tuple(step.status for step in steps),
            rows,
            min(memory.task_rank, rows.shape[1], memory.mobility),
            passive,
        )

    def _mirror(self, solver: Solver, held: list[tuple[int, FrameTask]]) -> None:
        """Makes the twin stand, move and be pulled as a solver is, by the tasks that hold in it."""
        twin = self._twin
        kinds = [(task.node, task.axes, task.translation, task.rotation, task.offset) for _, task in held]
        if kinds != self._kinds:
            for own in twin.tasks:
                twin.remove_task(own)
            for node, axes, translation, rotation, at in kinds:
                twin.add_task(node, translation=translation, rotation=rotation, axes=axes, offset=at)
            self._kinds = kinds
        for own, (_, task) in zip(twin.tasks, held, strict=True):
            own.weight, own.target = task.weight, task.target
            if task.twist is not None:
                own.twist = task.twist
        if twin._changed:
            twin._write_tasks()
        own_memory, memory, ratio = twin._memory, solver._memory, self.dt / solver.dt
        twin.gain = solver.gain
        twin._q[:], twin._objectives = solver._q, solver._objectives
        twin.exception_log = solver.exception_log  # the same objectives: none of their exceptions is logged twice
        for name in ("closure", "secondary_scale", "damping_threshold", "has_acceleration_limits", "ticks"):
            setattr(own_memory, name, getattr(memory, name))
        own_memory.tasks_are_suspended, own_memory.is_warm = memory.tasks_are_suspended, 0
        goes_on = own_memory.fixed == memory.fixed
        own_memory.longest_change[:] = memory.longest_change * (ratio * ratio) if goes_on else np.inf
        for name in ("last", "drift", "secondary"):  # of the last tick
            getattr(own_memory, name)[:] = getattr(memory, name) * ratio if goes_on else 0.0
        for own, (_, task) in zip(twin.tasks, held, strict=True):
            own.memory.aim[:] = task.memory.aim
            own.memory.is_followed = task.memory.is_followed
        if not solver._changed and len(held) == len(solver.tasks):  # then it goes on as the solver will, bit for bit
            for name in ("is_warm", "signature", "task_rank"):
                setattr(own_memory, name, getattr(memory, name))
            own_memory.left[:] = memory.left
        own_memory.is_at_q, own_memory.phase = 0, BEGIN

    def _note(self) -> None:
        """Keep the Jacobians with which a tick began: a trial of it will overwrite those of the loops."""
        self._noted, memory = True, self._twin._memory
        columns = self._twin.mechanism.passive_columns - memory.fixed
        tasks = memory.task_jacobian[: memory.active_rows]
        self._notes.append((tasks.copy(), memory.null_space.copy(), memory.jacobian[:, columns]))


class _Course(NamedTuple):
    """How a target moves on: a turn about its origin, and the origin straight on."""

    begin: pin.SE3
    linear: Array
    angular: Array

    def at(self, time: float) -> pin.SE3:
        """Where the target is then, s from now."""
        turned = pin.exp3(self.angular * time) @ self.begin.rotation
        return pin.SE3(turned, self.begin.translation + self.linear * time)


def _course(solver: Solver, i: int, task: FrameTask) -> _Course | None:
    """How the target of a solver's task i moves, by where it was in the last two ticks; None where it stands, or was
    moved further than any tick follows: such a leap goes on no further."""
    earlier, latest = solver._earlier, solver._latest
    if earlier is None or latest is None or solver._changed or task.twist is not None:
        return None
    if task.memory.is_followed:  # it followed a twist
        return None
    (before, was_active), (now, is_active) = (
        (solver._layout.get(record, "record_aims")[i], solver._layout.get(record, "record_tasks")[i, 3])
        for record in (earlier, latest)
    )
    if not (was_active and is_active) or (before == now).all():
        return None
    linear = now[3] - before[3]
    angular = log(now[:3].T @ before[:3])
    far = max(float(np.abs(linear).max()) / solver.mechanism.length, float(np.abs(angular).max()))
    if not far <= ERROR_CAP:
        return None
    return _Course(task.target.copy(), linear / solver.dt, angular / solver.dt)
