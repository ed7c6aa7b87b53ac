"""How long all assembly modes of a 6-3 platform take, against one mode by Newton's method from nearby.

    python benchmarks/modes.py [SETS]

Merlet found the polynomial "at least a factor 10" slower than methods that begin with an estimate. What is printed are
medians of microseconds for each set of lengths, of random poses of the manipulator of his table 1, and of the same with
base points out of their plane:

    batch        TSSM.batch: all modes
    modes        TSSM.modes, one set a call, with its account of all complex solutions
    newton       the platform's six coordinates by compiled Newton steps, from 1/20 of its size and 0.05 rad away
    plain        the same in numpy, which is what one writes at first
    all          batch / newton: what it costs to know all modes; measured alternately
    each         the same for each mode that is found
    call         modes / plain
"""

from __future__ import annotations

import sys
import time
from statistics import median

import numpy as np

from cinegen.assembly.triangle import TSSM
from cinegen.assembly.triangle._kernels.pose import polish
from cinegen.jit.compiled import compiled

BASE = np.array([[-9.7, 9.1, 0], [9.7, 9.1, 0], [12.76, 3.9, 0], [3.0, -13.0, 0], [-3.0, -13.0, 0], [-12.76, 3.9, 0]])
PLATFORM = np.array([[0, 7.3, 0], [4.822, -5.480722, 0], [-4.822, -5.480722, 0]])
ROUNDS = 15


def main() -> None:
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    rng = np.random.default_rng(0)
    print(
        f"{'microseconds':<12}",
        *(f"{name:>8}" for name in ("batch", "modes", "newton", "plain", "all", "each", "call")),
    )
    for name, base in (("plane", BASE), ("space", BASE + rng.normal(size=(6, 3)) * [0.0, 0.0, 2.0])):
        measure(name, TSSM(base, PLATFORM), rng, sets)


def poses(rng: np.random.Generator, count: int) -> np.ndarray:
    """(count, 4, 4) above the base, turned by up to 1 rad or so."""
    found = np.tile(np.eye(4), (count, 1, 1))
    found[:, :3, :3] = turned(found[:, :3, :3], 0.5 * rng.normal(size=(count, 3)))
    found[:, :3, 3] = [0.0, 0.0, 20.0] + 3.0 * rng.normal(size=(count, 3))
    return found


def turned(rotations: np.ndarray, by: np.ndarray) -> np.ndarray:
    cross = np.zeros((len(by), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]], cross[:, [1, 2, 0], [2, 0, 1]] = by, -by
    one = np.eye(3)
    return np.linalg.solve(one - 0.5 * cross, one + 0.5 * cross) @ rotations


def measure(name: str, tssm: TSSM, rng: np.random.Generator, sets: int) -> None:
    there = poses(rng, sets)
    lengths = tssm.lengths(there)
    near = there.copy()
    near[:, :3, 3] += 0.5 * rng.normal(size=(sets, 3))
    near[:, :3, :3] = turned(near[:, :3, :3], 0.05 * rng.normal(size=(sets, 3)))
    work = np.empty((10, 7))

    @compiled
    def newton_all(base, platform, legs, lengths, near, work):
        for i in range(len(lengths)):
            for _ in range(2):  # it stops after a few steps
                polish(base, platform, legs, lengths[i], near[i], work)

    robot = tssm._robot
    ways = {
        "batch": lambda: tssm.batch(lengths),
        "modes": lambda: [tssm.modes(row) for row in lengths],
        "newton": lambda: newton_all(robot.base, robot.platform, robot.legs, lengths, near.copy(), work),
        "plain": lambda: [plain(tssm, row, placement) for row, placement in zip(lengths, near, strict=True)],
    }
    for way in ways.values():
        way()
    seconds: dict[str, list[float]] = {way: [] for way in ways}
    for _ in range(ROUNDS):
        for way, run in ways.items():
            began = time.perf_counter()
            run()
            seconds[way].append((time.perf_counter() - began) / sets)
    micro = {way: 1e6 * median(found) for way, found in seconds.items()}
    factor = median(a / b for a, b in zip(seconds["batch"], seconds["newton"], strict=True))
    call = median(a / b for a, b in zip(seconds["modes"], seconds["plain"], strict=True))
    each = factor / tssm.batch(lengths)[1].mean()
    print(f"{name:<12}", *(f"{micro[way]:8.1f}" for way in ways), f"{factor:8.1f} {each:8.2f} {call:8.2f}")


def plain(tssm: TSSM, lengths: np.ndarray, placement: np.ndarray) -> np.ndarray:
    """Newton's method on the six lengths."""
    for _ in range(20):
        arms = (tssm.platform @ placement[:3, :3].T)[tssm.legs]
        rods = arms + placement[:3, 3] - tssm.base
        now = np.linalg.norm(rods, axis=1)
        if np.abs(now - lengths).max() < 1e-12 * lengths.max():
            break
        along = rods / now[:, None]
        step = np.linalg.solve(np.hstack([along, np.cross(arms, along)]), lengths - now)
        placement = placement.copy()
        placement[:3, :3] = turned(placement[None, :3, :3], step[None, 3:])[0]
        placement[:3, 3] += step[:3]
    return placement


if __name__ == "__main__":
    main()
