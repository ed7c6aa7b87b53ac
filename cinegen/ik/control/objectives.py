"""Objectives and barriers of a solver: Python functions that each tick calls."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.exception_log import ExceptionLog
from cinegen.ik._kernels.memory import MOST_FLAGS
from cinegen.ik.barrier import Barrier, Bounds
from cinegen.ik.branch import passes_toggle
from cinegen.ik.control.rates import RateControl
from cinegen.ik.given_task import Task
from cinegen.ik.objectives import Objective
from cinegen.ik.setup import make_room_for_barriers
from cinegen.ik.state import State
from cinegen.ik.task import FrameTask
from cinegen.ik.thresholds import STEP_CAP

_FASTEST = 1e100  # rad/s or m/s: no objective means more


class ObjectiveControl(RateControl):
    """Control of a solver's objectives and barriers at run time. What they raise never ends a tick."""

    __slots__ = (
        "_barriers", "_blocked", "_caught", "_data", "_detour", "_keeps_branch", "_model", "_objectives",
        "exception_log",
    )  # fmt: skip

    q: Array
    exception_log: ExceptionLog
    _data: pin.Data | None  # for tasks in Python and ranges
    _model: pin.Model
    _objectives: tuple[Objective, ...]
    _detour: tuple[Objective, ...] | None  # objectives that replace them, until they are set
    _barriers: tuple[Barrier, ...]
    _blocked: bool  # a barrier failed in this tick
    _keeps_branch: bool
    _caught: tuple[Exception, ...]  # in this tick

    @property
    def tasks(self) -> tuple[FrameTask | Task, ...]:
        """Tasks in the order in which they were added."""
        raise NotImplementedError

    @property
    def objectives(self) -> tuple[Objective, ...]:
        """Objectives whose velocities, added, act in the null space that loops and tasks leave; may be set at any
        time.

        Objectives do not disturb tasks. One that raises in a tick, or returns no finite velocity of shape (nv,), is
        left out in that tick: the step's `failed_objectives` and `exceptions` report it, and the logger "cinegen" gets
        the traceback once.

        Raises:
            CinegenError: set to an object without a method `velocity`, or to one that does not fit this mechanism; or
                another thread uses the solver. Other exceptions of the first call are only logged: the objective may
                work in a later tick.
        """
        return self._objectives

    @objectives.setter
    def objectives(self, objectives: Iterable[Objective]) -> None:
        checked, state = tuple(objectives), self.state
        for i, objective in enumerate(checked):
            if not callable(getattr(objective, "velocity", None)):
                raise CinegenError(f"an objective has a method `velocity`; {objective!r} has none")
            try:
                objective.velocity(state)
            except CinegenError:
                raise
            except Exception as error:
                self.exception_log.report(self._source("objective", i, objective), error)
        self._check_thread()
        self._objectives, self._detour = checked, None

    @property
    def state(self) -> State:
        """State of the solver now, as tasks in Python, objectives and barriers are given it; it does not change."""
        return State(self._joints.limited, self.q, self.dt, self.tasks)

    @property
    def _tick_state(self) -> State:
        """The same for one tick: its data are used again in the next."""
        return State(self._joints.limited, self.q, self.dt, self.tasks, self._data)

    @property
    def barriers(self) -> tuple[Barrier, ...]:
        """Barriers that neither tasks nor objectives cross; may be set at any time.

        A barrier that raises, or returns invalid bounds, stops all motion in that tick. The step's `exceptions` report
        it, and the logger "cinegen" gets the traceback once.

        Raises:
            CinegenError: set to an object without the methods `bounds` and `clear`, or another thread uses the solver.
        """
        return self._barriers

    @barriers.setter
    def barriers(self, barriers: Iterable[Barrier]) -> None:
        checked = tuple(barriers)
        for barrier in checked:
            if not (callable(getattr(barrier, "bounds", None)) and callable(getattr(barrier, "clear", None))):
                raise CinegenError(f"a barrier has the methods `bounds` and `clear`; {barrier!r} lacks one")
        self._check_thread()
        self._barriers = checked
        self._memory.barriers, self.keep_branch = 0, self._keeps_branch

    @property
    def keep_branch(self) -> bool:
        """True if no tick passes a toggle of the actuated joints (type 2), where two branches of closed configurations
        meet; False by default. Steps that would pass one are shortened, and refused in the end: the status is BARRED
        then. It may be set at any time. A tick takes longer; see also `Step.branch_changed`."""
        return self._keeps_branch

    @keep_branch.setter
    def keep_branch(self, keeps: bool) -> None:
        self._check_thread()
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
