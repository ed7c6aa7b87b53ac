"""Time of one tick of the solver, robot by robot: where it goes, and beside one LAPACK SVD of the extended Jacobian.

    python benchmarks/tick.py [ROBOT...]

All parts are measured, alternately in one run; medians, in microseconds:

    tick        all of it, as a program calls it: `task.target = target; solver.step()`
    target      `task.target = target`
    python      `solver.step()` without the compiled function: the call itself, the copy of the record, the `Step`
    call        calling a compiled function that does nothing
    reading     reading the targets of the tasks
    kinematics  frames and Jacobians of all joints, as often as the ticks evaluate them (`evals`)
    loops       residual, Jacobian, factors and null space of the loops at q, and each correction that closes them
    rest        everything else in the compiled function: tasks, limits, the step, judging it, the record
    svd         numpy.linalg.svd of the extended Jacobian, and the ratio of the tick to it
"""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import mean, median

import numpy as np
from bench import robots
from numba import types

import cinegen
from cinegen.devices import fit_path
from cinegen.ik._kernels.memory import SolverMemory
from cinegen.ik._kernels.tasks import read_tasks
from cinegen.jit.compiled import entry, prepare
from cinegen.loops._kernels.closure import factor_loops, find_null_space, loop_correction
from cinegen.loops._kernels.kinematics import evaluate, integrate
from cinegen.loops._kernels.residual import evaluate_loops

ROUNDS, TICKS, REPEATS = 30, 20, 200
COLUMNS = ("tick", "target", "python", "call", "reading", "kinematics", "loops", "rest")


@entry
def nothing(memory: SolverMemory, times: int) -> None:
    """Do nothing, so often."""


@entry
def read(memory: SolverMemory, times: int) -> None:
    """Read the targets, so often."""
    for _ in range(times):
        read_tasks(memory)


@entry
def kinematics(memory: SolverMemory, times: int) -> None:
    """Evaluate the joints at q, so often."""
    for _ in range(times):
        evaluate(memory, memory.q)


@entry
def loops_at_q(memory: SolverMemory, times: int) -> None:
    """Compute the null space of the loops, so often."""
    for _ in range(times):
        evaluate_loops(memory, True)
        factor_loops(memory, False)
        find_null_space(memory)


@entry
def residuals(memory: SolverMemory, times: int) -> None:
    """Compute the residual of the loops, so often."""
    for _ in range(times):
        evaluate_loops(memory, False)


@entry
def corrections(memory: SolverMemory, times: int) -> None:
    """Compute a correction of the loops and the configuration that it leads to, so often."""
    for _ in range(times):
        loop_correction(memory, True, memory.correction)
        integrate(memory, memory.q, memory.delta, memory.candidate)


PARTS = [prepare(part, SolverMemory, types.int64) for part in (read, kinematics, loops_at_q, residuals, corrections)]
NOTHING = prepare(nothing, SolverMemory, types.int64)


def measure(name: str, mechanism: cinegen.Mechanism) -> None:
    """Print a robot's row."""
    path = fit_path(mechanism, mechanism.nodes[-1])
    solver = cinegen.Solver(mechanism, 1.0 / 240.0)
    task = solver.add_task(path.node, mechanism.placement(mechanism.q_home, path.node), rotation=path.rotation)
    matrix = np.asarray(mechanism.extended_jacobian(mechanism.q_home, path.node))
    targets = [path.target(i / 240.0) for i in range(ROUNDS * TICKS)]
    memory, tick = solver._memory, solver._tick
    evaluated, corrected = [], []
    for target in targets:
        task.target = target
        evaluated.append(solver.step().evaluations)
        corrected.append(memory.corrections)
    solver.q = mechanism.q_home
    solver.step()
    handle = memory.handle  # now that memory is allocated for the task

    def assign(block: list) -> None:
        for target in block:
            task.target = target

    def compiled_only(block: list) -> None:
        for target in block:
            task.target = target
            tick(handle)

    def whole(block: list) -> None:
        for target in block:
            task.target = target
            solver.step()

    def call(block: list) -> None:
        for _ in block:
            NOTHING(handle, 1)

    def loop(block: list) -> None:
        for _ in block:
            pass

    def svd(block: list) -> None:
        for _ in block:
            np.linalg.svd(matrix)

    runs: list[Callable[[list], None]] = [whole, compiled_only, assign, call, loop, svd]
    spent: list[list[float]] = [[] for _ in (*runs, *PARTS)]
    for turn in range(ROUNDS):
        block = targets[turn * TICKS : (turn + 1) * TICKS]
        start = solver.q
        for run, times in zip(runs, spent, strict=False):
            if run in (whole, compiled_only):  # the same ticks, once warm
                solver.q, task.target = start, block[0]
                solver.step()
            began = time.perf_counter()
            run(block)
            times.append((time.perf_counter() - began) / TICKS * 1e6)
        for part, times in zip(PARTS, spent[len(runs) :], strict=True):
            began = time.perf_counter()
            part(handle, REPEATS)
            times.append((time.perf_counter() - began) / REPEATS * 1e6)
    all_of_it, kernel, target, calling, nothing_at_all, factored = (median(times) for times in spent[: len(runs)])
    reading, joints, at_q, residual, correction = (median(times) for times in spent[len(runs) :])
    evaluations = mean(evaluated)
    calling, kernel, python = calling - nothing_at_all, kernel - target, all_of_it - kernel
    closing = at_q + evaluations * residual + mean(corrected) * correction if mechanism.loops else 0.0
    known = reading + evaluations * joints + closing
    row = (
        all_of_it, target - nothing_at_all, python, calling, reading, evaluations * joints, closing,
        kernel - calling - known,
    )  # fmt: skip
    rows = sum(closure.rows for closure in mechanism.loops)
    print(
        f"{name:<16}{len(mechanism.joints):>7}{rows:>6}{evaluations:>7.2f}"
        + "".join(f"{value:>{max(len(column) + 2, 8)}.2f}" for column, value in zip(COLUMNS, row, strict=True))
        + f"{factored:>8.0f}{all_of_it / factored:>7.2f}"
    )


def main() -> None:
    print(
        f"{'robot':<16}{'joints':>7}{'rows':>6}{'evals':>7}"
        + "".join(f"{column:>{max(len(column) + 2, 8)}}" for column in COLUMNS)
        + f"{'svd':>8}{'ratio':>7}"
    )
    for name, mechanism in robots():
        measure(name, mechanism)


if __name__ == "__main__":
    main()
