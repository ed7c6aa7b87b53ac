"""The result of a tick: its status, and the numbers behind it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik._kernels import memory as m
from cinegen.ik.plain import equations
from cinegen.ik.resolve import free_motions
from cinegen.ik.singular import LostDoF, UncontrolledDoF, gained, lost, passive_singular_values
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism

Array = NDArray[np.float64]


class Status(Enum):
    """Outcome of a tick. The first that applies is reported, in this order: BAD_TARGET, IDLE, REFUSED, FOLLOWING (all
    targets reached), DETOUR, BARRED, AT_LIMIT, OUT_OF_REACH, SINGULAR, FOLLOWING (moving towards them)."""

    BAD_TARGET = "a task has an invalid target, weight or count: it is left out"
    REFUSED = "the loops could not be closed after any fraction of the step: the configuration is unchanged"
    AT_LIMIT = "a joint limit restricts the motion"
    SINGULAR = "near a singularity: motion is damped"
    OUT_OF_REACH = "the motion has stopped and a target is not reached"
    FOLLOWING = "every task is followed"
    IDLE = "there is no task"
    DETOUR = "moving to the targets by another configuration"
    BARRED = "a barrier restricts the motion"


STATUSES = tuple(Status)  # in the kernel's order


@dataclass(frozen=True)
class Layout:
    """Layout of a tick's record.

    Attributes:
        mechanism: mechanism that was moved.
        tasks: node, axes and offset of each task.
        resting: number of leading columns that are fixed: 6 for a floating base that no task moves.
    """

    mechanism: Mechanism
    tasks: tuple[tuple[str, str, pin.SE3], ...]
    resting: int

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """Starts of q, v, errors, targets, singular values and active limits; then the record's length."""
        nq, nv, tasks = self.mechanism.model.nq, self.mechanism.model.nv, len(self.tasks)
        return tuple(np.cumsum((m.R_HEAD, nq, nv, 2 * tasks, m.WANTED * tasks, 6 * tasks, nv)).tolist())


