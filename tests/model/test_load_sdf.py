"""SDF: poses in any frame, every kind of joint, loops, and errors with the element's line."""

import numpy as np
import pinocchio as pin
import pytest

import cinegen

PARALLELOGRAM = """<?xml version="1.0"?>
<sdf version="1.9">
  <world name="w">
    <model name="parallelogram">
      <link name="ground"/>
      <link name="crank"><pose>0 0 0 0 0 0</pose>
        <visual name="v"><pose>0.1 0 0 0 0 0</pose><geometry><box><size>0.2 0.02 0.02</size></box></geometry>
          <material><diffuse>0 0 1 1</diffuse></material></visual></link>
      <link name="coupler"><pose relative_to="crank">0.2 0 0 0 0 1.5707963267948966</pose></link>
      <link name="rocker"><pose degrees="true">0 0.4 0 0 0 0</pose></link>
      <joint name="world_joint" type="fixed"><parent>world</parent><child>ground</child></joint>
      <joint name="drive" type="revolute"><parent>ground</parent><child>crank</child>
        <axis><limit><lower>-2</lower><upper>2</upper><velocity>3</velocity><effort>7</effort></limit></axis></joint>
      <joint name="elbow" type="revolute"><parent>crank</parent><child>coupler</child>
        <axis><xyz>0 0 1</xyz></axis></joint>
      <joint name="swing" type="revolute"><parent>ground</parent><child>rocker</child>
        <axis><xyz>0 0 1</xyz></axis></joint>
      <joint name="cut" type="ball"><pose relative_to="rocker">0.2 0 0 0 0 0</pose>
        <parent>coupler</parent><child>rocker</child><axis><xyz>0 0 1</xyz></axis></joint>
    </model>
  </world>
</sdf>"""


def test_a_loop_limits_and_shapes_are_read():
    mechanism = cinegen.load(PARALLELOGRAM)
    assert [(loop.name, loop.rows) for loop in mechanism.loops] == [("cut", 3)]
    assert (mechanism.mobility, mechanism.joints) == (1, ("drive", "elbow", "swing"))
    assert mechanism.gap_as_written < 1e-15
    i, j = mechanism.q_index("drive"), mechanism.v_index("drive")
    model = mechanism.model
    assert (model.lowerPositionLimit[i], model.upperPositionLimit[i], model.upperVelocityLimit[j]) == (-2.0, 2.0, 3.0)
    assert model.upperEffortLimit[j] == 7.0
    assert np.isinf(model.upperPositionLimit[mechanism.q_index("elbow")])
    text = PARALLELOGRAM.replace("<effort>7</effort>", "<effort>-1</effort>")
    assert np.isinf(cinegen.load(text).model.upperEffortLimit[j])
    (shape,) = mechanism.visual.geometryObjects
    assert np.allclose(shape.meshColor, [0.0, 0.0, 1.0, 1.0])


ARM = """<sdf version="{version}">
  <model name="arm">
    <pose>5 5 5 0 0 0</pose>
    <link name="a"/>
    <link name="b"><pose>0 0 1 0 0 0.5</pose></link>
    <frame name="mark" attached_to="b"><pose>0.3 0 0 0 0.2 0</pose></frame>
    <joint name="j" type="{kind}"><pose>0.1 0.2 0 0 0 0</pose><parent>a</parent><child>b</child>
      {axis}</joint>
  </model>
</sdf>"""


def arm(kind="revolute", version="1.9", axis="<axis><xyz>0 1 0</xyz></axis>"):
    return ARM.format(kind=kind, version=version, axis=axis)


B = pin.SE3(pin.utils.rotate("z", 0.5), np.array([0.0, 0.0, 1.0]))  # where b stands
J = B * pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.0]))  # where the joint stands


def about(axis, angle):
    """The turn about an axis of the model's frame through the joint."""
    return pin.SE3(pin.AngleAxis(angle, axis / np.linalg.norm(axis)).matrix(), np.zeros(3))


