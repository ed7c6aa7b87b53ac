"""What is seen of a mechanism: its meshes, where they may lie, and a stick figure where there are none."""

import numpy as np
import pytest
import trimesh

import cinegen
from cinegen.cli import main
from cinegen.cockpit import make_page
from cinegen.model.motion_plane import motion_plane
from cinegen.model.stick import stick_figure

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


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("lost.stl", "mesh 'lost.stl' is not found"),
        ("../meshes/pointer.stl", "mesh '../meshes/pointer.stl' is a Git LFS pointer: run `git lfs pull` in "),
        ("../../../etc/passwd", "leads out of"),
        ("ftp://somewhere/x.stl", "'ftp://' can't be read"),
    ],
)
@pytest.mark.filterwarnings("default::cinegen.CinegenWarning")
def test_a_mesh_that_cannot_be_had_is_replaced_by_sticks_but_never_for_collisions(write, name, says, tmp_path, capsys):
    (tmp_path / "arm_description/meshes/pointer.stl").write_text("version https://git-lfs.github.com/spec/v1\n")
    path = write(VISUAL.format("../meshes/part.stl"), VISUAL.format(name) + VISUAL.format(name))
    mechanism = cinegen.load(path)
    with pytest.warns(cinegen.CinegenWarning, match=rf"^\S*arm.urdf:3: .*{says}.*; sticks are drawn instead$") as seen:
        found = mechanism.visual.geometryObjects
    assert len(seen) == 1
    assert str(seen[0].message).count(name) - says.count(name) <= 2  # each file once
    frames = mechanism.model.frames
    drawn = {(frames[shape.parentFrame].name, shape.name.partition(" ")[0]) for shape in found}
    assert drawn == {("base", "base_0"), ("upper", "bar"), ("upper", "joint")}
    with pytest.raises(cinegen.CinegenError, match=rf"arm.urdf:3: .*{says}"):
        _ = mechanism.collision
    page = tmp_path / "page.html"
    assert main(["drive", str(path), "--snapshot", str(page), "--no-browser"]) == 0
    said = capsys.readouterr().err
    assert said.count("sticks are drawn instead") == 1
    assert page.stat().st_size > 1000
    assert main(["info", str(path), "--collision"]) == 1
    assert f"{path}:3: " in capsys.readouterr().err


@pytest.mark.parametrize("ending", ["glb", "ply"])
def test_what_pinocchio_does_not_read_or_browsers_is_converted(write, tmp_path, ending):
    box = trimesh.creation.box(extents=(0.1, 0.2, 0.3))
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 255])
    if ending == "glb":
        box.visual = trimesh.visual.TextureVisuals(material=material)
    box.export(tmp_path / f"arm_description/meshes/box.{ending}")
    (shape,) = cinegen.load(write(VISUAL.format(f"../meshes/box.{ending}"))).visual.geometryObjects
    shape.geometry.computeLocalAABB()
    assert np.allclose(shape.geometry.aabb_local.max_, [0.05, 0.1, 0.15], atol=1e-6)
    if ending == "glb":
        assert np.allclose(shape.meshColor, [1.0, 0.0, 0.0, 1.0])


def test_a_mesh_of_gigabytes_is_refused(write, tmp_path):
    with open(tmp_path / "arm_description/meshes/huge.stl", "wb") as file:
        file.truncate(600_000_000)  # a sparse file
    with pytest.raises(cinegen.CinegenError, match=r"mesh '../meshes/huge.stl' has 600 MB, and is not read"):
        _ = cinegen.load(write(VISUAL.format("../meshes/huge.stl"))).collision


def test_without_shapes_a_stick_figure_stands_in(write):
    mechanism = cinegen.load(write())
    shapes = mechanism.visual.geometryObjects
    model = mechanism.model
    owners = {model.frames[shape.parentFrame].name for shape in shapes}
    assert owners == {"base", "upper", "tool"}
    bars = {model.frames[s.parentFrame].name: s for s in shapes if s.name.startswith("bar")}
    ends = {"base": [0.0, 0.0, 0.5], "upper": [0.4, 0.0, 0.0]}
    for node, end in ends.items():
        bar = bars[node]
        half = bar.geometry.halfLength * bar.placement.rotation[:, 2]
        assert np.allclose(bar.placement.translation + half, end, atol=1e-9)
        assert np.allclose(bar.placement.translation - half, 0.0, atol=1e-9)
    (drum,) = [s for s in shapes if model.frames[s.parentFrame].name == "upper" and s.name.startswith("joint")]
    assert np.allclose(drum.placement.rotation[:, 2], [0.0, 0.6, 0.8], atol=1e-9)
    page, _ = make_page({"arm": mechanism})
    assert len(page.html()) > 1000


@pytest.mark.parametrize(("name", "count"), [("five_bar", 2), ("delta4", 3), ("gough", 6)])
def test_a_stick_figure_has_a_bar_to_each_joint_on_the_base(robot, name, count):
    """Also where they are near each other; joints on one point share a bar."""
    mechanism = robot(name)
    bars = [shape for shape in stick_figure(mechanism.model).geometryObjects if shape.name.startswith("bar 0 ")]
    ends = [bar.placement.translation + bar.geometry.halfLength * bar.placement.rotation[:, 2] for bar in bars]
    model = mechanism.model
    on_base = [model.jointPlacements[j].translation for j in range(1, model.njoints) if model.parents[j] == 0]
    assert len(bars) == count
    assert all(min(np.linalg.norm(end - point) for point in on_base) < 1e-9 for end in ends)


def test_a_robot_of_one_joint_has_a_plane(tmp_path):
    """Pinocchio returns its Jacobian as a vector."""
    links = '<link name="a"/><link name="b"/>'
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>'
    (tmp_path / "one.urdf").write_text(f'<robot name="one">{links}{joint}</robot>')
    assert np.allclose(motion_plane(cinegen.load(tmp_path / "one.urdf")), [0.0, 0.0, 1.0])
