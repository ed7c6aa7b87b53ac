"""Levels of priority: against the plain statement, against optima of SLSQP, and the promises that ticks keep."""

import math

import numpy as np
import pinocchio as pin
import pytest
import two_armed
from making import graph
from repository import load
from scipy.optimize import minimize
from small_robots import two_bars
from test_barriers import Objective
from test_kernel import every_robot, near, steps_agree
from ticking import beside

import cinegen
from cinegen import Solver, Status
from cinegen.ik import PointInPlane, RelativePose


def random_levels(solver: Solver, rng: np.random.Generator, levels: int) -> None:
    mechanism = solver.mechanism
    for level in range(levels):
        for _ in range(int(rng.integers(1, 3))):
            node = str(rng.choice(mechanism.nodes[1:]))
            target = near(mechanism, mechanism.placement(solver.q, node), rng, float(rng.choice([1e-3, 1e-2])))
            weights = rng.uniform(0.3, 1.0, 6) * (rng.random(6) < 0.4)
            solver.add_task(node, target, weights=weights, weight=float(rng.uniform(0.3, 3.0)), priority=level)


def compare(mechanism: cinegen.Mechanism, count: int, rng: np.random.Generator) -> tuple[int, int]:
    """Compare steps for random tasks on three levels with the plain statement, at random closed configurations, with
    limits about as near as a step is long. Return how many were compared, and how many of these limits restricted."""
    seen = []
    for q in [mechanism.q_home, *mechanism.random_closed(count, seed=3)]:
        solver = Solver(mechanism, 1.0, q=q)
        random_levels(solver, rng, 3)
        seen.append(steps_agree(solver, rng, float(rng.choice([3e-3, 100.0])), odd=False))
    return len(seen) - seen.count("not compared") - seen.count("nudged"), seen.count("bent")


@every_robot
def test_the_step_of_each_level_is_that_of_the_plain_statement(name, which):
    mechanism = load(name, which)
    if mechanism.mobility > 1:
        compared, bent = compare(mechanism, 20, np.random.default_rng(5))
        assert compared > 10
        assert bent


@pytest.mark.parametrize("count", [8, pytest.param(200, marks=pytest.mark.slow)])
@pytest.mark.filterwarnings("ignore::cinegen.CinegenWarning")
def test_so_it_is_on_random_mechanisms(count):
    """Trees of 4 to 8 bodies with up to two loops between any two of them."""
    rng, totals, loops = np.random.default_rng(8), np.zeros(2, dtype=int), 0
    for _ in range(count):
        bodies = int(rng.integers(4, 9))
        mechanism = cinegen.load(f"RAFF random\n{graph(rng, bodies, int(rng.integers(0, 3))).text()}")
        if mechanism.mobility > 1:
            totals += compare(mechanism, 3, rng)
            loops += bool(mechanism.loops)
    assert totals[0] > count
    assert min(totals[1], loops) > count // 10


def settle(solver: Solver, most: int = 400) -> cinegen.Step:
    for _ in range(most):
        step = solver.step()
        if not step.v.any():
            return step
    raise AssertionError(f"no rest after {most} ticks: {np.abs(step.v).max():.2g}")


def test_a_level_is_not_blamed_for_what_those_above_do():
    """The second level wants another place in x and y, which gets worse by the first, and z, which is free: a tick
    reaches z, as placo's soft task beside a hard one does."""
    solver = Solver(load("delta4", "r1"), 1e-3)
    first = solver.add_task("platform", weights=[1, 1, 0, 0, 0, 0], axes="world")
    second = solver.add_task("platform", rotation=0, axes="world", priority=1)
    start = first.target.translation
    first.target, second.target = beside(first.target, (1e-5, -2e-5, 0.0)), beside(first.target, (5e-5, 3e-5, 2e-5))
    end = solver.mechanism.placement(solver.step().q, "platform").translation
    assert end - start == pytest.approx([1e-5, -2e-5, 2e-5], abs=1e-10)


def test_hand_first_elbow_second_ends_where_an_optimiser_does():
    arm = load("arm7", "arm")
    solver = Solver(arm, 0.01)
    hand, elbow = solver.add_task("tool"), solver.add_task("link4", rotation=0, priority=1)
    hand.target, elbow.target = beside(hand.target, (-0.1, 0.15, -0.1)), beside(elbow.target, (0.3, 0.6, 0.4))
    step = settle(solver)

    def off(q: np.ndarray) -> float:
        return float(np.sum((arm.placement(q, "link4").translation - elbow.target.translation) ** 2))

    def slip(q: np.ndarray) -> np.ndarray:
        return pin.log6(hand.target.actInv(arm.placement(q, "tool"))).vector

    best = minimize(off, step.q, constraints={"type": "eq", "fun": slip}, method="SLSQP", options={"ftol": 1e-15})
    assert np.abs(slip(step.q)).max() < 1e-12
    assert step.errors[1][0] == pytest.approx(math.sqrt(best.fun), abs=1e-6)
    assert [level.status for level in step.levels] == [Status.FOLLOWING, Status.OUT_OF_REACH]
    assert step.status is Status.OUT_OF_REACH