@pytest.mark.parametrize("pose", [
    '<pose degrees="true">0 0 1 10 20 30</pose>',
    f"<pose>0 0 1 {np.radians(10)} {np.radians(20)} {np.radians(30)}</pose>",
    '<pose rotation_format="quat_xyzw">0 0 1 {} {} {} {}</pose>'.format(
        *3.0 * pin.Quaternion(pin.rpy.rpyToMatrix(*np.radians([10.0, 20.0, 30.0]))).coeffs()),
], ids=["degrees", "radians", "quaternion"])  # fmt: skip
def test_a_pose_may_be_written_in_three_ways(pose):
    mechanism = cinegen.load(arm().replace("<pose>0 0 1 0 0 0.5</pose>", pose))
    wanted = pin.SE3(pin.rpy.rpyToMatrix(*np.radians([10.0, 20.0, 30.0])), np.array([0.0, 0.0, 1.0]))
    assert mechanism.placement(mechanism.q_home, "b").isApprox(wanted, 1e-12)


@pytest.mark.parametrize(("version", "axis", "direction"), [
    ("1.9", "<axis><xyz>0 1 0</xyz></axis>", J.rotation @ [0.0, 1.0, 0.0]),
    ("1.9", '<axis><xyz expressed_in="__model__">0 1 0</xyz></axis>', np.array([0.0, 1.0, 0.0])),
    ("1.9", '<axis><xyz expressed_in="mark">1 0 0</xyz></axis>', B.rotation @ pin.utils.rotate("y", 0.2)[:, 0]),
    ("1.6", "<axis><xyz>0 1 0</xyz></axis>", J.rotation @ [0.0, 1.0, 0.0]),
    ("1.6", "<axis><xyz>0 1 0</xyz><use_parent_model_frame>1</use_parent_model_frame></axis>",
     np.array([0.0, 1.0, 0.0])),
    ("1.4", "<axis><xyz>0 1 0</xyz></axis>", np.array([0.0, 1.0, 0.0])),
])  # fmt: skip
def test_an_axis_counts_in_the_frame_that_its_version_says(version, axis, direction):
    """And it passes through the joint, which stands beside the link's origin."""
    mechanism = cinegen.load(arm(version=version, axis=axis))
    for angle in (0.0, 0.7, -1.2):
        through = pin.SE3(np.eye(3), J.translation)
        wanted = through * about(direction, angle) * through.inverse() * B
        stands = mechanism.placement(mechanism.configuration({"j": angle}), "b")
        assert stands.isApprox(wanted, 1e-12)


def test_a_slide_and_two_axes_and_a_ball():
    slide = cinegen.load(arm("prismatic"))
    stands = slide.placement(slide.configuration({"j": 0.25}), "b")
    assert stands.isApprox(pin.SE3(B.rotation, B.translation + 0.25 * J.rotation[:, 1]), 1e-12)
    two = cinegen.load(arm("universal", axis="<axis><xyz>0 1 0</xyz></axis><axis2><xyz>1 0 0</xyz></axis2>"))
    assert two.joints == ("j_1", "j_2")
    stands = two.placement(two.configuration({"j_1": 0.3, "j_2": 0.4}), "b")
    turn = about(np.array([0.0, 1.0, 0.0]), 0.3) * about(np.array([1.0, 0.0, 0.0]), 0.4)
    assert stands.isApprox(J * turn * J.inverse() * B, 1e-12)
    ball = cinegen.load(arm("ball", axis=""))
    assert ball.joints == ("j_X", "j_Y", "j_Z")
    turn = pin.SE3(pin.utils.rotate("x", 0.3) @ pin.utils.rotate("y", 0.4) @ pin.utils.rotate("z", 0.5), np.zeros(3))
    stands = ball.placement(ball.configuration({"j_X": 0.3, "j_Y": 0.4, "j_Z": 0.5}), "b")
    assert stands.isApprox(J * turn * J.inverse() * B, 1e-12)


