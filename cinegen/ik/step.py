"""The result of a tick: its status, and the numbers behind it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.html import table
from cinegen.ik._kernels import memory as m
from cinegen.ik.branch import passes_toggle
from cinegen.ik.equations import equations
from cinegen.ik.singular_values import LostDoF, UncontrolledDoF, gained, lost, passive_singular_values
from cinegen.ik.task import FrameTask
from cinegen.ik.thresholds import ARRIVED
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.motions import motions_of
from cinegen.model import Mechanism


class Status(Enum):
    """Outcome of a tick. The first that applies is reported, in this order: BAD_TARGET, IDLE, REFUSED, FOLLOWING (all
    targets reached), DETOUR, BARRED, AT_LIMIT, OUT_OF_REACH, SINGULAR, FOLLOWING (moving towards them). IN_COLLISION
    and UNAVOIDABLE, of `AvoidingSolver` only, come before all others."""

    BAD_TARGET = "a task has an invalid target, weight or other value: it is left out"
    REFUSED = "the loops could not be closed after any fraction of the step: the configuration is unchanged"
    AT_LIMIT = "a joint limit restricts the motion"
    SINGULAR = "near a singularity: motion is damped"
    OUT_OF_REACH = "the motion has stopped and a target is not reached"
    FOLLOWING = "every task is followed"
    IDLE = "there is no task"
    DETOUR = "moving to the targets by another configuration"
    BARRED = "a barrier restricts the motion"
    UNAVOIDABLE = "no motion was found that avoids a collision: braking to a stop"
    IN_COLLISION = "two bodies are in contact"
    NO_FREEDOM = "tasks of higher priority leave no freedom for a task"


STATUSES = tuple(Status)  # in the kernel's order, which knows all but UNAVOIDABLE and IN_COLLISION


class Level(NamedTuple):
    """Outcome of a tick for the tasks of one priority.

    Attributes:
        status: outcome.
        smallest_singular_value: of its tasks in the freedom that the levels above leave, dimensionless and without the
            weights of tasks; infinite if it was not needed, or there is none.
    """

    status: Status
    smallest_singular_value: float


@dataclass(frozen=True)
class Layout:
    """Layout of a tick's record.

    Attributes:
        mechanism: mechanism that was moved.
        tasks: node, axes and offset of each task; the offset is None of a task in Python.
        levels: level of each task, 0 first.
        fields: where the parts of a record are, and their shapes.
        dt: period of the tick, s.
    """

    mechanism: Mechanism
    tasks: tuple[tuple[str, str, pin.SE3 | None], ...]
    levels: tuple[int, ...]
    fields: Mapping[str, tuple[slice, tuple[int, ...]]]
    dt: float

    def get(self, record: Array, name: str) -> Array:
        """Return a part of a record, by the name that `SolverMemory` has for it."""
        where, shape = self.fields[name]
        return record[where].reshape(shape)


class Step:
    """Result of one tick; immutable."""

    __slots__ = ("_exceptions", "_layout", "_problems", "_record")

    def __init__(
        self, record: Array, layout: Layout, exceptions: tuple[Exception, ...] = (), problems: tuple[str, ...] = ()
    ) -> None:
        self._record, self._layout, self._exceptions, self._problems = record, layout, exceptions, problems

    def __repr__(self) -> str:
        errors = ", ".join(f"{left:.3g} m {angle:.3g} rad" for left, angle in self.errors)
        return f"<Step {self.status.name}: errors ({errors}), closure {self.closure:.1g}>"

    def with_status(self, status: Status) -> Step:
        """Return the same step with another status."""
        record = self._record.copy()
        record[m.STATUS] = STATUSES.index(status)
        return Step(record, self._layout, self._exceptions, self._problems)

    def _repr_html_(self) -> str:
        tasks = zip(self._layout.tasks, self.errors, strict=True)
        rows = [(node, f"{1e3 * left:.3g}", f"{angle:.3g}") for (node, _, _), (left, angle) in tasks]
        caption = f"Step {self.status.name}: {self.status.value}; closure {self.closure:.1g}"
        return table(caption, ("task", "error (mm)", "error (rad)"), rows)

    @property
    def status(self) -> Status:
        """Outcome of the tick."""
        return STATUSES[int(self._record[m.STATUS])]

    @property
    def q(self) -> Array:
        """(nq,) new configuration."""
        return self._layout.get(self._record, "record_q")

    @property
    def v(self) -> Array:
        """(nv,) velocity of the tick, rad/s and m/s."""
        return self._layout.get(self._record, "record_v")

    @property
    def closure(self) -> float:
        """Largest loop residual at q, rad or characteristic lengths."""
        return float(self._record[m.CLOSURE])

    @property
    def errors(self) -> tuple[tuple[float, float], ...]:
        """Remaining error of each task, in the order in which they were added: m and rad; NaN of an invalid task."""
        if self._record[m.ERRORS_KNOWN]:
            return tuple((left, angle) for left, angle in self._layout.get(self._record, "record_errors").tolist())
        mechanism, q = self._layout.mechanism, self.q
        remaining = [(math.nan, math.nan)] * len(self._layout.tasks)
        for i, task, axes in self._wanted():
            straight, turn = task.errors(mechanism.placement(q, task.node) * task.offset, axes)
            remaining[i] = math.hypot(*straight), math.hypot(*turn)
        return tuple(remaining)

    @property
    def problems(self) -> tuple[str, ...]:
        """Texts on the tasks that were left out: the name of the wrong value, the value, and what it must be; empty for
        valid tasks."""
        return self._problems or ("",) * len(self._layout.tasks)

    @property
    def task_statuses(self) -> tuple[Status, ...]:
        """Outcome of the tick for each task, in the order in which they were added: BAD_TARGET if it was left out,
        FOLLOWING if it is reached, else that of its level. Beside a task that was left out, the status is what hinders
        all others: BARRED, AT_LIMIT, OUT_OF_REACH if nothing moves, else FOLLOWING. REFUSED, IN_COLLISION and
        UNAVOIDABLE are statuses of all tasks."""
        status, tasks = self.status, self._layout.get(self._record, "record_tasks")
        if status in (Status.IN_COLLISION, Status.UNAVOIDABLE, Status.REFUSED):
            return (status,) * len(tasks)
        levels = [self._hindrance] if status is Status.BAD_TARGET else [level.status for level in self.levels]
        statuses, length = list[Status](), self._layout.mechanism.length
        for i, (distance, angle) in enumerate(self.errors):
            if not tasks[i, 1]:
                statuses.append(Status.BAD_TARGET)
            elif max(distance / length, angle) <= ARRIVED:
                statuses.append(Status.FOLLOWING)
            else:
                statuses.append(levels[min(self._layout.levels[i], len(levels) - 1)])
        return tuple(statuses)

    @property
    def _hindrance(self) -> Status:
        """The hindrance in a tick whose status is that of a task that was left out."""
        if self.active_barriers:
            return Status.BARRED
        if self.saturated:
            return Status.AT_LIMIT
        return Status.FOLLOWING if self.v.any() else Status.OUT_OF_REACH

    def _wanted(self) -> list[tuple[int, FrameTask, Array]]:
        """Return the valid tasks that are frames as they were in the tick, each with its index before and its axes in
        the world behind."""
        layout, record, tasks = self._layout, self._record, []
        kept, aims, axes = (layout.get(record, f"record_{name}") for name in ("tasks", "aims", "axes"))
        for i, (node, _, offset) in enumerate(layout.tasks):
            weight, is_active, weights = kept[i, 0], kept[i, 1], kept[i, 2:]
            if is_active and offset is not None:
                aim, frame = pin.SE3(aims[i, :3].T, aims[i, 3]), layout.mechanism.frame_id(node)
                task = FrameTask(node, aim, weight=weight, frame=frame, offset=offset, weights=weights)
                tasks.append((i, task, axes[i].T))
        return tasks

    def _first_level(self) -> list[tuple[FrameTask, Array]]:
        """Return those of the first level."""
        return [(task, axes) for i, task, axes in self._wanted() if self._layout.levels[i] == 0]

    @property
    def levels(self) -> tuple[Level, ...]:
        """Outcome of each level of priority, the first first. A level's errors are those of its tasks in `errors`."""
        rows = self._layout.get(self._record, "record_levels").tolist()
        if len(rows) == 1:  # its status may be that of a task in Python, too
            return (Level(self.status, rows[0][1]),)
        return tuple(Level(STATUSES[int(status)], smallest) for status, smallest in rows)

    @property
    def singular_values(self) -> Array:
        """Dimensionless singular values of the weighted tasks, of the first level if there are several, in the loops'
        null space, largest first, as many as their generic rank. At a type 1 singularity the last is 0. Far from
        singularities they are computed on access, at q; with a task in Python they are those before the tick."""
        count = int(self._record[m.TASK_RANK])
        if self._record[m.SIGMA_KNOWN]:
            return self._layout.get(self._record, "record_sigma")[:count]
        mechanism = self._layout.mechanism
        system = mechanism.structure.system
        motions = motions_of(system, self.q, mechanism.loop_rank)
        rows = equations(mechanism, system, self._first_level())[1]
        return np.asarray(np.linalg.svd(rows @ motions, compute_uv=False)[:count])

    @property
    def loop_singular_values(self) -> Array:
        """Dimensionless singular values of all loops at q, largest first: `Mechanism.loop_singular_values`. Computed on
        access."""
        return self._layout.mechanism.loop_singular_values(self.q)

    @property
    def passive_singular_values(self) -> Array:
        """Dimensionless singular values of the passive joints' columns in the loops' screw matrix at q, largest first,
        as many as their generic rank. At a type 2 singularity the last is 0. Computed on access."""
        return passive_singular_values(self._layout.mechanism, self.q)

    @property
    def lost_dof(self) -> LostDoF | None:
        """Direction that the tasks of the first level follow worst at q, with its singular value (type 1); None without
        a task that can move, or with a task in Python. Computed on access."""
        return self.lost_dof_in(None)

    def lost_dof_in(self, system: ClosedLoops | None) -> LostDoF | None:
        """Return `lost_dof` by another Jacobian of the mechanism's loops: see `cinegen.ik.singular_values.lost`."""
        wanted, layout = self._first_level(), self._layout
        count, pairs = int(self._record[m.TASK_RANK]), zip(layout.tasks, layout.levels, strict=True)
        if any(offset is None and level == 0 for (_, _, offset), level in pairs):
            return None
        dof = lost(layout.mechanism, self.q, wanted, count, system)
        if dof is None or len(wanted) == len(layout.tasks):
            return dof
        twists = np.zeros((len(layout.tasks), 6))
        first = np.array(layout.levels) == 0
        twists[first & (layout.get(self._record, "record_tasks")[:, 1] != 0.0)] = dof.twists
        return replace(dof, twists=twists)

    @property
    def uncontrolled_dof(self) -> UncontrolledDoF | None:
        """Motion that the actuated joints control least at q, with its singular value (type 2); None without loops.
        Computed on access."""
        return gained(self._layout.mechanism, self.q)

    @property
    def branch_changed(self) -> bool:
        """True if the tick passed a toggle of the actuated joints (type 2): the sign of the determinant of the passive
        joints' Jacobian of the loops has changed. `Solver(keep_branch=True)` does not pass one. Computed on access."""
        mechanism, q = self._layout.mechanism, self.q
        return passes_toggle(mechanism, mechanism.integrate(q, -self._layout.dt * self.v), q)

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
        return self._layout.get(self._record, "record_stopped")

    @property
    def speed_scale(self) -> float:
        """Fraction of the desired motion, 0 to 1, that remains after scaling to velocity limits and to the largest
        step of a tick (0.1 rad or characteristic lengths)."""
        return float(self._record[m.SPEED_SCALE])

    @property
    def limiting_joint(self) -> str | None:
        """Joint whose velocity or acceleration limit determines `speed_scale`; None without one."""
        which = int(self._record[m.LIMITING_DOF])
        return None if which < 0 else self._layout.mechanism.columns[which]

    @property
    def failed_objectives(self) -> tuple[int, ...]:
        """Indices of the solver's objectives that failed in this tick and were left out."""
        flags = int(self._record[m.FAILED_OBJECTIVES])
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
        flags = int(self._record[m.ACTIVE_BARRIERS])
        return tuple(i for i in range(flags.bit_length()) if flags >> i & 1)

    @property
    def evaluations(self) -> int:
        """Number of times that the placements and Jacobians of all joints were computed."""
        return int(self._record[m.EVALUATIONS])

    @property
    def sweeps(self) -> int:
        """Number of sweeps of rotations for the singular values."""
        return int(self._record[m.SWEEPS])
