"""RRT-Connect by OMPL (https://ompl.kavrakilab.org), for any function that tests motions. Needs the package ompl."""

from __future__ import annotations

from collections.abc import Callable, Sequence

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


def connect(
    low: Array,
    high: Array,
    start: Array,
    goals: Sequence[Array],
    free: Free,
    longest: float,
    seconds: float,
    seed: int,
    close: Close | None = None,
    equations: int = 0,
) -> Array | None:
    """Grow two trees in a box towards each other, one from the start and one from the goals (J. J. Kuffner and S. M.
    LaValle, "RRT-Connect: an efficient approach to single-query path planning", ICRA 2000).

    Args:
        low: (n,) lower bounds of the box.
        high: (n,) upper bounds.
        start: (n,)
        goals: (n,) each.
        free: whether the straight motion between two points is free.
        longest: longest motion to a new point.
        seconds: time limit.
        seed: seed from 0: the same seed finds the same path, if there is time.
        close: if points have to satisfy equations: returns a point (n,) near a given one that does, or None. Random
            targets, and the motions to them, are projected by it (Z. Kingston, M. Moll and L. E. Kavraki, "Exploring
            implicit spaces for constrained sampling-based planning", IJRR 2019).
        equations: number of independent equations.

    Returns:
        path (m, n) to one of the goals, free from point to point; None if the time was too short.
    """
    level = ou.getLogLevel()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    try:
        ou.RNG.setSeed(1 + seed)
        count = len(low)
        box = ob.RealVectorBounds(count)
        for i in range(count):
            box.setLow(i, float(low[i]))
            box.setHigh(i, float(high[i]))
        space = ob.RealVectorStateSpace(count)
        space.setBounds(box)
        if close is None:
            information = ob.SpaceInformation(space)
        else:
            space = ob.ProjectedStateSpace(space, _Closed(count, equations, close))
            information = ob.ConstrainedSpaceInformation(space)
            space.setDelta(_STRIDE)

        def state(point: Array) -> ob.State:
            made = space.allocState()
            if close is None:
                made[0:count] = point.tolist()
            else:
                made.copy(point.tolist())
            return made

        # OMPL would test points, and motions at samples: `free` decides instead
        information.setStateValidityChecker(ob.AllValidStateValidityChecker(information))
        information.setMotionValidator(_Motions(information, count, free))
        information.setup()
        problem = ob.ProblemDefinition(information)
        problem.addStartState(state(start))
        aim = ob.GoalStates(information)
        for goal in goals:
            aim.addState(state(goal))
        problem.setGoal(aim)
        planner = og.RRTConnect(information)
        planner.setRange(longest)
        planner.setProblemDefinition(problem)
        planner.setup()
        planner.solve(float(seconds))
        return _points(problem.getSolutionPath(), count) if problem.hasExactSolution() else None
    finally:
        ou.setLogLevel(level)


def _points(path: og.PathGeometric, count: int) -> Array:
    return np.array([_point(state, count) for state in path.getStates()])


def _point(state: ob.State, count: int) -> Array:
    return np.array([state[i] for i in range(count)])


class _Motions(ob.MotionValidator):  # type: ignore[misc]
    """Tests of OMPL's motions."""

    def __init__(self, information: ob.SpaceInformation, count: int, free: Free) -> None:
        super().__init__(information)
        self._count, self._free = count, free

    def checkMotion(self, begin: ob.State, end: ob.State) -> bool:
        """Return whether a motion is free."""
        return self._free(_point(begin, self._count), _point(end, self._count))


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