def test_a_joint_that_leads_inwards_is_walked_the_other_way():
    """The tree begins at the first link that no joint holds; b's joint holds it from there all the same."""
    text = arm().replace("<parent>a</parent><child>b</child>", "<parent>b</parent><child>a</child>")
    text = text.replace("<model name", '<model canonical_link="a" name')
    mechanism = cinegen.load(text)
    assert mechanism.nodes[0] == "a"
    joint = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.0]))  # now it is given on a
    for angle in (0.0, 0.6):
        wanted = joint * about(np.array([0.0, 1.0, 0.0]), -angle) * joint.inverse() * B
        assert mechanism.placement(mechanism.configuration({"j": angle}), "b").isApprox(wanted, 1e-12)


def test_the_first_model_is_loaded_unless_another_is_named():
    text = '<sdf version="1.9"><model name="x"><link name="a"/></model><model name="y"><link name="b"/></model></sdf>'
    assert (cinegen.load(text).name, cinegen.load(text, "y").nodes) == ("x", ("b",))
    with pytest.raises(cinegen.CinegenError, match=r"no model 'z'.*known: x, y"):
        cinegen.load(text, "z")


@pytest.mark.parametrize(("change", "says"), [
    (("0 1 0</xyz>", "0 0 0</xyz>"), r":8: the axis '0 0 0' of joint 'j' must be three numbers, not all 0"),
    (('<link name="b">', '<link name="a">'), r":5: link 'a' is defined twice"),
    (('<link name="a"/>', '<link name="a"/>' + 2 * '<model name="n"><link name="c"/></model>\n'),
     r":5: model 'n' is defined twice"),
])  # fmt: skip
def test_what_is_wrong_is_told_by_its_line(change, says):
    text = arm()
    assert change[0] in text
    with pytest.raises(cinegen.CinegenError, match=says):
        cinegen.load(text.replace(*change))


NESTED = """<sdf version="1.9"><world name="w">
  <frame name="spot"><pose>0 0 5 0 0 0</pose></frame>
  <model name="outer"><pose relative_to="spot">1 0 0 0 0 0</pose>
    <link name="a"/>
    <model name="inner" placement_frame="grip"><pose relative_to="a">0 2 0 0 0 0</pose>
      <link name="b"><pose>0 0 1 0 0 0</pose></link>
      <frame name="grip" attached_to="b"><pose>0 0 1 0 0 0</pose></frame>
      <link name="c"/>
      <joint name="j" type="fixed"><parent>grip</parent><child>c</child></joint>
    </model>
    <frame name="f" attached_to="inner::j"><pose relative_to="inner::grip">3 0 0 0 0 0</pose></frame>
    <joint name="world" type="fixed"><parent>world</parent><child>__model__</child></joint>
    <joint name="k" type="revolute"><pose relative_to="inner::__model__"/><parent>a</parent><child>inner</child>
      <axis><xyz expressed_in="f">0 0 1</xyz></axis></joint>
  </model>
</world></sdf>"""


def test_names_within_nested_models_are_found():
    """As Drake, which reads SDF by Gazebo's own library, has them."""
    mechanism = cinegen.load(NESTED)
    assert mechanism.joints == ("k",)
    places = {"a": (1, 0, 5), "inner::b": (1, 2, 4), "inner::grip": (1, 2, 5), "inner::c": (1, 2, 3), "f": (4, 2, 5)}
    assert {name: tuple(at(mechanism, name).translation) for name in places} == places
    turned = mechanism.placement(mechanism.configuration({"k": np.pi / 2}), "f")
    assert np.allclose(turned.translation, [1.0, 5.0, 5.0])


def test_a_chain_of_relative_poses_may_be_long():
    link = '<link name="l{1}"><pose relative_to="l{0}">0.1 0 0 0 0 0</pose></link>'
    joint = '<joint name="j{1}" type="fixed"><parent>l{0}</parent><child>l{1}</child></joint>'
    chain = "".join((link + joint).format(i - 1, i) for i in range(1, 1100))
    mechanism = cinegen.load(f'<sdf version="1.9"><model name="m"><link name="l0"/>{chain}</model></sdf>')
    assert mechanism.placement(mechanism.q_home, "l1099").translation[0] == pytest.approx(109.9)