class Step:
    """Result of one tick; immutable."""

    __slots__ = ("_exceptions", "_layout", "_record")

    def __init__(self, record: Array, layout: Layout, exceptions: tuple[Exception, ...] = ()) -> None:
        self._record, self._layout, self._exceptions = record, layout, exceptions

    def __repr__(self) -> str:
        return f"<Step {self.status.name}: errors {self.errors}, closure {self.closure:.1g}>"

    @property
    def status(self) -> Status:
        """Outcome of the tick."""
        return STATUSES[int(self._record[m.R_STATUS])]

    @property
    def q(self) -> Array:
        """(nq,) new configuration."""
        start = self._layout.starts
        return self._record[start[0] : start[1]]

    @property
    def v(self) -> Array:
        """(nv,) velocity of the tick, rad/s and m/s."""
        start = self._layout.starts
        return self._record[start[1] : start[2]]

    @property
    def closure(self) -> float:
        """Largest loop residual at q, rad or characteristic lengths."""
        return float(self._record[m.R_CLOSURE])

    @property
    def errors(self) -> tuple[tuple[float, float], ...]:
        """Remaining error of each task, in the order in which they were added: m and rad."""
        start = self._layout.starts
        if self._record[m.R_MEASURED]:
            left = self._record[start[2] : start[3]].tolist()
            return tuple(zip(left[::2], left[1::2], strict=True))
        mechanism, q = self._layout.mechanism, self.q
        found = []
        for task, axes in self._wanted():
            straight, turn = task.errors(mechanism.placement(q, task.node) * task.offset, axes)
            found.append((math.hypot(*straight), math.hypot(*turn)))
        return tuple(found)

    def _wanted(self) -> list[tuple[FrameTask, Array]]:
        """Return the valid tasks as they were in the tick, each with its axes in the world."""
        start = self._layout.starts
        rows = self._record[start[3] : start[4]].reshape(-1, m.WANTED)
        tasks = []
        for (node, _, at), row in zip(self._layout.tasks, rows, strict=True):
            if row[24]:
                aim = pin.SE3(row[:9].reshape(3, 3).T, row[9:12])
                frame = self._layout.mechanism.frame_id(node)
                task = FrameTask(node, aim, int(row[21]), int(row[22]), row[23], frame=frame, offset=at)
                tasks.append((task, row[12:21].reshape(3, 3)))
        return tasks

    @property
    def singular_values(self) -> Array:
        """Dimensionless singular values of the tasks in the loops' null space, largest first, as many as their generic
        rank. At a type 1 singularity the last is 0. Far from singularities they are computed on access, at q."""
        count = int(self._record[m.R_PULL_RANK])
        if self._record[m.R_SIGMA]:
            start = self._layout.starts[4]
            return self._record[start : start + count]
        mechanism, resting = self._layout.mechanism, self._layout.resting
        system = mechanism.system
        loops = system.evaluate(self.q)[1][:, resting:]
        rows = equations(mechanism, system, self._wanted())[1][:, resting:]
        motions, _ = free_motions(loops, mechanism.loop_rank)
        return np.asarray(np.linalg.svd(rows @ motions, compute_uv=False)[:count])

    @property
    def loop_singular_values(self) -> Array:
        """Dimensionless singular values of all loops at q, largest first, as many as their generic rank. Computed on
        access."""
        mechanism = self._layout.mechanism
        if not mechanism.loops or mechanism.loop_rank == 0:
            return np.zeros(0)
        rows = mechanism.system.evaluate(self.q)[1][:, self._layout.resting :]
        return np.asarray(np.linalg.svd(rows, compute_uv=False)[: mechanism.loop_rank])

    @property
    def passive_singular_values(self) -> Array:
        """Dimensionless singular values of the passive joints' columns in the loops' Jacobian at q, largest first, as
        many as their generic rank. At a type 2 singularity the last is 0. Computed on access."""
        return passive_singular_values(self._layout.mechanism, self.q)

    @property
    def lost_dof(self) -> LostDoF | None:
        """Direction that the tasks follow worst at q, with its singular value (type 1); None without a task that can
        move. Computed on access."""
        wanted, layout, start = self._wanted(), self._layout, self._layout.starts
        count = int(self._record[m.R_PULL_RANK])
        found = lost(layout.mechanism, self.q, wanted, count, layout.resting)
        if found is None or len(wanted) == len(layout.tasks):
            return found
        twists = np.zeros((len(layout.tasks), 6))
        twists[self._record[start[3] : start[4]].reshape(-1, m.WANTED)[:, 24] != 0.0] = found.twists
        return replace(found, twists=twists)

    @property
    def uncontrolled_dof(self) -> UncontrolledDoF | None:
        """Motion that the actuated joints control least at q, with its singular value (type 2); None without loops.
        Computed on access."""
        return gained(self._layout.mechanism, self.q)

    @property
    def saturated(self) -> tuple[str, ...]:
        """Joints at a position limit that restricts the motion."""
        flags = self.stopped
        if not flags.any():
            return ()
        columns = self._layout.mechanism.columns
        return tuple(columns[j] for j in np.flatnonzero(flags))

    @property
    def stopped(self) -> Array:
        """(nv,) -1 for each of these at its lower limit, 1 at its upper limit, else 0."""
        start = self._layout.starts
        return self._record[start[5] : start[6]]

    @property
    def speed_scale(self) -> float:
        """Fraction of the desired motion, 0 to 1, that remains after scaling to velocity limits and to the largest
        step of a tick (0.1 rad or characteristic lengths)."""
        return float(self._record[m.R_PACE])

    @property
    def limiting_joint(self) -> str | None:
        """Joint whose velocity or acceleration limit determines `speed_scale`; None without one."""
        which = int(self._record[m.R_SLOWEST])
        return None if which < 0 else self._layout.mechanism.columns[which]

    @property
    def failed_objectives(self) -> tuple[int, ...]:
        """Indices of the solver's objectives that failed in this tick and were left out."""
        flags = int(self._record[m.R_LEFT_OUT])
        return tuple(i for i in range(flags.bit_length()) if flags >> i & 1)

    @property
    def exceptions(self) -> tuple[Exception, ...]:
        """Exceptions, with tracebacks, of objectives, barriers and the search for a path around obstacles in this tick.

        An invalid return value of theirs is a ValueError here.
        """
        return self._exceptions

    @property
    def active_barriers(self) -> tuple[int, ...]:
        """Indices of the barriers' rows that restrict the motion, among all rows of this tick; 52 stands for all
        from there on."""
        flags = int(self._record[m.R_BARRED])
        return tuple(i for i in range(flags.bit_length()) if flags >> i & 1)

    @property
    def evaluations(self) -> int:
        """Number of Pinocchio evaluations."""
        return int(self._record[m.R_EVALUATIONS])

    @property
    def sweeps(self) -> int:
        """Number of sweeps of rotations for the singular values."""
        return int(self._record[m.R_SWEEPS])
