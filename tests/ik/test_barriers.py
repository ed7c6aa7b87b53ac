"""Barriers: bounds of velocity that no task and no objective breaks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_tick import resolve
from scipy.optimize import linprog
from test_kernel import plain_levels
from ticking import away

from cinegen import CinegenError, Solver, Status
from cinegen.ik import Posture
from cinegen.ik.barrier import Bounds
from cinegen.loops.motions import free_motions

DT = 0.01
seeds = st.integers(0, 2**32 - 1)
ROBOTS = ["planar_3r", "arm7", "five_bar", "delta4"]
EXACT = 1e-9


class Objective:
    """Returns or raises what `answer(state)` does."""

    def __init__(self, answer):
        self.answer = answer

    def velocity(self, state):
        return self.answer(state)


class Barrier:
    """Its methods are given."""

    def __init__(self, bounds=None, clear=None):
        self._bounds, self._clear = bounds, clear

    def bounds(self, state):
        return self._bounds(state) if self._bounds else Bounds(np.zeros((0, state.mechanism.model.nv)), np.zeros(0))

    def clear(self, state, q):
        return self._clear(state, q) if self._clear else 1.0


def linear(rows, most):
    """Keeps rows @ v <= most, whatever the configuration."""
    return Barrier(lambda state: Bounds(rows, most))


def pulled(mechanism, rng, lengths=0.3, rotation=0, **options):
    solver = Solver(mechanism, DT, **options)
    task = solver.add_task(mechanism.nodes[-1], rotation=rotation, axes="world")
    task.target = away(mechanism, mechanism.nodes[-1], rng, lengths)
    return solver, task


def fastest(mechanism):
    """(nv,) rad/s and m/s that a tick may go at most."""
    limits = mechanism.model.upperVelocityLimit
    cap = 0.1 * mechanism.scale / DT
    return np.where(limits > 0.0, np.minimum(limits, cap), cap)


def random_rows(mechanism, rng, count):
    """Some that a motion without any task would keep, some that it would not, and that can be kept all together."""
    nv = mechanism.model.nv
    rows = rng.normal(size=(count, nv)) / mechanism.scale
    motions, _ = free_motions(loops_at_home(mechanism), mechanism.loop_rank)
    possible = motions @ rng.normal(size=motions.shape[1])
    possible *= 0.2 * (fastest(mechanism) / mechanism.scale / np.maximum(np.abs(possible), 1e-9)).min()
    least = rows @ (possible * mechanism.scale)
    return rows, least + rng.uniform(0.0, 0.3, count) * np.abs(least)


def loops_at_home(mechanism):
    return mechanism.structure.system.evaluate(mechanism.q_home)[1]


def proposed(solver):
    """(nv,) the velocity that the last tick set out with, before what closed its loops."""
    return solver._memory.step * solver.mechanism.scale / DT


# --- what is kept ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ROBOTS)
@settings(max_examples=40)
@given(seed=seeds, wishing=st.booleans(), accelerated=st.booleans(), rotation=st.sampled_from([0, 3]))
def test_bounds_are_kept_together_with_all_else(robot, name, seed, wishing, accelerated, rotation):
    mechanism, rng = robot(name), np.random.default_rng(seed)
    solver, task = pulled(mechanism, rng, rotation=rotation, acceleration=30.0 if accelerated else None)
    rows, most = random_rows(mechanism, rng, int(rng.integers(1, 6)))
    most = np.maximum(most, 0.0)
    solver.barriers = [linear(rows[:2], most[:2]), linear(rows[2:], most[2:])]
    if wishing:
        aim = mechanism.close(mechanism.q_home + 0.2 * rng.normal(size=mechanism.model.nq))
        solver.objectives = [Posture(aim, rate=5.0)]
    low, high = mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit
    size = np.abs(rows) @ mechanism.scale
    for _ in range(15):
        step = solver.step()
        # what can't stop at once turns back by half, which is not quite within what the loops of this tick would allow
        rounded = 1e-4 if accelerated and mechanism.is_constrained else EXACT
        assert (rows @ proposed(solver) <= most + rounded * size).all()
        # closing the loops, and keeping tasks where wishes would move them, adds what is of second order
        exact = not (mechanism.is_constrained or wishing)
        second = 0.0 if exact else 2.0 * (np.abs(step.v / mechanism.scale).max() * DT) ** 2 / DT
        assert (rows @ step.v <= most + (rounded + second) * size).all()
        assert (np.abs(step.v) <= fastest(mechanism) * (1.0 + 1e-9)).all()
        assert (step.q >= low - 1e-9).all()
        assert (step.q <= high + 1e-9).all()
        assert step.closure <= EXACT
        if rng.random() < 0.2:
            task.target = away(mechanism, mechanism.nodes[-1], rng, 0.3)


@pytest.mark.parametrize("name", ROBOTS)
@settings(max_examples=40)
@given(seed=seeds)
def test_where_it_has_to_go_back_it_does_at_once_if_it_can(robot, name, seed):
    """Also where that costs the task, and without any."""
    mechanism, rng = robot(name), np.random.default_rng(seed)
    solver, task = pulled(mechanism, rng)
    if rng.random() < 0.3:
        solver.remove_task(task)
    rows, most = random_rows(mechanism, rng, int(rng.integers(1, 4)))
    most -= 0.01 * np.abs(most)
    solver.barriers = [linear(rows, most)]
    loops = loops_at_home(mechanism) / mechanism.scale
    reach = np.column_stack([-fastest(mechanism), fastest(mechanism)])
    closed = (loops, np.zeros(len(loops))) if len(loops) else (None, None)
    possible = linprog(np.zeros(len(reach)), rows, most, *closed, reach)
    step = solver.step()
    size = np.abs(rows) @ mechanism.scale
    if possible.status == 0:
        assert (rows @ proposed(solver) <= most + EXACT * size).all()
    # it never goes on, but for what closes the loops, which is of second order
    back = most < 0.0
    assert (rows[back] @ proposed(solver) <= 1e-6 * size[back]).all()
    second = 0.1 * (np.abs(step.v / mechanism.scale).max() * DT) ** 2 / DT if mechanism.is_constrained else 0.0
    assert (rows[back] @ step.v <= (1e-6 + second) * size[back]).all()


def test_where_joints_cant_go_back_so_fast_they_go_as_fast_as_they_can(robot):
    mechanism = robot("planar_3r")
    solver = Solver(mechanism, DT)
    solver.add_task("tool", rotation=0)
    solver.barriers = [linear(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), np.array([-1e3, -1.0]))]
    assert solver.step().v[0] == pytest.approx(-mechanism.model.upperVelocityLimit[0], rel=1e-6)


# --- the best that bounds allow ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["arm7", "delta4"])
@settings(max_examples=60)
@given(seed=seeds)
def test_within_its_bounds_a_step_does_most_for_the_pulls(robot, name, seed):
    mechanism, rng = robot(name), np.random.default_rng(seed)
    solver, _ = pulled(mechanism, rng, lengths=0.005, rotation=0 if name == "delta4" else 3)
    rows, most = random_rows(mechanism, rng, int(rng.integers(1, 5)))
    most = 0.05 * np.maximum(most, 0.0)
    system, memory, free = mechanism.structure.system, solver._memory, np.full(mechanism.model.nv, np.inf)
    levels, loops, barriers = plain_levels(solver), loops_at_home(mechanism), (rows * mechanism.scale, most * DT)
    best = resolve(loops, mechanism.loop_rank, levels, -free, free, memory.longest_step, system.cut_rates(), barriers)
    solver.barriers = [linear(rows, most), linear(-rows, np.full(len(rows), np.inf))]  # the latter binds nothing
    solver.step()
    assert best is not None
    assert memory.step == pytest.approx(best, abs=1e-8)


# --- steps are asked about ---------------------------------------------------------------------------------------


def test_a_step_that_is_not_clear_is_made_shorter_until_it_is(robot):
    mechanism = robot("planar_3r")
    free, _ = pulled(mechanism, np.random.default_rng(0))
    whole = free.step().v
    asked = []

    def clear(state, q):
        assert (state.q == mechanism.q_home).all()
        asked.append(q - state.q)
        return 1.0 if np.abs(q - state.q).max() < 0.3 * np.abs(whole).max() * DT else 0.5

    solver, _ = pulled(mechanism, np.random.default_rng(0))
    solver.barriers = [Barrier(clear=clear)]
    step = solver.step()
    assert len(asked) == 3
    assert step.v == pytest.approx(0.25 * whole)
    assert (step.q == mechanism.q_home + asked[-1]).all()


def test_all_barriers_are_asked_and_the_strictest_counts(robot):
    solver, _ = pulled(robot("planar_3r"), np.random.default_rng(0))
    for parts in ((1.0, 0.0), (0.0, 1.0)):
        solver.barriers = [Barrier(clear=lambda state, q, part=part: part) for part in parts]
        assert not solver.step().v.any()


def test_what_a_barrier_does_to_what_it_is_shown_changes_nothing(robot):
    def spoil(state, q):
        q[:] = 17.0
        state.q[:] = 17.0
        return 1.0

    free, _ = pulled(robot("five_bar"), np.random.default_rng(0))
    solver, _ = pulled(robot("five_bar"), np.random.default_rng(0))
    solver.barriers = [Barrier(clear=spoil)]
    assert (solver.step().q == free.step().q).all()


# --- barriers that make no sense -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["planar_3r", "arm7", "delta4"])
def test_bounds_that_contradict_each_other_hold_it_there(robot, name):
    mechanism = robot(name)
    nv = mechanism.model.nv
    for accelerated in (None, 30.0):
        solver, _ = pulled(mechanism, np.random.default_rng(0), acceleration=accelerated)
        every = np.vstack([np.eye(nv), -np.eye(nv)])
        for most in (np.full(2 * nv, -0.1), np.full(2 * nv, -np.inf), np.full(2 * nv, -1e9)):
            solver.barriers = [linear(every, most)]
            step = solver.step()
            assert np.abs(step.v / mechanism.scale).max() < 1e-8
            assert step.status is Status.BARRED


def test_more_rows_than_bits_are_told_from_none(robot):
    mechanism = robot("planar_3r")
    solver, _ = pulled(mechanism, np.random.default_rng(0))
    v = solver.step().v
    rows = np.zeros((200, 3))
    rows[150] = v / np.linalg.norm(v)
    solver.barriers = [linear(rows, np.zeros(200))]
    step = solver.step()
    assert rows[150] @ step.v <= 1e-9
    assert step.status is Status.BARRED
    assert step.active_barriers == (52,)


@pytest.mark.parametrize("wrong", [object(), Posture, "bounds", 3.0])
def test_what_is_no_barrier_is_refused_and_the_others_stay(robot, wrong):
    solver, _ = pulled(robot("planar_3r"), np.random.default_rng(0))
    good = linear(np.zeros((1, 3)), np.zeros(1))
    solver.barriers = [good]
    with pytest.raises(CinegenError, match="a barrier has the methods `bounds` and `clear`"):
        solver.barriers = [good, wrong]
    assert solver.barriers == (good,)
