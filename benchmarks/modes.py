"""Time for all assembly modes of a 6-3 platform, relative to one mode by Newton's method from nearby.

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

import math
import sys
from statistics import median

import numpy as np
from bench import in_turns
from numba import njit

from cinegen.hexapod import TSSM

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

    methods = {
        "batch": lambda: tssm.batch(lengths),
        "modes": lambda: [tssm.modes(row) for row in lengths],
        "newton": lambda: newton(tssm.base.copy(), tssm.platform[tssm.legs], lengths, near.copy(), work),
        "plain": lambda: [plain(tssm, row, placement) for row, placement in zip(lengths, near, strict=True)],
    }
    for run in methods.values():
        run()
    seconds = in_turns(methods, ROUNDS)
    micro = {method: 1e6 * median(times) / sets for method, times in seconds.items()}
    factor = median(a / b for a, b in zip(seconds["batch"], seconds["newton"], strict=True))
    call = median(a / b for a, b in zip(seconds["modes"], seconds["plain"], strict=True))
    each = factor / tssm.batch(lengths)[1].mean()
    print(f"{name:<12}", *(f"{micro[method]:8.1f}" for method in methods), f"{factor:8.1f} {each:8.2f} {call:8.2f}")


@njit(error_model="numpy", fastmath={"contract"})
def newton(base, platform, lengths, placements, work):
    """Newton's method on the six lengths, compiled; twice up to four steps, of which a worse one is undone."""
    for i in range(len(lengths)):
        longest = lengths[i].max()
        placement = placements[i]
        for _ in range(2):
            best = 1e300
            for step in range(5):
                worst = write_steps(base, platform, lengths[i], placement, work) / longest
                if not worst < best:
                    placement[:3] = work[6:9, :4]
                    break
                best = worst
                if best <= 2e-14 or step == 4 or not reduce(work, 6, 7) > 0.0:
                    break
                work[6:9, :4] = placement[:3]
                move(work[3, 6], work[4, 6], work[5, 6], work[0, 6], work[1, 6], work[2, 6], placement)


@njit(error_model="numpy", fastmath={"contract"})
def reduce(a, rows, columns):
    """Solve the first `rows` columns against the others by elimination with row pivots, in place; the least pivot."""
    least = 1e300
    for i in range(rows):
        best = i
        for k in range(i + 1, rows):
            if abs(a[k, i]) > abs(a[best, i]):
                best = k
        least = min(least, abs(a[best, i]))
        if not abs(a[best, i]) > 0.0:
            return 0.0
        if best != i:
            for j in range(i, columns):
                a[i, j], a[best, j] = a[best, j], a[i, j]
        inverse = 1.0 / a[i, i]
        for j in range(i, columns):
            a[i, j] *= inverse
        for k in range(rows):
            if k != i and a[k, i] != 0.0:
                part = a[k, i]
                for j in range(i, columns):
                    a[k, j] -= part * a[i, j]
    return least


@njit(error_model="numpy", fastmath={"contract"})
def write_steps(base, platform, lengths, placement, work):
    """Rows of the equations for a velocity (3) and a rotation (3) about the platform's origin; the worst length."""
    worst = 0.0
    for leg in range(6):
        square = 0.0
        for i in range(3):
            arm = 0.0
            for j in range(3):
                arm += placement[i, j] * platform[leg, j]
            work[leg, 3 + i] = arm
            work[leg, i] = arm + placement[i, 3] - base[leg, i]
            square += work[leg, i] * work[leg, i]
        length = math.sqrt(square)
        off = lengths[leg] - length
        x, y, z = work[leg, 0] / length, work[leg, 1] / length, work[leg, 2] / length
        a, b, c = work[leg, 3], work[leg, 4], work[leg, 5]
        work[leg, 0], work[leg, 1], work[leg, 2] = x, y, z
        work[leg, 3], work[leg, 4], work[leg, 5] = b * z - c * y, c * x - a * z, a * y - b * x
        work[leg, 6] = off
        if not abs(off) <= worst:
            worst = abs(off)
    return worst


@njit(error_model="numpy", fastmath={"contract"})
def move(a, b, c, x, y, z, placement):
    """Rotate by the vector (a, b, c), of small length (Cayley), and shift by (x, y, z)."""
    f = 1.0 / (1.0 + 0.25 * (a * a + b * b + c * c))
    for j in range(3):
        u, v, w = placement[0, j], placement[1, j], placement[2, j]
        du, dv, dw = b * w - c * v, c * u - a * w, a * v - b * u
        placement[0, j] += f * (du + 0.5 * (b * dw - c * dv))
        placement[1, j] += f * (dv + 0.5 * (c * du - a * dw))
        placement[2, j] += f * (dw + 0.5 * (a * dv - b * du))
    placement[0, 3] += x
    placement[1, 3] += y
    placement[2, 3] += z


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
