"""Locked joints in inverse kinematics and plans: they stay, and the others reach the target."""

import bipeds
import numpy as np
import pinocchio as pin
import pytest

import cinegen
from cinegen import CinegenError, PersistentSolver, inverse_kinematics
from cinegen.errors import ClosureError, UnknownNameError
from cinegen.planning import plan


def reached(mechanism, q, node):
    """The pose by Pinocchio's own kinematics."""
    data = mechanism.model.createData()
    pin.framesForwardKinematics(mechanism.model, data, q)
    return data.oMf[mechanism.model.getFrameId(node, pin.FrameType.BODY)]


@pytest.mark.parametrize(
    ("name", "joints"), [("arm7", ["joint3"]), ("arm7", ["joint1", "joint5"]), ("gough", ["joint3"])]
)
def test_named_joints_stay_where_they_are(robot, name, joints):
    mechanism = robot(name)
    q, goal = mechanism.q_home, None
    for there in mechanism.with_held(joints, q).random_closed(3):
        goal = reached(mechanism, there, mechanism.end)
        found = inverse_kinematics(mechanism, {mechanism.end: goal}, q, locked=joints, limits=False)
        assert found
        assert found.closure <= 1e-10
        for joint in joints:
            assert found.q[mechanism.q_index(joint)] == q[mechanism.q_index(joint)]
        error = pin.log6(goal.actInv(reached(mechanism, found.q, mechanism.end))).vector
        assert np.abs(error).max() < 1e-6
    other = pin.SE3(goal.rotation, goal.translation + 0.3 * mechanism.length)
    missed = inverse_kinematics(mechanism, {mechanism.end: other}, q, locked=mechanism.joints, starts=2)
    assert not missed
    assert (missed.q == q).all()


def test_a_value_is_kept_and_loops_close_there(robot):
    mechanism = robot("gough")
    value = mechanism.q_home[mechanism.q_index("joint3")] + 0.02
    goal = mechanism.placement(mechanism.close(mechanism.configuration({"joint3": value}), ["joint3"]), mechanism.end)
    found = inverse_kinematics(mechanism, {mechanism.end: goal}, locked={"joint3": value})
    assert found
    assert found.q[mechanism.q_index("joint3")] == value
    assert found.closure <= 1e-10


def test_all_solutions_take_names_too(robot):
    mechanism = robot("arm7")
    q = mechanism.q_home
    goal = {mechanism.end: mechanism.placement(q, mechanism.end)}
    by_name = inverse_kinematics(mechanism, goal, all=True, locked=["joint3"])
    by_value = inverse_kinematics(mechanism, goal, all=True, locked={"joint3": float(q[mechanism.q_index("joint3")])})
    assert len(by_name) == len(by_value) > 0


def test_a_locked_base_stays_and_the_hand_reaches(tmp_path):
    (tmp_path / "biped.urdf").write_text(bipeds.URDF)
    mechanism = cinegen.load(tmp_path / "biped.urdf")
    far = pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.8]))
    task = cinegen.FrameTask("hand", far, rotation=0)
    assert inverse_kinematics(mechanism, [task])
    assert not inverse_kinematics(mechanism, [task], locked=["base"], starts=5)
    near = cinegen.FrameTask("hand", reached(mechanism, mechanism.configuration({"elbow": 0.7}), "hand"), rotation=0)
    found = inverse_kinematics(mechanism, [near], locked=["base"])
    assert found
    assert (found.q[:7] == mechanism.q_home[:7]).all()


def test_what_cannot_be_locked_is_an_error(robot):
    mechanism = robot("gough")
    goal = {mechanism.end: mechanism.placement(mechanism.q_home, mechanism.end)}
    with pytest.raises(UnknownNameError, match="did you mean 'joint3'"):
        inverse_kinematics(mechanism, goal, locked=["joint33"])
    with pytest.raises(CinegenError, match=r"such as \['joint3'\], not by one text"):
        inverse_kinematics(mechanism, goal, locked="joint3")
    with pytest.raises(ClosureError, match="can't be closed"):
        inverse_kinematics(mechanism, goal, locked={"joint3": 3.0, "joint9": 0.1})


def test_a_persistent_solver_does_not_search_for_what_its_locks_forbid(robot):
    mechanism = robot("arm7")
    solver = PersistentSolver(mechanism, 1 / 240)
    solver.lock("joint1")
    task = solver.add_task(mechanism.end, rotation=0)
    turned = pin.SE3(pin.exp3(np.array([0.0, 0.0, 2.0])), np.zeros(3)) * task.target
    task.target = pin.SE3(task.target.rotation, turned.translation)
    for _ in range(400):
        step = solver.step()
        assert step.q[mechanism.q_index("joint1")] == mechanism.q_home[mechanism.q_index("joint1")]
    assert step.status is not cinegen.Status.DETOUR


def test_a_plan_keeps_joints_that_are_locked(robot):
    mechanism = robot("arm7")
    goal = mechanism.placement(mechanism.q_home, mechanism.end).translation + np.array([0.05, 0.05, -0.05])
    found = plan(mechanism, goal, locked=["joint1"], planner="vortex")
    assert found
    assert np.ptp(found.path[:, mechanism.q_index("joint1")]) == 0.0
    free = plan(mechanism, goal, planner="vortex")
    assert np.ptp(free.path[:, mechanism.q_index("joint1")]) > 1e-3
    with pytest.raises(CinegenError, match="'joint2' is a joint of the goal"):
        plan(mechanism, {"joint2": 0.1}, locked=["joint2"])
