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
def test_no_step_opens_a_loop_whatever_is_pulled(seed):
    rng = np.random.default_rng(seed)
    loops = _loops(rng, 6, 8, 4)
    low, high = -rng.uniform(0, 0.3, 8), rng.uniform(0, 0.3, 8)
    found = resolve(loops, 4, rng.normal(size=(6, 8)), 4, rng.normal(size=6), low, high)
    assert np.abs(loops @ found.step).max() < 1e-9


@given(seeds)
def test_no_step_leaves_its_bounds(seed):
    rng = np.random.default_rng(seed)
    low, high = -rng.uniform(0, 0.1, 8), rng.uniform(0, 0.1, 8)
    low[rng.random(8) < 0.3] = 0.0
    found = resolve(_loops(rng, 6, 8, 3), 3, rng.normal(size=(3, 8)), 3, rng.normal(size=3), low, high)
    assert (found.step <= high + 1e-11).all()
    assert (found.step >= low - 1e-11).all()


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
    motions, _ = free_motions(loops, 2)
    _, sigma, wt = np.linalg.svd(tasks @ motions)
    weight = np.concatenate([damping(sigma, float(np.linalg.norm(error))), np.full(2, RESTING)])

    def cost(y):
        return np.sum((tasks @ motions @ y - error) ** 2) + weight @ (wt @ y) ** 2

    within = LinearConstraint(motions, low, high)
    best = minimize(cost, np.zeros(5), constraints=[within], method="SLSQP", options={"ftol": 1e-14, "maxiter": 500})
    assert cost(motions.T @ found.step) <= best.fun + 1e-6


def test_a_joint_at_its_bound_is_frozen_and_the_others_do_the_rest():
    tasks = np.array([[1.0, 1.0, 0.0]])
    low, high = np.full(3, -np.inf), np.array([0.1, np.inf, np.inf])
    found = resolve(np.zeros((0, 3)), 0, tasks, 1, np.array([1.0]), low, high)
    assert found.frozen == (0,)
    assert found.step == pytest.approx([0.1, 0.9, 0.0], abs=1e-3)
    assert found.step[0] == pytest.approx(0.1, abs=1e-12)


def test_where_a_loop_ties_a_joint_to_a_bound_both_end_on_it():
    loops = np.array([[1.0, -2.0, 0.0]])  # joint 0 turns twice as far as joint 1
    low, high = np.full(3, -np.inf), np.array([np.inf, 0.1, np.inf])
    found = resolve(loops, 1, np.array([[1.0, 0.0, 1.0]]), 1, np.array([1.0]), low, high)
    assert found.step[:2] == pytest.approx([0.2, 0.1])
    assert found.step[2] == pytest.approx(0.8, abs=1e-3)


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
