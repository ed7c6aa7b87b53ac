"""The command `cinegen ik`: one solution or all, on the terminal and as JSON."""

import json

import bipeds
import numpy as np
import pytest

import cinegen


def test_limits_that_are_exceeded_are_named(printed):
    said = printed("ik", "five_bar", "--at", "x=0.01", "--all")
    assert "4 inverse solutions, 1 within the limits" in said
    assert "joint1 15.9 < 60 deg, 1 more" in said
    assert "These are all. 1 pair of bodies on three hinges" in said
    assert max(map(len, said.splitlines())) <= 100


def test_one_solution_within_limits_nearest_home(robot, printed):
    delta = robot("delta4")
    answer = json.loads(printed("ik", "delta4", "--at", "x=0.1,y=0.2,z=-2.9", "--json"))
    assert len(answer["solutions"]) == 1
    assert answer["complete"] is False
    q = delta.configuration(answer["solutions"][0]["joints"])
    assert np.allclose(delta.placement(q, "platform").translation, [0.1, 0.2, -2.9])
    assert answer["solutions"][0]["within_limits"]
    assert "--all lists all" in printed("ik", "delta4", "--at", "x=0.1,y=0.2,z=-2.9")


CAM = """RAFF Cam
robot cam {
  link 1 { parameters { theta 10 } type 2 pred 0 }
  link 2 { parameters { d 100 r 6 } type 1 pred 0 actuated 1 }
  coupling { link 2 link 1 polynomial ( 0.5 0.01 ) }
}
"""


def test_passive_joints_are_shown_where_solutions_differ_in_these_only(text_file, printed):
    """0.5 theta + 0.01 theta^2 = 10 has the roots -25 +- sqrt(1625) degrees."""
    path = text_file("cam.raff", CAM)
    said = printed("ik", path, "--node", "link2", "--at", "x=0.1,y=0,z=0.01", "--all").splitlines()
    assert ["solution", "joint2", "joint1"] in [line.split() for line in said]
    rows = [line.split() for line in said if "0.010000" in line]
    assert rows == [["1", "0.010000", "15.31"], ["2", "0.010000", "-65.31"]]
    cam = cinegen.load(path)
    target = cinegen.FrameTask("link2", cam.placement(cam.q_home, "link2"))
    shown = cinegen.inverse_kinematics(cam, [target], all=True)._repr_html_()
    assert "joint1 (rad, m)" in shown
    assert "joint1 " not in printed("ik", path, "--node", "link2", "--at", "x=0.1,y=0,z=0.01")


def test_a_pose_out_of_reach_ends_with_code_1(printed):
    assert "None was found within the limits." in printed("ik", "planar_3r", "--at", "x=0.9,y=0.9,rz=20", code=1)
    said = printed("ik", "planar_3r", "--at", "x=0.9,y=0.9,rz=20", "--all", code=1)
    assert "misses it by" in said
    assert "There is none." in said


def test_a_redundant_arm_needs_a_locked_joint(printed):
    assert "lock 1 of its joints" in printed("ik", "arm7", "--at", "x=0.4,rz=10", "--all", code=1)
    assert "These are all." in printed("ik", "arm7", "--at", "x=0.4,rz=10", "--all", "--lock", "joint3=10")
    (solution,) = json.loads(printed("ik", "arm7", "--at", "x=0.4", "--lock", "joint3=10", "--json"))["solutions"]
    assert solution["joints"]["joint3"] == pytest.approx(np.radians(10.0))
    assert "no joint 'joint8'" in printed("ik", "arm7", "--at", "x=0.4", "--all", "--lock", "joint8=10", code=1)


def test_the_pose_of_a_floating_base_is_reported_and_a_fixed_one_has_none(text_file, printed):
    path = text_file("biped.urdf", bipeds.URDF)
    asked = "ik", path, "--node", "hand", "--at", "x=1.5,y=0.3,z=1.1"
    (solution,) = json.loads(printed(*asked, "--json"))["solutions"]
    biped = cinegen.load(path)
    q = biped.configuration(solution["joints"])
    q[:7] = solution["base"]
    assert np.allclose(biped.placement(q, "hand").translation, [1.5, 0.3, 1.1], atol=1e-6)
    text = printed(*asked)
    assert "the base moves to x" in text
    assert "--fixed-base holds it" in text
    assert "misses it by" in printed(*asked, "--fixed-base", code=1)
    nearer = printed("ik", path, "--node", "hand", "--at", "x=0.6,z=1.2", "--fixed-base", "--json")
    (solution,) = json.loads(nearer)["solutions"]
    assert "base" not in solution
