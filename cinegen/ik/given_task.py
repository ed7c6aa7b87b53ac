"""Tasks whose equations Python gives: the protocol that they follow, and what a solver keeps of each."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError
from cinegen.ik._kernels.memory import TaskMemory
from cinegen.ik.state import State
from cinegen.ik.task import FrameTask
from cinegen.ik.tasks.values import checked_priority
from cinegen.jit.foreign import address

_VALID = TaskMemory.fields["is_valid"].slot
_STEP = 1e-6  # rad or lengths: of the difference by which a Jacobian's sign is checked


class Task(Protocol):
    """Protocol of a task in Python: any object with these four is one. See docs/howto/own-task.md.

    The attributes may be set between two ticks. An optional attribute `unit` is the unit of `error`: "m" or "rad", or a
    sequence of these for the rows; "m" unless given. A tick calls `error` at the solver's configuration and at
    those that it tries: let it depend on the state and on the task's own attributes alone.

    Attributes:
        priority: 0 is served first; tasks of equal priority are weighed against each other.
        weight: weight among the tasks of the same priority; only proportions matter.
    """

    priority: int
    weight: float

    def error(self, state: State) -> ArrayLike:
        """Return the error (m,), which the solver drives to 0; m or rad."""
        ...

    def jacobian(self, state: State) -> ArrayLike:
        """Return its derivative by the velocities (m, nv) of Pinocchio: the error's rate is `jacobian @ v`."""
        ...


def is_task(what: Any) -> bool:
    """Return whether an object follows the protocol."""
    has_values = hasattr(what, "priority") and hasattr(what, "weight")
    return has_values and callable(getattr(what, "error", None)) and callable(getattr(what, "jacobian", None))


class GivenTask:
    """A task of the protocol, as a solver keeps it.

    Args:
        task: the task.
        state: of the solver, where the task is tried.

    Attributes:
        task: the task.
        memory: its numbers, as kernels see them.
        changed: called when the solver has to write the task again.
        problem: why the last evaluation failed; empty if it did not.

    Raises:
        CinegenError: the task does not follow the protocol, or its Jacobian has the opposite sign.
    """

    def __init__(self, task: Task, state: State) -> None:
        self.task, self.memory = task, TaskMemory()
        self._words = self.memory.words
        self.changed: Callable[[bool], None] = lambda binds: None
        self.problem = ""
        self.memory.own_target[:3] = np.eye(3)
        self.memory.target = address(self.memory.own_target)
        self.priority = checked_priority(task.priority)
        error = np.asarray(task.error(state), dtype=float)
        if error.ndim != 1 or not len(error):
            raise CinegenError(f"{task!r}: error(state) returned shape {error.shape}: return (m,), m > 0")
        rows, nv = len(error), state.model.nv
        units = _units(task, rows)
        angles = [unit == "rad" for unit in units]
        self._order = np.argsort(angles, kind="stable")  # lengths come first
        self._is_ordered = bool((np.diff(self._order) > 0).all())
        self._scale = np.where(angles, 1.0, 1.0 / state.mechanism.length)[self._order]
        self._shape, self._columns = (rows, nv), state.mechanism.scale
        memory = self.memory
        memory.resize(weighed=rows, python_rows=rows, n=nv)
        memory.translation, memory.rotation, memory.row_weight[:] = rows - sum(angles), sum(angles), 1.0
        self._minus_scale, self._weight = -self._scale, math.nan
        self.hold(())
        self.evaluate(state)
        self._check_sign(state)

    def __repr__(self) -> str:
        return repr(self.task)

    def hold(self, columns: Sequence[int]) -> None:
        """Let locked joints, by their columns, not move the task; all others do."""
        self._factor = self._scale[:, None] * self._columns
        self._factor[:, list(columns)] = 0.0
        self._numbers = self.memory.given_rows.reshape(-1)

    def is_valid(self) -> bool:
        """Return whether the last evaluation succeeded."""
        return bool(self._words[_VALID])

    @property
    def rows(self) -> int:
        """Number of equations."""
        return self._shape[0]

    def evaluate(self, state: State) -> None:
        """Evaluate the task at the beginning of a tick.

        Raises:
            Exception: of the task's own, or one that names what is wrong with what it returned; then the task is left
                out of the tick.
        """
        task = self.task
        self._words[_VALID] = 0
        if task.priority != self.priority:
            self.priority = checked_priority(task.priority)
            self.changed(True)
        if task.weight != self._weight:
            self._weight = self.memory.weight = checked_weight(task.weight)
        self.evaluate_error(state)
        rows = np.asarray(task.jacobian(state), dtype=float)
        if rows.shape != self._shape:
            raise CinegenError(f"jacobian(state) returned shape {rows.shape}: return {self._shape}")
        np.multiply(rows if self._is_ordered else rows[self._order], self._factor, out=self.memory.given_rows)
        numbers = self._numbers
        if not math.isfinite(numbers.dot(numbers)):
            raise CinegenError("jacobian(state) is not finite")
        self._words[_VALID] = 1

    def evaluate_error(self, state: State) -> None:
        """Evaluate the error only, at a configuration that a tick tries."""
        error, stored = np.asarray(self.task.error(state), dtype=float), self.memory.given_error
        if error.shape != stored.shape:
            raise CinegenError(f"error(state) returned shape {error.shape}: return {stored.shape}")
        np.multiply(error if self._is_ordered else error[self._order], self._minus_scale, out=stored)
        if not math.isfinite(stored.dot(stored)):
            raise CinegenError("error(state) is not finite")

    def _check_sign(self, state: State) -> None:
        """Compare the Jacobian with a difference of errors: the opposite sign is a mistake that no tick can mend."""
        mechanism, error = state.mechanism, self.memory.given_error
        direction = np.cos(np.arange(1.0, state.model.nv + 1.0))
        before, by_jacobian = error.copy(), self.memory.given_rows @ direction
        ahead = mechanism.structure.system.integrate(state.q, _STEP * direction)
        self.evaluate_error(State(mechanism, ahead, state.dt))
        slope, size = (before - error) / _STEP, float(np.linalg.norm(by_jacobian))
        if size > 1e-3 and np.linalg.norm(slope + by_jacobian) < 1e-2 * size:
            raise CinegenError(f"{self.task!r}: jacobian(state) has the wrong sign: return the derivative of the error")


