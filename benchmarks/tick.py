"""What one tick of the solver costs, robot by robot, beside one LAPACK SVD of the same extended Jacobian.

    python benchmarks/tick.py [ROBOT...]

Both are timed alternately in one run; what is printed is the median of each and their ratio.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from statistics import median

import numpy as np

import cinegen
from cinegen.devices import fit_path

ROBOTS = Path(__file__).parent.parent / "robots"
ROUNDS, TICKS = 30, 20


def main() -> None:
    names = sys.argv[1:] or sorted(path.stem for path in ROBOTS.glob("*.raff"))
    print(f"{'robot':<16}{'joints':>7}{'rows':>6}{'tick us':>10}{'svd us':>9}{'ratio':>8}")
    for name in names:
        mechanism = cinegen.load(ROBOTS / f"{name}.raff")
        path = fit_path(mechanism, mechanism.nodes[-1])
        solver = cinegen.Solver(mechanism, 1.0 / 240.0)
        task = solver.add_task(path.node, path.home, rotation=path.rotation)
        matrix = np.asarray(mechanism.extended_jacobian(mechanism.q_home, path.node))
        ticks, svds = [], []
        for turn in range(ROUNDS):
            began = time.perf_counter()
            for i in range(TICKS):
                task.target = path.target((turn * TICKS + i) / 240.0)
                solver.step()
            between = time.perf_counter()
            for _ in range(TICKS):
                np.linalg.svd(matrix)
            ended = time.perf_counter()
            ticks.append((between - began) / TICKS * 1e6)
            svds.append((ended - between) / TICKS * 1e6)
        tick, svd = median(ticks), median(svds)
        rows = sum(loop.rows for loop in mechanism.loops)
        print(f"{name:<16}{len(mechanism.joints):>7}{rows:>6}{tick:>10.2f}{svd:>9.0f}{tick / svd:>8.1f}")


if __name__ == "__main__":
    main()
