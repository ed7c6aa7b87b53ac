"""RRT-Connect and LBKPIECE by OMPL (https://ompl.kavrakilab.org), for any function that tests motions. Needs the
package ompl."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import ompl.base as ob
import ompl.geometric as og
import ompl.util as ou

from cinegen.arrays import Array

Free = Callable[[Array, Array], bool]
Close = Callable[[Array], Array | None]

_STRIDE = 0.4  # between projected points of a motion
_CLOSED = 1e-8
_ITERATION = 0.05  # of the time that the test of a motion takes


class Trees:
    """Two trees in a box that grow towards each other, one from the start and one from the goals (J. J. Kuffner and
    S. M. LaValle, "RRT-Connect: an efficient approach to single-query path planning", ICRA 2000).

    Lazy trees test only the motions of a path that has been found, and prefer to grow where cells of a projection are
    little explored (LBKPIECE; I. A. Sucan and L. E. Kavraki, "Kinodynamic motion planning by interior-exterior cell
    exploration", WAFR 2008).

    Args:
        low: (n,) lower bounds of the box.
        high: (n,) upper bounds.
        start: (n,)
        goals: (n,) each.
        free: whether the straight motion from a point of a tree to another point is free.
        longest: longest motion to a new point.
        seed: seed from 0: the same seed finds the same path, if there is time.
        close: if points have to satisfy equations: returns a point (n,) near a given one that does, or None. Random
            targets, and the motions to them, are projected by it (Z. Kingston, M. Moll and L. E. Kavraki, "Exploring
            implicit spaces for constrained sampling-based planning", IJRR 2019).
        equations: number of independent equations.
        is_lazy: LBKPIECE instead of RRT-Connect; without equations only.
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
        is_lazy: bool = False,
    ) -> None:
        self._count = len(low)
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
                space.setDelta(min(_STRIDE, 0.1 * space.getMaximumExtent()))

            def state(point: Array) -> ob.State:
                made = space.allocState()
                if close is None:
                    made[0 : self._count] = point.tolist()
                else:
                    made.copy(point.tolist())
                return made

            # OMPL would test points, and motions at samples: `free` decides instead
            information.setStateValidityChecker(ob.AllValidStateValidityChecker(information))
            self._motions = _Motions(information, free, [start, *goals])
            information.setMotionValidator(self._motions)
            information.setup()
            problem = self._problem = ob.ProblemDefinition(information)
            problem.addStartState(state(start))
            aim = ob.GoalStates(information)
            for goal in goals:
                aim.addState(state(goal))
            problem.setGoal(aim)
            planner = self._planner = og.LBKPIECE1(information) if is_lazy else og.RRTConnect(information)
            planner.setRange(longest)
            planner.setProblemDefinition(problem)
            planner.setup()

    @property
    def work(self) -> float:
        """Work so far, in tests of motions: the same for the same seed and path, however long it takes."""
        return self._motions.work

    def grow(self, deadline: float, work: float = math.inf) -> Array | None:
        """Return a path (m, n) to one of the goals, free from point to point; None if the trees have not met yet. The
        next call goes on, after a path with new trees.

        Args:
            deadline: value of `time.monotonic` at which the trees stop to grow, s.
            work: value of `work` at which they do so.
        """
        motions, is_other = self._motions, False

        def is_over() -> bool:
            nonlocal is_other
            if not is_other and (motions.work >= work or time.monotonic() >= deadline):
                return True
            motions.work += _ITERATION
            is_other = not is_other  # LBKPIECE extends both trees in turn, the first one first in each call
            return False

        with _silence():
            self._planner.solve(ob.PlannerTerminationCondition(is_over))
            if not self._problem.hasExactSolution():
                return None
            path = _points(self._problem.getSolutionPath(), self._count)
            self._problem.clearSolutionPaths()
            self._planner.clear()
            return path


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
    """Tests of OMPL's motions, each away from a point of a tree; OMPL tests those of the goals' tree towards it.

    Attributes:
        work: as of `Trees`.
    """

    def __init__(self, information: ob.SpaceInformation, free: Free, roots: Sequence[Array]) -> None:
        super().__init__(information)
        self._free, self._known, self._size = free, {root.tobytes() for root in roots}, len(roots[0])
        self.work = 0.0

    def checkMotion(self, begin: ob.State, end: ob.State) -> bool:
        """Return whether a motion is free."""
        self.work += 1.0
        known, new = _point(begin, self._size), _point(end, self._size)
        if known.tobytes() not in self._known:
            known, new = new, known
        is_free = bool(self._free(known, new))
        if is_free:
            self._known.add(new.tobytes())
        return is_free


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
