"""Blending: from one target or weight to another without a jerk, and nobody is held who takes over."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ticking import beside, ticked

import cinegen
from cinegen.ik.tasks.blend import eased

DT = 1e-3


@pytest.fixture
def platform(robot):
    """A solver of a delta robot, and the task of its platform."""
    solver = cinegen.Solver(robot("delta4"), DT)
    return solver, solver.add_task("platform")


@given(st.floats(-0.5, 1.5), st.floats(1e-4, 0.1))
def test_it_begins_and_ends_at_rest_and_never_turns_back(part, more):
    assert eased(part + more) >= eased(part)
    assert eased(more) <= 10.0 * more**3
    assert 1.0 - eased(1.0 - more) <= 10.0 * more**3 + 1e-12
    assert eased(part) == pytest.approx(1.0 - eased(1.0 - part), abs=1e-12)


def test_the_target_arrives_in_time_on_a_straight_line_and_the_node_with_it(robot):
    solver = cinegen.Solver(robot("arm7"), DT)
    task = solver.add_task("tool")
    begin = task.target.copy()
    end = beside(begin, [-0.03, 0.02, 0.02], (0.1, -0.2, 0.1))
    solver.blend(task, end, seconds=0.3)
    places, turns = [], []
    for _ in range(300):
        step = solver.step()
        assert step.errors[0][0] < 1e-5
        places.append(task.target.translation.copy())
        turns.append(np.linalg.norm(pin.log3(begin.rotation.T @ task.target.rotation)))
    assert task.target == end
    way = end.translation - begin.translation
    along = (np.array(places) - begin.translation) @ way / (way @ way)
    np.testing.assert_allclose(np.array(places), begin.translation + along[:, None] * way, atol=1e-12)
    assert (np.diff(along) >= 0.0).all()
    np.testing.assert_allclose(turns, along * np.sqrt(0.06), atol=1e-9)
    speed = np.diff(along) / DT
    assert np.abs(np.diff(speed)).max() <= 5.9 / 0.3**2 * DT  # the least jerk's largest acceleration is 5.77 / T^2


def test_a_fading_pull_gives_way_smoothly_and_ends(robot):
    solver = cinegen.Solver(robot("arm7"), DT)
    fading, other = solver.add_task("link4", rotation=0), solver.add_task("tool", rotation=0)
    other.target.translation += np.array([0.0, 0.05, 0.05])
    fading.target.translation += np.array([0.0, -0.03, 0.0])
    step = ticked(solver, 400)
    solver.remove_task(fading, seconds=0.4)
    assert solver.tasks == (fading, other)
    for tick in range(400):
        step = solver.step()
        assert np.abs(step.v).max() < 2.0
        assert len(solver.tasks) == (2 if tick < 399 else 1)
    step = ticked(solver, 200)
    assert step.errors[0][0] < 1e-6
    solver.remove_task(fading)  # is let go already


@pytest.mark.parametrize("take_over", [
    lambda solver, task: setattr(task, "target", beside(task.target, [0.01, 0.0, 0.0])),
    lambda solver, task: task.target.translation.__iadd__(np.array([0.01, 0.0, 0.0])),
    lambda solver, task: solver.remove_task(task),
], ids=["another target", "moved in place", "let go"])  # fmt: skip
def test_who_changes_the_target_meanwhile_takes_over(platform, take_over):
    solver, task = platform
    solver.blend(task, beside(task.target, [0.0, 0.0, -0.1]), seconds=0.5)
    ticked(solver, 100)
    take_over(solver, task)
    target = task.target.copy()
    ticked(solver, 500)
    assert task.target == target


def test_who_sets_the_weight_meanwhile_keeps_it(platform):
    solver, task = platform
    solver.blend(task, seconds=0.05, weight=5.0)
    solver.step()
    task.weight = 2.0
    ticked(solver, 60)
    assert task.weight == 2.0


def test_a_later_blend_replaces_the_one_before_and_may_take_no_time(platform):
    solver, task = platform
    end = beside(task.target, [0.05, 0.0, 0.0])
    solver.blend(task, beside(task.target, [0.0, 0.0, -0.1]), seconds=0.5)
    for seconds in (0.2, 0.0):
        ticked(solver, 100)
        solver.blend(task, end, seconds=seconds, weight=2.0)
    solver.step()
    assert task.target == end
    assert task.weight == 2.0


def test_what_makes_no_sense_is_refused(platform):
    solver, task = platform
    home = task.target.copy()
    with pytest.raises(cinegen.CinegenError, match="0 seconds or more"):
        solver.blend(task, home, seconds=-1.0)
    with pytest.raises(cinegen.CinegenError, match="finite"):
        solver.blend(task, "there")
    with pytest.raises(cinegen.CinegenError, match="weight must be 0"):
        solver.blend(task, weight=float("nan"))
    with pytest.raises(cinegen.CinegenError, match="not one of"):
        cinegen.Solver(solver.mechanism, DT).blend(task, home)
    task.twist = np.zeros(6)
    with pytest.raises(cinegen.CinegenError, match="follows a twist"):
        solver.blend(task, home)
