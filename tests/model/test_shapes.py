"""What is seen of a mechanism: its meshes, where they may lie, and a stick figure where there are none."""

import json
import pickle
import re

import numpy as np
import pytest
import trimesh
from urdf_text import joint_at, links, robot

import cinegen
import raff2urdf
from cinegen.cockpit import make_page
from cinegen.cockpit.scene import _drawn
from cinegen.model.build import build
from cinegen.model.motion_plane import motion_plane
from cinegen.model.stick import stick_figure
from raff2urdf.cli import main as convert
from raff2urdf.urdf2raff.cli import main as urdf2raff

URDF = """<robot name="arm">
  <link name="base">{0}</link>
  <link name="upper">{1}</link>
  <link name="tool"/>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.5"/><axis xyz="0 0.6 0.8"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="reach" type="prismatic">
    <parent link="upper"/><child link="tool"/><origin xyz="0.4 0 0"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>"""
VISUAL = '<visual><geometry><mesh filename="{0}"/></geometry></visual>'


@pytest.fixture
def write(tmp_path):
    folder = tmp_path / "arm_description/urdf"
    folder.mkdir(parents=True)
    (tmp_path / "arm_description/meshes").mkdir()
    trimesh.creation.box(extents=(0.1, 0.2, 0.3)).export(tmp_path / "arm_description/meshes/part.stl")

    def write(*visuals):
        path = folder / "arm.urdf"
        path.write_text(URDF.format(*visuals, *[""] * (2 - len(visuals))))
        return path

    return write


LOST = [
    ("lost.stl", "mesh 'lost.stl' is not found"),
    ("../meshes/pointer.stl", "mesh '../meshes/pointer.stl' is a Git LFS pointer: run `git lfs pull` in "),
    ("../../../etc/passwd", "leads out of"),
    ("ftp://somewhere/x.stl", "'ftp://' can't be read"),
    ("package://parts/x.stl", "the package 'parts' is not found: name its folder by --package parts=FOLDER"),
    ("../meshes/empty.stl", "empty.stl' can't be read: File is empty: export it again"),
    ("../meshes/none.stl", "none.stl' can't be read: STL: file is empty. There are no facets defined: export it again"),
    ("../meshes/cut.dae", "cut.dae' can't be read: .*: export it again"),
    ("../meshes/bare.obj", "bare.obj' can't be read: .*: export it again"),
    ("../meshes/cut.glb", "cut.glb' can't be read: .*: export it again"),
    ("../meshes/part.step", "part.step' can't be read: only .stl, "),
]


