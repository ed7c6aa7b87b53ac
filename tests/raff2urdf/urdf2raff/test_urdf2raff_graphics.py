"""What a URDF shows is shown by the RAFF file that becomes of it."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from lxml import etree

import raff2urdf
from raff2urdf.conversion import convert
from raff2urdf.placement import from_origin
from raff2urdf.readers.urdf import numbers
from raff2urdf.urdf2raff.cli import main

URDF = """<robot name="arm">
  <material name="blue"><color rgba="0 0 1 1"/></material>
  <link name="base_link">{base}</link>
  <link name="upper">{upper}</link>
  <joint name="turn" type="revolute">
    <parent link="base_link"/><child link="upper"/><origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>"""

BOX = """<visual><origin xyz="0.1 0 0" rpy="0 0 0.5"/><geometry><box size="0.2 0.1 0.05"/></geometry>
  <material name="blue"/></visual>"""
MESH = '<visual><geometry><mesh filename="{0}"{1}/></geometry>{2}</visual>'
RED = '<material name="r"><color rgba="1 0 0 0.5"/></material>'


@pytest.fixture
def there(tmp_path):
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box(extents=(0.3, 0.2, 0.1)).export(tmp_path / "meshes/part.stl")
    trimesh.creation.icosphere(subdivisions=1, radius=0.1).export(tmp_path / "ball.stl")
    return tmp_path


def write(folder, base="", upper=""):
    path = folder / "arm.urdf"
    path.write_text(URDF.format(base=base, upper=upper))
    return path


def shown(urdf: Path):
    """Of each link: area, centre and colour of every surface it shows, in its own frame, m."""
    tree = etree.parse(str(urdf)).getroot()
    colours = {m.get("name"): m.find("color") for m in tree.findall("material")}
    found = {}
    for link in tree.findall("link"):
        for visual in link.findall("visual"):
            origin = visual.find("origin")
            xyz, rpy = (
                ("0 0 0", "0 0 0") if origin is None else (origin.get("xyz", "0 0 0"), origin.get("rpy", "0 0 0"))
            )
            geometry = visual.find("geometry")[0]
            if geometry.tag == "mesh":
                mesh = trimesh.load(urdf.parent / geometry.get("filename").removeprefix("file://"), force="mesh")
                mesh.apply_transform(np.diag([*numbers(geometry.get("scale", "1 1 1")), 1.0]))
            else:
                mesh = trimesh.creation.box(extents=numbers(geometry.get("size")))
            mesh.apply_transform(from_origin(numbers(xyz), numbers(rpy)))
            material = visual.find("material")
            colour = None
            if material is not None:
                named = material.find("color")
                colour = (colours[material.get("name")] if named is None else named).get("rgba")
                colour = tuple(round(255 * value) for value in numbers(colour))
            found.setdefault(link.get("name"), []).append((mesh.area, tuple(mesh.centroid), colour))
    return found


@pytest.mark.parametrize("units", ["m", "mm"])
def test_every_link_shows_what_it_showed(there, units):
    upper = BOX + MESH.format("meshes/part.stl", ' scale="2 2 -2"', RED)
    path = write(there, base=MESH.format("file://" + str(there / "ball.stl"), "", ""), upper=upper)
    raff2urdf.to_raff(path, there / "out/arm.raff", units=units)
    (made,) = convert(there / "out/arm.raff", there / "again")
    before, after = shown(path), shown(made.urdf)
    assert set(after) == {"base_link", "upper"}
    for link, surfaces in before.items():
        assert len(surfaces) == len(after[link])
        pairs = zip(sorted(surfaces), sorted(after[link]), strict=True)
        for (area, centre, colour), (area_there, centre_there, colour_there) in pairs:
            assert area_there == pytest.approx(area, rel=1e-5)
            assert centre_there == pytest.approx(centre, abs=1e-5)
            assert colour_there == colour or colour is None


def test_what_raff2urdf_draws_itself_is_drawn_again(root, tmp_path):
    """A skeleton needs no files."""
    convert(root / "robots/four_bar.raff", tmp_path)
    found = raff2urdf.to_raff(tmp_path / "four_bar.urdf", tmp_path / "four_bar.raff")
    robot = found.document.robot()
    assert all(part.filenames is None for part in (robot.base, *robot.parts))
    assert not (tmp_path / "four_bar_graphics").exists()
    (made,) = convert(tmp_path / "four_bar.raff", tmp_path / "again")
    assert made.urdf.read_bytes() == (tmp_path / "four_bar.urdf").read_bytes()


@pytest.mark.parametrize(
    ("visual", "says"),
    [
        (MESH.format("meshes/part.stl", ' scale="1 1"', ""), r'arm.urdf:3: scale="1 1" of <mesh> in link .* must be 3'),
        ('<visual><geometry><torus radius="1"/></geometry></visual>', r"arm.urdf:3: the shape <torus> is not in URDF"),
    ],
)  # fmt: skip
def test_a_shape_that_is_wrong_is_told_by_its_line(there, capsys, visual, says):
    path = write(there, base=visual, upper=BOX)
    before = set(there.rglob("*"))
    with pytest.raises(raff2urdf.RaffError, match=says):
        raff2urdf.to_raff(path, there / "out/arm.raff")
    assert set(there.rglob("*")) == before
    assert main([str(path), "-o", str(there / "out/arm.raff")]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in err
    assert "arm.urdf:3:" in err
    assert set(there.rglob("*")) == before
    if "scale" not in says:  # a URDF whose numbers are wrong is refused
        raff2urdf.to_raff(path, there / "out/arm.raff", graphics=False)  # what can be read is not lost


@pytest.mark.parametrize(("name", "says"), [
    ("lost.stl", "is not found"),
    ("pointer.stl", "is a Git LFS pointer: run `git lfs pull`"),
    ("file:///etc/passwd", "leads out of"),
    ("http://example.com/x.stl", "'http://' can't be read"),
    ("cut.stl", "can't be read: .*: export it again"),
    ("cut.dae", "can't be read: .*: export it again"),
    ("empty.stl", "can't be read: .*: export it again"),
    ("bare.obj", "can't be read: it holds no surface: export it again"),
])  # fmt: skip
def test_a_link_whose_mesh_cannot_be_had_is_drawn_as_a_skeleton(there, name, says):
    (there / "pointer.stl").write_text("version https://git-lfs.github.com/spec/v1\n")
    (there / "cut.stl").write_bytes((there / "meshes/part.stl").read_bytes()[:200])
    (there / "cut.dae").write_text('<?xml version="1.0"?><COLLADA><library_geometries>')
    (there / "empty.stl").touch()
    (there / "bare.obj").write_text("v 0 0 0\n")
    path = write(there, base=MESH.format(name, "", ""), upper=BOX + MESH.format(name, ' scale="2 2 2"', ""))
    warned = f"arm.urdf:3: .*mesh '.*{name}'.*{says}.*left out; .*skeleton"
    with pytest.warns(raff2urdf.RaffWarning, match=warned) as seen:
        found = raff2urdf.to_raff(path, there / "arm.raff")
    assert len(seen) == 1
    robot = found.document.robot()
    files = {part.node: part.filenames for part in (robot.base, *robot.parts)}
    assert files["base_link"] is None
    assert files["upper"] == ("arm_graphics/upper.glb",)
    (made,) = convert(there / "arm.raff", there / "again")
    drawn = {link.get("name"): link.findall("visual/geometry/*") for link in etree.parse(made.urdf).iter("link")}
    assert {shape.tag for shape in drawn["base"]} >= {"mesh", "cylinder"}  # the tube to the joint, and its hinge
    assert [shape.tag for shape in drawn["upper"]] == ["mesh"]


def test_a_mesh_that_the_raff_file_may_not_name_is_copied(there):
    """So that the file can be read where it is written."""
    path = write(there, base=MESH.format("meshes/part.stl", "", ""))
    found = raff2urdf.to_raff(path, there / "far/away/arm.raff")
    files = [part.filenames for part in (found.document.robot().base, *found.document.robot().parts)]
    assert ("arm_graphics/base_link.glb",) in files
    (made,) = convert(there / "far/away/arm.raff", there / "again")
    assert shown(made.urdf)["base_link"][0][0] == pytest.approx(shown(path)["base_link"][0][0], rel=1e-5)
