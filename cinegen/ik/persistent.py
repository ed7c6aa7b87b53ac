"""`PersistentSolver`: leaves dead ends by another configuration that reaches the targets."""

from __future__ import annotations

import math
from collections.abc import Mapping

from numpy.typing import ArrayLike

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.ik.global_ik import inverse_kinematics
from cinegen.ik.objectives import Posture
from cinegen.ik.solver import Solver
from cinegen.ik.step import Status, Step
from cinegen.model import Mechanism

_STARTS = 24  # of the search, once for each set of targets
_TICKS = 2  # at rest before the search
_REST = 1e-6  # rad or lengths in a tick
_RATE = 0.2  # largest fraction of the distance to the other configuration in a tick; velocity limits apply, too
_ARRIVED = 0.02  # rad or lengths from that configuration, where the tasks are resumed


class PersistentSolver(Solver):
    """A `Solver` that leaves dead ends.

    Where it comes to rest before targets that do not move, it searches for a configuration that reaches them
    (`inverse_kinematics`). If there is one, it moves there in joint space, loops closed and limits kept, while the
    tasks and the objectives are suspended. The status is DETOUR meanwhile.

    A tick with a search takes some milliseconds; the first for a set of tasks takes a few tenths of a second if the
    mechanism has loops. Tasks that follow twists are never suspended. Setting a target or objectives ends the detour.
    The configuration found may be far away: do not use this solver for robots among people.
    """

    __slots__ = ("_goal", "_resting", "_tried")

    def __init__(
        self,
        mechanism: Mechanism,
        dt: float,
        q: ArrayLike | None = None,
        gain: float = math.inf,
        acceleration: float | Mapping[str, float] | None = None,
        keep_branch: bool = False,
    ) -> None:
        self._goal: Array | None = None
        self._resting = 0  # ticks at rest
        self._tried: tuple[bytes, ...] = ()  # targets of the last search
        super().__init__(mechanism, dt, q, gain, acceleration, keep_branch)

    def _mark_changed(self, binds: bool) -> None:
        super()._mark_changed(binds)
        if binds:
            self._tried = ()

    def _step(self) -> Step:
        if self._goal is not None and (self._detour is None or self._targets() != self._tried):
            self._resume()
        before = self._q.copy()
        step = super()._step()
        moved = self.mechanism.distance(before, self._q)
        if self._goal is not None:
            if self.mechanism.distance(self._q, self._goal) < _ARRIVED or moved < _REST:
                self._resume()
        elif moved < _REST * self.tick_gain and step.status in (Status.AT_LIMIT, Status.OUT_OF_REACH):
            self._resting += 1
            if self._resting >= _TICKS and self._targets() != self._tried:
                self._search()
        else:
            self._resting = 0
        return step

    def _targets(self) -> tuple[bytes, ...]:
        return tuple(task.target.homogeneous.tobytes() for task in self.frame_tasks if task.is_valid())

    def _search(self) -> None:
        """Search for a configuration that reaches the targets; if there is one, suspend the tasks and move there."""
        self._tried = self._targets()
        tasks = [task for task in self.frame_tasks if task.is_valid()]
        if not tasks or len(self.frame_tasks) < len(self.tasks) or any(task.twist is not None for task in tasks):
            return
        try:
            result = inverse_kinematics(self._joints.limited, tasks, starts=_STARTS)
        except CinegenError:
            return
        if result:
            self._goal, self._detour = result.q, (Posture(result.q, rate=_RATE / self.dt),)
            self._suspend_tasks(True)

    def _resume(self) -> None:
        """Resume the tasks."""
        if self._goal is None:
            return
        self._goal, self._detour = None, None
        self._suspend_tasks(False)
        self._resting = 0
