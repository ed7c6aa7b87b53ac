"""RRT-Connect by OMPL (https://ompl.kavrakilab.org), told by functions what is free. Needs the package ompl."""

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

_SHORTCUTS = 40  # tried, and in vain at most
_STRIDE = 0.4  # between closed points on the way to a new one
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
) -> list[Array]:
    """Two trees in a box, one from the start and one from the goals, that grow towards each other (J. J. Kuffner and
    S. M. LaValle, "RRT-Connect: an efficient approach to single-query path planning", ICRA 2000).

    Args:
        low: (n,) of the box.
        high: (n,)
        start: (n,)
        goals: (n,) each.
        free: whether one may go from one point to another, both included.
        longest: way to a new point.
        seconds: that this may take; shortening the way found takes a little longer.
        seed: of what is random, from 0: the same way is found again, if there is time.
        close: where points have to satisfy equations: one (n,) near a given one that does, or None. Targets at random
            are projected by it, and so is the way to them (Z. Kingston, M. Moll and L. E. Kavraki, "Exploring implicit
            spaces for constrained sampling-based planning", IJRR 2019).
        equations: how many of these are independent.

    Returns:
        ways to one of the goals, (m, n) each, free from point to point: the shortened one, then as it was found. None
        at all if there was too little time.
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

        # OMPL would look at points and, on the way, at samples: what is free is for `free` to say
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
        if not problem.hasExactSolution():
            return []
        path = problem.getSolutionPath()
        found = _points(path, count)
        shorter = og.PathSimplifier(information)
        shorter.reduceVertices(path, _SHORTCUTS, _SHORTCUTS)
        shorter.partialShortcutPath(path, _SHORTCUTS, _SHORTCUTS)
        return [_points(path, count), found]
    finally:
        ou.setLogLevel(level)


def _points(path: og.PathGeometric, count: int) -> Array:
    return np.array([_point(state, count) for state in path.getStates()])


def _point(state: ob.State, count: int) -> Array:
    return np.array([state[i] for i in range(count)])


class _Motions(ob.MotionValidator):  # type: ignore[misc]
    """OMPL asks it about every motion."""

    def __init__(self, information: ob.SpaceInformation, count: int, free: Free) -> None:
        super().__init__(information)
        self._count, self._free = count, free

    def checkMotion(self, begin: ob.State, end: ob.State) -> bool:
        """Whether it is free."""
        return self._free(_point(begin, self._count), _point(end, self._count))


class _Closed(ob.Constraint):  # type: ignore[misc]
    """Equations, of which OMPL needs to know no more than how to satisfy them."""

    def __init__(self, count: int, equations: int, close: Close) -> None:
        super().__init__(count, equations, _CLOSED)
        self._close = close

    def project(self, point: Array) -> bool:
        """Moves a point to a near one that satisfies them; whether there is one."""
        near = self._close(np.array(point))
        if near is None:
            return False
        point[:] = near
        return True