@pytest.fixture
def lost(write, tmp_path):
    """Files that are no meshes."""
    meshes = tmp_path / "arm_description/meshes"
    (meshes / "pointer.stl").write_text("version https://git-lfs.github.com/spec/v1\n")
    (meshes / "none.stl").write_bytes(bytes(84))
    (meshes / "cut.dae").write_text("<COLLADA>")
    (meshes / "bare.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    for name in ("empty.stl", "cut.glb", "part.step"):
        (meshes / name).touch()


@pytest.mark.usefixtures("lost")
@pytest.mark.parametrize(("name", "says"), LOST)
def test_sticks_are_drawn_for_a_mesh_that_is_lost(write, name, says):
    """And only where a link has no other shape; the bars of these sticks collide."""
    kept = VISUAL.format("../meshes/part.stl")
    mechanism = cinegen.load(write(kept, VISUAL.format(name) + VISUAL.format(name)))
    for shapes in ("visual", "collision"):
        with pytest.warns(cinegen.CinegenWarning, match=rf"arm.urdf:3: .*{says}.*; sticks are drawn instead$") as seen:
            objects = getattr(mechanism, shapes).geometryObjects
        assert len(seen) == 1
        frames = mechanism.model.frames
        drawn = {(frames[shape.parentFrame].name, shape.name.partition(" ")[0]) for shape in objects}
        assert drawn == {("base", "base_0"), ("upper", "bar"), *([("upper", "joint")] * (shapes == "visual"))}
    assert list(mechanism.unchecked_links) == ["upper"]
    both = cinegen.load(write("", kept + VISUAL.format(name)))
    with pytest.warns(cinegen.CinegenWarning, match="sticks are drawn instead"):
        assert [shape.name for shape in both.visual.geometryObjects] == ["upper_0"]
    with pytest.warns(cinegen.CinegenWarning, match="sticks are drawn instead"):
        assert list(both.unchecked_links) == ["upper"]


@pytest.mark.usefixtures("lost")
def test_one_warning_names_the_first_lost_mesh_and_counts_the_others(write):
    mechanism = cinegen.load(write("".join(VISUAL.format(name) for name, _ in LOST)))
    with pytest.warns(cinegen.CinegenWarning, match=rf"not found: .*; and {len(LOST) - 1} more meshes; sticks") as seen:
        _ = mechanism.visual
    assert len(seen) == 1


SCENE = """robot = "arm.urdf"
goal = { joints = { turn = 0.2, reach = 0.1 } }
[[obstacle]]
kind = "sphere"
radius = 0.1
point = [9, 9, 9]
"""


@pytest.mark.usefixtures("lost")
@pytest.mark.filterwarnings("default::cinegen.CinegenWarning")
def test_every_command_goes_on_without_a_lost_mesh_and_warns_once(write, typed, capsys, monkeypatch):
    visual = VISUAL.format("../meshes/pointer.stl")
    path = write(visual, visual + VISUAL.format("../meshes/part.stl"))
    monkeypatch.chdir(path.parent)
    (path.parent / "scene.toml").write_text(SCENE)
    for command, checks in (
        (["info", "arm.urdf", "--collision"], True),
        (["drive", "arm.urdf", "--snapshot", "page.html"], False),
        (["drive", "--scene", "scene.toml", "--snapshot", "scene.html"], True),
        (["plan", "scene.toml"], True),
    ):
        out, err = typed(*command)
        assert err.count("arm.urdf:2: ") == 1, command
        assert err.count("warning: ") == 1, command
        assert ("not checked: " in out) == checks, command
    assert urdf2raff(["arm.urdf"]) == 0
    assert capsys.readouterr().err.count("warning: ") == 1
    assert convert(["arm.raff", "--format", "mjcf"]) == 0
    assert "warning" not in capsys.readouterr().err
    for form in (["plan", "scene.toml"], ["info", "arm.urdf", "--collision"]):
        report = json.loads(typed(*form, "--json").out)
        lost = report["mesh_check"]["lost"] if "plan" in form else report[0]["collision"]["not_checked"]
        assert list(lost) == ["base", "upper"]
    assert "is a Git LFS pointer: run `git lfs pull` in" in typed("info", "arm.urdf").err


@pytest.mark.filterwarnings("default::cinegen.CinegenWarning")
def test_the_package_that_a_warning_asks_for_is_read(write, tmp_path, typed):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "arm_description/meshes/part.stl").rename(tmp_path / "elsewhere/part.stl")
    path = write(VISUAL.format("package://parts/part.stl"))
    option = re.search(r"by (--package parts=)FOLDER", typed("info", path).err)[1].split()
    out, err = typed("info", path, option[0], f"{option[1]}{tmp_path}/elsewhere", "--collision")
    assert (err, "not checked" in out) == ("", False)
    mechanism = pickle.loads(pickle.dumps(cinegen.load(path, packages={"parts": tmp_path / "elsewhere"})))
    assert mechanism.visual.geometryObjects[0].meshPath == str(tmp_path / "elsewhere/part.stl")


def test_a_recording_opens_no_package_that_it_names_itself(write, tmp_path, monkeypatch):
    """`cinegen replay` has no `--package`; what the user names in the environment is read."""
    (tmp_path / "elsewhere/parts").mkdir(parents=True)
    (tmp_path / "arm_description/meshes/part.stl").rename(tmp_path / "elsewhere/parts/part.stl")
    path = write(VISUAL.format("package://parts/part.stl"))
    source = cinegen.load(path, packages={"parts": tmp_path / "elsewhere/parts"}).source
    recorded = build(*source._replace(owner=str(path.parent)))
    with pytest.warns(cinegen.CinegenWarning, match="'parts' is not found: add the folder above it to ROS_PACK"):
        _ = recorded.visual
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "elsewhere"))
    (shape,) = build(*recorded.source).visual.geometryObjects
    assert shape.meshPath == str(tmp_path / "elsewhere/parts/part.stl")


DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><created>2026-01-01</created><modified>2026-01-01</modified>{0}</asset>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="f" count="12">0 0 0 1 0 0 0 2 0 0 0 3</float_array>
      <technique_common><accessor source="#f" count="4" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
  </library_visual_scenes><scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""


def corner(shape):
    """The upper corner of a mesh's box, m."""
    shape.geometry.computeLocalAABB()
    return shape.geometry.aabb_local.max_


@pytest.mark.parametrize(("unit", "metres", "axis", "colour"), [
    ("", 1.0, "<up_axis>Y_UP</up_axis>", ""),
    ('<unit meter="1" name="m"/>', 1.0, "<up_axis>Z_UP</up_axis>", ""),
    ("<unit name='mm' meter='0.001'/>", 1e-3, "", '<material name="red"><color rgba="1 0 0 1"/></material>'),
    ("<unit name='mm' meter='0.001'/>", 1e-3, "<up_axis>Y_UP</up_axis>", ""),
])  # fmt: skip
def test_the_unit_of_collada_counts_and_its_upward_axis_does_not(write, tmp_path, unit, axis, metres, colour):
    """As in RViz: drawn, in the page, for collisions, and in RAFF and back."""
    (tmp_path / "arm_description/meshes/tip.dae").write_text(DAE.format(unit + axis))
    path = write(VISUAL.format('../meshes/tip.dae" scale="2 2 2').replace("</visual>", f"{colour}</visual>"))
    mechanism, size = cinegen.load(path), 2.0 * metres * np.array([1.0, 2.0, 3.0])
    for shapes in (mechanism.visual, mechanism.collision):
        (shape,) = shapes.geometryObjects
        np.testing.assert_allclose(corner(shape), size, rtol=1e-6)
    ((geometry, _, placed),) = _drawn(mechanism.visual.geometryObjects[0])
    np.testing.assert_allclose(geometry.vertices.max(axis=0) * np.diag(placed)[:3], size, rtol=1e-6)
    raff = tmp_path / "arm_description/arm.raff"
    raff2urdf.to_raff(path, raff, units="mm")
    (shape,) = cinegen.load(raff).visual.geometryObjects
    np.testing.assert_allclose(corner(shape), size, rtol=1e-6)


