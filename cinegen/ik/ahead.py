"""A second solver that runs ahead of the first, to see where its tasks lead."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik._kernels import memory as m
from cinegen.ik.step import Status
from cinegen.ik.task import FrameTask
from cinegen.ik.thresholds import BEGIN, ERROR_CAP, JUDGE
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
        self._evaluate = twin._evaluate
        twin._evaluate = self._note_first

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
        start, last = twin.q, twin._memory.arrays["last"].copy()
        self._notes = []
        steps = []
        for tick in range(1, ticks + 2):  # one more, for what is known where the last one ends
            for own, course in courses:
                own.target = course.at(tick * self.dt)
            self._noted = False
            steps.append(twin.step())
            if not self._noted:
                self._note()
        offset, n = int(twin._table[m.OFFSET]), int(twin._table[m.N])
        first = np.zeros(mechanism.model.nv)
        first[offset:] = last[:n]
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
            min(int(twin._table[m.PULL_RANK]), rows.shape[1], mechanism.mobility - offset),
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
        arrays, others, ratio = twin._memory.arrays, solver._memory.arrays, self.dt / solver.dt
        twin.gain = solver.gain
        twin._q[:], twin._objectives = solver._q, solver._objectives
        twin.exception_log = solver.exception_log  # the same objectives: none of their exceptions is logged twice
        arrays["settings"][[m.CLOSED, m.TRUST, m.NEAR]] = others["settings"][[m.CLOSED, m.TRUST, m.NEAR]]
        arrays["acceleration"][:] = others["acceleration"] * (ratio * ratio)
        goes_on = twin._table[m.OFFSET] == solver._table[m.OFFSET]
        for name in ("last", "drift", "secondary"):  # of the last tick
            arrays[name][:] = others[name] * ratio if goes_on else 0.0
        twin._table[[m.ACCELERATED, m.TICKS, m.DETOUR]] = solver._table[[m.ACCELERATED, m.TICKS, m.DETOUR]]
        twin._table[m.WARM] = 0
        for j, (i, _) in enumerate(held):
            arrays["pull_state"][j] = 0.0 if solver._changed else others["pull_state"][i]
        if not solver._changed and len(held) == len(solver.tasks):  # then it goes on as the solver will, bit for bit
            twin._table[[m.WARM, m.SIGNATURE, m.PULL_RANK]] = solver._table[[m.WARM, m.SIGNATURE, m.PULL_RANK]]
            arrays["u"][:] = others["u"]
        self._evaluate(twin._model, twin._data, twin._q)
        twin._table[m.PHASE] = BEGIN

    def _note_first(self, *arguments: object) -> None:
        """In place of Pinocchio's: takes notes when the twin asks first in a tick."""
        if self._twin._table[m.PHASE] == JUDGE and not self._noted:
            self._note()
        self._evaluate(*arguments)

    def _note(self) -> None:
        """Keeps the Jacobians with which the tick began: a trial of it will overwrite those of the loops."""
        self._noted = True
        table, arrays = self._twin._table, self._twin._memory.arrays
        n, p, k, rows = (int(table[size]) for size in (m.N, m.P, m.K, m.ROWS))
        columns = self._twin.mechanism.passive_columns - int(table[m.OFFSET])
        tasks, motions, loops = (
            arrays[name].ravel()[: height * n].reshape(height, n)
            for name, height in (("jp", p), ("motions", k), ("jc", rows))
        )
        self._notes.append((tasks.copy(), motions.copy(), loops[:, columns]))


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
    if solver._memory.arrays["pull_state"][i, m.FOLLOWED]:  # it followed a twist
        return None
    begin = solver._layout.starts[3] + m.WANTED * i
    before, now = (record[begin : begin + m.WANTED] for record in (earlier, latest))
    if not (before[24] and now[24]) or (before[:12] == now[:12]).all():
        return None
    linear = now[9:12] - before[9:12]
    angular = log(now[:9].reshape(3, 3).T @ before[:9].reshape(3, 3))
    far = max(float(np.abs(linear).max()) / solver.mechanism.length, float(np.abs(angular).max()))
    if not far <= ERROR_CAP:
        return None
    return _Course(task.target.copy(), linear / solver.dt, angular / solver.dt)
