"""Joints of several variables: the motion that RAFF's reference defines, their successive joints, and errors."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from elementary import shift, turn
from hypothesis import given
from hypothesis import strategies as st
from urdf_text import UrdfJoint, urdf_text

import cinegen
import raff2urdf
from raff2urdf.constraints import constraints
from raff2urdf.conversion import describe
from raff2urdf.raff.compound import VARIABLES, expanded
from raff2urdf.raff.document import CompoundKind
from raff2urdf.raff.kleinfinger import transform
from raff2urdf.readers.loops import successive
from raff2urdf.readers.urdf import joints, limits, velocity
from raff2urdf.readers.urdf_file import parse
from raff2urdf.tree import home, kleinfinger, placements

FILE = """
RAFF Joints
robot arm {
  link 1 { parameters { theta 15 r 70 d 100 alpha 20 gamma 5 epsilon 30 } joint KIND pred 0 VARIABLES }
  frame 2 { parameters { d 100 alpha 30 } pred 1 }
}
"""
HOMES = {"ball": "variable x { home 20 } variable z { home -30 }", "planar": "variable ty { home 40 }"}
KINDS = [kind.value for kind in CompoundKind]


def text(kind: str, variables: str = "") -> str:
    return FILE.replace("KIND", kind).replace("VARIABLES", variables)


def step(name: str, value: float) -> np.ndarray:
    """The transform of a variable (rad, m): of x a rotation about x, of tx a translation along it."""
    return shift(name[-1], value) if name.startswith("t") else turn(name, value)


@pytest.mark.parametrize("kind", KINDS)
def test_joints_move_as_the_reference_defines(kind: str) -> None:
    document = raff2urdf.loads(text(kind, HOMES.get(kind, "")))
    robot = document.robot()
    link = robot.links[0]
    mechanism_joints = [part for part in expanded(robot).links if part.type]
    values = dict(zip([part.joint for part in mechanism_joints], [0.4, -0.7, 1.9], strict=False))
    kept = {parameter: 0.0 for parameter in VARIABLES[link.compound].values() if parameter}
    expected = transform(kleinfinger(document, replace(link.parameters, **kept)))
    for (name, _), value in zip(VARIABLES[link.compound].items(), values.values(), strict=True):
        expected = expected @ step(name, value)
    assert np.abs(placements(document, expanded(robot), values)[1] - expected).max() < 1e-15
    at_home = placements(document, expanded(robot), {part.joint: home(document, part) for part in mechanism_joints})
    assert np.abs(at_home[1] - placements(document, expanded(robot))[1]).max() < 1e-15


@pytest.mark.parametrize("kind", KINDS)
def test_urdf_sdf_and_mjcf_move_alike(kind: str, tmp_path) -> None:
    file = tmp_path / "arm.raff"
    variables = {"universal": "variable y { home 5 limits { -50 60 } }", "ball": "variable y { actuated 1 }"}
    file.write_text(text(kind, variables.get(kind, "")))
    mechanism = cinegen.load(file)
    q = mechanism.random_closed(1)[0]
    for format, ending in (("urdf", "urdf"), ("sdf", "sdf"), ("mjcf", "xml")):
        raff2urdf.convert(file, tmp_path, format=format)
        read = cinegen.load(tmp_path / f"arm.{ending}")
        assert (read.joints, read.actuated) == (mechanism.joints, mechanism.actuated)
        q_read = read.configuration({name: q[mechanism.q_index(name)] for name in mechanism.joints})
        for node in ("link1", "frame2"):
            assert read.placement(q_read, node).isApprox(mechanism.placement(q, node), 1e-9)
        assert np.abs(read.q_home - mechanism.q_home).max() < 1e-12


def test_the_constraints_file_lists_joints_and_ball_joints_without_limits_but_no_links_between() -> None:
    document = raff2urdf.loads(text("ball", "variable y { home 40 }"))
    values = constraints(document, document.robot(), None)
    assert values["nodes"] == ["base", "link1", "frame2"]
    joints = ["joint1_X", "joint1_Y", "joint1_Z"]
    assert [(joint["name"], joint["actuated"]) for joint in values["joints"]] == [(joint, False) for joint in joints]
    assert values["joints"][1]["home"] == np.radians(40.0)
    assert values["balls"] == [{"name": "joint1", "joints": joints}]
    for word in ("limits { -80 80 }", "velocity 90", "actuated 1"):
        document = raff2urdf.loads(text("ball", f"variable y {{ {word} }}"))
        assert "balls" not in constraints(document, document.robot(), None)


def test_limits_velocity_and_actuated_are_of_a_variable() -> None:
    words = "variable tz { limits { 0 90 } velocity 10 actuated 1 } variable z { actuated 0 }"
    document = raff2urdf.loads(text("cylindrical", words))
    rotation, translation = constraints(document, document.robot(), None)["joints"]
    urdf = parse(describe(document, document.robot(), Path())[0], "")
    hinge, slide = (joint for joint in joints(urdf) if joint.get("type") != "fixed")
    assert (limits(hinge), velocity(hinge)) == (None, None)
    assert rotation["actuated"] is False
    assert rotation["home"] == np.radians(15.0)
    assert (limits(slide), velocity(slide)) == ((0.0, 0.09), 0.01)
    assert translation["actuated"]
    assert translation["home"] == 0.07


def test_a_home_outside_its_limits_is_warned_of() -> None:
    with pytest.warns(raff2urdf.RaffWarning, match="home 15 of variable z of link 1 is outside its limits 20 to 40"):
        raff2urdf.check(raff2urdf.loads(text("planar", "variable z { limits { 20 40 } }")))


# --- successive -------------------------------------------------------------------------------------------------------
# Joints of several freedoms are the same motions as successive ones.


BODY = urdf_text([
    UrdfJoint("first", "base", "arm", axis="1 0 0", kind="prismatic"),
    UrdfJoint("j", "arm", "body", "0.1 0.2 0.3", "{axis}", "{kind}", rpy="0.4 0.5 0.6"),
])  # fmt: skip

angles = st.floats(-1.5, 1.5)


ORIGIN = pin.SE3(pin.rpy.rpyToMatrix(0.4, 0.5, 0.6), np.array([0.1, 0.2, 0.3]))


@given(st.tuples(*[angles] * 3), st.sampled_from(["0 0 1", "0 1 0", "1 0 0", "1 2 -3"]))
def test_a_planar_joint_slides_at_right_angles_to_its_axis_and_turns_about_it(values, axis):
    mechanism = cinegen.load(BODY.format(kind="planar", axis=axis))
    assert mechanism.joints == ("first", "j_TX", "j_TY", "j_Z")
    normal = np.array(axis.split(), dtype=float)
    normal /= np.linalg.norm(normal)
    q = mechanism.configuration(dict(zip(mechanism.joints[1:], values, strict=True)))
    moved = ORIGIN.inverse() * mechanism.placement(q, "body")
    assert abs(moved.translation @ normal) < 1e-12
    assert np.linalg.norm(moved.translation) == pytest.approx(np.hypot(*values[:2]), abs=1e-12)
    assert np.allclose(pin.log3(moved.rotation), values[2] * normal, atol=1e-12)


def test_a_floating_joint_that_frees_the_whole_robot_may_be_kept():
    text = BODY.format(kind="fixed", axis="0 0 1").replace('type="prismatic"', 'type="floating"')
    tree = parse(text, "x")
    assert successive.replace_compound(tree, "x", keep_root=True) == {}
    assert successive.replace_compound(tree, "x", keep_root=False).keys() == {"first"}
