"""What it costs that kernels call Pinocchio: times with its kinematics, divided by times with the kernels' own.

    python benchmarks/kinematics.py [ROBOT...]

Both do the same in turn, in one process; printed is the median of the ratios of many rounds, so that a slow moment of
the machine affects both or does not count. The kernels' own kinematics (`cinegen/loops/_kernels/kinematics.py`) is what
runs where Pinocchio is not:

    evaluate    frames and Jacobians of all joints, once
    tick        the compiled tick
    step        `solver.step()`
    close       closing the loops with the actuated joints locked, from 0.01 rad away
    batch       a batch of 30 configurations
    q           largest difference of a joint, rad and m, after any of 2,000 ticks
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from unittest.mock import patch

import numpy as np
from numba import types
from random_scenes import robot

import cinegen
from cinegen.devices import fit_path
from cinegen.ik._kernels.memory import SolverMemory
from cinegen.ik.batch import BatchEvaluator
from cinegen.jit import pinocchio_calls
from cinegen.jit.compiled import entry, prepare
from cinegen.jit.pinocchio_calls import Native
from cinegen.loops._kernels.kinematics import evaluate
from cinegen.loops.close import Closer

ROBOTS = Path(__file__).parent.parent / "robots"
ROUNDS, TICKS, REPEATS, COUNT = 161, 50, 50, 30
COLUMNS = ("evaluate", "tick", "step", "close", "batch")


@entry
def kinematics(memory: SolverMemory, times: int) -> None:
    """Evaluate the joints at q, so often."""
    for _ in range(times):
        evaluate(memory, memory.q)


EVALUATE = prepare(kinematics, SolverMemory, types.int64)


class Driven:
    """A robot on its demonstration path, and what is measured of it."""

    def __init__(self, mechanism: cinegen.Mechanism) -> None:
        self.mechanism, self.path = mechanism, fit_path(mechanism, mechanism.nodes[-1])
        self.solver = cinegen.Solver(mechanism, 1.0 / 240.0)
        self.task = self.solver.add_task(
            self.path.node, mechanism.placement(mechanism.q_home, self.path.node), rotation=self.path.rotation
        )
        self.ticked = 0
        rng, columns = np.random.default_rng(0), [mechanism.v_index(joint) for joint in mechanism.actuated]
        self.locked = np.zeros(mechanism.model.nv)
        self.locked[columns] = 1.0
        self.closer = Closer(mechanism.structure.system, mechanism.cluster_ranks)
        self.starts = [
            mechanism.integrate(mechanism.q_home, 0.01 * mechanism.scale * rng.normal(size=mechanism.model.nv))
            for _ in range(10)
        ]
        self.batch = BatchEvaluator(mechanism, self.path.node)
        home = mechanism.q_home[[mechanism.q_index(joint) for joint in mechanism.actuated]]
        self.values = home + 0.05 * np.sin(np.arange(COUNT)[:, None] / 30.0) * mechanism.scale[columns]
        self.parts: dict[str, Callable[[], None]] = {
            "evaluate": lambda: EVALUATE(self.solver._memory.handle, REPEATS),
            "tick": lambda: self.drive(lambda: self.solver._tick(self.solver._memory.handle)),
            "step": lambda: self.drive(self.solver.step),
            "close": lambda: [self.closer.close(start, self.locked) for start in self.starts],
            "batch": lambda: self.batch.follow(self.values),
        }  # fmt: skip
        if not mechanism.loops:
            del self.parts["close"]

    def drive(self, tick: Callable[[], object], ticks: int = TICKS) -> None:
        """Follow the path for so many ticks."""
        for _ in range(ticks):
            self.task.target = self.path.target(self.ticked / 240.0)
            self.ticked += 1
            tick()


def both(mechanism: cinegen.Mechanism) -> tuple[Driven, Driven]:
    """The robot with Pinocchio's kinematics and with the kernels' own."""
    with patch.object(pinocchio_calls, "native", lambda: Native(reason="it is compared")):
        own = Driven(mechanism)
    return Driven(mechanism), own


def measure(name: str) -> None:
    """Print a robot's row."""
    two = both(robot(name))
    difference = 0.0
    for _ in range(2000):
        for one in two:
            one.drive(one.solver.step, 1)
        difference = max(difference, float(np.abs(two[0].solver.q - two[1].solver.q).max()))
    found: dict[str, list[float]] = {part: [] for part in two[0].parts}
    for turn in range(ROUNDS):
        for part, ratios in found.items():
            seconds = [0.0, 0.0]
            for which in (turn % 2, 1 - turn % 2):
                began = time.perf_counter()
                two[which].parts[part]()
                seconds[which] = time.perf_counter() - began
            ratios.append(seconds[0] / seconds[1])
    print(
        f"{name:<20}" + "".join(f"{median(found[part]):>10.3f}" if part in found else f"{'-':>10}" for part in COLUMNS)
        + f"{difference:>10.1e}",
        flush=True,
    )  # fmt: skip


def main() -> None:
    assert not pinocchio_calls.native().reason
    print(f"{'robot':<20}" + "".join(f"{part:>10}" for part in (*COLUMNS, "q")))
    for name in sys.argv[1:] or [*sorted(path.stem for path in ROBOTS.glob("*.raff")), "panda"]:
        measure(name)


if __name__ == "__main__":
    main()
