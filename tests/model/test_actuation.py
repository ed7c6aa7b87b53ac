"""Actuated joints determine a mechanism, or load says which would: a five-bar whose tip is pinned to both arms.

The tip spins, so its mobility is 3. Ranks are those of numpy's singular values.
"""

import re
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from elementary import turn
from making import REVOLUTE, Body, Mechanism, axis
from urdf_text import joint_at, joint_text, limit, links
from urdf_text import robot as urdf

import cinegen
import raff2urdf
from cinegen.model.build import build

# shoulder, elbow and tip of each arm, m
LEFT, RIGHT = ((-0.1, 0.0), (-0.25, 0.3)), ((0.15, 0.05), (0.3, 0.35))
TIP = (0.02, 0.55)


def raff(actuated: str = "") -> str:
    """The mechanism in RAFF; `actuated` are numbers of joints."""
    joints = {1: (0, LEFT[0]), 2: (1, LEFT[1]), 3: (0, RIGHT[0]), 4: (3, RIGHT[1]), 5: (2, TIP), 6: (4, TIP)}
    bodies = [
        Body(
            number, pred, axis((*place, 0.0)) @ turn("z", 0.7 * number), REVOLUTE if number < 6 else None,
            "actuated 1" if str(number) in actuated else "",
        )
        for number, (pred, place) in joints.items()
    ]  # fmt: skip
    return "RAFF pinned\n" + Mechanism(tuple(bodies), ((5, 6, REVOLUTE),)).text(joint_digits=None)


def by_hand() -> str:
    """The same as a URDF, its last pin as a second parent of the tip."""
    joints = (("base", "a", 0, LEFT[0]), ("a", "b", LEFT[0], LEFT[1]), ("base", "c", 0, RIGHT[0]),
              ("c", "d", RIGHT[0], RIGHT[1]), ("b", "tip", LEFT[1], TIP), ("d", "tip", RIGHT[1], TIP))  # fmt: skip
    pins = []
    for number, (parent, child, begin, end) in enumerate(joints, 1):
        x, y = np.subtract(end, begin)
        pins.append(joint_at(f"joint{number}", parent, child, f"{x:.17g} {y:.17g} 0"))
    return urdf(links("base", *"abcd", "tip"), *pins)


def uncontrolled(mechanism: cinegen.Mechanism) -> int:
    """DoF that remain with actuated joints locked, by numpy's rank of the passive columns at random configurations."""
    passive = [mechanism.v_index(joint) for joint in mechanism.joints if joint not in mechanism.actuated]
    matrices = [mechanism.loop_jacobian(q)[:, passive] for q in mechanism.random_closed(4, seed=5)]
    return len(passive) - max(int(np.linalg.matrix_rank(matrix, tol=1e-6)) for matrix in matrices)


CHOICES = {
    "json": r',\s*"actuated": \w+',
    "sdf": "<raff:robot.*</raff:robot>",
    "mjcf": '<actuator>.*</actuator>| ctrl="[^"]*"',
}
"""Where a converted file states which joints are actuated."""


def declared(folder: Path, kind: str, joints: str) -> tuple[cinegen.Mechanism, list[str]]:
    """The mechanism of a file of a kind whose actuated joints are those of these numbers, as advice for this kind says;
    and the warnings about them."""
    path = folder / "p.raff"
    path.write_text(raff(joints), encoding="utf-8")
    with warnings.catch_warnings(record=True, action="always") as met:
        if kind in ("json", "sdf", "mjcf"):
            (made,) = raff2urdf.convert(path, folder, format="urdf" if kind == "json" else kind)
            path, stated = made.file, made.constraints or made.file
            if not joints:  # the reader chooses, not the converter
                stated.write_text(re.sub(CHOICES[kind], "", stated.read_text(), flags=re.DOTALL))
        elif kind == "urdf":
            path = folder / "p.urdf"
            path.write_text(by_hand(), encoding="utf-8")
            names = ", ".join(f"joint{number}" for number in joints)
            (folder / "p.yaml").write_text(f"name_mot: [{names}]", encoding="utf-8")
        mechanism = cinegen.load(path)
    return mechanism, [str(warning.message) for warning in met if "actuated" in str(warning.message)]


