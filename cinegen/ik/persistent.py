"""`PersistentSolver`: does not stay where limits or its posture keep it from targets that it could reach."""

from __future__ import annotations

from collections.abc import Iterable

from cinegen.errors import CinegenError
from cinegen.ik.objectives import Objective, Posture
from cinegen.ik.point_to_point import inverse_kinematics
from cinegen.ik.solver import Array, Solver
from cinegen.ik.step import Status, Step
from cinegen.ik.task import FrameTask

_STARTS = 24  # from so many configurations a way out is looked for, once for each place of the targets
_TICKS = 2  # at rest, before it is looked for
_REST = 1e-6  # rad or lengths in a tick
_RATE = 0.2  # part of the way to the other posture in a tick, at most; limits of speed count too
_THERE = 0.02  # rad or lengths from that posture, tasks take over again


class PersistentSolver(Solver):
    """A `Solver` that leaves dead ends.

    Where it comes to rest, its targets standing still and not reached, it looks for a posture that reaches them
    (`inverse_kinematics`). If there is one it goes there through the joints, loops closed and limits kept, while the
    tasks wait. The status is DETOUR meanwhile.

    A tick in which a posture is looked for takes some milliseconds; the first for a set of tasks a few tenths of a
    second where loops are to be closed. Tasks after twists never wait. What it finds may be far from where the robot
    is: not for robots among people.
    """

    _goal: Array | None = None
    _own: tuple[Objective, ...] = ()  # objectives that wait
    _resting = 0  # ticks
    _tried: tuple[bytes, ...] = ()  # where the targets were when a posture was looked for

    @property
    def objectives(self) -> tuple[Objective, ...]:
        """See `Solver`; on a detour they wait."""
        return self._objectives if self._goal is None else self._own

    @objectives.setter
    def objectives(self, objectives: Iterable[Objective]) -> None:
        self._take_over()
        Solver.objectives.__set__(self, objectives)  # type: ignore[attr-defined]

    def step(self) -> Step:
        """One tick of dt. Never raises: the status says what happened."""
        if self._goal is not None and self._places() != self._tried:
            self._take_over()
        before = self._q.copy()
        step = super().step()
        moved = self.mechanism.distance(before, self._q)
        if self._goal is not None:
            if self.mechanism.distance(self._q, self._goal) < _THERE or moved < _REST:
                self._take_over()
        elif moved < _REST * self.tick_gain and step.status in (Status.AT_LIMIT, Status.OUT_OF_REACH):
            self._resting += 1
            if self._resting >= _TICKS and self._places() != self._tried:
                self._look_for_another()
        else:
            self._resting = 0
        return step

    def _places(self) -> tuple[bytes, ...]:
        return tuple(task.target.homogeneous.tobytes() for task in self._tasks if task.is_valid())

    def _look_for_another(self) -> None:
        self._tried = self._places()
        tasks = [task for task in self._tasks if task.is_valid()]
        if not tasks or any(task.twist is not None for task in tasks):
            return
        wanted = [
            FrameTask(p.node, p.target, p.translation, p.rotation, p.weight, p.axes, offset=p.offset) for p in tasks
        ]
        try:
            reached = inverse_kinematics(self.mechanism, wanted, starts=_STARTS)
        except CinegenError:
            return
        if reached:
            self._goal, self._own = reached.q, self._objectives
            self._objectives = (Posture(reached.q, rate=_RATE / self.dt),)
            self._suspend_tasks(True)

    def _take_over(self) -> None:
        """The tasks do, again."""
        if self._goal is None:
            return
        self._goal, self._objectives, self._own = None, self._own, ()
        self._suspend_tasks(False)
        self._resting = 0
