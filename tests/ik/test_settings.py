"""Gain, damping and period, set while a robot moves."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cinegen import CinegenError, Solver, Status, load

ARM = load("robots/planar_3r.raff")
END = ARM.nodes[-1]


def _pulled(near=None, gain=math.inf):
    """An arm pulled outwards near where it is stretched, one tick on: its step, and how far that went."""
    q = ARM.configuration(dict(zip(ARM.joints, (0.3, 0.02, 0.02), strict=True)))
    solver = Solver(ARM, 0.01, q=q, gain=gain)
    if near is not None:
        solver.damping_threshold = near
    task = solver.add_task(END, translation=2, rotation=0)
    task.target = task.target * pin.SE3(np.eye(3), np.array([0.0, -1e-4, 0.0]))
    before = ARM.placement(q, END).translation
    step = solver.step()
    return step, float(np.linalg.norm(ARM.placement(step.q, END).translation - before))


@given(st.floats(1.0, 1000.0))
def test_errors_decay_exponentially_at_the_gain(gain):
    solver = Solver(ARM, 0.01)
    solver.gain = gain
    task = solver.add_task(END, rotation=0, translation=2)
    task.target = task.target * pin.SE3(np.eye(3), np.array([1e-5, 0.0, 0.0]))
    assert solver.gain == gain
    assert solver.step().errors[0][0] == pytest.approx(math.exp(-0.01 * gain) * 1e-5, abs=1e-9)


def test_damping_sets_in_below_the_value_that_is_set():
    sigma = _pulled()[0].singular_values[-1]
    assert 1e-3 < sigma < 0.1
    lively, usual, calm = (_pulled(near)[1] for near in (0.5 * sigma, 2.0 * sigma, 0.3))
    assert calm < usual < lively
    assert lively == pytest.approx(1e-4, rel=1e-2)  # not damped at all


@pytest.mark.parametrize("value", [0.0, -1.0, 1.5, math.nan])
def test_invalid_settings_are_refused_and_nothing_changes(value):
    solver = Solver(ARM, 0.01, gain=50.0)
    if value != 1.5:
        with pytest.raises(CinegenError, match="gain"):
            solver.gain = value
    with pytest.raises(CinegenError, match="damping"):
        solver.damping_threshold = value
    assert (solver.gain, solver.damping_threshold) == (50.0, 0.05)


def test_a_gentle_pull_is_followed_to_the_end_and_never_said_to_be_out_of_reach():
    solver = Solver(ARM, 0.001, gain=20.0)
    task = solver.add_task(END, translation=2, rotation=0)
    task.target = task.target * pin.SE3(np.eye(3), np.array([0.01, 0.01, 0.0]))
    statuses = {solver.step().status for _ in range(2000)}
    assert statuses == {Status.FOLLOWING}
    assert solver.step().errors[0][0] < 1e-6 * ARM.length


# --- the period ------------------------------------------------------------------------------------------------------


SLOW, FAST = 1.0 / 60.0, 1e-3


def aside(task, step):
    task.target = task.target * pin.SE3(np.eye(3), np.array([0.0, step, 0.0]))


@pytest.mark.parametrize("name", ["planar_3r", "delta4"])
@pytest.mark.parametrize("accelerated", [False, True])
@pytest.mark.parametrize(("before", "after"), [(SLOW, FAST), (FAST, SLOW)])
def test_ticks_go_on_as_those_of_a_solver_with_the_new_period(robot, name, accelerated, before, after):
    mechanism = robot(name)
    acceleration = 5.0 if accelerated else None
    solver = Solver(mechanism, before, gain=20.0, acceleration=acceleration)
    task, speed = solver.add_task(mechanism.end, rotation=0), 0.05 * mechanism.length
    for _ in range(20):
        aside(task, speed * before)
        solver.step()
    other = Solver(mechanism, after, gain=20.0, acceleration=acceleration)
    other.copy_state(solver)
    v = solver.v
    solver.dt = after
    assert solver.v == pytest.approx(v, rel=1e-12)
    for _ in range(5):
        for one in (solver, other):
            aside(one.tasks[0], speed * after)
        step, expected = solver.step(), other.step()
        assert step.q == pytest.approx(expected.q, abs=1e-12)
        assert step.v == pytest.approx(expected.v, rel=1e-9, abs=1e-12)


def test_limits_that_are_lifted_stay_lifted(robot):
    solver = Solver(robot("planar_3r"), SLOW)
    solver.lift_limits(position=False)
    solver.dt = FAST
    assert np.isinf(solver._memory.longest_step).all()


@pytest.mark.parametrize("dt", [0.0, -1.0, np.nan, np.inf])
def test_a_period_that_is_none_is_refused(robot, dt):
    solver = Solver(robot("planar_3r"), SLOW)
    with pytest.raises(CinegenError, match="dt must be a positive time"):
        solver.dt = dt
    assert solver.dt == SLOW
