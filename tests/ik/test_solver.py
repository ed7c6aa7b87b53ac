"""The solver as one who tasks on a robot meets it."""

import numpy as np
import pinocchio as pin
import pytest

import cinegen
from cinegen import Solver, Status
from cinegen.errors import UnknownNameError

DT = 0.01


def _run(solver, ticks=300):
    for _ in range(ticks):
        step = solver.step()
    return step


def _offset(mechanism, node, vector):
    home = mechanism.placement(mechanism.q_home, node)
    return pin.SE3(home.rotation, home.translation + np.array(vector))


@pytest.mark.parametrize("name", ["delta4", "gough", "hybrid", "arm7"])
def test_a_target_within_reach_is_reached_exactly(robot, name):
    mechanism = robot(name)
    lower, upper = mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit
    inside = [q for q in mechanism.random_closed(60, seed=5) if (q > lower).all() and (q < upper).all()][:4]
    assert inside
    node = mechanism.nodes[-1]
    for q in inside:
        solver = Solver(mechanism, DT)
        target = mechanism.placement(q, node)
        home = mechanism.placement(mechanism.q_home, node)
        near = pin.SE3.Interpolate(home, target, 0.3) if not mechanism.is_constrained else target
        solver.add_task(node, near)
        step = _run(solver, 600)
        assert step.errors[0][0] < 1e-9 * max(1.0, mechanism.length)
        assert step.errors[0][1] < 1e-9
        assert step.status is Status.FOLLOWING
        assert step.closure <= 1e-12


def test_a_stretched_arm_comes_to_rest_without_jitter(robot):
    arm = robot("planar_3r")
    solver = Solver(arm, DT)
    solver.add_task("tool", pin.SE3(np.eye(3), np.array([20.0, 3.0, 0.0])), rotation=0)
    assert {len(solver.step().singular_values) for _ in range(3000)} == {2}
    assert max(np.abs(solver.step().v).max() for _ in range(50)) < 1e-4


def test_targets_that_are_no_numbers_give_a_status_and_leave_the_rest_alone(robot):
    delta = robot("delta4")
    solver = Solver(delta, DT)
    task = solver.add_task("platform")
    bad = pin.SE3.Identity()
    for value in (np.nan, np.inf):
        bad.translation = np.array([0.0, value, 0.0])
        task.target = bad
        step = solver.step()
        assert step.status is Status.BAD_TARGET
        assert np.array_equal(step.q, delta.q_home)
        assert np.isnan(step.errors[0][0])
    for attribute, value in (
        ("target", np.eye(4)), ("target", None), ("translation", 7), ("rotation", -1), ("rotation", "all"),
        ("weight", "a"), ("weight", np.inf), ("weight", 0.0),
    ):  # fmt: skip
        task = solver.add_task("platform")
        assert task.is_valid()
        setattr(task, attribute, value)
        assert not task.is_valid()
        assert solver.step().status is Status.BAD_TARGET
        solver.remove_task(task)
    task.target = _offset(delta, "platform", [1e300, 0.0, 0.0])
    assert np.isfinite(solver.step().q).all()


@pytest.mark.parametrize("matrix", [np.zeros((3, 3)), -np.eye(3), 2.0 * np.eye(3), np.diag([1e308, 1.0, 1.0])])
def test_targets_that_are_no_rotations_give_a_status(robot, matrix):
    solver = Solver(robot("arm7"), DT)
    task = solver.add_task("tool")
    near = np.eye(4)
    near[:3, :3] = task.target.rotation + 1e-5
    near[:3, 3] = task.target.translation
    solver.remove_task(task)
    for target, known in ((pin.SE3(near), True), (pin.SE3(matrix, np.zeros(3)), False)):
        task = solver.add_task("tool", target)
        assert (solver.step().status is not Status.BAD_TARGET) == known
        assert task.is_valid() == known
        solver.remove_task(task)


def test_wrong_calls_are_refused_before_the_loop(robot):
    delta = robot("delta4")
    with pytest.raises(cinegen.CinegenError, match="dt"):
        Solver(delta, 0.0)
    with pytest.raises(cinegen.CinegenError, match="gain"):
        Solver(delta, DT, gain=0.0)
    with pytest.raises(cinegen.CinegenError, match="open"):
        Solver(delta, DT, q=delta.q_home + 0.1)
    solver = Solver(delta, DT)
    with pytest.raises(UnknownNameError, match="platform"):
        solver.add_task("platfrom")
    with pytest.raises(cinegen.CinegenError, match="0 to 3"):
        solver.add_task("platform", translation=4)
    with pytest.raises(cinegen.CinegenError, match="SE3"):
        solver.add_task("platform", np.eye(4))


def test_errors_of_a_step_keep_their_places_where_a_task_is_invalid(robot):
    solver = Solver(robot("delta4"), DT)
    first, second = solver.add_task("base"), solver.add_task("platform")
    first.target = pin.SE3(np.eye(3), np.array([np.nan, 0.0, 0.0]))
    for _ in range(20):
        aim = second.target.copy()
        aim.translation[2] += 1e-4
        second.target = aim
        step = solver.step()
        assert np.isnan(step.errors[0]).all()
        assert np.isfinite(step.errors[1]).all()
    assert "nan" in step._repr_html_()
    assert step._repr_html_().count("<tr>") == 3
    assert len(repr(step)) < 200
