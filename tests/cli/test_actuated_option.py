"""`--actuated` of all commands that load robots: the actuated joints, whatever the file states."""

import json

import pytest

from cinegen.cli import main

LINKS = '<link name="base"/><link name="upper"/><link name="fore"/>'
URDF = f"""<robot name="arm">{LINKS}
  <joint name="joint1" type="continuous"><parent link="base"/><child link="upper"/></joint>
  <joint name="joint2" type="continuous"><parent link="upper"/><child link="fore"/></joint></robot>"""
SDF = f"""<sdf version="1.9"><model name="arm">{LINKS}
  <joint name="joint1" type="revolute"><parent>base</parent><child>upper</child><axis/></joint>
  <joint name="joint2" type="revolute"><parent>upper</parent><child>fore</child><axis/></joint></model></sdf>"""
MJCF = """<mujoco model="arm"><worldbody><body name="upper"><joint name="joint1"/><geom size="0.1"/>
  <body name="fore"><joint name="joint2"/><geom size="0.1"/></body></body></worldbody>
  <actuator><motor joint="joint1"/></actuator></mujoco>"""


@pytest.mark.parametrize(("ending", "text"), [("urdf", URDF), ("sdf", SDF), ("xml", MJCF)])
def test_named_joints_are_actuated_in_every_format(tmp_path, capsys, ending, text):
    path = tmp_path / f"arm.{ending}"
    path.write_text(text)
    assert main(["info", str(path), "--actuated", "joint2", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["actuated"] == ["joint2"]
    assert main(["info", str(path), "--actuated", "joint2 joint1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["actuated"] == ["joint1", "joint2"]
    assert main(["info", str(path), "--actuated", "joint3"]) == 1
    assert "no joint 'joint3': did you mean 'joint" in capsys.readouterr().err


def test_a_scene_and_a_closed_robot_take_it_too(root, capsys, tmp_path):
    robot = str(root / "robots/five_bar.raff")
    assert main(["modes", robot, "--actuated", "joint1,joint2", "--json"]) == 0
    assert {*json.loads(capsys.readouterr().out)[0]["actuated"]} == {"joint1", "joint2"}
    scene = {"robot": robot, "node": "tool", "goal": {"point": [0.0, 0.35]}}
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    assert main(["plan", str(tmp_path / "scene.json"), "--actuated", "joint1,jont3"]) == 1
    assert "no joint 'jont3': did you mean" in capsys.readouterr().err
