"""Actuated joints determine a mechanism, or load says which would: a five-bar whose tip is pinned to both arms.

The tip spins, so its mobility is 3. Ranks are those of numpy's singular values.
"""

import math
import warnings
from pathlib import Path

import numpy as np
import pytest

import cinegen
import raff2urdf
from cinegen.model.build import build

# shoulder, elbow and tip of each arm, m
LEFT, RIGHT = ((-0.1, 0.0), (-0.25, 0.3)), ((0.15, 0.05), (0.3, 0.35))
TIP = (0.02, 0.55)
JOINTS = {"a": ("base", "l1", LEFT[0]), "b": ("l1", "l2", LEFT[1]), "c": ("base", "r1", RIGHT[0]),
          "d": ("r1", "r2", RIGHT[1]), "e": ("l2", "tip", TIP), "f": ("r2", "tip", TIP)}  # fmt: skip
AT = {child: place for _, child, place in JOINTS.values()}


def raff(actuated: str = "") -> str:
    """The mechanism in RAFF; `actuated` are letters of joints."""
    lines, turned = ["RAFF pinned", "robot pinned {", "base { }"], {"base": 0.0}
    for number, joint in enumerate("abcde", 1):
        parent, child, place = JOINTS[joint]
        apart = np.subtract(place, AT.get(parent, (0.0, 0.0)))
        turned[child] = math.degrees(math.atan2(apart[1], apart[0]))
        pred = {"base": 0, "l1": 1, "l2": 2, "r1": 3}[parent]
        has = "actuated 1" if joint in actuated else ""
        gamma = turned[child] - turned[parent]
        parameters = f"gamma {gamma:.17g} d {1e3 * math.hypot(*apart):.17g}"
        lines.append(f'link {number} {{ name "{child}" parameters {{ {parameters} }} type 2 pred {pred} {has} }}')
    apart = np.subtract(TIP, RIGHT[1])
    gamma = math.degrees(math.atan2(apart[1], apart[0])) - turned["r2"]
    lines += [
        f"frame 6 {{ parameters {{ gamma {gamma:.17g} d {1e3 * math.hypot(*apart):.17g} }} pred 4 }}",
        "constraint { link 5 frame 6 type 2 }",
        "}",
    ]
    return "\n".join(lines)


def urdf() -> str:
    """The same, its last pin as a second parent of the tip."""
    lines = ['<robot name="pinned">', *(f'<link name="{link}"/>' for link in ("base", *AT))]
    for joint, (parent, child, place) in JOINTS.items():
        x, y = np.subtract(place, AT.get(parent, (0.0, 0.0)))
        lines.append(
            f'<joint name="{joint}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{x:.17g} {y:.17g} 0"/><axis xyz="0 0 1"/></joint>'
        )
    return "\n".join([*lines, "</robot>"])


def sdf(own: str = "") -> str:
    lines = ['<sdf version="1.9"><model name="pinned">', '<link name="base"/>']
    lines += [f'<link name="{link}"><pose>{x} {y} 0 0 0 0</pose></link>' for link, (x, y) in AT.items()]
    lines += ['<joint name="foot" type="fixed"><parent>world</parent><child>base</child></joint>']
    for joint, (parent, child, _) in JOINTS.items():
        lines.append(
            f'<joint name="{joint}" type="revolute"><parent>{parent}</parent><child>{child}</child>'
            f"<axis><xyz>0 0 1</xyz></axis></joint>"
        )
    return "\n".join([*lines, own, "</model></sdf>"])


def mjcf(actuated: str) -> str:
    def body(joint: str, inside: str = "") -> str:
        parent, child, place = JOINTS[joint]
        x, y = np.subtract(place, AT.get(parent, (0.0, 0.0)))
        inner = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        return f'<body name="{child}" pos="{x} {y} 0"><joint name="{joint}" axis="0 0 1"/>{inner}{inside}</body>'

    x, y = np.subtract(TIP, RIGHT[1])
    motors = "".join(f'<general joint="{joint}"/>' for joint in actuated)
    return (
        f"<mujoco><worldbody>{body('a', body('b', body('e')))}{body('c', body('d'))}</worldbody><equality>"
        f'<connect body1="r2" body2="tip" anchor="{x} {y} 0"/></equality><actuator>{motors}</actuator></mujoco>'
    )


def uncontrolled(mechanism: cinegen.Mechanism) -> int:
    """DoF that remain with actuated joints locked, by numpy's rank of the passive columns at random configurations."""
    passive = [mechanism.v_index(joint) for joint in mechanism.joints if joint not in mechanism.actuated]
    matrices = [mechanism.loop_jacobian(q)[:, passive] for q in mechanism.random_closed(4, seed=5)]
    return len(passive) - max(int(np.linalg.matrix_rank(matrix, tol=1e-6)) for matrix in matrices)


def load(path: Path, text: str) -> tuple[cinegen.Mechanism, list[str]]:
    """The mechanism of a text, and the warnings about its actuated joints."""
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings(record=True) as met:
        warnings.simplefilter("always")
        mechanism = cinegen.load(path)
    return mechanism, [str(one.message) for one in met if "actuated" in str(one.message)]