CROSS = """<sdf version="1.9"><model name="cross"><link name="a"/><link name="b"/>
  <joint name="j" type="{kind}"><parent>a</parent><child>b</child><pose>0 0 0 0 1.5707963267948966 0</pose>
    <axis><xyz>0 1 0</xyz></axis>{second}</joint></model></sdf>"""


@pytest.mark.parametrize("kind", ["universal", "revolute2"])
@pytest.mark.parametrize("second", ["", "<axis2><limit><lower>-1</lower><upper>1</upper></limit></axis2>"])
def test_a_second_axis_is_z_of_the_joint_unless_given_and_that_is_told(kind, second):
    mechanism = cinegen.load(CROSS.format(kind=kind, second=second))
    assert mechanism.joints == ("j_1", "j_2")
    (note,) = mechanism.source.notes
    assert note == "axis2 of joint 'j' is not given: 0 0 1, as SDF has it by default; for another, add <axis2>"
    turned = mechanism.placement(mechanism.configuration({"j_2": 0.5}), "b").rotation
    assert turned == pytest.approx(pin.utils.rotate("x", 0.5), abs=1e-12)  # z of the joint is x of the child
    assert cinegen.load(CROSS.format(kind=kind, second="<axis2><xyz>0 0 1</xyz></axis2>")).source.notes == ()


def test_gravity_is_that_of_the_world_as_the_first_link_has_it():
    """A base that nothing holds stands at the identity: gravity is turned instead."""
    world = '<sdf version="1.9"><world name="w"><gravity>0 0 -3.7</gravity>{}</world></sdf>'
    arm = """<model name="arm"><pose>0 0 1 0 1.5707963267948966 0</pose><link name="base"/>
      <link name="rod"><inertial><mass>2</mass><pose>0.5 0 0 0 0 0</pose></inertial></link>
      <joint name="j" type="revolute"><parent>base</parent><child>rod</child><axis><xyz>0 1 0</xyz></axis>
      </joint>{}</model>"""
    loose = cinegen.load(world.format(arm.format("")))
    assert loose.gravity == pytest.approx([3.7, 0.0, 0.0])
    assert cinegen.forces(loose, np.array([0.0])).torques == pytest.approx([0.0], abs=1e-12)
    held = '<joint name="w" type="fixed"><parent>world</parent><child>base</child></joint>'
    fixed = cinegen.load(world.format(arm.format(held)))
    assert fixed.gravity.tolist() == [0.0, 0.0, -3.7]
    q = np.array([0.4])
    assert cinegen.forces(loose, q).torques == pytest.approx(cinegen.forces(fixed, q).torques)
    assert abs(cinegen.forces(fixed, q).torques[0]) == pytest.approx(2.0 * 3.7 * 0.5 * np.sin(0.4))
    with pytest.raises(cinegen.CinegenError, match=r":1: the gravity '0 0' must be three numbers"):
        cinegen.load(world.format(arm.format("")).replace("0 0 -3.7", "0 0"))


def test_what_forces_leave_out_of_an_sdf_is_told():
    dynamics = "<dynamics><damping>1</damping><friction>0</friction><spring_stiffness>2</spring_stiffness></dynamics>"
    text = arm().replace("</xyz></axis>", f"</xyz>{dynamics}</axis>")
    (note,) = cinegen.load(text.replace('<link name="b">', '<link name="b"><gravity>0</gravity>')).source.notes
    assert note == "forces leave out the springs of j, the disabled gravity of b"


def test_an_empty_link_world_is_the_world():
    text = """<sdf version="1.6"><model name="m"><pose>0 0 1 0 0 0</pose><link name="world"/><link name="tool"/>
      <joint name="lift" type="prismatic"><parent>world</parent><child>tool</child><axis><xyz>0 0 1</xyz></axis></joint>
      </model></sdf>"""
    mechanism = cinegen.load(text)
    assert mechanism.source.notes == ("the empty link 'world' is taken for the world itself",)
    assert mechanism.placement(np.array([0.5]), "tool").translation.tolist() == [0.0, 0.0, 1.5]