def test_raff_has_coordinates_in_its_own_unit_whatever_collada_declares(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "tip.dae").write_text(DAE.format('<unit meter="0.01"/>'))
    part = 'link 1 { type 2 pred 0 filename { "tip.dae" } }'
    (tmp_path / "tip.raff").write_text(f"RAFF tip\nunits mm\nrobot tip {{ base {{ }} {part} }}")
    (made,) = raff2urdf.convert(tmp_path / "tip.raff", tmp_path / "out")
    for path in (tmp_path / "tip.raff", made.urdf):
        shape = next(mesh for mesh in cinegen.load(path).visual.geometryObjects if mesh.meshPath.endswith(".stl"))
        np.testing.assert_allclose(corner(shape), [1e-3, 2e-3, 3e-3], rtol=1e-6)


@pytest.mark.parametrize("ending", ["glb", "ply"])
def test_what_pinocchio_does_not_read_or_browsers_is_converted(write, tmp_path, ending):
    box = trimesh.creation.box(extents=(0.1, 0.2, 0.3))
    if ending == "glb":
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 255])
        box.visual = trimesh.visual.TextureVisuals(material=material)
    box.export(tmp_path / f"arm_description/meshes/box.{ending}")
    (shape,) = cinegen.load(write(VISUAL.format(f"../meshes/box.{ending}"))).visual.geometryObjects
    assert np.allclose(corner(shape), [0.05, 0.1, 0.15], atol=1e-6)
    if ending == "glb":
        assert np.allclose(shape.meshColor, [1.0, 0.0, 0.0, 1.0])


def test_a_mesh_of_gigabytes_is_refused(write, tmp_path):
    with open(tmp_path / "arm_description/meshes/huge.stl", "wb") as file:
        file.truncate(600_000_000)  # a sparse file
    with pytest.warns(cinegen.CinegenWarning, match=r"mesh '../meshes/huge.stl' has 600 MB, and is not read"):
        _ = cinegen.load(write(VISUAL.format("../meshes/huge.stl"))).collision


def test_without_shapes_a_stick_figure_stands_in(write):
    mechanism = cinegen.load(write())
    shapes = mechanism.visual.geometryObjects
    owners = [mechanism.model.frames[shape.parentFrame].name for shape in shapes]
    assert set(owners) == {"base", "upper", "tool"}
    bars = {owner: s for owner, s in zip(owners, shapes, strict=True) if s.name.startswith("bar")}
    for node, end in (("base", [0.0, 0.0, 0.5]), ("upper", [0.4, 0.0, 0.0])):
        bar = bars[node]
        half = bar.geometry.halfLength * bar.placement.rotation[:, 2]
        assert np.allclose(bar.placement.translation + half, end, atol=1e-9)
        assert np.allclose(bar.placement.translation - half, 0.0, atol=1e-9)
    (drum,) = [s for owner, s in zip(owners, shapes, strict=True) if owner == "upper" and s.name.startswith("joint")]
    assert np.allclose(drum.placement.rotation[:, 2], [0.0, 0.6, 0.8], atol=1e-9)
    page, _ = make_page({"arm": mechanism})
    assert len(page.html()) > 1000


@pytest.mark.parametrize(("name", "count"), [("five_bar", 2), ("delta4", 3), ("gough", 6)])
def test_a_stick_figure_has_a_bar_to_each_joint_on_the_base(robot, name, count):
    """Also where they are near each other; joints on one point share a bar."""
    mechanism = robot(name)
    bars = [shape for shape in stick_figure(mechanism.model) if shape.name.startswith("bar 0 ")]
    ends = [bar.placement.translation + bar.geometry.halfLength * bar.placement.rotation[:, 2] for bar in bars]
    model = mechanism.model
    on_base = [model.jointPlacements[j].translation for j in range(1, model.njoints) if model.parents[j] == 0]
    assert len(bars) == count
    assert all(min(np.linalg.norm(end - point) for point in on_base) < 1e-9 for end in ends)


def test_a_robot_of_one_joint_has_a_plane():
    """Pinocchio returns its Jacobian as a vector."""
    mechanism = cinegen.load(robot(links("a", "b"), joint_at("j", "a", "b")))
    assert np.allclose(motion_plane(mechanism), [0.0, 0.0, 1.0])