@pytest.mark.parametrize(("name", "text"), [("p.raff", raff()), ("p.urdf", urdf()), ("p.sdf", sdf())])
def test_a_joint_whose_column_is_rounding_is_not_taken_for_a_passive_one(name, text, tmp_path):
    mechanism, met = load(tmp_path / name, text)
    assert (mechanism.mobility, len(mechanism.actuated), met) == (3, 3, [])
    assert uncontrolled(mechanism) == 0


@pytest.mark.parametrize("name", ["arm7", "delta4", "planar_hybrid", "gough", "sr400", "scara", "planetary_gear"])
def test_the_actuated_joints_of_shipped_robots_determine_them(name, robot):
    mechanism = robot(name)
    assert not mechanism.uncontrolled
    if mechanism.is_constrained and not mechanism.balls:
        assert uncontrolled(mechanism) == 0


def declared(folder: Path, kind: str, joints: str) -> tuple[Path, str]:
    """A file of a kind whose actuated joints are those of these letters, as advice for this kind says; and its text."""
    if kind == "raff":
        return folder / "p.raff", raff(joints)
    if kind == "sdf":
        own = "".join(f'<raff:joint name="{joint}" actuated="true"/>' for joint in joints)
        return folder / "p.sdf", sdf(f'<raff:robot xmlns:raff="urn:raff2urdf">{own}</raff:robot>')
    if kind == "mjcf":
        return folder / "p.xml", mjcf(joints)
    if kind == "json":
        (folder / "r.raff").write_text(raff(joints), encoding="utf-8")
        raff2urdf.convert(folder / "r.raff", folder)
        return folder / "r.urdf", (folder / "r.urdf").read_text(encoding="utf-8")
    (folder / "p.yaml").write_text(f"name_mot: [{', '.join(joints)}]", encoding="utf-8")
    return folder / "p.urdf", urdf()


SYNTAX = {
    "raff": "'actuated 1' in its link",
    "json": '"actuated": true in r.constraints.json',
    "urdf": "its name in name_mot: [...] of p.yaml",
    "sdf": '<raff:joint name="NAME" actuated="true"/> in the model\'s <raff:robot xmlns:raff="urn:raff2urdf">',
    "mjcf": '<general joint="NAME"/> in <actuator>',
}
RAFF_NAMES = dict(zip(("joint1", "joint2", "joint3", "joint4", "joint5"), "abcde", strict=True))


@pytest.mark.parametrize("kind", SYNTAX)
def test_dependent_actuated_joints_are_told_with_joints_that_would_do_and_these_do(kind, tmp_path):
    mechanism, (message,) = load(*declared(tmp_path, kind, "abc"))
    assert uncontrolled(mechanism) == len(mechanism.uncontrolled) == 1
    (more,), (less,) = mechanism.uncontrolled, mechanism.dependent
    assert "with its actuated joints locked it still moves, with 1 DoF" in message
    assert f"let {more} be actuated instead of {less}; {SYNTAX[kind]} declares that" in message
    better = "".join(sorted({*"abc", RAFF_NAMES.get(more, more)} - {RAFF_NAMES.get(less, less)}))
    mechanism, met = load(*declared(tmp_path, kind, better))
    assert len(mechanism.actuated) == 3
    assert (uncontrolled(mechanism), met) == (0, [])


@pytest.mark.parametrize("kind", SYNTAX)
def test_too_few_actuated_joints_are_noted_with_those_that_are_missing(kind, tmp_path):
    """No warning: under-actuated robots are built, too."""
    mechanism, met = load(*declared(tmp_path, kind, "ac"))
    assert (len(mechanism.actuated), met) == (2, [])
    (more,) = mechanism.uncontrolled
    (note,) = [note for note in mechanism.source.notes if "locked" in note]
    assert f"let {more} be actuated too; {SYNTAX[kind]} declares that" in note
    mechanism, met = load(*declared(tmp_path, kind, "ac" + RAFF_NAMES.get(more, more)))
    assert (uncontrolled(mechanism), met) == (0, [])


def test_what_an_sdf_says_of_actuated_joints_must_be_true_or_false(tmp_path):
    own = '<raff:robot xmlns:raff="urn:raff2urdf"><raff:joint name="a" actuated="yes"/></raff:robot>'
    with pytest.raises(cinegen.CinegenError, match="actuated='yes' of a raff:joint must be true or false"):
        load(tmp_path / "p.sdf", sdf(own))


# --- drives -----------------------------------------------------------------------------------------------------------
# Transmissions, command interfaces and plugins name actuated joints, as far as these determine the mechanism.


def links(*names):
    return "".join(f'<link name="{name}"/>' for name in names)


def pin(name, parent, child, x):
    origin = f'<origin xyz="{x} 0 0"/>'
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="continuous">{ends}{origin}<axis xyz="0 0 1"/></joint>'


