"""Tasks of pink as tasks of a solver. Both use Pinocchio. Needs the extra `pink`."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.ik.state import State
from cinegen.ik.tasks.values import checked_priority
from raff2urdf.command.extras import needs

_POSE = ("m", "m", "m", "rad", "rad", "rad")
_UNITS: dict[str, Sequence[str] | str] = {
    "FrameTask": _POSE, "RelativeFrameTask": _POSE, "ComTask": "m", "PostureTask": "rad", "DampingTask": "rad",
    "LowAccelerationTask": "rad",
}  # fmt: skip


class PinkTask:
    """A task of pink, which a solver follows.

    The task may be changed between two ticks (`set_target`, `cost`). Rows of cost 0 are left out; the others are
    weighed as their costs are, and `weight` is the largest.

    Args:
        task: a task of pink: an object with `compute_error`, `compute_jacobian` and `cost`.
        priority: 0 is served first.
        unit: unit of the rows, "m" or "rad", or one of these for each; known for pink's own tasks.

    Raises:
        CinegenError: the task is none of pink's, its gain is not 1, its lm_damping not 0, or its rows' unit is not
            known.
        MissingExtraError: pink is not installed.
    """

    __slots__ = ("_configuration", "_priority", "_unit", "task")

    def __init__(self, task: Any, priority: int = 0, unit: str | Sequence[str] | None = None) -> None:
        with needs("pink", "tasks of pink"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # qpsolvers misses solvers that no task needs
            from pink import Configuration
        if not (callable(getattr(task, "compute_error", None)) and callable(getattr(task, "compute_jacobian", None))):
            raise CinegenError(f"a task of pink has compute_error and compute_jacobian, not {task!r:.80}")
        unit = _UNITS.get(type(task).__name__) if unit is None else unit
        if unit is None:
            raise CinegenError(f"the unit of {type(task).__name__}'s rows is not known: give unit='m' or 'rad'")
        if task.gain != 1.0:
            raise CinegenError(
                f"a solver has one gain for all tasks: set Solver.gain, and the task's to 1, not {task.gain}"
            )
        if task.lm_damping != 0.0:
            raise CinegenError(
                f"a solver damps motion near singularities: set the task's lm_damping to 0, not {task.lm_damping}"
            )
        self.task, self._unit, self._configuration = task, unit, Configuration
        self._priority = checked_priority(priority)

    def __repr__(self) -> str:
        return f"<PinkTask of {self.task!r}>"

    @property
    def priority(self) -> int:
        """Level of the task; 0 is served first."""
        return self._priority

    @priority.setter
    def priority(self, priority: int) -> None:
        self._priority = checked_priority(priority)

    @property
    def weight(self) -> float:
        """Largest cost of a row."""
        return float(np.max(self._costs))

    @property
    def unit(self) -> str | Sequence[str]:
        """Unit of the rows, or of each of them."""
        if isinstance(self._unit, str):
            return self._unit
        return [
            unit
            for unit, is_kept in zip(self._unit, np.broadcast_to(self._costs > 0.0, len(self._unit)), strict=True)
            if is_kept
        ]

    @property
    def _costs(self) -> Array:
        return np.atleast_1d(np.asarray(1.0 if self.task.cost is None else self.task.cost, dtype=float))

    def _weighed(self, rows: Array) -> Array:
        """Return rows times their costs, as fractions of the largest, without those of cost 0."""
        costs = np.broadcast_to(self._costs, len(rows))
        kept = costs > 0.0
        return np.asarray((rows[kept].T * (costs[kept] / costs.max())).T)

    def error(self, state: State) -> Array:
        """Return the error (m,) by the task, weighted by its costs."""
        return self._weighed(np.asarray(self.task.compute_error(self._at(state)), dtype=float))

    def jacobian(self, state: State) -> Array:
        """Return the Jacobian (m, nv) by the task, weighted alike."""
        return self._weighed(np.asarray(self.task.compute_jacobian(self._at(state)), dtype=float))

    def _at(self, state: State) -> Any:
        data = state.dynamics_data
        pin.updateFramePlacements(state.model, data)
        return self._configuration(state.model, data, state.q, copy_data=False, forward_kinematics=False)