SYNTAX = {
    "raff": "'actuated 1' in its link",
    "json": '"actuated": true in p.constraints.json',
    "urdf": "its name in name_mot: [...] of p.yaml",
    "sdf": '<raff:joint name="NAME" actuated="true"/> in the model\'s <raff:robot xmlns:raff="urn:raff2urdf">',
    "mjcf": '<general joint="NAME"/> in <actuator>',
}


@pytest.mark.parametrize("kind", SYNTAX)
def test_a_joint_whose_column_is_rounding_is_not_taken_for_a_passive_one(kind, tmp_path):
    """Nor is a tip on two coaxial hinges a rod that may spin: its angle matters."""
    mechanism, met = declared(tmp_path, kind, "")
    assert (mechanism.mobility, len(mechanism.actuated), met) == (3, 3, [])
    assert uncontrolled(mechanism) == 0
    assert (mechanism.structure.idle, mechanism.uncontrolled) == ((), ())


@pytest.mark.parametrize("name", ["arm7", "delta4", "planar_hybrid", "gough", "sr400", "scara", "planetary_gear"])
def test_the_actuated_joints_of_shipped_robots_determine_them(name, robot):
    mechanism = robot(name)
    assert not mechanism.uncontrolled
    if mechanism.is_constrained and not mechanism.balls:
        assert uncontrolled(mechanism) == 0


@pytest.mark.parametrize("kind", SYNTAX)
def test_dependent_actuated_joints_are_told_with_joints_that_would_do_and_these_do(kind, tmp_path):
    mechanism, (*_, message) = declared(tmp_path, kind, "123")  # the converter says it, too
    assert uncontrolled(mechanism) == len(mechanism.uncontrolled) == 1
    (more,), (less,) = mechanism.uncontrolled, mechanism.dependent
    assert "with its actuated joints locked it still moves, with 1 DoF" in message
    assert f"let {more} be actuated instead of {less}; {SYNTAX[kind]} declares that" in message
    mechanism, met = declared(tmp_path, kind, "123".replace(less[-1], more[-1]))
    assert len(mechanism.actuated) == 3
    assert (uncontrolled(mechanism), met) == (0, [])


@pytest.mark.parametrize("kind", SYNTAX)
def test_too_few_actuated_joints_are_noted_with_those_that_are_missing(kind, tmp_path):
    """No warning: under-actuated robots are built, too."""
    mechanism, met = declared(tmp_path, kind, "13")
    assert (len(mechanism.actuated), met) == (2, [])
    (more,) = mechanism.uncontrolled
    (note,) = [note for note in mechanism.source.notes if "locked" in note]
    assert f"let {more} be actuated too; {SYNTAX[kind]} declares that" in note
    mechanism, met = declared(tmp_path, kind, "13" + more[-1])
    assert (uncontrolled(mechanism), met) == (0, [])


def test_a_ball_joint_that_nothing_drives_counts_as_its_three_dof(raff):
    mechanism = raff(
        "robot pendulum { link 1 { type 2 pred 0 actuated 1 } link 2 { parameters { d 200 } joint ball pred 1 } "
        "link 3 { parameters { d 150 } type 2 pred 2 actuated 0 } frame 4 { parameters { d 100 } pred 3 } }"
    )
    (note,) = mechanism.source.notes
    assert f"still moves, with {mechanism.model.nv - 1} DoF, 3 of them of ball joints: let joint3 be actuated" in note


def test_the_actuated_joints_of_an_mjcf_are_those_of_mujocos_actuators(tmp_path):
    mechanism, _ = declared(tmp_path, "mjcf", "13")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "p.xml"))
    driven = {model.joint(joint).name for joint in model.actuator_trnid[:, 0]}
    assert driven == set(mechanism.actuated) == {"joint1", "joint3"}


def test_what_an_sdf_says_of_actuated_joints_must_be_true_or_false():
    element = '<raff:robot xmlns:raff="urn:raff2urdf"><raff:joint name="turn" actuated="yes"/></raff:robot>'
    with pytest.raises(cinegen.CinegenError, match="actuated='yes' of a raff:joint must be true or false"):
        cinegen.load(SDF.format(element))


# --- drives -----------------------------------------------------------------------------------------------------------
# Transmissions, command interfaces and plugins name actuated joints, as far as these determine the mechanism.