FIVE_BAR = (
    f'<robot name="five">{links("ground", "left", "up", "down", "right", "end", "eye")}'
    + pin("a", "ground", "left", 0) + pin("b", "left", "up", 1) + pin("c", "up", "down", 1)
    + pin("d", "ground", "right", 3)
    + '<joint name="e1" type="fixed"><parent link="down"/><child link="end"/><origin xyz="1.5 0 0"/></joint>'
    + '<joint name="e2" type="fixed"><parent link="right"/><child link="eye"/><origin xyz="0 1.2 0"/></joint>'
    + '<loop_joint name="tip" type="continuous"><link1 link="end"/><link2 link="eye"/><axis xyz="0 0 1"/></loop_joint>'
    + "{}</robot>"
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
    commands = "<command_interface name='position'/>"
    states = "<state_interface name='position'/>"
    joints = "".join(f'<joint name="{one}">{commands if one in names else ""}{states}</joint>' for one in "abcd")
    return f'<ros2_control name="hw" type="system"><hardware/>{joints}</ros2_control>'


def plugins(*names):
    """As of Gazebo: a controller for each joint, and one plugin that measures all."""
    listed = "".join(
        f'<plugin filename="gz-sim-joint-position-controller-system" name="p_{name}"><joint_name>{name}</joint_name>'
        "</plugin>"
        for name in names
    )
    measured = "".join(f"<joint_name>{name}</joint_name>" for name in "abcd")
    return f'<gazebo>{listed}<plugin filename="joint-state-publisher" name="controller">{measured}</plugin></gazebo>'


def load_quietly(text, actuated=None):
    """Load a robot without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return cinegen.load(text, actuated=actuated)


@pytest.mark.parametrize("named", [transmissions, interfaces, plugins])
def test_what_drives_a_closed_robot_is_actuated(named):
    for pair in (("a", "b"), ("a", "d"), ("b", "c"), ("c", "d")):
        mechanism = load_quietly(FIVE_BAR.format(named(*pair)))
        assert (mechanism.actuated, mechanism.mobility) == (pair, 2)
        again = build(mechanism.source.urdf, mechanism.source.constraints)
        assert again.actuated == pair
    assert load_quietly(FIVE_BAR.format(named("a", "d")), ["b", "d"]).actuated == ("b", "d")


def test_what_the_user_or_a_file_states_is_stronger(tmp_path):
    path = tmp_path / "five.urdf"
    path.write_text(FIVE_BAR.format(transmissions("a", "d")))
    (tmp_path / "five.yaml").write_text("closed_loop: [[end, eye]]\ntype: [3d]\nname_mot: [b, d]\n")
    assert cinegen.load(path).actuated == ("b", "d")


@pytest.mark.parametrize(("named", "says"), [
    ("abd", "depend on each other: [abd] is passive"),
    ("d", "do not determine its motion: [abc] is actuated, too"),
    ("abcd", "depend on each other: [abcd], [abcd] are passive"),
])  # fmt: skip
def test_a_set_that_does_not_determine_the_motion_is_replaced_with_a_warning(named, says):
    with pytest.warns(UserWarning, match=says) as told:
        mechanism = cinegen.load(FIVE_BAR.format(transmissions(*named)))
    assert len(mechanism.actuated) == len({*mechanism.actuated}) == 2
    assert {*mechanism.actuated} <= {*named} or {*named} <= {*mechanism.actuated}
    assert (mechanism.uncontrolled, mechanism.dependent) == ((), ())
    assert "--actuated JOINTS (in Python actuated=[...]) names others" in str(told[0].message)
    again = build(mechanism.source.urdf, mechanism.source.constraints)
    assert again.actuated == mechanism.actuated
    assert load_quietly(FIVE_BAR.format(transmissions(*named)), ["b", "d"]).actuated == ("b", "d")


def test_in_a_tree_every_joint_stays_actuated():
    """A caster has no transmission, and can move all the same."""
    tree = (
        f'<robot name="cart">{links("ground", "left", "up")}'
        + pin("a", "ground", "left", 0)
        + pin("b", "left", "up", 1)
        + "{}</robot>"
    )
    mechanism = load_quietly(tree.format(transmissions("a")))
    assert mechanism.actuated == ("a", "b")
    assert mechanism.source.notes == ("nothing in the file drives b: actuated all the same",)
    assert load_quietly(tree.format(transmissions("a", "b"))).source.notes == ()
    assert load_quietly(tree.format(transmissions("lost"))).source.notes == ()


def test_a_robot_with_a_gripper_of_mimic_joints():
    """The arm has no transmissions in its file: it stays actuated, with a note."""
    grip = '<joint name="{}" type="prismatic"><parent link="left"/><child link="{}"/><axis xyz="0 1 0"/>{}</joint>'
    limit = '<limit lower="0" upper="1" velocity="1" effort="1"/>'
    text = (
        f'<robot name="g">{links("ground", "left", "up", "down")}'
        + pin("a", "ground", "left", 0)
        + grip.format("f", "up", limit)
    )
    text += grip.format("g", "down", f'{limit}<mimic joint="f"/>') + "{}</robot>"
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
    for joint in ("turn", "knee", "slide"):
        mechanism = load_quietly(SDF.format(plugin.format(joint)))
        assert (mechanism.actuated, mechanism.mobility) == ((joint,), 1)
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