def test_priorities_swapped_swap_who_wins_and_any_integers_order_them():
    arm = load("arm7", "arm")
    q_goal, elsewhere = arm.q_home + 0.3, arm.q_home - 0.25
    for first, second in ((0, 7), (7, 0)):
        solver = Solver(arm, 0.01)
        tool = solver.add_task("tool", arm.placement(q_goal, "tool"), priority=first)
        mid = solver.add_task("link5", arm.placement(elsewhere, "link5"), priority=second)
        step = settle(solver)
        winner, loser = step.errors if first < second else step.errors[::-1]
        assert max(winner) < 1e-9
        assert max(loser) > 1e-3
    mid.priority, tool.priority = 2, 1  # at run time
    assert max(settle(solver).errors[0]) < 1e-9


def test_a_single_level_has_the_status_and_the_smallest_singular_value_of_the_tick():
    solver = Solver(cinegen.load(two_bars()), 0.01, [0.5, 1e-6])  # almost stretched
    solver.add_task("tool", rotation=0)
    step = solver.step()
    (level,) = step.levels
    assert level.status is step.status
    assert level.smallest_singular_value < 1e-5
    assert level.smallest_singular_value == pytest.approx(step.singular_values[-1])


def test_the_same_task_twice_is_met_once_and_the_second_level_has_no_freedom():
    delta = load("delta4", "r1")
    solver = Solver(delta, 0.01)
    twice = [solver.add_task("platform", rotation=0, priority=level) for level in (0, 1)]
    for task in twice:
        task.target = beside(task.target, (0.02, 0.03, -0.02))
    assert np.abs(settle(solver).errors).max() < 1e-9
    twice[1].target = beside(twice[1].target, (0.02, 0.0, 0.0))
    step = settle(solver)
    assert step.task_statuses == (Status.FOLLOWING, step.levels[1].status) == (Status.FOLLOWING, Status.NO_FREEDOM)


def test_a_stretched_arm_comes_to_rest_and_a_lower_level_never_vetoes():
    arm = load("arm7", "arm")
    far = Solver(arm, 0.01)
    hand, elbow = far.add_task("tool", rotation=0), far.add_task("link4", rotation=0, priority=1)
    hand.target, elbow.target = beside(hand.target, (3.0, 1.0, 0.5)), beside(elbow.target, (-0.2, 0.3, 0.2))
    alone = Solver(arm, 0.01)
    alone.add_task("tool", hand.target, rotation=0)
    speeds = []
    for _ in range(600):
        step, reference = far.step(), alone.step()
        speeds.append(float(np.abs(step.v).max()) * far.dt)
    assert step.errors[0][0] == pytest.approx(reference.errors[0][0], abs=1e-5)
    assert max(speeds[-50:]) < 1e-3  # rad in a tick
    assert max(np.abs(np.diff(speeds))) < 0.1


def test_two_arms_carry_an_object_within_limits():
    both = cinegen.load(two_armed.URDF)
    solver = Solver(both, 0.01)
    solver._write_tasks()
    solver._memory.lower[:], solver._memory.upper[:] = both.q_home - 0.35, both.q_home + 0.35
    solver.add_task(RelativePose("left_hand", "right_hand", solver.state.frame("left_hand", "right_hand")))
    hand = solver.add_task("right_hand", priority=1)
    start, worst, limited = hand.target.copy(), 0.0, 0
    for tick in range(1500):
        w = 2.0 * np.pi * tick / 700.0
        hand.target = pin.SE3(
            start.rotation @ pin.exp3(0.4 * np.array([np.sin(w), np.sin(2.0 * w), 0.0])),
            start.translation + 0.25 * np.array([np.sin(w), np.cos(2.0 * w) - 1.0, np.sin(3.0 * w)]),
        )
        step = solver.step()
        worst, limited = max(worst, *step.errors[0]), limited + bool(step.saturated)
    assert worst < 1e-10
    assert limited > 500


def test_an_objective_below_two_levels_moves_neither():
    arm = load("arm7", "arm")
    solver = Solver(arm, 0.01)
    solver.add_task("tool", rotation=0)
    level = solver.add_task(PointInPlane("link4", priority=1))
    level.through = solver.state.frame("link4").translation
    posture = cinegen.Posture(arm.q_home + 0.3, rate=5.0)
    solver.objectives = [posture]
    before = posture.value(solver.state)
    for _ in range(200):
        step = solver.step()
        assert max(*step.errors[0], *step.errors[1]) < 1e-9
    assert posture.value(solver.state) < 0.8 * before


@pytest.mark.parametrize("spins", [False, True])
def test_an_outstretched_arm_escapes_while_an_objective_moves_it(spins):
    """A target straight inwards: the error has no gradient there."""
    solver = Solver(load("planar_3r", "arm"), 0.01, q=np.zeros(3))
    if spins:
        solver.objectives = [Objective(lambda state: np.array([0.0, 0.2, -0.2]))]
    task = solver.add_task("tool", rotation=0)
    task.target = beside(task.target, (-0.19, 0.0, 0.0))
    assert min(solver.step().errors[0][0] for _ in range(300)) < 1e-6


def test_wrong_priorities_are_errors_with_the_remedy():
    solver = Solver(load("arm7", "arm"), 0.01)
    task = solver.add_task("tool")
    for wrong in (-1, 0.5, True, "first", None):
        with pytest.raises(cinegen.CinegenError, match="0 or more"):
            task.priority = wrong
        with pytest.raises(cinegen.CinegenError, match="0 or more"):
            solver.add_task("tool", priority=wrong)
    task.priority = 3
    assert solver.step().status is Status.FOLLOWING