FIVE_BAR = urdf(
    links("ground", "left", "up", "down", "right", "end", "eye"),
    joint_at("a", "ground", "left"), joint_at("b", "left", "up", "1 0 0"), joint_at("c", "up", "down", "1 0 0"),
    joint_at("d", "ground", "right", "3 0 0"),
    joint_at("e1", "down", "end", "1.5 0 0", kind="fixed"), joint_at("e2", "right", "eye", "0 1.2 0", kind="fixed"),
    '<loop_joint name="tip" type="continuous"><link1 link="end"/><link2 link="eye"/><axis xyz="0 0 1"/></loop_joint>',
    "{}", name="five",
)  # fmt: skip
"""Mobility 2: a, b, c one after the other, closed with d."""


def transmissions(*names):
    """As of ROS 1: simple ones."""
    return "".join(
        f'<transmission name="t_{name}"><type>transmission_interface/SimpleTransmission</type><joint name="{name}">'
        f'<hardwareInterface>PositionJointInterface</hardwareInterface></joint><actuator name="m"/></transmission>'
        for name in names
    )


def interfaces(*names):
    """As of ROS 2; the other joints are only measured."""
    commands = dict.fromkeys(names, "<command_interface name='p'/>")
    joints = (f'<joint name="{j}">{commands.get(j, "")}<state_interface name="p"/></joint>' for j in "abcd")
    return f'<ros2_control name="hw" type="system"><hardware/>{"".join(joints)}</ros2_control>'


def plugins(*names):
    """As of Gazebo: a controller for each joint, and one plugin that measures all."""
    plugin = '<plugin filename="gz-sim-joint-position-controller-system" name="p"><joint_name>{}</joint_name></plugin>'
    listed = "".join(map(plugin.format, names))
    measured = "".join(f"<joint_name>{name}</joint_name>" for name in "abcd")
    return f'<gazebo>{listed}<plugin filename="joint-state-publisher" name="controller">{measured}</plugin></gazebo>'


def load_quietly(text, actuated=None):
    """Load a robot without a warning."""
    with warnings.catch_warnings(action="error"):
        return cinegen.load(text, actuated=actuated)


@pytest.mark.parametrize("named", [transmissions, interfaces, plugins])
def test_what_drives_a_closed_robot_is_actuated(named):
    for pair in (("a", "b"), ("a", "d"), ("b", "c"), ("c", "d")):
        mechanism = load_quietly(FIVE_BAR.format(named(*pair)))
        assert (mechanism.actuated, mechanism.mobility) == (pair, 2)
        assert build(mechanism.source.urdf, mechanism.source.constraints).actuated == pair
    assert load_quietly(FIVE_BAR.format(named("a", "d")), ["b", "d"]).actuated == ("b", "d")


def test_what_the_user_or_a_file_states_is_stronger(tmp_path, text_file):
    path = text_file("five.urdf", FIVE_BAR.format(transmissions("a", "d")))
    (tmp_path / "five.yaml").write_text("closed_loop: [[end, eye]]\ntype: [3d]\nname_mot: [b, d]\n")
    assert cinegen.load(path).actuated == ("b", "d")


@pytest.mark.parametrize(("named", "says"), [
    ("abd", "depend on each other: [abd] is passive"),
    ("d", "do not determine its motion: [abc] is actuated, too"),
    ("abcd", "depend on each other: [abcd], [abcd] are passive"),
])  # fmt: skip
def test_a_set_that_does_not_determine_the_motion_is_replaced_with_a_warning(named, says):
    with pytest.warns(UserWarning, match=says) as warned:
        mechanism = cinegen.load(FIVE_BAR.format(transmissions(*named)))
    assert len(mechanism.actuated) == len({*mechanism.actuated}) == 2
    assert {*mechanism.actuated} <= {*named} or {*named} <= {*mechanism.actuated}
    assert (mechanism.uncontrolled, mechanism.dependent) == ((), ())
    assert "--actuated JOINTS (in Python actuated=[...]) names others" in str(warned[0].message)
    assert build(mechanism.source.urdf, mechanism.source.constraints).actuated == mechanism.actuated
    assert load_quietly(FIVE_BAR.format(transmissions(*named)), ["b", "d"]).actuated == ("b", "d")


