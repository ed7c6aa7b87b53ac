"""RRT-Connect by OMPL (https://ompl.kavrakilab.org), for any function that tests motions. Needs the package ompl."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import ompl.base as ob
import ompl.geometric as og
import ompl.util as ou
from numpy.typing import NDArray

Array = NDArray[np.float64]
Free = Callable[[Array, Array], bool]
Close = Callable[[Array], Array | None]

_STRIDE = 0.4  # between projected points of a motion
_CLOSED = 1e-8
_FIRST, _GROWTH = 1500, 1.5  # work of the first pair of trees; of each one relative to the one before


class Trees:
    """Two trees in a box that grow towards each other, one from the start and one from the goals (J. J. Kuffner and
    S. M. LaValle, "RRT-Connect: an efficient approach to single-query path planning", ICRA 2000).

    The time that they need has a heavy tail: trees that have not met after a while start anew, each pair with more work
    than the one before (M. Luby, A. Sinclair and D. Zuckerman, "Optimal speedup of Las Vegas algorithms", 1993).

    Args:
        low: (n,) lower bounds of the box.
        high: (n,) upper bounds.
        start: (n,)
        goals: (n,) each.
        free: whether the straight motion between two points is free.
        longest: longest motion to a new point.
        seed: seed from 0: the same seed finds the same path, if there is time.
        close: if points have to satisfy equations: returns a point (n,) near a given one that does, or None. Random
            targets, and the motions to them, are projected by it (Z. Kingston, M. Moll and L. E. Kavraki, "Exploring
            implicit spaces for constrained sampling-based planning", IJRR 2019).
        equations: number of independent equations.
    """

    def __init__(
        self,
        low: Array,
        high: Array,
        start: Array,
        goals: Sequence[Array],
        free: Free,
        longest: float,
        seed: int,
        close: Close | None = None,
        equations: int = 0,
    ) -> None:
        self._count = len(low)
        self._targets, self._pair, self._limit = 0, 0, float(_FIRST)
        with _silence():
            ou.RNG.setSeed(1 + seed)
            box = ob.RealVectorBounds(self._count)
            for i in range(self._count):
                box.setLow(i, float(low[i]))
                box.setHigh(i, float(high[i]))
            space = ob.RealVectorStateSpace(self._count)
            space.setBounds(box)
            if close is None:
                information = ob.SpaceInformation(space)
            else:
                space = ob.ProjectedStateSpace(space, _Closed(self._count, equations, close))
                information = ob.ConstrainedSpaceInformation(space)
                space.setDelta(_STRIDE)

            def state(point: Array) -> ob.State:
                made = space.allocState()
                if close is None:
                    made[0 : self._count] = point.tolist()
                else:
                    made.copy(point.tolist())
                return made

            # OMPL would test points, and motions at samples: `free` decides instead
            information.setStateValidityChecker(ob.AllValidStateValidityChecker(information))
            self._motions = _Motions(information, self._count, free)
            information.setMotionValidator(self._motions)
            information.setup()
            problem = self._problem = ob.ProblemDefinition(information)
            problem.addStartState(state(start))
            aim = ob.GoalStates(information)
            for goal in goals:
                aim.addState(state(goal))
            problem.setGoal(aim)
            planner = self._planner = og.RRTConnect(information)
            planner.setRange(longest)
            planner.setProblemDefinition(problem)
            planner.setup()

    def grow(self, deadline: float) -> Array | None:
        """Return a path (m, n) to one of the goals, free from point to point; None if the trees have not met yet: the
        next call goes on.

        Args:
            deadline: value of `time.monotonic` at which the trees stop to grow, s.
        """
        with _silence():
            while time.monotonic() < deadline:
                self._planner.solve(ob.PlannerTerminationCondition(lambda: self._has_to_stop(deadline)))
                found = None
                if self._problem.hasExactSolution():
                    found = _points(self._problem.getSolutionPath(), self._count)
                if found is not None or self._work >= self._limit:
                    self._start_anew()
                if found is not None:
                    return found
        return None

    @property
    def _work(self) -> int:
        return self._targets + self._motions.tested

    def _has_to_stop(self, deadline: float) -> bool:
        """Return whether OMPL has to return; it asks at each random target."""
        self._targets += 1
        return self._work >= self._limit or time.monotonic() >= deadline

    def _start_anew(self) -> None:
        """Start another pair of trees."""
        self._pair += 1
        self._limit = self._work + _FIRST * _GROWTH**self._pair
        self._problem.clearSolutionPaths()
        self._planner.clear()


@contextmanager
def _silence() -> Iterator[None]:
    """Keep OMPL from printing."""
    level = ou.getLogLevel()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    try:
        yield
    finally:
        ou.setLogLevel(level)


def _points(path: og.PathGeometric, count: int) -> Array:
    return np.array([_point(state, count) for state in path.getStates()])


def _point(state: ob.State, count: int) -> Array:
    return np.array([state[i] for i in range(count)])


class _Motions(ob.MotionValidator):  # type: ignore[misc]
    """Tests of OMPL's motions.

    Attributes:
        tested: number of tests.
    """

    def __init__(self, information: ob.SpaceInformation, count: int, free: Free) -> None:
        super().__init__(information)
        self._count, self._free, self.tested = count, free, 0

    def checkMotion(self, begin: ob.State, end: ob.State) -> bool:
        """Return whether a motion is free."""
        self.tested += 1
        return bool(self._free(_point(begin, self._count), _point(end, self._count)))


class _Closed(ob.Constraint):  # type: ignore[misc]
    """Equations, of which OMPL only needs the projection."""

    def __init__(self, count: int, equations: int, close: Close) -> None:
        super().__init__(count, equations, _CLOSED)
        self._close = close

    def project(self, point: Array) -> bool:
        """Move a point to a near one that satisfies the equations; return whether there is one."""
        near = self._close(np.array(point))
        if near is None:
            return False
        point[:] = near
        return True
