"""Weights of a task's axes: 0 frees an axis, others say what counts more where not all can be met."""

import itertools

import bipeds
import numpy as np
import pinocchio as pin
import pytest
import two_armed
from ticking import ticked

import cinegen
from cinegen import Solver
from cinegen.errors import CinegenError
from cinegen.ik import FrameTask, Status

DT = 0.01
PATTERNS = [np.array(pattern) for pattern in itertools.product((0.0, 1.0), repeat=6)]


def moved(pose: pin.SE3, twist: np.ndarray) -> pin.SE3:
    return pin.SE3(pose.rotation @ pin.exp3(twist[3:]), pose.translation + pose.rotation @ twist[:3])


@pytest.mark.parametrize(
    ("weights", "translation", "rotation"),
    [((1, 1, 0, 1, 1, 0), 2, 2), ((1, 0, 0, 0, 0, 1), 1, 1), ((0, 0, 0, 1, 1, 1), 0, 3)],
)
def test_the_counts_are_a_shorthand(weights, translation, rotation):
    for options in ({"weights": weights}, {"translation": translation, "rotation": rotation}):
        task = FrameTask("tool", pin.SE3.Identity(), **options)
        assert (task.translation, task.rotation, task.rows) == (translation, rotation, translation + rotation)
        assert task.weights.tolist() == list(weights)


def test_rows_are_the_derivative_of_the_error():
    rng = np.random.default_rng(0)
    for pattern in PATTERNS:
        task = FrameTask("node", pin.SE3.Random(), weights=pattern * rng.uniform(0.1, 10.0, 6))
        near = moved(task.target, rng.normal(0.0, 0.5, 6))
        axes = pin.SE3.Random().rotation
        error, rows = task.equations(near, np.eye(6), axes)
        assert error.shape == (task.rows,) == task.row_weights.shape
        exact = np.zeros((task.rows, 6))
        for i, e in enumerate(1e-6 * np.eye(6)):
            ahead, behind = (task.equations(moved(near, s * e), np.eye(6), axes)[0] for s in (1.0, -1.0))
            exact[:, i] = (behind - ahead) / 2e-6
        weighted = task.row_weights**2 * error
        assert weighted @ rows == pytest.approx(weighted @ exact, abs=1e-6)
        if pattern[3:].sum() < 3:
            assert rows == pytest.approx(exact, abs=1e-6)


def test_weights_may_be_set_between_ticks(robot):
    solver = cinegen.Solver(robot("arm7"), DT)
    task = solver.add_task("tool")
    start = task.target.copy()
    task.target = moved(start, np.array([0.03, 0.0, 0.0, 0.2, 0.0, 0.0]))
    task.weights = (1, 1, 1, 0, 0, 0)
    first = ticked(solver, 30)
    assert max(task.error) <= 1e-9
    task.weights = (1, 1, 1, 0.1, 1, 1)
    assert first.errors[0][0] <= 1e-9  # a step keeps what it was made for
    assert first.errors[0][1] == 0.0
    step = ticked(solver, 60)
    assert max(task.error) <= 1e-9
    assert pin.log6(task.target.actInv(solver.mechanism.placement(step.q, "tool"))).vector == pytest.approx(0, abs=1e-9)
    task.translation = 2
    assert task.weights.tolist() == [1, 1, 0, 0.1, 1, 1]
    assert step.lost_dof is not None


def test_weights_that_can_not_be_used(robot):
    solver = cinegen.Solver(robot("arm7"), DT)
    for wrong in ((1, 1, 1), (1, 1, 1, -1, 1, 1), (1, 1, 1, np.nan, 1, 1), "heavy", np.ones((6, 1)), np.inf):
        with pytest.raises(CinegenError, match="six finite numbers of at least 0, not"):
            solver.add_task("tool", weights=wrong)
    with pytest.raises(CinegenError, match="leave out translation and rotation"):
        solver.add_task("tool", translation=2, weights=np.ones(6))
    assert not solver.tasks
    task = solver.add_task("tool", weights=(1, 2, 3, 4, 5, 6))
    task.weights = np.zeros(6)
    assert task.rows == 0
    assert solver.step().status is Status.FOLLOWING
    task.weights = np.full(6, 1e300)
    task.weight = 1e300  # their product overflows
    assert solver.step().status is Status.BAD_TARGET
    task.weights = np.full(6, 1e-300)
    assert solver.step().status is Status.FOLLOWING


