"""The linear algebra of one tick, against what it must be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference_tick import damping, resolve
from scipy.optimize import LinearConstraint, minimize

from cinegen.ik.thresholds import RESTING
from cinegen.loops.motions import free_motions
from cinegen.tolerances import NEAR_SINGULAR

seeds = st.integers(0, 2**32 - 1)


def _loops(rng, rows, nv, rank):
    return rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, nv))


@given(seeds)
def test_without_bounds_the_pulls_are_met_by_the_shortest_step(seed):
    rng = np.random.default_rng(seed)
    loops, tasks, error = _loops(rng, 5, 9, 3), rng.normal(size=(3, 9)), rng.normal(size=3)
    free = np.full(9, np.inf)
    found = resolve(loops, 3, tasks, 3, error, -free, free)
    if found.sigma[-1] < NEAR_SINGULAR:
        return
    # an independent statement: the least-norm solution of both together
    shortest = np.linalg.lstsq(np.vstack([loops, tasks]), np.concatenate([np.zeros(5), error]), rcond=1e-10)[0]
    assert found.step == pytest.approx(shortest, abs=1e-8)


@given(seeds)
def test_with_bounds_it_is_the_best_of_all_steps_within_them(seed):
    """Against a general optimiser, on the function that the docstring states."""
    rng = np.random.default_rng(seed)
    loops, tasks, error = _loops(rng, 4, 7, 2), rng.normal(size=(3, 7)), rng.normal(size=3)
    low, high = -rng.uniform(0.0, 0.4, 7), rng.uniform(0.0, 0.4, 7)
    found = resolve(loops, 2, tasks, 3, error, low, high)
    assert np.abs(loops @ found.step).max() < 1e-9
    assert (found.step <= high + 1e-11).all()
    assert (found.step >= low - 1e-11).all()
    motions, _ = free_motions(loops, 2)
    _, sigma, wt = np.linalg.svd(tasks @ motions)
    weight = np.concatenate([damping(sigma, float(np.linalg.norm(error))), np.full(2, RESTING)])

    def cost(y):
        return np.sum((tasks @ motions @ y - error) ** 2) + weight @ (wt @ y) ** 2

    within = LinearConstraint(motions, low, high)
    best = minimize(cost, np.zeros(5), constraints=[within], method="SLSQP", options={"ftol": 1e-14, "maxiter": 500})
    assert cost(motions.T @ found.step) <= best.fun + 1e-6


def test_the_free_motions_keep_their_width_where_the_loops_lose_a_rank():
    loops = np.diag([1.0, 1.0, 1e-14, 0.0])
    motions, sigma = free_motions(loops, 3)
    assert motions.shape == (4, 1)
    assert sigma == pytest.approx([1.0, 1.0, 0.0], abs=1e-13)


def test_damping_is_exactly_none_away_from_singularities_and_smooth_up_to_them():
    assert not damping(np.array([10.0, 1.0, NEAR_SINGULAR]), 0.1).any()
    sigma = np.linspace(0.0, 2 * NEAR_SINGULAR, 4001)
    values = damping(sigma, 0.05)
    assert values[0] == RESTING + 0.05
    assert (np.diff(values) <= 0.0).all()
    assert np.abs(np.diff(values, 2)).max() < 1e-6  # no kink
