"""A seven-joint arm that is dragged past a pole, at 1 kHz: who gets there, and what a tick costs.

    python benchmarks/drag.py [DRAGS]

The tool is dragged within a second from one side of a pole to the other, and 7 more are waited (`arrived`: to 1 mm).
There is the pole, and four balls further away, for the cost. Alternately by

    alone     a solver that knows no obstacles: how often it hits (`hits`) is what the others are there for
    damper    the same, held clear: it slides along and is held off
    avoiding  `cinegen.planning.AvoidingSolver`

`least` is the least clearance of all ticks, mm; 10 are to be kept. `median` and `99 %` are microseconds of a tick.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import pinocchio as pin
from random_scenes import clear_posture, clearance, posture, robot, scene

from cinegen.collision import Scene, clearance_of
from cinegen.ik import Solver
from cinegen.planning import AvoidingSolver
from cinegen.planning.clearance_barrier import ClearanceBarrier

DT, NODE = 1e-3, "tool"
DRAG, TICKS = 1000, 8000
GAIN = 100.0  # 1/s, as in the cockpit


def drag(number: int) -> Scene:
    """Its goal is where the tool is dragged to."""
    rng, mechanism = np.random.default_rng(number), robot("arm7")
    while True:
        turn, r, aside = rng.uniform(-1.0, 1.0), rng.uniform(0.3, 0.55), rng.uniform(0.35, 0.8)
        place = [float(r * np.cos(turn)), float(r * np.sin(turn)), 0.4]
        obstacles = [{"name": "pole", "kind": "cylinder", "radius": 0.03, "length": 1.2, "point": place}]
        for i in range(4):
            back = turn + np.pi + rng.uniform(-1.0, 1.0)
            place = [float(0.6 * np.cos(back)), float(0.6 * np.sin(back)), rng.uniform(0.1, 0.8)]
            obstacles.append({"name": f"ball{i + 1}", "kind": "sphere", "radius": 0.05, "point": place})
        far, near = rng.uniform(0.4, 0.6), clearance(mechanism, obstacles)
        ends = []
        for way in (turn - aside, turn + aside):
            place = np.array([far * np.cos(way), far * np.sin(way), rng.uniform(0.2, 0.6)])
            ends.append(clear_posture(mechanism, NODE, place, near, rng))
        if ends[0] is None or ends[1] is None:
            continue
        goal = mechanism.placement(ends[1], NODE).translation
        return scene(mechanism, f"drag {number}", obstacles, posture(mechanism, ends[0]), goal, node=NODE)


def dragged(given: Scene, way: str) -> tuple[bool, float, list[float]]:
    """Whether it arrived, its least clearance, m, and what ticks took, s."""
    near = clearance_of(given)
    if way == "avoiding":
        solver: Solver = AvoidingSolver(near, DT, given.safety, q=given.start)
    else:
        solver = Solver(given.mechanism, DT, given.start)
        if way == "damper":
            solver.barriers = (ClearanceBarrier(near, given.safety),)
    solver.gain = GAIN
    task = solver.add_task(NODE, translation=3, rotation=0)
    begin, times, least = task.target.copy(), [], np.inf
    for tick in range(TICKS):
        part = min(1.0, tick / DRAG)
        task.target = pin.SE3(begin.rotation, (1.0 - part) * begin.translation + part * given.goal.translation)
        start = time.perf_counter()
        step = solver.step()
        times.append(time.perf_counter() - start)
        least = min(least, near.least(step.q))
        if part == 1.0 and step.errors[0][0] < 1e-3:
            return True, least, times
    return False, least, times


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    ways = ("alone", "damper", "avoiding")
    found: dict[str, list[tuple[bool, float, list[float]]]] = {way: [] for way in ways}
    for number in range(count):
        given = drag(number)
        for way in ways:
            found[way].append(dragged(given, way))
    print(f"{'':<9}", *(f"{name:>8}" for name in ("arrived", "hits", "least", "median", "99 %")))
    for way in ways:
        times = 1e6 * np.concatenate([times for _, _, times in found[way]])
        arrived, hits = sum(one[0] for one in found[way]), sum(one[1] <= 0.0 for one in found[way])
        least = 1e3 * min(one[1] for one in found[way])
        print(f"{way:<9} {arrived:>5}/{count} {hits:>8} {least:>8.2f} {np.median(times):>8.1f}"
              f" {np.percentile(times, 99):>8.1f}")  # fmt: skip


if __name__ == "__main__":
    main()
