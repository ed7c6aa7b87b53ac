"""Robots that are pulled far away, with limits of acceleration: how often is one exceeded, or a step refused?

    python benchmarks/accelerations.py [RUNS] [ROBOT ...]

In each run of 600 ticks the end is pulled to another random place every 150 ticks, 0.3, 1 or 3 characteristic lengths
from home, so that most are out of reach and joints are driven against their position limits. RUNS (12 unless given) are
made with 20 and with 5 rad/s^2 and m/s^2, for all robots of robots/ unless named. `exceeded` are ticks in which a joint
accelerates by more than 1.001 of its limit, `worst` the largest multiple of it, `distance` the mean distance to the
targets in characteristic lengths, and `us` the CPU time of a tick and of these measurements.
"""

from __future__ import annotations

import sys
import time
import warnings
from pathlib import Path

import numpy as np

import cinegen

ROOT = Path(__file__).resolve().parents[1]
DT, TICKS, HELD = 1.0 / 240.0, 600, 150
LIMITS = 20.0, 5.0


def main() -> None:
    """Print a table."""
    warnings.simplefilter("ignore", cinegen.CinegenWarning)
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 12
    names = sys.argv[2:] or sorted(path.stem for path in (ROOT / "robots").glob("*.raff"))
    print(f"{'':20}{'ticks':>8}{'exceeded':>10}{'worst':>8}{'refused':>9}{'distance':>10}{'us':>7}")
    for name in names:
        mechanism, rng = cinegen.load(name), np.random.default_rng(0)
        exceeded, refused, worst, distance, begin = 0, 0, 0.0, 0.0, time.process_time()
        for limit in LIMITS * runs:
            solver, v = cinegen.Solver(mechanism, DT, acceleration=limit), np.zeros(mechanism.model.nv)
            task = solver.add_task(mechanism.end, rotation=0)
            home = task.target.translation.copy()
            for tick in range(TICKS):
                if tick % HELD == 0:
                    task.target.translation = home + rng.normal(size=3) * mechanism.length * rng.choice([0.3, 1.0, 3.0])
                step = solver.step()
                part, v = float(np.abs(step.v - v).max()) / DT / limit, step.v
                if step.status is cinegen.Status.REFUSED:
                    refused += 1
                elif part > 1.001:
                    exceeded, worst = exceeded + 1, max(worst, part)
                distance += step.errors[0][0] / mechanism.length
        ticks = len(LIMITS) * runs * TICKS
        span = 1e6 * (time.process_time() - begin) / ticks
        row = f"{ticks:8}{exceeded:10}{worst:8.3g}{refused:9}{distance / ticks:10.4f}{span:7.1f}"
        print(f"{name:20}{row}", flush=True)


if __name__ == "__main__":
    main()