# --- sdf includes -----------------------------------------------------------------------------------------------------
# Models that an SDF includes: poses as the specification has them, worked out by hand; only near files are read.


GRIPPER = """<sdf version="1.9">
  <model name="gripper">
    <pose>9 0 0 0 0 0</pose>
    <frame name="flange"><pose>0 0 -0.5 0 0 0</pose></frame>
    <link name="palm"><pose>0 0 0.1 0 0 0</pose>
      <visual name="v"><geometry><mesh><uri>meshes/palm.stl</uri></mesh></geometry></visual></link>
    <link name="finger"><pose relative_to="palm">0.2 0 0 0 0 0</pose></link>
    <joint name="grip" type="prismatic"><parent>palm</parent><child>finger</child>
      <axis><xyz expressed_in="__model__">0 1 0</xyz></axis></joint>
  </model>
</sdf>"""

ROBOT = """<sdf version="1.9">
  <model name="robot">
    <link name="base"/>
    <link name="arm"><pose>0 0 1 0 0 1.5707963267948966</pose></link>
    <joint name="turn" type="revolute"><parent>base</parent><child>arm</child><axis><xyz>0 0 1</xyz></axis></joint>
    <include {merge}><uri>{uri}</uri>{more}</include>
    <joint name="held" type="fixed"><parent>arm</parent><child>{child}</child></joint>
  </model>
</sdf>"""

AT_ARM = '<pose relative_to="arm"/>'
CONFIG = """<model><name>gripper</name><version>1.0</version>
  <sdf version="1.4">old.sdf</sdf><sdf version="1.10">model.sdf</sdf><sdf version="1.9">other.sdf</sdf></model>"""


@pytest.fixture
def models(tmp_path):
    """A folder of models: the gripper, with model.config and a mesh, beside the robot's own folder. It is so deep that
    the search for packages does not meet other tests' folders."""
    tmp_path = tmp_path / "w" / "x" / "y" / "z"
    write_file(tmp_path / "gripper/model.sdf", GRIPPER)
    write_file(tmp_path / "gripper/model.config", CONFIG)
    write_file(tmp_path / "gripper/meshes/palm.stl", "solid p\nendsolid p\n")
    write_file(tmp_path / "robot/model.config", CONFIG)
    return tmp_path


def write_file(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def robot(models, uri="model://gripper", more="", child="gripper::palm", merge="", text=ROBOT):
    path = models / "robot/robot.sdf"
    return write_file(path, text.format(uri=uri, more=more, child=child, merge=merge))


def at(mechanism, node):
    return mechanism.placement(mechanism.q_home, node)


@pytest.mark.parametrize(("more", "child", "palm", "heading"), [
    ("", "gripper::palm", (9.0, 0.0, 0.1), 0.0),  # its own pose
    ("<pose>1 2 3 0 0 0</pose>", "gripper::palm", (1.0, 2.0, 3.1), 0.0),
    ('<pose relative_to="arm">1 0 0 0 0 0</pose>', "gripper::palm", (0.0, 1.0, 1.1), np.pi / 2.0),
    (f"<name>hand</name>{AT_ARM}", "hand::palm", (0, 0, 1.1), np.pi / 2.0),
    # the frame, 0.5 m below the model's origin, is placed at the arm
    (f"{AT_ARM}<placement_frame>flange</placement_frame>", "gripper::palm", (0, 0, 1.6), np.pi / 2.0),
])  # fmt: skip
def test_an_included_model_is_where_its_include_places_it(models, more, child, palm, heading):
    mechanism = cinegen.load(robot(models, more=more, child=child))
    assert mechanism.joints == ("turn", child.replace("palm", "grip"))
    placed = at(mechanism, child)
    assert placed.translation == pytest.approx(palm, abs=1e-12)
    c, s = np.cos(heading), np.sin(heading)
    assert placed.rotation == pytest.approx(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), abs=1e-12)
    finger = at(mechanism, child.replace("palm", "finger"))
    assert finger.translation == pytest.approx(np.add(palm, [0.2 * c, 0.2 * s, 0.0]), abs=1e-12)
    q = mechanism.configuration({child.replace("palm", "grip"): 0.1})
    opened = mechanism.placement(q, child.replace("palm", "finger"))
    assert opened.translation - finger.translation == pytest.approx([-0.1 * s, 0.1 * c, 0.0], abs=1e-12)


