"""`cinegen forces`: loads as they are typed, and what is printed."""

import json
import math

import pytest

LOADED = ("forces", "planar_3r", "--massless", "--payload", "2kg", "--at", "joint1=0", "joint2=0", "joint3=0")


def test_an_arm_holds_a_payload_by_its_levers(printed):
    """Links of 0.4, 0.3 and 0.2 m that lie flat; the tool is at their end."""
    words = (*LOADED, "--gravity", "0,-10,0", "--json")
    report = json.loads(printed(*words))
    levers = [0.9, 0.5, 0.2]
    assert [torque["value"] for torque in report["torques"]] == pytest.approx([20.0 * lever for lever in levers])
    moved = json.loads(printed(*words, "--payload", "500g@link2", "--wrench", "tool=0,0,0,0,0,3"))
    more = [torque["value"] - was["value"] for torque, was in zip(moved["torques"], report["torques"], strict=True)]
    assert more == pytest.approx([5.0 * 0.4 - 3.0, -3.0, -3.0])


def test_velocities_are_in_degrees_and_the_power_is_printed(printed):
    words = (*LOADED, "--gravity", "0,0,0")
    report = json.loads(printed(*words, "--acceleration", "joint1=90", "--velocity", "joint1=180", "--json"))
    assert report["torques"][0]["value"] == pytest.approx(2.0 * 0.9**2 * math.pi / 2.0)
    assert report["power"] == pytest.approx(2.0 * 0.9**2 * math.pi**2 / 2.0)
    text = printed(*words, "--acceleration", "joint1=1.5rad/s2", "--velocity", "joint1=1rad/s")
    assert f"{2.0 * 0.9**2 * 1.5:.4g} N m" in text
    assert "power" in text
    assert "note: forces leave out the masses of link1, link2, link3\n" in text


def test_what_cannot_move_holds_itself(printed, text_file):
    truss = """RAFF truss
robot truss {
  link 1 { parameters { theta 60 } type 2 pred 0 inertial { mass 1 } }
  frame 2 { parameters { d 100 } pred 1 }
  link 3 { parameters { d 100 theta 120 } type 2 pred 0 inertial { mass 1 } }
  frame 4 { parameters { d 100 } pred 3 }
  constraint { frame 2 frame 4 type 2 }
}"""
    assert "truss: its bodies hold the load" in printed("forces", str(text_file("truss.raff", truss)))


def test_torques_along_a_recorded_motion(printed):
    """Three times the mass needs three times the torque, at the same times."""
    printed("plan", "disc", "-o", "run.jsonl")
    along = ("forces", "planar_3r", "--massless", "--payload", "2kg", "--trajectory", "run.jsonl")
    report = json.loads(printed(*along, "--json"))
    assert report["held"]
    assert all(0.0 < torque["rms"] < torque["peak"] for torque in report["torques"])
    heavy = json.loads(printed(*along, "--payload", "4kg", "--json"))
    for torque, three in zip(report["torques"], heavy["torques"], strict=True):
        assert three["peak"] == pytest.approx(3.0 * torque["peak"])
        assert three["at"] == torque["at"]
    assert "peak" in printed(*along)
    refused = printed("forces", "five_bar", "--massless", "--trajectory", "run.jsonl", code=1)
    assert "joints of 'planar_3r' are not those of five_bar" in refused
