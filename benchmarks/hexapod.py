"""Time for all assembly modes of random hexapods of some families.

    python benchmarks/hexapod.py [COUNT]

What is printed, of COUNT (100) platforms each, at the lengths of a random pose:

    begin        ms, median: Hexapod(base, platform), once for a platform
    modes        ms, median: hexapod.modes(lengths), for each six lengths
    worst        ms, of both together
    paths        that are followed to the lengths, in the mean: 40, less those that ended at infinity on the way there
    steps        of a path from the start system to the platform, in the mean
    real         modes, in the mean
    complete     of COUNT
"""

from __future__ import annotations

import sys
import time
from statistics import mean, median

import numpy as np
from bench import ROBOTS

from cinegen.hexapod import Hexapod

sys.path.append(str(ROBOTS.parent / "tests/hexapod"))
from test_hexapod import DIETMAIER_BASE, DIETMAIER_LENGTHS, DIETMAIER_PLATFORM

DIETMAIER = tuple(np.array(part, dtype=float) for part in (DIETMAIER_BASE, DIETMAIER_PLATFORM, DIETMAIER_LENGTHS))


def example(rng: np.random.Generator, family: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Base and platform (6, 3), lengths (6,)."""
    if family == "Dietmaier":
        return DIETMAIER
    base, platform = rng.normal(size=(2, 6, 3))
    if family != "general":
        base[:, 2] = platform[:, 2] = 0.0
    if family == "6-3":
        platform = platform[[0, 0, 1, 1, 2, 2]]
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    return base, platform, np.linalg.norm(platform @ turn.T + 2.0 * rng.normal(size=3) - base, axis=1)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    Hexapod(*example(np.random.default_rng(0), "general")[:2])  # compiles
    print(f"{'':<12}{'begin':>7}{'modes':>7}{'worst':>7}{'paths':>7}{'steps':>7}{'real':>6}{'complete':>10}")
    for family in ("general", "planar", "6-3", "Dietmaier"):
        measure(family, count)


def measure(family: str, count: int) -> None:
    rng = np.random.default_rng(1)
    begin, modes, paths, steps, real, complete = [], [], [], [], [], 0
    for _ in range(count):
        base, platform, lengths = example(rng, family)
        began = time.perf_counter()
        hexapod = Hexapod(base, platform)
        ready = time.perf_counter()
        solutions = hexapod.modes(lengths)
        ended = time.perf_counter()
        begin.append(1e3 * (ready - began))
        modes.append(1e3 * (ended - ready))
        paths.append(hexapod.degree)
        steps.append(hexapod.steps / 40)
        real.append(len(solutions.placements))
        complete += solutions.complete
    worst = max(a + b for a, b in zip(begin, modes, strict=True))
    print(
        f"{family:<12}{median(begin):>7.1f}{median(modes):>7.1f}{worst:>7.1f}{mean(paths):>7.1f}{mean(steps):>7.1f}"
        f"{mean(real):>6.1f}{complete:>10}"
    )


if __name__ == "__main__":
    main()
