"""`plan(mechanism, goal)`: scenes without a file."""

import numpy as np
import pinocchio as pin
import pytest

import cinegen
from cinegen.collision import SceneError, scene_for, scene_of
from cinegen.planning import plan

BALL = {"name": "ball", "kind": "sphere", "radius": 0.05, "point": [0.4, 0.0, 0.3]}


@pytest.fixture(scope="module")
def arm():
    return cinegen.load("arm7")


def test_one_line_plans_to_a_point_a_pose_and_joint_values(arm):
    end = arm.configuration({"joint1": 0.5, "joint2": 0.4, "joint4": -1.0})
    pose = arm.placement(end, arm.end)
    to_point = cinegen.plan(arm, pose.translation)
    assert arm.placement(to_point.path[-1], arm.end).translation == pytest.approx(pose.translation, abs=1e-3)
    to_pose = cinegen.plan(arm, goal=pose)
    assert pin.log6(arm.placement(to_pose.path[-1], arm.end).actInv(pose)).vector == pytest.approx(
        np.zeros(6), abs=1e-3
    )
    to_joints = cinegen.plan(arm, {"joint1": 0.5}, start=end, obstacles=[BALL])
    assert to_joints.path[0] == pytest.approx(end)
    assert to_joints.path[-1][arm.q_index("joint1")] == pytest.approx(0.5)
    assert [one.name for one in to_joints.scene.obstacles] == ["ball"]
    assert to_point.path[0] == pytest.approx(arm.q_home)


def test_a_closed_mechanism_is_planned_for_in_one_line():
    delta = cinegen.load("delta4")
    home = delta.placement(delta.q_home, delta.end).translation
    found = plan(delta, home + np.array([0.2, 0.1, -0.2]))
    assert found
    assert max(delta.closure(q) for q in found.path) < 1e-9


def test_other_keys_of_a_file_and_obstacles_of_a_scene_are_taken(arm):
    made = scene_of({"goal": {"point": [0, 0, 1]}, "obstacle": [BALL]}, mechanism=arm).obstacles[0]
    goal = {"point": [0.4, 0.2, 0.4], "tolerance": [0.1, 0.1, 0.1]}
    scene = scene_for(arm, goal, obstacles=[made, {**BALL, "name": "other"}], safety=0.02, locked=["joint3"])
    assert (scene.safety, scene.locked, scene.node) == (0.02, ("joint3",), arm.end)
    assert sorted(one.name for one in scene.obstacles) == ["ball", "other"]
    assert scene.tolerance == pytest.approx(0.1)
    with pytest.raises(SceneError, match="'ball' is the name of two"):
        scene_for(arm, goal, obstacles=[made, BALL])


def test_what_is_missing_or_given_twice_is_reported(arm):
    scene = scene_for(arm, [0.4, 0.2, 0.4])
    for given, keys, message in [
        (arm, {}, "goal is missing: write plan"),
        (scene, {"goal": [0, 0, 1]}, "give them only with a mechanism"),
        (arm, {"goal": [0, 0]}, "goal must be a pose"),
        (arm, {"goal": {"elbow": 1.0}}, "'elbow' is not a joint of"),
        (arm, {"goal": [0, 0, 1], "start": [0.0]}, "start must have 7 numbers"),
        (arm, {"goal": [0, 0, 1], "node": "hand"}, "'hand' is not a node of"),
    ]:
        with pytest.raises(SceneError, match=message):
            plan(given, **keys)
