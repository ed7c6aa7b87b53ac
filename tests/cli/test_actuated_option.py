"""`--actuated` of all commands that load robots: the actuated joints, whatever the file states."""

import json

import numpy as np
import pytest

MJCF = """<mujoco model="arm"><worldbody><body name="upper"><joint name="joint1"/><geom size="0.1"/>
  <body name="fore"><joint name="joint2"/><geom size="0.1"/></body></body></worldbody>
  <actuator><motor joint="joint1"/></actuator></mujoco>"""


def test_named_joints_are_actuated_whatever_the_file_states(text_file, typed):
    path = text_file("arm.xml", MJCF)
    (report,) = json.loads(typed("info", path, "--actuated", "joint2", "--json").out)
    assert report["actuated"] == ["joint2"]
    said = typed("info", path, "--actuated", "joint2 joint1", "--json")
    assert json.loads(said.out)[0]["actuated"] == ["joint1", "joint2"]
    assert "no joint 'joint3': did you mean 'joint" in typed("info", path, "--actuated", "joint3", code=1).err


def test_a_scene_and_a_closed_robot_take_it_too(typed, tmp_path):
    said = typed("modes", "five_bar", "--actuated", "joint1,joint2", "--json")
    assert {*json.loads(said.out)[0]["actuated"]} == {"joint1", "joint2"}
    scene = {"robot": "five_bar", "node": "tool", "goal": {"point": [0.0, 0.35]}}
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    said = typed("plan", tmp_path / "scene.json", "--actuated", "joint1,jont3", code=1)
    assert "no joint 'jont3': did you mean" in said.err


# --- lock option ------------------------------------------------------------------------------------------------------
# `--lock` of `cinegen plan`, `drive` and `ik`: joints that do not move.


@pytest.fixture
def scene(tmp_path):
    """A scene of an arm whose tool is to go a little upwards."""
    start = {"joints": {"joint1": -67.61, "joint2": 56.72, "joint3": 50.42}}
    text = {"robot": "planar_3r", "node": "tool", "start": start, "goal": {"point": [0.62, -0.25]}}
    (tmp_path / "scene.json").write_text(json.dumps(text))
    return str(tmp_path / "scene.json")


def test_a_plan_does_not_move_what_is_locked(scene, typed):
    planned = json.loads(typed("plan", scene, "--lock", "joint3", "--json").out)
    assert planned["locked"] == ["joint3"]
    assert {q["joint3"] for q in planned["path"]} == {np.radians(50.42)}
    assert np.ptp([q["joint1"] for q in planned["path"]]) > 0.01


def test_a_snapshot_with_a_locked_joint_is_drawn(typed, tmp_path):
    typed("drive", "planar_3r", "--lock", "joint2", "--snapshot", tmp_path / "arm.html")
    assert (tmp_path / "arm.html").stat().st_size > 1000
