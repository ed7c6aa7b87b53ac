"""The URDF is the robot's tree: other people's readers place every node where RAFF says it is."""

import io
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from by_pinocchio import placements_of
from hypothesis import example, given, settings
from hypothesis import strategies as st
from lxml import etree
from strategies import EXTREME, UNITS, documents
from yourdfpy import Calibration, Dynamics, Inertial, Joint, Limit, Link, Mimic, Robot, SafetyController, Visual

import raff2urdf
from raff2urdf import RaffError, loads, readers
from raff2urdf.bounds import UNLIMITED
from raff2urdf.conversion import Translation, translate
from raff2urdf.placement import from_origin
from raff2urdf.raff.document import Document, JointType, RaffLink, RaffParameters, RaffRobot
from raff2urdf.raff.kleinfinger import Kleinfinger
from raff2urdf.tree import placements
from raff2urdf.writers.urdf_object import ExactUrdf, geometry, material_of

EXACT = 1e-12  # m and rad: rounding along a chain of some links of up to a metre

trees = documents(moderate=True, loops=False, graphics=False, least_robots=1)


def translated(document: Document, robot: RaffRobot | None = None) -> Translation:
    return translate(document, robot or document.robot(), Path())


def numbers(text: str) -> list[float]:
    return [float(number) for number in text.split()]


# --- placements --------------------------------------------------------------------------------------------------


_SHAPES = {"cylinder": ("radius", "length"), "box": ("size",), "sphere": ("radius",), "mesh": ("scale",)}


def check_shapes(text: str) -> int:
    """Every shape is finite and has an extent, every mesh more than three triangles; how many collide."""
    tree = etree.fromstring(text.encode())
    visuals, collisions = tree.findall("link/visual"), tree.findall("link/collision")
    assert visuals
    for visual in (*visuals, *collisions):
        (shape,) = visual.find("geometry")
        sizes = [size for word in _SHAPES[shape.tag] for size in numbers(shape.get(word))]
        assert all(0.0 < size < math.inf for size in sizes)
        assert shape.tag != "mesh" or Path(shape.get("filename")).stat().st_size > 84 + 3 * 50
        origin = visual.find("origin")
        assert all(math.isfinite(number) for word in ("xyz", "rpy") for number in numbers(origin.get(word)))
    return len(collisions)


