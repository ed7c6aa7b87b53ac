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
from cinegen.ik.task import FrameTask, checked_priority
from cinegen.jit.foreign import address

_STEP = 1e-6  # rad or lengths: of the difference by which a Jacobian's sign is checked


class Task(Protocol):
    """What a solver asks of a task. Any object with these four serves; see docs/howto.md, "Write your own task".

    The attributes may be set between two ticks. An optional attribute `unit`, "m" or "rad", or a sequence of these for
    the rows, says what `error` is in; it is "m" unless given. A tick calls `error` at the solver's configuration and at
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

    Raises:
        CinegenError: the task does not follow the protocol, or its Jacobian has the opposite sign.
    """

    def __init__(self, task: Task, state: State) -> None:
        self.task, self.memory = task, TaskMemory()
        self.changed: Callable[[], None] = lambda: None
        self.memory.own_target[:3] = np.eye(3)
        self.memory.target = address(self.memory.own_target)
        self.priority = checked_priority(task.priority)
        checked_weight(task.weight)
        error = _checked_error(task.error(state), None)
        rows = len(error)
        if not rows:
            raise CinegenError(f"{task!r}: error(state) is empty: return at least one row")
        units = _units(task, rows)
        self._order = np.argsort([unit == "rad" for unit in units], kind="stable")  # lengths come first
        self._scale = np.array([1.0 if unit == "rad" else 1.0 / state.mechanism.length for unit in units])[self._order]
        jacobian = _checked_jacobian(task.jacobian(state), (rows, state.model.nv))
        self._check_sign(state, error, jacobian)
        lengths = sum(unit == "m" for unit in units)
        memory = self.memory
        memory.resize(weighed=rows, given=rows, n=state.model.nv)
        memory.translation, memory.rotation, memory.row_weight[:] = lengths, rows - lengths, 1.0
        self._columns = state.mechanism.scale
        self._is_good = True

    def __repr__(self) -> str:
        return repr(self.task)

    def is_valid(self) -> bool:
        """Return whether the last evaluation succeeded."""
        return self._is_good

    @property
    def rows(self) -> int:
        """Number of equations."""
        return int(self.memory.given)

    def evaluate(self, state: State) -> None:
        """Evaluate the task at the beginning of a tick.

        Raises:
            Exception: any of the task's own, or one that says what is wrong with what it returned; the task is left out
                of the tick.
        """
        memory = self.memory
        memory.is_valid, self._is_good = 0, False
        priority = checked_priority(self.task.priority)
        if priority != self.priority:
            self.priority = priority
            self.changed()
        memory.weight = checked_weight(self.task.weight)
        self.evaluate_error(state)
        rows = _checked_jacobian(self.task.jacobian(state), (self.rows, state.model.nv))[self._order]
        memory.given_rows[:] = rows[:, len(self._columns) - memory.n :] * self._columns * self._scale[:, None]
        memory.is_valid, self._is_good = 1, True

    def evaluate_error(self, state: State) -> None:
        """Evaluate the error only, at a configuration that a tick tries."""
        error = _checked_error(self.task.error(state), self.rows)
        self.memory.given_error[:] = -error[self._order] * self._scale

    def _check_sign(self, state: State, error: Array, jacobian: Array) -> None:
        """Compare the Jacobian with a difference of errors: the opposite sign is a mistake that no tick can mend."""
        direction = np.cos(np.arange(1.0, state.model.nv + 1.0))
        system = state.mechanism.system
        ahead = system.integrate(state.q, _STEP * direction)
        found = (_checked_error(self.task.error(State(state.mechanism, ahead, state.dt)), len(error)) - error) / _STEP
        told = jacobian @ (direction * state.mechanism.scale)
        size = float(np.linalg.norm(told))
        if size > 1e-3 and np.linalg.norm(found + told) < 1e-2 * size:
            raise CinegenError(
                f"{self.task!r}: jacobian(state) has the opposite sign: return the derivative of the error"
            )


AnyTask: TypeAlias = FrameTask | GivenTask
"""A task as a solver keeps it."""


def rows_of(task: Task, state: State) -> Array:
    """Return the rows (m, nv) of a task at a state, dimensionless.

    Raises:
        Exception: any of the task's own, or one that says what is wrong with what it returned.
    """
    found = np.asarray(task.jacobian(state), dtype=float)
    _checked_jacobian(found, (len(found), state.model.nv))
    scale = np.array([1.0 if unit == "rad" else 1.0 / state.mechanism.length for unit in _units(task, len(found))])
    return np.asarray(found * state.mechanism.scale * scale[:, None])


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


def _units(task: Task, rows: int) -> Sequence[str]:
    unit = getattr(task, "unit", "m")
    units = [unit] * rows if isinstance(unit, str) else list(unit)
    if len(units) != rows or not set(units) <= {"m", "rad"}:
        raise CinegenError(f"{task!r}: unit is 'm' or 'rad', or one of these for each of {rows} rows, not {unit!r:.80}")
    return units


def _checked_error(error: ArrayLike, rows: int | None) -> Array:
    found = np.asarray(error, dtype=float)
    if found.ndim != 1 or (rows is not None and len(found) != rows):
        wanted = "(m,)" if rows is None else (rows,)
        raise CinegenError(f"error(state) returned shape {found.shape}: return {wanted}")
    if not np.isfinite(found).all():
        raise CinegenError("error(state) is not finite")
    return found


def _checked_jacobian(jacobian: ArrayLike, shape: tuple[int, int]) -> Array:
    found = np.asarray(jacobian, dtype=float)
    if found.shape != shape:
        raise CinegenError(f"jacobian(state) returned shape {found.shape}: return {shape}")
    if not np.isfinite(found).all():
        raise CinegenError("jacobian(state) is not finite")
    return found