@pytest.mark.parametrize("frame", ["", "<placement_frame>flange</placement_frame>"])
@pytest.mark.parametrize("other", ["arm", "__model__"])
def test_a_merged_model_has_its_links_without_its_name(models, frame, other):
    nail = '<model name="tip"><pose relative_to="__model__">0 0 0.2 0 0.3 0</pose><link name="nail"/></model>'
    weld = '<joint name="weld" type="fixed"><parent>palm</parent><child>tip::nail</child></joint>'
    file = models / "gripper/model.sdf"
    file.write_text(file.read_text().replace("</model>", f"{nail}{weld}</model>"))
    more = f'<pose relative_to="{other}">0 0 0.3 0 0 0</pose>' + frame
    mechanism = cinegen.load(robot(models, more=more, child="palm", merge='merge="true"'))
    nested = cinegen.load(robot(models, more=more))
    assert mechanism.joints == ("turn", "grip")
    assert {*mechanism.nodes} == {node.removeprefix("gripper::") for node in nested.nodes}
    for q in (np.zeros(2), np.array([0.7, 0.1])):
        for node in mechanism.nodes:
            full = node if node in nested.nodes else f"gripper::{node}"
            assert mechanism.placement(q, node).isApprox(nested.placement(q, full), 1e-12)


def test_files_are_named_relative_or_by_their_model(models):
    expected = at(cinegen.load(robot(models, more=AT_ARM)), "gripper::finger")
    home = models / "robot"
    for folder in ("parts/gripper", "gripper"):
        write_file(home / folder / "model.sdf", GRIPPER)
    for uri in ("parts/gripper", "parts/gripper/model.sdf", "gripper", "model://gripper/model.sdf", "file://gripper"):
        assert at(cinegen.load(robot(models, uri, AT_ARM)), "gripper::finger").isApprox(expected)


