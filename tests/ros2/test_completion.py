"""Joint states and trajectories, completed without ROS: judged by Pinocchio's placements and by finite differences."""

import numpy as np
import pytest
from cinegen_joint_states.joint_states import CompletionError, JointStateCompletion
from cinegen_joint_states.trajectories import Trajectory, completed
from small_robots import rssr

import cinegen

ROBOTS = "delta4", "four_bar", "hybrid", "differential_wrist"


def load(root, name):
    return cinegen.load(root / f"generated/{name}.urdf")


def motion(robot, t):
    """Values of the actuated joints about home, and their first two derivatives."""
    phases = np.arange(len(robot.actuated))
    home = np.array([robot.q_home[robot.q_index(name)] for name in robot.actuated])
    size = 0.1 * np.array([robot.scale[robot.v_index(name)] for name in robot.actuated])
    return home + size * (np.sin(t + phases) - np.sin(phases)), size * np.cos(t + phases), -size * np.sin(t + phases)


@pytest.mark.parametrize("name", ROBOTS)
def test_states_of_all_joints(root, name):
    robot = load(root, name)
    completion, states, dt = JointStateCompletion(robot), [], 1e-4
    for tick in range(-1, 2):
        values, rates, _ = motion(robot, 0.4 + tick * dt)
        order = np.random.default_rng(tick + 1).permutation(len(values))
        names = [robot.actuated[i] for i in order]
        states.append(made := completion.complete(names, values[order], rates[order]))
        assert made.names == robot.joints
        q = robot.configuration(dict(zip(made.names, map(float, made.positions), strict=True)))
        assert robot.closure(q) < 1e-12
        assert [q[robot.q_index(joint)] for joint in robot.actuated] == pytest.approx(values, abs=1e-15)
    before, middle, after = states
    assert middle.velocities == pytest.approx((after.positions - before.positions) / (2.0 * dt), abs=1e-6)


def test_foreign_and_passive_joints_are_ignored_and_parts_complete_each_other(root):
    robot = load(root, "delta4")
    by_parts, both = JointStateCompletion(robot), JointStateCompletion(robot)
    first, second, third = robot.actuated
    by_parts.complete([first, "wheel", "joint3"], [0.1, 5.0, 0.0])
    made = by_parts.complete([second, third], [0.05, 0.02])
    wanted = both.complete([third, first, second], [0.02, 0.1, 0.05])
    assert made.positions == pytest.approx(wanted.positions, abs=1e-12)
    assert not len(made.velocities)


@pytest.mark.parametrize(
    ("names", "positions", "velocities", "message"),
    [
        (["joint1"], [], [], "1 joints are named, with 0 positions"),
        (["joint1", "joint1"], [0.0, 0.0], [], "'joint1' is named twice"),
        (["joint2"], [0.0], [], "no actuated joint is named: joint1, joint12, joint6"),
        (["joint1"], [900.0], [], "can't reach these values on this branch"),
    ],
)
def test_what_is_wrong_moves_nothing(root, names, positions, velocities, message):
    completion = JointStateCompletion(load(root, "delta4"))
    before = completion.q
    with pytest.raises(cinegen.CinegenError, match=message):
        completion.complete(names, positions, velocities)
    assert np.array_equal(completion.q, before)


def test_balls_have_no_place_in_joint_states():
    with pytest.raises(CompletionError, match=r"joint2 of .* have more: .* use the URDF"):
        JointStateCompletion(cinegen.load(rssr()))


# --- trajectories ------------------------------------------------------------------------------------------------


def trajectory(robot):
    """A trajectory of all joints, exact to rounding: by the completion of the actuated ones."""
    parts = [np.array(part) for part in zip(*(motion(robot, 1e-3 * k) for k in range(9)), strict=True)]
    return completed(robot, Trajectory(robot.actuated, *parts))


@pytest.mark.parametrize("name", ROBOTS)
def test_rates_are_those_of_the_positions(root, name):
    made = trajectory(load(root, name))
    dt, p = 1e-3, made.positions
    assert made.velocities[1:-1] == pytest.approx((p[2:] - p[:-2]) / (2.0 * dt), abs=2e-6)
    assert made.accelerations[1:-1] == pytest.approx((p[2:] - 2.0 * p[1:-1] + p[:-2]) / dt**2, abs=2e-6)


@pytest.mark.parametrize(("name", "drivers"), [("four_bar", ["joint3"]), ("five_bar", ["joint2", "joint3"])])
def test_other_joints_that_determine_the_robot_determine_the_actuated_ones(root, name, drivers):
    robot = load(root, name)
    whole = trajectory(robot)
    back = completed(robot, whole.of(drivers))
    for name in ("positions", "velocities", "accelerations"):
        assert getattr(back, name) == pytest.approx(getattr(whole, name), abs=1e-8)


def test_a_trajectory_of_all_joints_is_compared(root):
    robot = load(root, "delta4")
    whole = trajectory(robot)
    assert completed(robot, whole).positions == pytest.approx(whole.positions, abs=1e-12)
    open_ = whole.positions.copy()
    open_[4, robot.joints.index("joint3")] += 1e-3
    with pytest.raises(CompletionError, match="point 4 of the trajectory: joint 'joint3' is at"):
        completed(robot, Trajectory(whole.names, open_))
    assert completed(robot, Trajectory(whole.names, open_), tolerance=2e-3)


@pytest.mark.parametrize(
    ("bad_trajectory", "message"),
    [
        (Trajectory(("joint2",), np.zeros((1, 1))), "joint2 don't determine"),
        (Trajectory(("joint99",), np.zeros((1, 1))), "has no joint 'joint99'"),
        (Trajectory(("joint1",), np.zeros((1, 1)), None, np.zeros((1, 1))), "accelerations, but no velocities"),
        (Trajectory(("joint1", "joint6", "joint12"), np.array([[900.0, 0.0, 0.0]])), "point 0 .*: .*can't reach"),
    ],
)
def test_wrong_trajectories_are_refused(root, bad_trajectory, message):
    with pytest.raises(CompletionError, match=message):
        completed(load(root, "delta4"), bad_trajectory)
