"""Transmissions, command interfaces and plugins name actuated joints, as far as these determine the mechanism."""

import warnings

import pytest

import cinegen
from cinegen.model.build import build


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


def load(text, actuated=None):
    """Load a robot without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return cinegen.load(text, actuated=actuated)


@pytest.mark.parametrize("named", [transmissions, interfaces, plugins])
def test_what_drives_a_closed_robot_is_actuated(named):
    for pair in (("a", "b"), ("a", "d"), ("b", "c"), ("c", "d")):
        mechanism = load(FIVE_BAR.format(named(*pair)))
        assert (mechanism.actuated, mechanism.mobility) == (pair, 2)
        again = build(mechanism.source.urdf, mechanism.source.constraints)
        assert again.actuated == pair
    assert load(FIVE_BAR.format(named("a", "d")), ["b", "d"]).actuated == ("b", "d")


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
    assert load(FIVE_BAR.format(transmissions(*named)), ["b", "d"]).actuated == ("b", "d")


def test_in_a_tree_every_joint_stays_actuated():
    """A caster has no transmission, and can move all the same."""
    tree = (
        f'<robot name="cart">{links("ground", "left", "up")}'
        + pin("a", "ground", "left", 0)
        + pin("b", "left", "up", 1)
        + "{}</robot>"
    )
    mechanism = load(tree.format(transmissions("a")))
    assert mechanism.actuated == ("a", "b")
    assert mechanism.source.notes == ("nothing in the file drives b: actuated all the same",)
    assert load(tree.format(transmissions("a", "b"))).source.notes == ()
    assert load(tree.format(transmissions("lost"))).source.notes == ()


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
    mechanism = load(text.format(transmissions("f")))
    assert mechanism.actuated == ("a", "f")
    assert any("a is actuated, too" in note for note in mechanism.source.notes)
    assert load(text.format(transmissions("a", "g"))).actuated == ("a", "g")


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
        mechanism = load(SDF.format(plugin.format(joint)))
        assert (mechanism.actuated, mechanism.mobility) == ((joint,), 1)
    assert load(SDF.format("")).loops[0].name == "slide"


def test_a_plugin_names_one_of_two_axes():
    cross = """<sdf version="1.9"><model name="m"><link name="a"/><link name="b"/><link name="c"/>
      <joint name="u" type="universal"><parent>a</parent><child>b</child><axis><xyz>1 0 0</xyz></axis>
        <axis2><xyz>0 1 0</xyz></axis2></joint>
      <joint name="w" type="revolute"><parent>a</parent><child>c</child>
        <axis><xyz>0 1 0</xyz><mimic joint="u" axis="axis"/></axis></joint>
      <plugin filename="joint-controller" name="p"><joint_name>u</joint_name><joint_index>1</joint_index></plugin>
      <plugin filename="joint-controller" name="p"><joint_name>w</joint_name></plugin></model></sdf>"""
    assert load(cross).actuated == ("u_2", "w")
