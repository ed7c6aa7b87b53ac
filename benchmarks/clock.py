"""Timing of a clock: a robot moves at 1 kHz while the caller reads its state 60 times a second.

    python benchmarks/clock.py [SECONDS] [--mode thread|process|both] [--robot NAME] [--work US]

Goal: 99 % of periods within 0.3 ms, and no overrun above 5 ms, for 60 s.
"""

from __future__ import annotations

import argparse
import functools
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cinegen
from cinegen.devices import ScriptedPath as Way
from cinegen.devices import fit_path
from cinegen.realtime import Clock, Tick

ROBOTS = Path(__file__).parent.parent / "robots"
FRAMES = 60  # a second
MOST_ERROR, MOST_OVERRUN = 0.3e-3, 5e-3  # s


def follower(mechanism: cinegen.Mechanism, way: Way, period: float) -> Callable[[Tick], Any]:
    """Steps a solver along a path; returns the configuration."""
    solver = cinegen.Solver(mechanism, period)
    task = solver.add_task(way.node, way.home, rotation=way.rotation)
    for _ in range(3):  # what is made at first use is made before the clock runs
        solver.step()

    def step(tick: Tick) -> Any:
        task.target = way.target(tick.time)
        return solver.step().q

    return step


def stand_in(mechanism: cinegen.Mechanism, way: Way, period: float, work: float) -> Callable[[Tick], Any]:
    """Computes for so many seconds in Python, and returns the configuration at home."""

    def step(tick: Tick) -> Any:
        end = time.perf_counter() + work
        while time.perf_counter() < end:
            pass
        return mechanism.q_home

    return step


def measure(mode: str, arguments: argparse.Namespace, mechanism: cinegen.Mechanism, way: Way) -> bool:
    clock = Clock(arguments.period, spin=arguments.spin, priority=arguments.priority)
    factory: Callable[..., Callable[[Tick], Any]] = follower
    if arguments.work is not None:
        factory = functools.partial(stand_in, work=arguments.work * 1e-6)
    if mode == "process":
        clock.spawn(factory, mechanism, way, clock.period, seconds=arguments.seconds)
    else:
        clock.start(factory(mechanism, way, clock.period), seconds=arguments.seconds)
    with clock:
        while clock.running:  # the caller reads the state 60 times a second
            clock.state  # noqa: B018
            time.sleep(1.0 / FRAMES)
    report = clock.report()
    kept = report.error.p99 <= MOST_ERROR and report.longest <= MOST_OVERRUN
    print(f"--- {mode}")
    print(report)
    print("goal met" if kept else "goal missed", flush=True)
    return kept


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("seconds", nargs="?", type=float, default=10.0)
    parser.add_argument("--mode", choices=("thread", "process", "both"), default="both")
    parser.add_argument("--robot", default="arm7")
    parser.add_argument("--work", type=float, metavar="US", help="us that a stand-in for the solver computes")
    parser.add_argument("--period", type=float, default=0.001, help="s")
    parser.add_argument("--spin", type=float, help="s")
    parser.add_argument("--priority", type=int, default=0, help="of SCHED_FIFO, 1 to 99; 0: ordinary scheduling")
    arguments = parser.parse_args()
    mechanism = cinegen.load(ROBOTS / f"{arguments.robot}.raff")
    way = fit_path(mechanism, mechanism.end)
    for mode in ("thread", "process") if arguments.mode == "both" else (arguments.mode,):
        measure(mode, arguments, mechanism, way)


if __name__ == "__main__":
    main()
