"""How loading, closing and ticks grow from 10 to 1,000 joints.

    OMP_NUM_THREADS=1 python benchmarks/large.py [FAMILY...]

Families, made here as RAFF; sizes are numbers of joints:

    chain   no loops: axes that turn by 90 degrees from link to link
    snake   segments one on the other, each a four-bar linkage and seven joints: a loop for ten joints, all independent
    star    the same segments side by side on the base
    train   cranks on the base, each coupled to the next by a bar: all loops in one cluster, mobility 1
    girder  the same with two bars between cranks: one cluster, mobility as many as cranks

Each is loaded, closed from configurations that are disturbed by 0.01 rad, and dragged by its end. Times are medians in
milliseconds but for loading, memory is the largest so far in MB, `^` the exponent from the row above (1: in proportion
to the joints).
"""

from __future__ import annotations

import math
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np

import cinegen
from cinegen.jit.starting import COMPILATION

SIZES = (10, 30, 100, 300, 1000)
TICKS = 300
DT = 1e-3  # s


# --- robots --------------------------------------------------------------------------------------------------------


def chain(joints: int) -> str:
    """10 m long, bent a little everywhere."""
    length = 10000.0 / joints
    links = [_link(i, i - 1, theta=200.0 / joints, d=length, alpha=90 if i % 2 else -90) for i in range(1, joints + 1)]
    return _robot([*links, _frame(joints + 1, joints, d=length)])


