"""Tasks of pink in a solver."""

import warnings

import numpy as np
import pinocchio as pin
import pytest
from test_kernel import load

from cinegen import CinegenError, Solver
from cinegen.ik import PinkTask, PointInPlane

with warnings.catch_warnings():  # qpsolvers misses solvers that no task needs
    warnings.simplefilter("ignore")
    from pink import Configuration
    from pink.tasks import ComTask, FrameTask, JointCouplingTask, PostureTask, RelativeFrameTask


def test_a_frame_of_pink_moves_as_one_of_cinegen():
    arm = load("arm7", "arm")
    target, poses = arm.placement(arm.q_home + 0.2, "tool"), []
    for own in (False, True):
        solver = Solver(arm, 0.01)
        if own:
            solver.add_task("tool", target)
        else:
            task = FrameTask("tool", position_cost=1.0, orientation_cost=1.0)
            task.set_target(target)
            added = solver.add_task(PinkTask(task))
        for _ in range(100):
            step = solver.step()
        assert max(step.errors[0]) < 1e-9
        poses.append(arm.placement(step.q, "tool").homogeneous)
    assert np.allclose(*poses, atol=1e-8)
    assert added.weight == 1.0
    there = Configuration(arm.model, arm.model.createData(), step.q)
    assert np.abs(task.compute_error(there)).max() < 1e-8  # by pink


def test_costs_are_weights_and_rows_of_cost_zero_are_left_out():
    arm = load("arm7", "arm")
    target = arm.placement(arm.q_home + 0.3, "tool")
    task = FrameTask("tool", position_cost=2.0, orientation_cost=0.0)
    task.set_target(target)
    solver = Solver(arm, 0.01)
    added = solver.add_task(PinkTask(task, priority=1))
    solver.add_task(PointInPlane("link4", arm.placement(arm.q_home + 0.3, "link4").translation))
    assert (added.weight, list(added.unit), added.error(solver.state).shape) == (2.0, ["m"] * 3, (3,))
    for _ in range(150):
        step = solver.step()
    assert step.errors[0][1] == 0.0
    assert np.abs(arm.placement(step.q, "tool").translation - target.translation).max() < 1e-6
    assert step.errors[1][0] < 1e-9


@pytest.mark.parametrize("name", ["arm7", "delta4"])
def test_relative_poses_and_postures_of_pink_with_and_without_loops(name):
    mechanism = load(name, None)
    q = mechanism.random_closed(1, seed=5)[0]
    node, other = mechanism.end, mechanism.nodes[2]
    relative = RelativeFrameTask(node, other, position_cost=1.0, orientation_cost=1.0)
    relative.set_target(mechanism.placement(q, other).actInv(mechanism.placement(q, node)))
    posture = PostureTask(cost=1.0)
    posture.set_target(q)
    for task in (relative, posture):
        solver = Solver(mechanism, 0.01)
        solver.add_task(PinkTask(task))
        for _ in range(300):
            step = solver.step()
        assert np.hypot(*step.errors[0]) < 1e-6
        assert step.closure < 1e-9


def test_what_a_solver_does_otherwise_is_an_error_with_the_remedy():
    frame = FrameTask("tool", position_cost=1.0, orientation_cost=1.0, lm_damping=1.0)
    with pytest.raises(CinegenError, match="lm_damping to 0"):
        PinkTask(frame)
    frame.lm_damping = 0.0
    frame.gain = 0.5
    with pytest.raises(CinegenError, match="set Solver"):
        PinkTask(frame)
    frame.gain = 1.0
    assert PinkTask(frame).priority == 0
    with pytest.raises(CinegenError, match="compute_error"):
        PinkTask(pin.SE3.Identity())
    arm = load("arm7", "arm")
    coupling = JointCouplingTask(
        ["joint1", "joint2"], [1.0, -1.0], 1.0, Configuration(arm.model, arm.model.createData(), arm.q_home)
    )
    with pytest.raises(CinegenError, match="give unit="):
        PinkTask(coupling)
    assert PinkTask(coupling, unit="rad").unit == "rad"
    assert PinkTask(ComTask(cost=[1.0, 1.0, 0.0])).unit == "m"
