"""The solver as one who tasks on a robot meets it."""

from __future__ import annotations

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
