"""Weights of joints: the least weighted motion of those that do the same for the tasks, and nothing else changes."""

import bipeds
import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import null_space
from ticking import ticked

import cinegen
from cinegen import Solver, Status

DT = 1.0 / 240.0
SMALL = 1e-5  # lengths: of a target, so that a tick is as good as linear


def aimed(mechanism, lengths, q=None, node=None, rotation=0, seed=0):
    """A solver with a target in a random direction."""
    solver = Solver(mechanism, DT, q)
    task = solver.add_task(node or mechanism.end, rotation=rotation)
    way = np.random.default_rng(seed).normal(size=3)
    way *= lengths * mechanism.length / np.linalg.norm(way)
    task.target = pin.SE3(task.target.rotation, task.target.translation + way)
    return solver


def least(mechanism, q, nodes, weights, moved):
    """The motion (nv,), rad and lengths, that moves nodes as `moved` does, with the least weighted sum: by Pinocchio's
    Jacobians alone."""
    data = mechanism.model.createData()
    frames = [mechanism.model.getFrameId(node, pin.FrameType.BODY) for node in nodes]
    jacobians = [pin.computeFrameJacobian(mechanism.model, data, q, frame, pin.LOCAL)[:3] for frame in frames]
    kept = np.vstack([*jacobians, mechanism.loop_jacobian(q)]) * mechanism.scale
    free = null_space(kept, rcond=1e-9)
    root = np.sqrt(weights)[:, None]
    return moved - free @ np.linalg.lstsq(root * free, root[:, 0] * moved, rcond=None)[0]


@pytest.mark.parametrize("name", ["arm7", "planar_3r", "two_arms", "hybrid", "gough", "sr400"])
def test_a_tick_is_the_least_weighted_motion_of_the_actuated_joints(robot, name):
    mechanism, rng = robot(name), np.random.default_rng(1)
    q = mechanism.structure.samples[1] if name != "two_arms" else mechanism.q_home
    weights = np.zeros(mechanism.model.nv)
    plain, solver = aimed(mechanism, SMALL, q), aimed(mechanism, SMALL, q)
    for joint in mechanism.actuated:
        weights[mechanism.v_index(joint)] = solver.joint_weights[joint] = rng.uniform(0.5, 40.0)
    moved, before = (twin.step().v * DT / mechanism.scale for twin in (solver, plain))
    expected = least(mechanism, q, [mechanism.end], weights, before)
    assert np.abs(moved - expected).max() < 1e-4 * np.abs(expected).max()
    assert mechanism.is_constrained or np.abs(before - expected).max() > 0.01 * np.abs(expected).max()
    assert solver.step().closure < 1e-10


def test_so_it_is_below_several_levels(robot):
    """The elbow moves in what the hand leaves, and the weights count in what both leave."""
    mechanism, rng = robot("arm7"), np.random.default_rng(4)
    q, moved = mechanism.structure.samples[1], []
    weights = rng.uniform(0.5, 40.0, mechanism.model.nv)
    for weighted in (weights, np.ones(mechanism.model.nv)):
        solver = aimed(mechanism, SMALL, q)
        elbow = solver.add_task("link4", rotation=0, priority=1)
        elbow.target = pin.SE3(np.eye(3), elbow.target.translation + SMALL * mechanism.length)
        solver.joint_weights = {joint: weighted[mechanism.v_index(joint)] for joint in mechanism.joints}
        moved.append(solver.step().v * DT / mechanism.scale)
    expected = least(mechanism, q, [mechanism.end, "link4"], weights, moved[1])
    assert np.abs(moved[0] - expected).max() < 1e-4 * np.abs(expected).max()
    assert np.abs(moved[1] - expected).max() > 0.01 * np.abs(expected).max()


def test_a_heavy_joint_changes_neither_singular_values_nor_statuses_nor_what_is_reached(robot):
    mechanism = robot("arm7")
    for seed in range(5):
        solver, other = aimed(mechanism, 0.6, seed=seed), aimed(mechanism, 0.6, seed=seed)
        heavy = mechanism.joints[seed]
        solver.joint_weights[heavy] = 1e5
        first, second = solver.step(), other.step()
        assert first.status is second.status
        q = solver.q
        other.q = q
        first, second = solver.step(), other.step()
        assert first.status is second.status
        solver.q = other.q = mechanism.q_home
        ends = []
        for twin in (solver, other):
            step = ticked(twin, 400)
            ends.append((step.status, step.errors[0][0]))
        assert ends[0][0] is ends[1][0]
        assert abs(ends[0][1] - ends[1][1]) < 1e-6 * mechanism.length
        solver, other = aimed(mechanism, 0.0, seed=seed), aimed(mechanism, 0.0, seed=seed)  # both stay
        solver.joint_weights[heavy] = 1e5
        assert (solver.step().singular_values == other.step().singular_values).all()


def test_a_heavy_base_stays_nearly_still_while_a_foot_is_dragged():
    mechanism = cinegen.load(bipeds.URDF)
    distances, q = [], mechanism.configuration({"left_knee": 1.0, "left_pitch": -0.5})
    for weight in (None, 1e4):
        solver = Solver(mechanism, DT, q)
        if weight:
            solver.joint_weights["base"] = weight
            assert solver.joint_weights["base"] == (weight,) * 6
        task = solver.add_task(bipeds.FEET[0], rotation=0)
        for _ in range(100):
            task.target = pin.SE3(task.target.rotation, task.target.translation + np.array([5e-4, 0.0, 1e-3]))
            step = solver.step()
        assert step.status is Status.FOLLOWING
        assert step.errors[0][0] < 1e-5
        distances.append(float(np.linalg.norm(solver.q[:3] - mechanism.q_home[:3])))
    assert distances[1] < 0.02 * distances[0]


def test_a_weighted_motion_keeps_limits_and_makes_no_task_slower(robot):
    mechanism = robot("arm7")
    low = mechanism.q_home[mechanism.q_index("joint3")] - 0.02
    solver, other = aimed(mechanism, 0.5), aimed(mechanism, 0.5)
    for twin in (solver, other):
        twin.velocity_limits = 0.2
        twin.position_limits["joint3"] = (low, low + 0.05)
    solver.joint_weights = {"joint1": 50.0, "joint2": 20.0}
    first, second = solver.step(), other.step()
    assert first.speed_scale >= second.speed_scale * (1.0 - 1e-9)
    for _ in range(100):
        step = solver.step()
        assert np.abs(step.v).max() <= 0.2
        assert low <= step.q[mechanism.q_index("joint3")] <= low + 0.05


def test_at_rest_nothing_moves(robot):
    mechanism = robot("arm7")
    solver = aimed(mechanism, 0.1)
    solver.joint_weights["joint2"] = 30.0
    ticked(solver, 100)
    q = solver.q
    for _ in range(50):
        assert (solver.step().q == q).all()
