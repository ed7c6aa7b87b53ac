"""Levels of priority: against the plain statement, against optima of SLSQP, and the promises that ticks keep."""

from __future__ import annotations

import numpy as np
import pytest
from reference_tick import resolve_levels
from test_kernel import EVERY, load, near
from variants import FEWER, others_slow

from cinegen import Solver
from cinegen.ik.equations import axes_of, equations, task_rank

several = [param for param in EVERY if load(*param.values).mobility > 1]


def random_levels(solver: Solver, rng: np.random.Generator, levels: int) -> None:
    mechanism = solver.mechanism
    for level in range(levels):
        for _ in range(int(rng.integers(1, 3))):
            node = str(rng.choice(mechanism.nodes[1:]))
            target = near(mechanism, mechanism.placement(solver.q, node), rng, float(rng.choice([1e-3, 1e-2])))
            weights = rng.uniform(0.3, 1.0, 6) * (rng.random(6) < 0.4)
            solver.add_task(node, target, weights=weights, weight=float(rng.uniform(0.3, 3.0)), priority=level)


def plain_levels(solver: Solver) -> list[tuple[np.ndarray, np.ndarray, int]]:
    mechanism, system, before, found = solver.mechanism, solver.mechanism.system, 0, []
    for priority in sorted({task.priority for task in solver.frame_tasks}):
        tasks = [task for task in solver.frame_tasks if task.priority <= priority]
        rank = task_rank(mechanism, system, tasks)
        system.evaluate(solver.q)
        own = [(task, axes_of(task, mechanism, system)) for task in tasks if task.priority == priority]
        error, rows = equations(mechanism, system, own)
        found.append((rows, error, rank - before))
        before = rank
    return found


@pytest.mark.parametrize(("name", "which"), others_slow(several, FEWER))
def test_the_step_of_each_level_is_that_of_the_plain_statement(name, which):
    """Random tasks on three levels, at random closed configurations, with limits about as near as a step is long."""
    mechanism, rng, bent, compared = load(name, which), np.random.default_rng(5), 0, 0
    nv = mechanism.model.nv
    for q in [mechanism.q_home, *mechanism.random_closed(20, seed=3)]:
        solver = Solver(mechanism, 1.0, q=q)
        random_levels(solver, rng, 3)
        memory, tight = solver._memory, float(rng.choice([3e-3, 100.0]))
        solver._write_tasks()
        low, high = rng.uniform(0.0, tight, (2, nv))
        memory.lower[:], memory.upper[:] = q - low * mechanism.scale, q + high * mechanism.scale
        low, high = (memory.lower - q) / mechanism.scale, (memory.upper - q) / mechanism.scale
        levels = plain_levels(solver)
        loops, cut_rates = mechanism.system.evaluate(q)[1], mechanism.system.cut_rates()
        expected = resolve_levels(loops, mechanism.loop_rank, levels, low, high, memory.longest_step, cut_rates)
        step = solver.step()
        assert mechanism.closure(step.q) <= 1e-9
        if expected is not None and not memory.is_nudged and levels[0][2] and len(levels[0][0]):
            compared += 1
            assert memory.step == pytest.approx(expected, abs=1e-8)
            bent += bool(step.saturated)
    assert compared > 10
    assert bent
