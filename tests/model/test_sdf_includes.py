"""Models that an SDF includes: poses as the specification has them, worked out by hand; only near files are read."""

import numpy as np
import pytest

import cinegen

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

ARM = '<pose relative_to="arm"/>'
CONFIG = """<model><name>gripper</name><version>1.0</version>
  <sdf version="1.4">old.sdf</sdf><sdf version="1.10">model.sdf</sdf><sdf version="1.9">other.sdf</sdf></model>"""


@pytest.fixture
def models(tmp_path):
    """A folder of models: the gripper, with model.config and a mesh, beside the robot's own folder. It is so deep that
    the search for packages does not meet other tests' folders."""
    tmp_path = tmp_path / "w" / "x" / "y" / "z"
    write(tmp_path / "gripper/model.sdf", GRIPPER)
    write(tmp_path / "gripper/model.config", CONFIG)
    write(tmp_path / "gripper/meshes/palm.stl", "solid p\nendsolid p\n")
    write(tmp_path / "robot/model.config", CONFIG)
    return tmp_path


def write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def robot(models, uri="model://gripper", more="", child="gripper::palm", merge="", text=ROBOT):
    path = models / "robot/robot.sdf"
    return write(path, text.format(uri=uri, more=more, child=child, merge=merge))


def at(mechanism, node):
    return mechanism.placement(mechanism.q_home, node)


@pytest.mark.parametrize(("more", "child", "palm", "heading"), [
    ("", "gripper::palm", (9.0, 0.0, 0.1), 0.0),  # its own pose
    ("<pose>1 2 3 0 0 0</pose>", "gripper::palm", (1.0, 2.0, 3.1), 0.0),
    ('<pose relative_to="arm">1 0 0 0 0 0</pose>', "gripper::palm", (0.0, 1.0, 1.1), np.pi / 2.0),
    (f"<name>hand</name>{ARM}", "hand::palm", (0, 0, 1.1), np.pi / 2.0),
    # the frame, 0.5 m below the model's origin, is placed at the arm
    (f"{ARM}<placement_frame>flange</placement_frame>", "gripper::palm", (0, 0, 1.6), np.pi / 2.0),
])  # fmt: skip
def test_an_included_model_is_where_its_include_places_it(models, more, child, palm, heading):
    mechanism = cinegen.load(robot(models, more=more, child=child))
    assert mechanism.joints == ("turn", child.replace("palm", "grip"))
    found = at(mechanism, child)
    assert found.translation == pytest.approx(palm, abs=1e-12)
    c, s = np.cos(heading), np.sin(heading)
    assert found.rotation == pytest.approx(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), abs=1e-12)
    finger = at(mechanism, child.replace("palm", "finger"))
    assert finger.translation == pytest.approx(np.add(palm, [0.2 * c, 0.2 * s, 0.0]), abs=1e-12)
    opened = mechanism.placement(mechanism.configuration({child.replace("palm", "grip"): 0.1}), finger_of(child))
    assert opened.translation - finger.translation == pytest.approx([-0.1 * s, 0.1 * c, 0.0], abs=1e-12)


def finger_of(palm):
    return palm.replace("palm", "finger")


@pytest.mark.parametrize("frame", ["", "<placement_frame>flange</placement_frame>"])
def test_a_merged_model_has_its_links_without_its_name(models, frame):
    more = '<pose relative_to="arm">0 0 0.3 0 0 0</pose>' + frame
    mechanism = cinegen.load(robot(models, more=more, child="palm", merge='merge="true"'))
    nested = cinegen.load(robot(models, more=more))
    assert mechanism.joints == ("turn", "grip")
    assert {*mechanism.nodes} == {node.removeprefix("gripper::") for node in nested.nodes}
    for q in (np.zeros(2), np.array([0.7, 0.1])):
        for node in mechanism.nodes:
            full = node if node in nested.nodes else f"gripper::{node}"
            assert mechanism.placement(q, node).isApprox(nested.placement(q, full), 1e-12)


def test_files_are_named_relative_or_by_their_model(models):
    place = '<pose relative_to="arm"/>'
    expected = at(cinegen.load(robot(models, more=place)), "gripper::finger")
    home = models / "robot"
    for folder in ("parts/gripper", "gripper"):
        write(home / folder / "model.sdf", GRIPPER)
    for uri in ("parts/gripper", "parts/gripper/model.sdf", "gripper", "model://gripper/model.sdf", "file://gripper"):
        assert at(cinegen.load(robot(models, uri, place)), "gripper::finger").isApprox(expected)