def test_a_model_is_found_in_the_folder_that_the_environment_names(models, monkeypatch, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (models / "gripper").rename(elsewhere / "gripper")
    path = robot(models)
    says = r"robot.sdf:6: the included 'model://gripper'.*is not found.*ROS_PACKAGE_PATH"
    with pytest.raises(cinegen.CinegenError, match=says):
        cinegen.load(path)
    for variable in ("ROS_PACKAGE_PATH", "GZ_SIM_RESOURCE_PATH"):
        with monkeypatch.context() as patched:
            patched.setenv(variable, str(elsewhere))
            assert cinegen.load(path).joints == ("turn", "gripper::grip")


def test_meshes_of_an_included_model_are_found_in_its_folder(models):
    from raff2urdf.graphics.names import find

    write_file(models / "robot/near/model.sdf", GRIPPER)
    write_file(models / "robot/near/meshes/palm.stl", "solid q\nendsolid q\n")
    for uri, mesh in (("model://gripper", "gripper/meshes/palm.stl"), ("near", "robot/near/meshes/palm.stl")):
        mechanism = cinegen.load(robot(models, uri))
        (name,) = [part.split('"')[0] for part in mechanism.source.urdf.split('filename="')[1:]]
        assert find(name, models / "robot") == models / mesh


def test_models_include_models_and_not_themselves(models):
    write_file(models / "tool/model.sdf", '<sdf version="1.9"><model name="tool"><link name="tip"/></model></sdf>')
    write_file(models / "tool/model.config", "<model/>")
    more = '<include><uri>model://tool</uri><pose relative_to="finger">0 0 0.4 0 0 0</pose></include>'
    more += '<joint name="j" type="fixed"><parent>finger</parent><child>tool::tip</child></joint></model>'
    write_file(models / "gripper/model.sdf", GRIPPER.replace("</model>", more))
    mechanism = cinegen.load(robot(models, more="<pose/>"))
    assert at(mechanism, "gripper::tool::tip").translation == pytest.approx([0.2, 0.0, 0.5])
    write_file(models / "tool/model.sdf", (models / "gripper/model.sdf").read_text())
    with pytest.raises(cinegen.CinegenError, match=f"includes itself: robot.sdf{3 * ' -> model.sdf'}"):
        cinegen.load(robot(models))


@pytest.mark.parametrize(("uri", "says"), [
    ("lost.sdf", r"robot.sdf:6: the included 'lost.sdf' is not found: there is no file"),
    ("arm.urdf", r"robot.sdf:6: the included 'arm.urdf' is no SDF: its first element is <robot>"),
    ("bad.sdf", r"/robot/bad.sdf:2: link 'gripper::a' is defined twice"),
])  # fmt: skip
def test_what_is_wrong_with_an_include_is_told_by_file_and_line(models, uri, says):
    write_file(models / "robot/arm.urdf", '<robot name="arm"><link name="a"/></robot>')
    twice = '<sdf version="1.9"><model name="gripper">\n<link name="a"/><link name="a"/></model></sdf>'
    write_file(models / "robot/bad.sdf", twice)
    with pytest.raises(cinegen.CinegenError, match=says):
        cinegen.load(robot(models, uri))


WORLD = """<sdf version="1.9"><world name="w"><gravity>0 0 -1.6</gravity>
  <include><uri>model://sun</uri></include>
  <include><uri>model://ground</uri></include>
  <include><uri>model://gripper</uri><name>left</name><pose>1 2 3 0 0 0</pose><static>{static}</static></include>
  <include><uri>model://gripper</uri><name>right</name></include></world></sdf>"""


def test_of_a_world_the_first_model_with_joints_is_loaded(models):
    """What Gazebo alone has, such as the sun, need not be there."""
    plane = '<sdf version="1.9"><model name="ground"><link name="plane"/></model></sdf>'
    write_file(models / "ground/model.sdf", plane)
    write_file(models / "ground/model.config", "<model/>")
    path = robot(models, text=WORLD.replace("{static}", "true"))
    mechanism = cinegen.load(path)
    assert (mechanism.name, mechanism.nodes[:2]) == ("left", ("world", "palm"))
    assert mechanism.gravity.tolist() == [0.0, 0.0, -1.6]
    assert at(mechanism, "palm").translation == pytest.approx([1.0, 2.0, 3.1])  # static: where the world has it
    assert cinegen.load(robot(models, text=WORLD.replace("{static}", "0"))).nodes[0] == "palm"
    assert cinegen.load(path, robot="right").name == "right"
    assert cinegen.load(path, robot="ground").nodes == ("plane",)
    with pytest.raises(cinegen.CinegenError, match=r"there is no model 'rigth': did you mean 'right'"):
        cinegen.load(path, robot="rigth")


@pytest.mark.parametrize("version", ["1.4", "1.5"])
def test_axes_of_an_included_file_are_those_of_its_version(models, version):
    """Before version 1.5 an axis was given in the frame of the model, not of the joint."""
    text = f"""<sdf version="{version}"><model name="gripper"><link name="palm"/>
      <link name="finger"><pose>0 0 0 1.5707963267948966 0 0</pose></link>
      <joint name="grip" type="prismatic"><parent>palm</parent><child>finger</child>
        <axis><xyz>0 1 0</xyz></axis></joint></model></sdf>"""
    write_file(models / "gripper/model.sdf", text)
    mechanism = cinegen.load(robot(models))
    moved = mechanism.placement(mechanism.configuration({"gripper::grip": 1.0}), "gripper::finger")
    expected = [0.0, 1.0, 0.0] if version == "1.4" else [0.0, 0.0, 1.0]
    assert moved.translation == pytest.approx(expected, abs=1e-12)
