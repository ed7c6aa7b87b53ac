"""Time for all assembly modes of a 6-3 platform.

    python benchmarks/modes.py [SETS]

What is printed are medians of microseconds for each set of lengths, of random poses of the manipulator of Merlet's
table 1, and of the same with base points out of their plane:

    batch        TSSM.batch: all modes
    modes        TSSM.modes, one set a call, with its account of all complex solutions
    real         mean number of modes
"""

from __future__ import annotations

import sys
from statistics import median

import numpy as np
from bench import in_turns
from scipy.spatial.transform import Rotation

from cinegen.hexapod import TSSM

BASE = np.array([[-9.7, 9.1, 0], [9.7, 9.1, 0], [12.76, 3.9, 0], [3.0, -13.0, 0], [-3.0, -13.0, 0], [-12.76, 3.9, 0]])
PLATFORM = np.array([[0, 7.3, 0], [4.822, -5.480722, 0], [-4.822, -5.480722, 0]])
ROUNDS = 15


def main() -> None:
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    rng = np.random.default_rng(0)
    print(f"{'microseconds':<12}", *(f"{name:>8}" for name in ("batch", "modes", "real")))
    for name, base in (("plane", BASE), ("space", BASE + rng.normal(size=(6, 3)) * [0.0, 0.0, 2.0])):
        measure(name, TSSM(base, PLATFORM), rng, sets)


def poses(rng: np.random.Generator, count: int) -> np.ndarray:
    """(count, 4, 4) above the base, turned by up to 1 rad or so."""
    placements = np.tile(np.eye(4), (count, 1, 1))
    placements[:, :3, :3] = Rotation.from_rotvec(0.5 * rng.normal(size=(count, 3))).as_matrix()
    placements[:, :3, 3] = [0.0, 0.0, 20.0] + 3.0 * rng.normal(size=(count, 3))
    return placements


def measure(name: str, tssm: TSSM, rng: np.random.Generator, sets: int) -> None:
    lengths = tssm.lengths(poses(rng, sets))
    calls = {"batch": lambda: tssm.batch(lengths), "modes": lambda: [tssm.modes(row) for row in lengths]}
    for call in calls.values():
        call()  # compiles
    micro = [1e6 * median(times) / sets for times in in_turns(calls, ROUNDS).values()]
    print(f"{name:<12}", *(f"{time:8.1f}" for time in micro), f"{tssm.batch(lengths)[1].mean():8.1f}")


if __name__ == "__main__":
    main()
