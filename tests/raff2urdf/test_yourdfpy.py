"""What raff2urdf builds and writes is a `yourdfpy.URDF`, and its text reads back as the same numbers."""

import io
import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from hypothesis import example, given
from hypothesis import strategies as st
from strategies import examples
from yourdfpy import (
    Calibration,
    Dynamics,
    Inertial,
    Joint,
    Limit,
    Link,
    Mimic,
    Robot,
    SafetyController,
    Visual,
)  # fmt: skip

import raff2urdf
from raff2urdf import RaffError, readers
from raff2urdf.conversion import translate
from raff2urdf.placement import from_origin
from raff2urdf.writers.urdf_object import ExactUrdf, geometry, material_of

ROBOTS = Path(__file__).parents[2] / "robots"

ULP = 2.0**-52

finite = st.floats(-1e6, 1e6)
angle = st.floats(-math.pi, math.pi)
gimbal = st.builds(
    lambda side, power: side * (math.pi / 2.0 - 10.0**power), st.sampled_from((-1, 1)), st.floats(-17.0, -3.0)
)


def read_back(text: str) -> yourdfpy.URDF:
    return yourdfpy.URDF.load(io.BytesIO(text.encode()), build_scene_graph=False)


def two_links(joint: Joint, *visuals: Visual, inertial: Inertial | None = None) -> Robot:
    return Robot("r", [Link("a"), Link("b", inertial, list(visuals))], [joint])


@pytest.mark.parametrize("name", ["delta4", "gough", "arm7"])
def test_a_translated_robot_is_a_valid_yourdfpy_urdf_and_its_text_is_that_object(name: str) -> None:
    path = ROBOTS / f"{name}.raff"
    document = raff2urdf.load(path)
    made = translate(document, document.robot(), path.parent)
    assert isinstance(made.model, yourdfpy.URDF)
    assert made.model.validate()
    for joint in made.model.robot.joints:
        joint.axis = np.array([1.0, 0.0, 0.0]) if joint.axis is None else joint.axis  # as it is read
    assert read_back(made.urdf) == made.model


@given(
    xyz=st.tuples(finite, finite, finite),
    rpy=st.tuples(angle, angle | gimbal, angle),
    spin=st.tuples(angle, angle, angle),
    moments=st.tuples(*[finite] * 6),
    sizes=st.tuples(*[st.floats(1e-12, 1e6)] * 3),
)
@example(
    xyz=(0.1, -0.0, 1e-300),
    rpy=(0.3, math.pi / 2.0 - 1e-9, 0.7),
    spin=(1.0, 2.0, 3.0),
    moments=(1e-9,) * 6,
    sizes=(1.0, 2.0, 1.0 / 3.0),
)
@examples(200)
def test_numbers_read_back_to_the_same_doubles_and_rotations_to_rounding(xyz, rpy, spin, moments, sizes) -> None:
    turned, placed = from_origin((0.0, 0.0, 0.0), spin), from_origin(xyz, rpy)
    placed[:3, :3] = (turned @ turned.T @ placed)[:3, :3]  # with rounding errors, as products have
    ixx, ixy, ixz, iyy, iyz, izz = moments
    inertia = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    joint = Joint("j", "revolute", "a", "b", placed, np.array(sizes), limit=Limit(*sizes, sizes[2]))
    visual = Visual(None, placed, geometry("box", sizes), material_of("grey", (0.1, 0.2, 1.0 / 3.0, 1.0)))
    text = ExactUrdf(two_links(joint, visual, inertial=Inertial(placed, sizes[0], inertia))).text()
    robot = read_back(text).robot
    (back,), link = robot.joints, robot.links[1]
    for origin in (back.origin, link.visuals[0].origin, link.inertial.origin):
        np.testing.assert_array_equal(origin[:3, 3], xyz)
        assert np.abs(origin - placed)[:3, :3].max() <= 16.0 * ULP
    np.testing.assert_array_equal(back.axis, sizes)
    assert back.limit == joint.limit
    assert (back.limit.lower, back.limit.effort) == (sizes[2], sizes[0])
    assert link.inertial.mass == sizes[0]
    np.testing.assert_array_equal(link.inertial.inertia, inertia)
    np.testing.assert_array_equal(link.visuals[0].geometry.box.size, sizes)
    np.testing.assert_array_equal(link.visuals[0].material.color.rgba, visual.material.color.rgba)
    frame = pin.buildModelFromXML(text.replace("revolute", "fixed")).frames[-1]
    assert np.abs(frame.placement.homogeneous - placed)[:3, :3].max() <= 32.0 * ULP  # by a quaternion


def test_all_that_a_joint_holds_is_written() -> None:
    joint = Joint(
        "j", "revolute", "a", "b", np.eye(4), np.array([0.0, 1.0, 0.0]), Dynamics("0.1", "0.2"),
        Limit(1.0, 2.0, -0.5, 0.5), Mimic("k", 2.5, -0.1), Calibration(rising=0.25),
        SafetyController(-0.4, 0.4, 10.0, 5.0),
    )  # fmt: skip
    model = ExactUrdf(two_links(joint))
    assert read_back(model.text()).robot.joints == [joint]
    assert read_back(yourdfpy.URDF(model.robot, build_scene_graph=False).write_xml_string().decode()) != model


@pytest.mark.parametrize(("change", "message"), [
    ({"parent": None}, "joint 'j' of robot 'r' can't be written as URDF: its parent must be a string, not None"),
    ({"type": 3}, "joint 'j' of robot 'r' can't be written as URDF: its type must be a string, not 3"),
    ({"origin": np.ones(3)}, "joint 'j' of robot 'r' .*: its origin must be a .4, 4. matrix of a rotation"),
    ({"origin": np.diag((1.0, 1.0, -1.0, 1.0))}, "joint 'j' of robot 'r' .*: its origin must be a .4, 4. matrix"),
    ({"name": "a\0b"}, "joint 'a\0b' of robot 'r' can't be written as URDF: .*XML compatible"),
])  # fmt: skip
def test_what_can_not_be_written_is_named(change: dict, message: str) -> None:
    joint = Joint("j", "fixed", "a", "b")
    vars(joint).update(change)
    with pytest.raises(RaffError, match=message):
        ExactUrdf(two_links(joint)).text()


@pytest.mark.parametrize(
    ("shapes", "inertia", "message"),
    [
        ([Visual(geometry=geometry("mesh", (1.0, 1.0, 1.0), None))], np.eye(3), "Argument must be bytes or unicode"),
        ([Visual()], np.eye(3), "One of <sphere>, <cylinder>, <box>, <mesh> needs to be defined"),
        ([], np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), "its inertia must be a symmetric"),
    ],
)
def test_the_link_that_can_not_be_written_is_named(shapes: list[Visual], inertia: np.ndarray, message: str) -> None:
    robot = two_links(Joint("j", "fixed", "a", "b"), *shapes, inertial=Inertial(np.eye(4), 1.0, inertia))
    with pytest.raises(RaffError, match=f"link 'b' of robot 'r' can't be written as URDF: {message}"):
        ExactUrdf(robot).text()


def test_a_model_without_a_name_gets_one(tmp_path: Path) -> None:
    (tmp_path / "a.sdf").write_text('<sdf version="1.7"><model name=""><link name="a"/></model></sdf>')
    assert read_back(readers.read(tmp_path / "a.sdf").urdf).robot.name == "model"