class HasError(Protocol):
    """A task of the protocol, or a range of one."""

    def error(self, state: State) -> ArrayLike:
        """Return the error (m,), m or rad."""
        ...


def errors_of(task: FrameTask | HasError, state: State) -> tuple[float, float]:
    """Return the remaining error of a task at a state, or by how much it is out of its range: m and rad."""
    if isinstance(task, FrameTask):
        return task.distances(state.mechanism, state.q)
    error = np.asarray(task.error(state), dtype=float)
    angles = np.array([unit == "rad" for unit in _units(task, len(error))])
    return math.hypot(*error[~angles]), math.hypot(*error[angles])


AnyTask: TypeAlias = FrameTask | GivenTask
"""A task as a solver keeps it."""


def rows_of(task: Task, state: State) -> Array:
    """Return the rows (m, nv) of a task at a state, dimensionless.

    Raises:
        Exception: of the task's own, or one that names what is wrong with what it returned.
    """
    rows = np.asarray(task.jacobian(state), dtype=float)
    scale = np.array([1.0 if unit == "rad" else 1.0 / state.mechanism.length for unit in _units(task, len(rows))])
    return np.asarray(rows * state.mechanism.scale * scale[:, None])


def checked_weight(weight: Any) -> float:
    """Return a valid weight.

    Raises:
        CinegenError: it is not positive and finite.
    """
    try:
        good = 0.0 < float(weight) < math.inf
    except (TypeError, ValueError):
        good = False
    if not good:
        raise CinegenError(f"a task's weight must be positive and finite, not {weight!r:.80}")
    return float(weight)


def _units(task: HasError, rows: int) -> Sequence[str]:
    unit = getattr(task, "unit", "m")
    units = [unit] * rows if isinstance(unit, str) else list(unit)
    if len(units) != rows or not set(units) <= {"m", "rad"}:
        raise CinegenError(f"{task!r}: unit is 'm' or 'rad', or one of these for each of {rows} rows, not {unit!r:.80}")
    return units