def test_inverse_kinematics_leaves_an_axis_of_weight_0_free(robot):
    arm, rng = robot("arm7"), np.random.default_rng(2)
    for weights in ((1, 1, 1, 0, 1, 1), (0, 1, 1, 1, 0, 1), (1, 1, 0, 0, 0, 0.01)):
        pose = arm.placement(arm.random_closed(1, seed=3)[0], "tool")
        task = FrameTask("tool", moved(pose, 0.1 * rng.normal(size=6)), weights=weights)
        result = cinegen.inverse_kinematics(arm, [task])
        assert result
        linear, angular = task.errors(arm.placement(result.q, "tool"))
        assert np.concatenate([linear, angular]) == pytest.approx(0.0, abs=1e-9)


# --- weights far apart ------------------------------------------------------------------------------------------------
# Weights of tasks, however far apart: what can be met together is met; what can't is in weighted least squares.


def reached(solver: Solver, most: int) -> int:
    """The number of ticks until all tasks are met to a micrometre; loops stay closed."""
    for tick in range(most):
        step = solver.step()
        assert step.closure <= 1e-11
        if max(max(error) for error in step.errors) < 1e-6:
            return tick
    raise AssertionError(f"{step.status} after {most} ticks: {step.errors}")


@pytest.mark.parametrize("weight", [1.0, 1e6])
def test_a_trunk_moves_over_feet_of_any_weight(weight):
    """From straight legs, a singularity, down to a squat, and then sideways."""
    biped = cinegen.load(bipeds.URDF)
    solver, furthest = Solver(biped, 0.01), 0.0
    trunk = solver.add_task("trunk")
    for foot in bipeds.FEET:
        solver.add_task(foot, weight=weight)
    for way in ((0.0, 0.0, -0.15), (0.03, 0.02, -0.1)):
        trunk.target = pin.SE3(trunk.target.rotation, trunk.target.translation + np.array(way))
        for _ in range(400):
            step = solver.step()
            furthest = max(furthest, *(error[0] for error in step.errors[1:]))
            if max(max(error) for error in step.errors) < 1e-7:
                break
        assert max(max(error) for error in step.errors) < 1e-7, step
    assert step.status is Status.FOLLOWING
    assert furthest < 0.1 / weight


@pytest.mark.parametrize("name", ["two_arms", "five_bar", "gough"])
def test_what_can_be_met_together_is_met_whatever_the_weights(robot, name):
    mechanism, rng = robot(name), np.random.default_rng(3)
    nodes = [node for node in mechanism.nodes if mechanism.jacobian(mechanism.q_home, node).any()]
    for _ in range(8):
        solver = Solver(mechanism, 0.01)
        first, *others = rng.choice(nodes, min(3, len(nodes)), replace=False)
        task = solver.add_task(first)
        away = task.target.translation + 0.1 * mechanism.length * rng.normal(size=3)
        task.target = pin.SE3(task.target.rotation, away)
        for _ in range(60):
            q_goal = solver.step().q
        solver = Solver(mechanism, 0.01)
        for node in (first, *others):
            solver.add_task(node, mechanism.placement(q_goal, node), weight=10.0 ** rng.uniform(-4.0, 4.0))
        reached(solver, 400)


def test_a_conflict_ends_at_the_weighted_mean(robot):
    """Two targets of one point: the sum of squared weights times squared distances is least at their mean."""
    for ratio in (2.0, 1e2, 1e4):
        solver = Solver(robot("arm7"), 0.01)
        tasks = [solver.add_task("tool", rotation=0, weight=weight) for weight in (ratio, 1.0)]
        start = tasks[0].target.translation
        places = start + np.array([0.02, 0.03, -0.02]), start + np.array([0.01, 0.04, -0.03])
        for task, place in zip(tasks, places, strict=True):
            task.target = pin.SE3(np.eye(3), place)
        for _ in range(300):
            q = solver.step().q
        mean = (ratio**2 * places[0] + places[1]) / (ratio**2 + 1.0)
        assert solver.mechanism.placement(q, "tool").translation == pytest.approx(mean, abs=2e-8)


def test_a_light_task_is_as_fast_as_alone():
    """One of two arms is stretched by a task of weight 0.2 as it is by that task alone, while the other is held."""
    mechanism, paths = cinegen.load(two_armed.URDF), []
    for is_held in (True, False):
        solver = Solver(mechanism, 0.01)
        solver.lock("to_waist")
        hand = solver.add_task("left_hand", rotation=0, weight=0.2)
        if is_held:
            solver.add_task("right_hand", rotation=0)
        hand.target = pin.SE3(np.eye(3), np.array([2.0, 0.3, 0.5]))
        paths.append(np.array([solver.step().q for _ in range(150)]))
    assert paths[0] == pytest.approx(paths[1], abs=1e-9)
    assert abs(paths[0][-1] - mechanism.q_home).max() > 0.5
