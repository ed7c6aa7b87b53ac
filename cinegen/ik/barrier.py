"""Barriers: linear bounds of the joint velocities that neither tasks nor objectives violate; and ranges, which keep the
values of a task between bounds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError
from cinegen.ik.given_task import Task, is_task
from cinegen.ik.state import State
from cinegen.joints import kinematic_data


class Bounds(NamedTuple):
    """Bounds rows v <= most of the joint velocities v.

    Attributes:
        rows: (m, nv) m/s per rad/s and m/s.
        most: (m,) m/s; negative where the mechanism has to retreat. Where velocity limits or other bounds do not allow
            that, it retreats more slowly, or stops; it never advances.
    """

    rows: Array
    most: Array


class Barrier(Protocol):
    """Object with the methods `bounds` and `clear`.

    A tick keeps the bounds exactly, like joint limits: B. Faverjon and P. Tournassoud, "A local based approach for path
    planning of manipulators with a high number of degrees of freedom", IEEE Int. Conf. Robotics and Automation, 1987.
    The bounds are linear, what they stand for is not: so each step is checked by `clear` before it is made.
    """

    def bounds(self, state: State) -> Bounds:
        """Return the bounds of the next tick."""
        ...

    def clear(self, state: State, q: Array) -> float:
        """Return the fraction of the step to q (nq,) that the mechanism may make: 1 for all of it."""
        ...


TOLERANCE = 1e-7
"""m or rad: a step that ends this little beyond a bound is made."""

_MARGIN = 1.3  # of the curvature of the last step, by which the next is kept inside
_FORGET = 0.9  # of that curvature, from tick to tick


class Range:
    """Values of a task stay in a range, as joints stay within their limits: a tool stays within a cone about upright, a
    point above a floor. It is a barrier (`Solver.barriers`) that `Solver.add_task` takes, too.

    A tick's bounds are linear, values are not: the curvature of the last step is allowed for, and a step that leads
    out of the range by more than 1e-7 m or rad is shortened. A mechanism that begins outside of the range moves back
    into it. A range belongs to one solver.

    Args:
        task: task whose `error` is the value: 0 is what the task by itself would reach.
        low: smallest value of each row, or one number for all; m or rad. -inf unless given.
        high: largest; inf unless given.
        radius: largest length of all rows together: half the angle of a cone, for instance. In place of low and high.

    Raises:
        CinegenError: the task does not follow the protocol `Task`, no bound is given, or a radius besides low or
            high; a bound is NaN, low exceeds high, or the radius is not above 0.
    """

    __slots__ = ("__weakref__", "_bend", "_data", "_step", "high", "low", "radius", "task")

    def __init__(
        self, task: Task, low: ArrayLike | None = None, high: ArrayLike | None = None, radius: float | None = None
    ) -> None:
        if not is_task(task):
            raise CinegenError(f"a range is of a task with error(state) and jacobian(state), not of {task!r:.80}")
        if (radius is None) == (low is None and high is None):
            raise CinegenError("a range has low or high or both, or a radius")
        self.task, self.radius = task, radius
        self.low = np.atleast_1d(np.array(-np.inf if low is None else low, dtype=float))
        self.high = np.atleast_1d(np.array(np.inf if high is None else high, dtype=float))
        fits = 1 in (len(self.low), len(self.high)) or self.low.shape == self.high.shape
        if not (fits and (self.low <= self.high).all()):  # false of NaN
            raise CinegenError(f"a range's low must not exceed its high, row by row: {low!r:.60} and {high!r:.60}")
        if radius is not None and not 0.0 < radius < math.inf:
            raise CinegenError(f"a range's radius must be above 0 (m or rad), not {radius!r:.60}")
        self._data: pin.Data | None = None
        self._bend = np.zeros(0)  # second-order change of each value by a step, as a multiple of its square
        self._step = 0.0  # squared length of the last step, dimensionless

    def __repr__(self) -> str:
        bounds = f"radius {self.radius:g}" if self.radius is not None else f"{self.low} to {self.high}"
        return f"<Range of {self.task!r}: {bounds}>"

    @property
    def unit(self) -> str | Sequence[str]:
        """Units of the values."""
        return getattr(self.task, "unit", "m")

    def error(self, state: State) -> Array:
        """Return by how much the values (m,) are beyond their bounds, with sign; m or rad, 0 within."""
        value = np.asarray(self.task.error(state), float)
        if self.radius is not None:
            return np.asarray(value * max(0.0, 1.0 - self.radius / max(float(np.linalg.norm(value)), 1e-12)))
        return np.asarray(value - np.clip(value, self.low, self.high))

    def bounds(self, state: State) -> Bounds:
        """Return the bounds of the next tick; see `Barrier.bounds`."""
        values, rows = self._values(state)
        if len(self._bend) != len(values):
            self._bend, self._step = np.zeros(len(values)), 0.0
        most = -values - _MARGIN * self._bend * self._step
        self._bend = self._bend * _FORGET
        return Bounds(rows, most / state.dt)

    def clear(self, state: State, q: Array) -> float:
        """Return the fraction of the step to q that keeps the range; see `Barrier.clear`."""
        if self._data is None:
            self._data = kinematic_data(state.model)
        before, rows = self._values(state)
        after = self._values(State(state.mechanism, q, state.dt, (), self._data))[0]
        step = state.mechanism.difference(state.q, q)
        self._step = float(np.sum((step / state.mechanism.scale) ** 2))
        if self._step > 0.0:
            bend = (after - before - rows @ step) / self._step
            self._bend = np.maximum(self._bend, np.maximum(bend, 0.0))
        beyond = after > np.maximum(before, TOLERANCE)
        parts = (TOLERANCE - before[beyond]) / (after[beyond] - before[beyond])
        return float(np.clip(parts, 0.0, 1.0).min(initial=1.0))

    def _values(self, state: State) -> tuple[Array, Array]:
        """Return by how much each value exceeds its bounds (m,), and the derivative (m, nv)."""
        error, rows = np.asarray(self.task.error(state), float), np.asarray(self.task.jacobian(state), float)
        if self.radius is not None:
            size = float(np.linalg.norm(error))
            return np.array([size - self.radius]), (error / max(size, 1e-12))[None, :] @ rows
        low, high = np.broadcast_to(self.low, error.shape), np.broadcast_to(self.high, error.shape)
        above, below = np.isfinite(high), np.isfinite(low)
        return np.concatenate([error[above] - high[above], low[below] - error[below]]), np.vstack(
            [rows[above], -rows[below]]
        )