@given(trees, st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_pinocchio_places_every_node_where_raff_does_and_shapes_can_be_shown(document: Document, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for robot in document.robots:
        q = {link.joint: rng.uniform(-3.0, 3.0) for link in robot.links if link.type is not JointType.FIXED}  # rad or m
        urdf = translated(document, robot).urdf
        assert check_shapes(urdf) >= max(1, len(q))
        by_pinocchio = placements_of(urdf, q)
        expected = placements(document, robot, q)
        assert set(by_pinocchio) - {"world"} == {node.node for node in robot.nodes.values()}
        for number, node in robot.nodes.items():
            assert np.abs(by_pinocchio[node.node] - expected[number]).max() <= EXACT


# --- joints ------------------------------------------------------------------------------------------------------


@given(st.tuples(EXTREME, EXTREME), EXTREME.filter(bool), st.sampled_from([1, 2]), st.sampled_from(UNITS))
def test_limits_read_back_to_the_same_double(pair: tuple[float, float], speed: float, kind: int, units: str) -> None:
    """Up to what counts as unlimited."""
    limits = {"limits": (min(pair), max(pair)), "velocity": abs(speed), "effort": 12.5}
    link = RaffLink(1, RaffParameters(), JointType(kind), 0, **limits)
    document = Document("t", (RaffRobot("r", parts=(link,)),), units=units)
    limit = etree.fromstring(translated(document).urdf.encode()).find("joint/limit")
    si = math.radians if kind == 2 else document.metres
    low, high = (min(max(si(value), -UNLIMITED), UNLIMITED) for value in (min(pair), max(pair)))
    assert (float(limit.get("lower")), float(limit.get("upper"))) == (low, high)
    assert float(limit.get("velocity")) == min(si(abs(speed)), UNLIMITED)
    assert limit.get("effort") == "12.5"


# --- the skeleton ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("word", ["d", "r", "epsilon"])
@pytest.mark.parametrize("size", [5e-324, 1e-310, 1e-160, 1e-20, 1.0, 1e20, 1e155, 1.7e308])
def test_a_robot_of_any_size_is_drawn_or_refused(size: float, word: str) -> None:
    """Beside others of the usual size, fixed and moving. What is refused is refused with its reason."""
    parts = [f"link {1 + i} {{ parameters {{ {word} {size} }} type {i} pred 0 }}" for i in range(3)]
    parts += [f"link {10 + i} {{ parameters {{ d 100 }} type 2 pred {1 + i} }}" for i in range(3)]
    for some in (parts[:1], parts[1:2], parts[2:3], parts):
        document = loads("\n".join(["RAFF t", "robot r { base { }", *some, "}"]))
        try:
            raff2urdf.check(document)
            text = translated(document).urdf
        except RaffError:
            continue
        assert check_shapes(text) > 0
        origins = etree.fromstring(text.encode()).findall("joint/origin")
        assert all(math.isfinite(number) for origin in origins for number in numbers(origin.get("xyz")))


def ends_of_bars(document: Document, link: str) -> list[np.ndarray]:
    """Both ends of every cylinder of a link that collides, in its frame."""
    ends = []
    for shape in translated(document).model.link_map[link].collisions:
        if shape.geometry.cylinder is not None:
            half = 0.5 * shape.geometry.cylinder.length * shape.origin[:3, 2]
            ends += [shape.origin[:3, 3] - half, shape.origin[:3, 3] + half]
    return ends


@given(st.builds(Kleinfinger, *[st.floats(-3, 3) if i % 2 == 0 else st.floats(0.1, 1.0) for i in range(6)]))
@settings(max_examples=40)
def test_bars_lead_all_the_way_to_where_a_child_stands(k: Kleinfinger) -> None:
    words = f"gamma {math.degrees(k.gamma)!r} epsilon {1e3 * k.epsilon!r} alpha {math.degrees(k.alpha)!r}"
    words += f" d {1e3 * k.d!r} theta {math.degrees(k.theta)!r} r {1e3 * k.r!r}"
    document = loads(f"RAFF t\nrobot r {{ link 1 {{ parameters {{ {words} }} type 2 pred 0 }} }}")
    child = placements(document, document.robot())[1][:3, 3]
    ends = ends_of_bars(document, "base")
    assert min(np.linalg.norm(end) for end in ends) <= 1e-5
    assert min(np.linalg.norm(end - child) for end in ends) <= 1e-5


# --- yourdfpy ---------------------------------------------------------------------------------------------------------
# What raff2urdf builds and writes is a `yourdfpy.URDF`, and its text reads back as the same numbers.


ROBOTS = Path(__file__).parents[2] / "robots"

ULP = 2.0**-52

finite = st.floats(-1e6, 1e6)
angle = st.floats(-math.pi, math.pi)
gimbal = st.floats(-17.0, -3.0).map(lambda power: math.pi / 2.0 - 10.0**power)


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
    st.tuples(*[finite] * 3), st.tuples(angle, angle | gimbal | gimbal.map(lambda pitch: -pitch), angle),
    st.tuples(*[angle] * 3), st.tuples(*[finite] * 6), st.tuples(*[st.floats(1e-12, 1e6)] * 3),
)  # fmt: skip
@example((0.1, -0.0, 1e-300), (0.3, math.pi / 2.0 - 1e-9, 0.7), (1.0, 2.0, 3.0), (1e-9,) * 6, (1.0, 2.0, 1.0 / 3.0))
@settings(max_examples=200)
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


FIXED = Joint("j", "fixed", "a", "b")
MIRRORED = np.diag((1.0, 1.0, -1.0, 1.0))
LOPSIDED = Inertial(np.eye(4), 1.0, np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))


@pytest.mark.parametrize(("robot", "part", "reason"), [
    (two_links(replace(FIXED, parent=None)), "joint 'j'", "its parent must be a string, not None"),
    (two_links(replace(FIXED, type=3)), "joint 'j'", "its type must be a string, not 3"),
    (two_links(replace(FIXED, origin=np.ones(3))), "joint 'j'", "its origin must be a .4, 4. matrix of a rotation"),
    (two_links(replace(FIXED, origin=MIRRORED)), "joint 'j'", "its origin must be a .4, 4. matrix"),
    (two_links(replace(FIXED, name="a\0b")), "joint 'a\0b'", ".*XML compatible"),
    (two_links(FIXED, Visual(geometry=geometry("mesh", (1.0, 1.0, 1.0), None))), "link 'b'", "Argument must be bytes"),
    (two_links(FIXED, Visual()), "link 'b'", "One of <sphere>, <cylinder>, <box>, <mesh> needs to be defined"),
    (two_links(FIXED, inertial=LOPSIDED), "link 'b'", "its inertia must be a symmetric"),
])  # fmt: skip
def test_what_can_not_be_written_is_named(robot: Robot, part: str, reason: str) -> None:
    with pytest.raises(RaffError, match=f"{part} of robot 'r' can't be written as URDF: {reason}"):
        ExactUrdf(robot).text()


def test_a_model_without_a_name_gets_one(tmp_path: Path) -> None:
    (tmp_path / "a.sdf").write_text('<sdf version="1.7"><model name=""><link name="a"/></model></sdf>')
    assert read_back(readers.read(tmp_path / "a.sdf").urdf).robot.name == "model"
