"""Inverse kinematics of tasks of all kinds and priorities: ticks of the solver from one start after the other."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Sequence

import numpy as np

from cinegen.arrays import Array
from cinegen.errors import ClosureError
from cinegen.ik.barrier import Range
from cinegen.ik.given_task import Task, errors_of
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.solver import Solver
from cinegen.ik.state import State
from cinegen.ik.task import FrameTask
from cinegen.ik.thresholds import STEP_CAP
from cinegen.model import Mechanism

_TICKS = 400  # from one start
_STILL = 1e-9  # rad or lengths in a tick: at rest
_EQUAL = 1e-6  # m or rad: errors of a level that differ less do not count


def solve_by_ticks(
    mechanism: Mechanism,
    tasks: Sequence[FrameTask | Task],
    q: Array | None,
    tolerance: float,
    limits: bool,
    starts: int,
    seed: int,
) -> tuple[bool, Array, int, int, tuple[str, ...]]:
    """Return whether all tasks are reached, the best configuration (nq,), the numbers of starts and ticks, and the
    joints at a limit there.

    The best is that whose first level has the smallest error, then the second, and so on. Arguments are those of
    `inverse_kinematics`; tasks are valid.
    """
    solver = solver_for(mechanism, tasks, limits)
    priorities = sorted({task.priority for task in tasks})
    best: tuple[list[float], Array, tuple[str, ...]] | None = None
    ticks = tried = 0
    for start in _starts(mechanism, q, limits, starts, seed):
        solver.q, tried = start, tried + 1
        for _ in range(_TICKS):
            step, ticks = solver.step(), ticks + 1
            if float(np.abs(step.v / mechanism.scale).max(initial=0.0)) < _STILL:
                break
        state = State(mechanism, step.q, 1.0)
        left = [
            max(max(errors_of(task, state)) for task in tasks if task.priority == priority) for priority in priorities
        ]
        if best is None or _is_less(left, best[0]):
            best = left, step.q, step.saturated
        if max(left) <= tolerance:
            break
    assert best is not None  # there is at least one start
    return max(best[0]) <= tolerance, best[1], tried, ticks, best[2]


def solver_for(mechanism: Mechanism, tasks: Sequence[FrameTask | Task | Range], limits: bool = True) -> Solver:
    """Return a solver whose ticks are iterations towards tasks: as long as the linearisation allows, whatever the
    velocity limits; and the position limits, unless `limits`. Tasks of frames, and ranges, are copied."""
    solver = Solver(mechanism, 1.0)
    for task in tasks:
        if isinstance(task, FrameTask):
            solver.add_task(
                task.node, task.target, weight=task.weight, axes=task.axes, offset=task.offset, weights=task.weights,
                priority=task.priority,
            )  # fmt: skip
        else:
            solver.add_task(copy.copy(task) if isinstance(task, Range) else task)
    solver.lift_limits(not limits)
    solver._memory.longest_step[:] = STEP_CAP  # range of the linearisation
    return solver


def _starts(mechanism: Mechanism, q: Array | None, limits: bool, count: int, seed: int) -> Iterator[Array]:
    """Yield closed configurations: q, home, then samples."""
    try:
        yield mechanism.q_home if q is None else mechanism.close(q)
    except ClosureError:
        yield mechanism.q_home
    if count > 1 and q is not None:
        yield mechanism.q_home
    yield from LocalIK(mechanism, (), limits).samples(count, np.random.default_rng(seed))[2 if q is not None else 1 :]


def _is_less(left: Sequence[float], right: Sequence[float]) -> bool:
    for value, other in zip(left, right, strict=True):
        if not math.isclose(value, other, abs_tol=_EQUAL, rel_tol=0.0):
            return value < other
    return False
