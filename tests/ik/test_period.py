"""A solver whose period changes between two ticks: against one that was made for the new period, and against the motion
that its targets have."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from cinegen.errors import CinegenError
from cinegen.ik import Solver

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


def test_limits_of_velocity_and_acceleration_hold_for_every_period(robot):
    mechanism = robot("planar_3r")
    solver = Solver(mechanism, SLOW, acceleration=4.0)
    task, v, largest = solver.add_task("tool", rotation=0), np.zeros(mechanism.model.nv), 0.0
    task.target = task.target * pin.SE3(np.eye(3), np.array([-0.4, 0.1, 0.0]) * mechanism.length)
    fastest = mechanism.limits.velocity
    for dt in np.geomspace(SLOW, FAST, 200):
        solver.dt = dt
        step = solver.step()
        assert (np.abs(step.v) <= fastest * (1.0 + 1e-9)).all()
        assert np.abs(step.v - v).max() <= 4.0 * dt * (1.0 + 1e-6)
        v, largest = step.v, max(largest, np.abs(step.v).max())
    assert largest > 0.1


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
