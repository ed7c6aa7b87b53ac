"""What benchmarks share: robots by their names, times, rates, and a planner of OMPL."""

from __future__ import annotations

import sys
import sysconfig
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

import cinegen

ROBOTS = Path(__file__).resolve().parents[1] / "robots"
EXAMPLES = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
PANDA = EXAMPLES / "panda_description/urdf/panda.urdf"
_RESOLUTION = 1e-2  # s


def robots(*names: str) -> Iterator[tuple[str, cinegen.Mechanism]]:
    """Yield the robots that the command line names, else these, else all in robots/, behind their names."""
    for name in sys.argv[1:] or names or sorted(path.stem for path in ROBOTS.glob("*.raff")):
        yield name, cinegen.load(name)


def cpu_time(call: Callable[[], object], rounds: int, count: int = 1) -> float:
    """Return the CPU time of a call, s: the least of so many rounds of `count` calls."""
    times = []
    for _ in range(rounds):
        begin = time.process_time()
        for _ in range(count):
            call()
        times.append((time.process_time() - begin) / count)
    return min(times)


def in_turns(calls: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    """Return the times of calls that take turns, s."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            begin = time.perf_counter()
            call()
            times[name].append(time.perf_counter() - begin)
    return times


def rate(solved: int, count: int) -> str:
    """Return a rate with its 95 % confidence interval by E. B. Wilson (1927), such as '19 of 20 (76 to 99 %)'."""
    if not count:
        return "0 of 0"
    interval = binomtest(solved, count).proportion_ci(method="wilson")
    return f"{solved} of {count} ({100.0 * interval.low:.0f} to {100.0 * interval.high:.0f} %)"


class CpuClock:
    """CPU seconds of this process. Where the system's clock takes as long as a test of a motion (0.2 ms in some
    sandboxes), most of a search would be spent on reading it: it is read every 10 ms at most."""

    def __init__(self) -> None:
        self._real = time.perf_counter  # not what is replaced by this clock
        self._read, self._seconds = -1.0, 0.0

    def __call__(self) -> float:
        """Return the seconds so far."""
        now = self._real()
        if now - self._read >= _RESOLUTION:
            self._seconds, self._read = time.process_time(), now
        return self._seconds


def rrt_connect(
    bounds: tuple[np.ndarray, np.ndarray], is_valid: Callable[[np.ndarray], bool], start: np.ndarray,
    goals: np.ndarray, seconds: float, simplifies: bool,
) -> tuple[np.ndarray | None, float]:  # fmt: skip
    """Return the path (n, k) of OMPL's RRT-Connect in its default settings, None if it finds none, and the CPU seconds
    of the search alone.

    Args:
        bounds: lower and upper bounds (k,).
        is_valid: whether a point (k,) is free.
        start: a point (k,).
        goals: points (m, k).
        seconds: limit, by `time.monotonic`.
        simplifies: whether OMPL shortens the path.
    """
    import ompl.base as ob
    import ompl.geometric as og
    import ompl.util as ou

    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    ou.RNG.setSeed(1)
    begin, count = time.process_time(), len(start)

    class Validity(ob.StateValidityChecker):
        def isValid(self, state: Any) -> bool:
            return is_valid(np.array(state[0:count]))

    box, space = ob.RealVectorBounds(count), ob.RealVectorStateSpace(count)
    for i, (low, high) in enumerate(zip(*bounds, strict=True)):
        box.setLow(i, float(low))
        box.setHigh(i, float(high))
    space.setBounds(box)
    information = ob.SpaceInformation(space)
    checker = Validity(information)
    information.setStateValidityChecker(checker)
    information.setup()

    def state_of(point: np.ndarray) -> Any:
        state = space.allocState()
        state[0:count] = point.tolist()
        return state

    problem, ends = ob.ProblemDefinition(information), ob.GoalStates(information)
    problem.addStartState(state_of(start))
    for goal in goals:
        ends.addState(state_of(goal))
    problem.setGoal(ends)
    planner = og.RRTConnect(information)
    planner.setProblemDefinition(problem)
    planner.setup()
    end = time.monotonic() + seconds
    planner.solve(ob.PlannerTerminationCondition(lambda: time.monotonic() > end))
    spent = time.process_time() - begin
    if not problem.hasExactSolution():
        return None, spent
    path = problem.getSolutionPath()
    if simplifies:
        og.PathSimplifier(information).simplifyMax(path)
    return np.array([[state[i] for i in range(count)] for state in path.getStates()]), spent