def test_in_a_tree_every_joint_stays_actuated():
    """A caster has no transmission, and can move all the same."""
    joints = joint_at("a", "ground", "left"), joint_at("b", "left", "up", "1 0 0")
    tree = urdf(links("ground", "left", "up"), *joints, "{}")
    mechanism = load_quietly(tree.format(transmissions("a")))
    assert mechanism.actuated == ("a", "b")
    assert mechanism.source.notes == ("nothing in the file drives b: actuated all the same",)
    assert load_quietly(tree.format(transmissions("a", "b"))).source.notes == ()
    assert load_quietly(tree.format(transmissions("lost"))).source.notes == ()


def test_a_robot_with_a_gripper_of_mimic_joints():
    """The arm has no transmissions in its file: it stays actuated, with a note."""
    grips = joint_text("f", "left", "up", limit(0, 1), "prismatic")
    grips += joint_text("g", "left", "down", f'{limit(0, 1)}<mimic joint="f"/>', "prismatic")
    text = urdf(links("ground", "left", "up", "down"), joint_at("a", "ground", "left"), grips, "{}")
    mechanism = load_quietly(text.format(transmissions("f")))
    assert mechanism.actuated == ("a", "f")
    assert any("a is actuated, too" in note for note in mechanism.source.notes)
    assert load_quietly(text.format(transmissions("a", "g"))).actuated == ("a", "g")


SDF = """<sdf version="1.9"><model name="slider"><link name="ground"/><link name="crank"/>
  <link name="rod"><pose>0.3 0.2 0 0 0 0</pose></link><link name="block"><pose>1 0 0 0 0 0</pose></link>
  <joint name="world" type="fixed"><parent>world</parent><child>ground</child></joint>
  <joint name="turn" type="revolute"><parent>ground</parent><child>crank</child><axis><xyz>0 0 1</xyz></axis></joint>
  <joint name="knee" type="revolute"><parent>crank</parent><child>rod</child><axis><xyz>0 0 1</xyz></axis></joint>
  <joint name="wrist" type="revolute"><parent>rod</parent><child>block</child><axis><xyz>0 0 1</xyz></axis></joint>
  <joint name="slide" type="prismatic"><parent>ground</parent><child>block</child><axis><xyz>1 0 0</xyz></axis></joint>
  {}</model></sdf>"""


@pytest.mark.parametrize(("filename", "name", "element"), [
    ("gz-sim-joint-position-controller-system", "gz::sim::systems::JointPositionController", "joint_name"),
    ("ignition-gazebo-joint-controller-system", "ignition::gazebo::systems::JointController", "joint_name"),
    ("libgazebo_ros_diff_drive.so", "wheels", "left_joint"),
    ("libgazebo_ros_joint_pose_trajectory.so", "p", "joint"),
])  # fmt: skip
def test_a_plugin_of_an_sdf_names_what_is_actuated(filename, name, element):
    """Where a loop would be cut at the joint that is driven, another one is cut."""
    plugin = f'<plugin filename="{filename}" name="{name}"><{element}>{{}}</{element}></plugin>'
    for driven in ("turn", "knee", "slide"):
        mechanism = load_quietly(SDF.format(plugin.format(driven)))
        assert (mechanism.actuated, mechanism.mobility) == ((driven,), 1)
    assert load_quietly(SDF.format("")).loops[0].name == "slide"


def test_a_plugin_names_one_of_two_axes():
    cross = """<sdf version="1.9"><model name="m"><link name="a"/><link name="b"/><link name="c"/>
      <joint name="u" type="universal"><parent>a</parent><child>b</child><axis><xyz>1 0 0</xyz></axis>
        <axis2><xyz>0 1 0</xyz></axis2></joint>
      <joint name="w" type="revolute"><parent>a</parent><child>c</child>
        <axis><xyz>0 1 0</xyz><mimic joint="u" axis="axis"/></axis></joint>
      <plugin filename="joint-controller" name="p"><joint_name>u</joint_name><joint_index>1</joint_index></plugin>
      <plugin filename="joint-controller" name="p"><joint_name>w</joint_name></plugin></model></sdf>"""
    assert load_quietly(cross).actuated == ("u_2", "w")