def snake(joints: int) -> str:
    """Each segment stands on the one before."""
    lines, below = list[str](), 0
    for first in range(1, 12 * (joints // 10), 12):
        lines += _segment(first, below, 20.0 if below else 0.0)
        below = first + 11
    return _robot([*lines, _frame(below + 1, below, d=20)])


def star(joints: int) -> str:
    """Segments 200 mm apart."""
    lines = [line for i in range(joints // 10) for line in _segment(12 * i + 1, 0, 200.0 * i)]
    return _robot([*lines, _frame(12 * (joints // 10) + 1, 12, d=20)])


def train(joints: int) -> str:
    """Cranks of 100 mm, 100 mm apart."""
    return _cranks(joints // 2, 1)


def girder(joints: int) -> str:
    """Cranks of 100 mm, 100 mm apart, and two bars of 60 mm between them."""
    return _cranks(joints // 3, 2)


FAMILIES: dict[str, Callable[[int], str]] = {family.__name__: family for family in (chain, snake, star, train, girder)}
MOBILITY: dict[str, Callable[[int], int]] = {
    "chain": lambda joints: joints,
    "snake": lambda joints: 8 * (joints // 10),
    "star": lambda joints: 8 * (joints // 10),
    "train": lambda joints: 1,
    "girder": lambda joints: joints // 3 + 1,
}
"""Counted by hand: a planar loop of revolute joints takes two from the joints that are in it."""


def _segment(first: int, below: int, at: float) -> list[str]:
    """A four-bar linkage with cranks of 60 mm, 80 mm apart, and on its coupler seven joints, 20 mm apart."""
    left, coupler, right, one_end, other_end = range(first, first + 5)
    turn = -90 if below else 0
    return [
        _link(left, below, theta=80, d=at, alpha=turn),
        _link(coupler, left, theta=-80, d=60),
        _link(right, below, theta=80, d=at + 80, alpha=turn),
        _frame(one_end, coupler, d=80),
        _frame(other_end, right, d=60),
        _loop(one_end, other_end),
        *(
            _link(i, coupler if i == first + 5 else i - 1, theta=5, d=20, alpha=90 if i % 2 else -90)
            for i in range(first + 5, first + 12)
        ),
    ]


def _cranks(loops: int, bars: int) -> str:
    lines, lean = [_link(1, 0, theta=80)], math.degrees(math.acos(50 / 60))
    for i in range(loops):
        crank, bar, two, end, after, other_end = (10 * i + k for k in (1, 2, 3, 4, 11, 5))
        lines += [_link(after, 0, theta=80, d=100.0 * (i + 1)), _frame(other_end, after, d=100)]
        if bars == 1:
            lines += [_link(bar, crank, theta=-80, d=100), _frame(end, bar, d=100)]
        else:
            lines += [_link(bar, crank, theta=lean - 80, d=100), _link(two, bar, theta=-2 * lean, d=60)]
            lines.append(_frame(end, two, d=60))
        lines.append(_loop(end, other_end))
    return _robot(lines)


def _link(number: int, below: int, **parameters: float) -> str:
    return f"link {number} {{ parameters {{ {_six(parameters)} }} type 2 pred {below} }}"


def _frame(number: int, below: int, **parameters: float) -> str:
    return f"frame {number} {{ parameters {{ {_six(parameters)} }} pred {below} }}"


def _six(parameters: dict[str, float]) -> str:
    return " ".join(f"{name} {value!r}" for name, value in parameters.items())


def _loop(first: int, second: int) -> str:
    return f"constraint {{ frame {first} frame {second} type 2 }}"


def _robot(lines: list[str]) -> str:
    return "\n".join(["RAFF large", "robot r {", "base { }", *lines, "}", ""])


# --- measurements --------------------------------------------------------------------------------------------------


def measure(path: Path, mobility: int) -> tuple[int, list[float], str]:
    """Return the number of joints, the times to load (s), close and tick (ms), and what was seen."""
    began = time.perf_counter()
    mechanism = cinegen.load(path)
    times = [time.perf_counter() - began]
    assert mechanism.mobility == mobility
    rng, closing = np.random.default_rng(0), list[float]()
    mechanism.close(mechanism.q_home)
    for _ in range(10):
        q = mechanism.q_home + 0.01 * rng.uniform(-1.0, 1.0, mechanism.model.nq)
        began = time.perf_counter()
        mechanism.close(q)
        closing.append(1e3 * (time.perf_counter() - began))
    times.append(median(closing))
    solver = cinegen.Solver(mechanism, DT)
    target = mechanism.placement(mechanism.q_home, mechanism.end)
    task, home = solver.add_task(mechanism.end, target, rotation=0), target.translation.copy()
    solver.step()
    ticks, closure, off = list[float](), 0.0, 0.0
    for i in range(TICKS):
        about = math.tau * i / TICKS
        target.translation = home + 0.01 * np.array([math.sin(about), 1.0 - math.cos(about), 0.0])
        began = time.perf_counter()
        task.target = target
        step = solver.step()
        ticks.append(1e3 * (time.perf_counter() - began))
        closure, off = max(closure, step.closure), max(off, step.errors[0][0])
    assert closure <= 1e-10
    return mechanism.model.nv, [*times, median(ticks)], f"closure {closure:.0e}, off by {1e3 * off:.1g} mm"


def main() -> None:
    cinegen.Solver(cinegen.load("four_bar"), DT)
    COMPILATION.wait()
    print(f"{'family':<8}{'joints':>7}{'load/s':>9}{'^':>5}{'close/ms':>10}{'^':>5}{'tick/ms':>10}{'^':>5}{'MB':>6}")
    with tempfile.TemporaryDirectory() as folder:
        for name in sys.argv[1:] or FAMILIES:
            before = None
            for size in SIZES:
                path = Path(folder, f"{name}{size}.raff")
                path.write_text(FAMILIES[name](size), encoding="utf-8")
                joints, times, seen = measure(path, MOBILITY[name](size))
                line = f"{name:<8}{joints:>7}"
                for k, value in enumerate(times):
                    growth = math.log(value / before[1][k]) / math.log(joints / before[0]) if before else math.nan
                    line += f"{value:>{9 if k == 0 else 10}.3f}" + (f"{growth:>5.1f}" if before else " " * 5)
                memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
                print(f"{line}{memory:>6.0f}  {seen}", flush=True)
                before = joints, times


if __name__ == "__main__":
    main()