def test_a_model_is_found_in_the_folder_that_the_environment_names(models, monkeypatch, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (models / "gripper").rename(elsewhere / "gripper")
    path = robot(models)
    with pytest.raises(
        cinegen.CinegenError, match=r"robot.sdf:6: the included 'model://gripper'.*is not found"
    ) as told:
        cinegen.load(path)
    assert "ROS_PACKAGE_PATH" in str(told.value)
    for variable in ("ROS_PACKAGE_PATH", "GZ_SIM_RESOURCE_PATH"):
        with monkeypatch.context() as patched:
            patched.setenv(variable, str(elsewhere))
            mechanism = cinegen.load(path)
            assert mechanism.joints == ("turn", "gripper::grip")


def test_meshes_of_an_included_model_are_found_in_its_folder(models):
    from raff2urdf.graphics.names import find

    write(models / "robot/near/model.sdf", GRIPPER)
    write(models / "robot/near/meshes/palm.stl", "solid q\nendsolid q\n")
    for uri, mesh in (("model://gripper", "gripper/meshes/palm.stl"), ("near", "robot/near/meshes/palm.stl")):
        mechanism = cinegen.load(robot(models, uri))
        (name,) = [part.split('"')[0] for part in mechanism.source.urdf.split('filename="')[1:]]
        assert find(name, models / "robot") == models / mesh


def test_models_include_models_and_not_themselves(models):
    write(models / "tool/model.sdf", '<sdf version="1.9"><model name="tool"><link name="tip"/></model></sdf>')
    write(models / "tool/model.config", "<model/>")
    more = '<include><uri>model://tool</uri><pose relative_to="finger">0 0 0.4 0 0 0</pose></include>'
    more += '<joint name="j" type="fixed"><parent>finger</parent><child>tool::tip</child></joint></model>'
    write(models / "gripper/model.sdf", GRIPPER.replace("</model>", more))
    mechanism = cinegen.load(robot(models, more="<pose/>"))
    assert at(mechanism, "gripper::tool::tip").translation == pytest.approx([0.2, 0.0, 0.5])
    write(models / "tool/model.sdf", (models / "gripper/model.sdf").read_text())
    with pytest.raises(
        cinegen.CinegenError, match=r"includes itself: robot.sdf -> model.sdf -> model.sdf -> model.sdf"
    ):
        cinegen.load(robot(models))


@pytest.mark.parametrize(("uri", "says"), [
    ("lost.sdf", r"robot.sdf:6: the included 'lost.sdf' is not found: there is no file"),
    ("arm.urdf", r"robot.sdf:6: the included 'arm.urdf' is no SDF: its first element is <robot>"),
    ("bad.sdf", r"/robot/bad.sdf:2: link 'gripper::a' is defined twice"),
])  # fmt: skip
def test_what_is_wrong_with_an_include_is_told_by_file_and_line(models, uri, says):
    write(models / "robot/arm.urdf", '<robot name="arm"><link name="a"/></robot>')
    write(
        models / "robot/bad.sdf",
        '<sdf version="1.9"><model name="gripper">\n<link name="a"/><link name="a"/></model></sdf>',
    )
    with pytest.raises(cinegen.CinegenError, match=says):
        cinegen.load(robot(models, uri))


WORLD = """<sdf version="1.9"><world name="w"><gravity>0 0 -1.6</gravity>
  <include><uri>model://sun</uri></include>
  <include><uri>model://ground</uri></include>
  <include><uri>model://gripper</uri><name>left</name><pose>1 2 3 0 0 0</pose><static>{static}</static></include>
  <include><uri>model://gripper</uri><name>right</name></include></world></sdf>"""


def test_of_a_world_the_first_model_with_joints_is_loaded(models):
    """What Gazebo alone has, such as the sun, need not be there."""
    write(models / "ground/model.sdf", '<sdf version="1.9"><model name="ground"><link name="plane"/></model></sdf>')
    write(models / "ground/model.config", "<model/>")
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
    write(models / "gripper/model.sdf", text)
    mechanism = cinegen.load(robot(models))
    moved = mechanism.placement(mechanism.configuration({"gripper::grip": 1.0}), "gripper::finger")
    expected = [0.0, 1.0, 0.0] if version == "1.4" else [0.0, 0.0, 1.0]
    assert moved.translation == pytest.approx(expected, abs=1e-12)
