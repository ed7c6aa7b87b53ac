"""Who gets round obstacles, among random scenes that all get alike (`random_scenes.py`).

    python benchmarks/avoidance.py [SCENES] [FAMILY ...] [--first NUMBER] [--workers N]

One table for each family of scenes, by default 5 scenes of each. All follow the same loop, keep the same safety
distance and look at the same distances; so none of them collides, and what differs is what leads:

    none        nothing turns: the same attempts as vortex, held clear, and that is all
    literal     De Medio and Oriolo's paper as it reads: folding (mobile: the shorter way), one attempt
    vortex 1    the first attempt of `cinegen plan --planner vortex`
    vortex      `cinegen plan --planner vortex`: other ways round, and postures at the goal, are tried in turn
    firas, spherical, elliptical    potentials instead of vortices, by steepest descent with a line search
    rrtconnect  RRT-Connect (OMPL), 10 s, shortened; does not count as local
    plan        `cinegen plan`: vortex and sampling in turn, 10 s together, shortened

What is printed, of those scenes that any of them solves (how many is said above each table):

    solved      how many of these, and the 95 % confidence interval of the rate
    clearance   the least of all solved ways, by conservative advancement, in safety distances
    way         median length of the node's way, by that of the straight line
    motion      median way of all joints together, rad and characteristic lengths
    step        median ms for a step, all attempts together
    time        median s for a scene
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
from bench import rate
from random_scenes import FAMILIES

from cinegen.planning import plan

sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "papers"))
from enclosing_potentials import FIELDS
from firas import firas
from literal_vortices import plan_literally

METHODS = ("none", "literal", "vortex 1", "vortex", "firas", "spherical", "elliptical", "rrtconnect", "plan")


class Result(NamedTuple):
    """Of one method in one scene."""

    solved: bool
    clearance: float
    way: float
    motion: float
    step: float
    time: float
    status: str


def result(family: str, number: int, method: str) -> Result:
    warnings.simplefilter("ignore")
    scene = FAMILIES[family](number)
    begin = time.perf_counter()
    if method == "rrtconnect":
        planned = plan(scene, planner="rrtconnect")
    elif method == "plan":
        planned = plan(scene)
    elif method == "literal":
        planned = plan_literally(scene)
    elif method == "vortex 1":
        planned = plan(scene, planner="vortex", attempts=1, shorten=False, seconds=60.0)
    else:
        planned = plan(
            scene, field={**FIELDS, "firas": firas}.get(method, method), planner="vortex", shorten=False, seconds=60.0
        )
    spent = time.perf_counter() - begin
    steps = sum(len(attempt.path) for attempt in planned.attempts)
    straight = float(np.linalg.norm(planned.trace[-1] - planned.trace[0]))
    clearance = planned.clearance / scene.safety if planned else np.inf
    return Result(
        bool(planned), clearance, planned.length / max(straight, 1e-9), planned.motion,
        1e3 * spent / steps if steps else np.nan, spent, planned.status.value,
    )  # fmt: skip


def table(family: str, numbers: range, workers: int) -> None:
    asked = [(family, number, method) for number in numbers for method in METHODS]
    results: dict[str, dict[int, Result]] = {method: {} for method in METHODS}
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for (_, number, method), outcome in zip(asked, pool.map(_result, asked), strict=True):
            results[method][number] = outcome
            if method == METHODS[-1]:
                print(f"\r{family} {number}", end="", file=sys.stderr, flush=True)
    solvable = [number for number in numbers if any(results[method][number].solved for method in METHODS)]
    never = sorted(set(numbers) - set(solvable))
    print(f"\n{family}: {len(solvable)} of {len(numbers)} are solved by any" + (f"; by none: {never}" if never else ""))
    print(f"{'':<12} {'solved':>22}", *(f"{name:>9}" for name in ("clearance", "way", "motion", "step", "time")))
    for method in METHODS:
        solved = [results[method][number] for number in solvable if results[method][number].solved]
        numbers = [
            min((outcome.clearance for outcome in solved), default=np.nan),
            *(median([getattr(outcome, name) for outcome in solved] or [np.nan]) for name in ("way", "motion")),
            median(outcome.step for outcome in results[method].values()),
            median(outcome.time for outcome in results[method].values()),
        ]
        print(
            f"{method:<12} {rate(len(solved), len(solvable)):>22}",
            *(f"{number:>9.2f}" for number in numbers),
            flush=True,
        )


def _result(asked: tuple[str, int, str]) -> Result:
    return result(*asked)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", nargs="?", type=int, default=5)
    parser.add_argument("families", nargs="*", default=list(FAMILIES), metavar="FAMILY")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, metavar="NUMBER", help="of the scenes (0)")
    options = parser.parse_args()
    for family in options.families:
        table(family, range(options.first, options.first + options.count), options.workers)


if __name__ == "__main__":
    main()
