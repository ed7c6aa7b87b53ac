"""`cinegen.load` takes a `yourdfpy.URDF`: the mechanism is that of the file it was read from."""

import numpy as np
import pytest
import trimesh
import yourdfpy
from yourdfpy import Joint, Link, Robot

import cinegen
from cinegen.errors import CinegenWarning, LoadError

URDF = """<robot name="arm">
  <material name="red"><color rgba="1 0 0 1"/><texture/></material>
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.1 0 0" rpy="0.1 0.2 0.3"/><mass value="2"/>
    <inertia ixx="0.1" ixy="0.01" ixz="0" iyy="0.2" iyz="0" izz="0.2"/></inertial>
    <visual><origin xyz="0 0 0.1" rpy="0 1.5707963267948966 0"/><geometry>
      <mesh filename="meshes/box.stl" scale="2 2 2"/></geometry><material name="red"/></visual>
    <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="fore"/>
  <link name="finger"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.4 1.57079632 0.5"/><limit lower="-1" upper="2" velocity="3" effort="4"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/><axis xyz="0 1 0"/>
    <origin xyz="0 0 0.3" rpy="1 2 3"/></joint>
  <joint name="slide" type="prismatic"><parent link="fore"/><child link="finger"/>
    <limit lower="0" upper="0.1" velocity="1" effort="1"/>
    <mimic joint="shoulder" multiplier="0.05" offset="0.01"/></joint>
</robot>"""


@pytest.fixture
def arm(tmp_path):
    """The file of a robot, from whose folder nobody works."""
    folder = tmp_path / "arm"
    (folder / "meshes").mkdir(parents=True)
    trimesh.creation.box((0.1, 0.2, 0.3)).export(folder / "meshes" / "box.stl")
    (folder / "arm.urdf").write_text(URDF)
    return folder / "arm.urdf"


def loaded(path, **options):
    return yourdfpy.URDF.load(str(path), **{"build_scene_graph": False, "load_meshes": False, **options})


def test_the_mechanism_is_that_of_the_file(arm):
    from_file, other = cinegen.load(arm), cinegen.load(loaded(arm, build_scene_graph=True, load_meshes=True))
    for attribute in ("name", "nodes", "joints", "actuated", "couplings", "q_home", "floating"):
        assert np.all(getattr(from_file, attribute) == getattr(other, attribute)), attribute
    assert from_file.length == pytest.approx(other.length, rel=1e-14)
    for placed, expected in zip(from_file.model.jointPlacements, other.model.jointPlacements, strict=True):
        np.testing.assert_allclose(placed.homogeneous, expected.homogeneous, atol=1e-15)
    for attribute in ("lowerPositionLimit", "upperPositionLimit", "upperVelocityLimit", "upperEffortLimit"):
        np.testing.assert_array_equal(getattr(from_file.model, attribute), getattr(other.model, attribute))
    for body, expected in zip(from_file.model.inertias, other.model.inertias, strict=True):
        np.testing.assert_allclose(body.toDynamicParameters(), expected.toDynamicParameters(), rtol=1e-14, atol=1e-16)
    for shapes, theirs in ((from_file.visual, other.visual), (from_file.collision, other.collision)):
        for shape, expected in zip(shapes.geometryObjects, theirs.geometryObjects, strict=True):
            assert (shape.name, shape.meshPath) == (expected.name, expected.meshPath)
            np.testing.assert_array_equal(shape.meshScale, expected.meshScale)
            np.testing.assert_array_equal(shape.meshColor, expected.meshColor)
            np.testing.assert_allclose(shape.placement.homogeneous, expected.placement.homogeneous, atol=1e-15)
    assert {shape.meshPath for shape in from_file.visual.geometryObjects} >= {str(arm.parent / "meshes" / "box.stl")}


def test_a_handler_of_file_names_says_where_meshes_are(arm, tmp_path, monkeypatch):
    (tmp_path / "box.stl").write_bytes((arm.parent / "meshes" / "box.stl").read_bytes())
    monkeypatch.chdir(tmp_path)
    model = loaded(arm, filename_handler=lambda name: name.rpartition("/")[2])
    meshes = [shape.meshPath for shape in cinegen.load(model).visual.geometryObjects if shape.meshPath]
    assert meshes == [str(tmp_path / "box.stl")]


def test_a_mesh_that_is_missing_is_named_and_sticks_are_drawn(arm):
    (arm.parent / "meshes" / "box.stl").unlink()
    with pytest.warns(CinegenWarning, match=r"yourdfpy.URDF 'arm'.*meshes/box.stl' is not found.*sticks are drawn"):
        assert cinegen.load(loaded(arm)).visual.geometryObjects


def test_files_in_the_working_folder_are_not_taken_for_files_next_to_it(arm, monkeypatch):
    monkeypatch.chdir(arm.parent)
    arm.with_name("robot.yaml").write_text("closed_loop: [[nonsense, fore]]\ntype: [3d]\nname_mot: []\n")
    with pytest.raises(LoadError, match="nonsense"):
        cinegen.load(arm)
    assert cinegen.load(loaded(arm)).joints == ("shoulder", "elbow", "slide")


def robot(*joints, links=("a", "b", "c")):
    model = Robot("r", [Link(name) for name in links], list(joints))
    return yourdfpy.URDF(model, build_scene_graph=False, load_meshes=False)


@pytest.mark.parametrize(("model", "message"), [
    (robot(Joint("j", "fixed", "a", None)), "joint 'j' of robot 'r' .* its child must be a string, not None"),
    (robot(Joint("j", "revolute", "a", "b", axis=np.array([np.nan, 0, 1]))), "axis 'nan 0.0 1.0' of joint 'j'"),
    (robot(links=()), "the robot 'r' has no link"),
])  # fmt: skip
def test_what_is_wrong_with_it_is_named(model, message):
    with pytest.raises(LoadError, match=message):
        cinegen.load(model)
