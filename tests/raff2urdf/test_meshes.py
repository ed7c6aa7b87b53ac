"""Graphics that are converted: each colour becomes an STL file that other programs read, in its place and size."""

import stat
import warnings
import zipfile
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
import trimesh
import yourdfpy
from lxml import etree
from test_graphic_files import CUBE

import cinegen
import raff2urdf
from raff2urdf import RaffError, RaffWarning
from raff2urdf.graphics import scene as scene_file
from raff2urdf.graphics.meshes import CONVERTED, keep

RED_NFF = "nff\nplate\n4\n0 0 0\n100 0 0\n100 50 0\n0 50 0\n1\n4 0 1 2 3 0xf00\n"


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's cache, empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "raff2urdf"


@pytest.fixture
def workshop(tmp_path: Path) -> Path:
    """A folder with graphics in its `parts`."""
    parts = tmp_path / "parts"
    parts.mkdir()
    (parts / "red.nff").write_text(RED_NFF)
    (parts / "cube.nff").write_text(CUBE)
    drawing = ezdxf.new("R2010")
    drawing.modelspace().add_3dface([(0, 0, 0), (10, 0, 0), (10, 10, 0)], dxfattribs={"color": 5})
    drawing.saveas(parts / "face.dxf")
    trimesh.creation.box((100.0, 50.0, 20.0)).export(parts / "bar.stl")
    (parts / "broken.nff").write_text(RED_NFF.replace("0 1 2 3", "0 1 2 9"))
    return tmp_path


def write(folder: Path, robot: str, units: str = "mm") -> Path:
    """A RAFF file whose robot's graphics lie in `parts`."""
    (folder / "arm.raff").write_text(f'RAFF arm\nunits {units}\nrobot arm {{ path "parts" {robot} }}')
    return folder / "arm.raff"


def convert(folder: Path, robot: str, units: str = "mm") -> tuple[Any, list[str]]:
    """The URDF that stands in `generated`, and what was warned of."""
    with warnings.catch_warnings(record=True, action="always") as caught:
        (made,) = raff2urdf.convert(write(folder, robot, units), folder / "generated")
    assert all(warning.category is RaffWarning for warning in caught)
    return etree.parse(made.urdf).getroot(), [str(warning.message) for warning in caught]


def named(xml: Any, link: str) -> list[tuple[str, str | None]]:
    """The meshes of a link and their colours."""
    meshes = []
    for visual in xml.findall(f"link[@name='{link}']/visual"):
        colour = visual.find("material/color")
        meshes.append((visual.find("geometry/mesh").get("filename"), None if colour is None else colour.get("rgba")))
    return meshes


def files_in(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


RED, BLUE = "1.0 0.0 0.0 1.0", "0.0 0.0 1.0 1.0"


# --- beside a URDF -----------------------------------------------------------------------------------------------


def test_each_colour_is_an_stl_of_its_own_beside_the_urdf(workshop: Path) -> None:
    xml, warned = convert(workshop, 'base { filename { "cube.nff" } }')
    assert warned == []
    meshes = named(xml, "base")
    assert [name for name, _ in meshes] == [f"meshes/arm/cube.nff.{i}.stl" for i in range(1, 7)]
    assert [colour for _, colour in meshes][:3] == [RED, "0.0 1.0 0.0 1.0", BLUE]
    names = [material.get("name") for material in xml.iter("material")]
    assert names == ["rgbff0000", "rgb00ff00", "rgb0000ff", "rgbffff00", "rgbffffff", "rgb123456"]
    areas = [trimesh.load(workshop / "generated" / name).area for name, _ in meshes]
    assert areas == pytest.approx([4.0, 4.0, 8.0, 8.0, 4.0, 4.0])
    assert set(files_in(workshop / "generated")) == {"arm.urdf", "arm.constraints.json", *(n for n, _ in meshes)}


@pytest.mark.parametrize(("units", "metres"), [("mm", 0.001), ("m", 1.0)])
def test_a_mesh_has_the_size_that_the_units_say(workshop: Path, units: str, metres: float) -> None:
    """In another's reader: the plate is 100 x 50 units, and the bar 20 thick."""
    for files, thick in (('"red.nff"', 0), ('"red.nff" "bar.stl"', 20)):
        convert(workshop, f"base {{ filename {{ {files} }} }}", units)
        model = yourdfpy.URDF.load(str(workshop / "generated" / "arm.urdf"))
        widths = [150, 75, 20] if thick else [100, 50, 0]
        assert model.scene.extents == pytest.approx(np.array(widths) * metres)


def test_base_links_and_frames_show_all_their_files_that_can_be_shown(workshop: Path) -> None:
    several = 'filename { "red.nff" "gone.nff" "face.dxf" } filename { "broken.nff" "bar.stl" }'
    parts = f"base {{ {several} }} link 1 {{ type 2 pred 0 {several} }} frame 2 {{ pred 1 {several} }}"
    xml, (warned,) = convert(workshop, parts)
    shown = [("meshes/arm/red.nff.1.stl", RED), ("meshes/arm/face.dxf.1.stl", BLUE), ("../parts/bar.stl", None)]
    for node in ("base", "link1", "frame2"):
        assert named(xml, node) == shown
        reason = "broken.nff (line 9: '9' is not a vertex of this object (0 to 3))"
        assert f"{node}: gone.nff (not found), {reason}" in warned


def test_files_of_one_name_are_kept_apart(workshop: Path) -> None:
    (workshop / "parts" / "other").mkdir()
    (workshop / "parts" / "other" / "RED.NFF").write_text(RED_NFF.replace("0xf00", "0x00f"))
    (workshop / "parts" / "other" / "a b;é.nff").write_text(RED_NFF)
    xml, warned = convert(workshop, 'base { filename { "red.nff" "other/RED.NFF" "other/a b;é.nff" } }')
    assert warned == []
    names = [("red.nff.1.stl", RED), ("RED.NFF-2.1.stl", BLUE), ("a_b_é.nff.1.stl", RED)]
    assert named(xml, "base") == [(f"meshes/arm/{name}", colour) for name, colour in names]


# --- other formats -----------------------------------------------------------------------------------------------


def scene() -> trimesh.Scene:
    """An orange box, and a grey one of 2 x 2 x 2 beside it at x = 5."""
    orange = trimesh.creation.box((1.0, 1.0, 1.0))
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 128, 0, 255])
    orange.visual = trimesh.visual.TextureVisuals(material=material)
    grey = trimesh.creation.box((1.0, 1.0, 1.0))
    grey.visual.face_colors = [100, 100, 100, 255]
    place = np.diag([2.0, 2.0, 2.0, 1.0])
    place[0, 3] = 5.0
    made = trimesh.Scene()
    made.add_geometry(orange)
    made.add_geometry(grey, transform=place)
    return made


def export(folder: Path, kind: str) -> None:
    if kind == ".gltf":
        for name, content in scene().export(file_type="gltf").items():
            (folder / ("part.gltf" if name.endswith(".gltf") else name)).write_bytes(content)
    elif kind in (".ply", ".off"):  # these hold one mesh
        scene().to_geometry().export(folder / f"part{kind}")
    else:
        scene().export(folder / f"part{kind}")


@pytest.mark.parametrize("kind", CONVERTED[2:])
def test_scenes_are_converted_with_everything_in_its_place(workshop: Path, kind: str) -> None:
    export(workshop / "parts", kind)
    xml, warned = convert(workshop, f'base {{ filename {{ "part{kind}" }} }}')
    assert warned == []
    bounds = yourdfpy.URDF.load(str(workshop / "generated" / "arm.urdf")).scene.bounds * 1000.0
    assert bounds == pytest.approx(np.array([[-0.5, -1.0, -1.0], [6.0, 1.0, 1.0]]))
    if kind in (".glb", ".gltf"):
        colours = {colour: trimesh.load(workshop / "generated" / name).area for name, colour in named(xml, "base")}
        expected = {"1.0 0.502 0.0 1.0": 6.0, "0.3922 0.3922 0.3922 1.0": 24.0}
        assert colours == {colour: pytest.approx(area) for colour, area in expected.items()}


# --- what can't be shown -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "content", "reason"), [
    ("a.nff", b"nff\na\n0\n0\n", "holds no surface"),
    ("a.glb", b"glTF\x02\x00\x00\x00\xff\xff\xff\xff", "unreadable: "),
    ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1000000000000\nend_header\n", ""),
    ("a.off", b"OFF\n1000000000000 1000000000000 0\n", ""),
    ("a.off", b"OFF\n3 1 0\n0 0 0\n1e300 0 0\n0 1 0\n3 0 1 2\n", "a coordinate is not a number up to 1e+37"),
    ("a.blend", b"", ".blend: only .stl, .obj, .dae, .nff, .dxf, "),
    ("bare", b"", "no extension"),
    ("a.stl", b"this is no mesh", ""),
    ("a.stl", b"", ""),
    ("a.obj", b"# nothing\n", ""),
    ("~no-such-user/bar.stl", None, ""),
    (300 * "x" + ".stl", None, ""),
])  # fmt: skip
def test_what_cannot_be_shown_is_warned_of_once_and_replaced_by_the_skeleton(workshop: Path, name, content, reason):
    if content is not None:
        (workshop / "parts" / name).write_bytes(content)
    xml, (warned,) = convert(workshop, f'link 1 {{ type 2 pred 0 filename {{ "{name}" }} }}')
    assert f"link1: {name} ({reason}" in warned
    assert len(warned) < 900
    assert "\n" not in warned
    shown = xml.findall("link[@name='link1']/visual")
    assert shown
    assert not any(visual.findall("geometry/mesh") for visual in shown)
    assert not (workshop / "generated" / "meshes").exists()


# --- all or nothing ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("taken", ["meshes", "meshes/arm", "meshes/arm/red.nff.1.stl", "arm.constraints.json"])
def test_where_one_file_cannot_be_written_none_is(workshop: Path, taken: str) -> None:
    """A file stands where a folder should, or a folder where a file should."""
    place = workshop / "generated" / taken
    if "." in taken:
        place.mkdir(parents=True)
    else:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(b"mine")
    before = sorted(workshop.rglob("*"))
    raff = write(workshop, 'base { filename { "red.nff" } }')
    with pytest.raises(RaffError, match=r"generated/\S+: can't be written: "):
        raff2urdf.convert(raff, workshop / "generated")
    assert sorted(workshop.rglob("*")) == sorted([*before, raff])


# --- in the user's cache -----------------------------------------------------------------------------------------


def test_cinegen_shows_the_same_meshes_without_a_folder_of_outputs(workshop: Path, cache: Path) -> None:
    mechanism = cinegen.load(write(workshop, 'base { filename { "cube.nff" } }'))
    shapes = mechanism.visual.geometryObjects
    assert [shape.meshColor.tolist() for shape in shapes][:3] == [[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]]
    assert {Path(shape.meshPath).parent for shape in shapes} == {cache}
    convert(workshop, 'base { filename { "cube.nff" } }')
    beside = {path.read_bytes() for path in (workshop / "generated").rglob("*.stl")}
    assert {Path(shape.meshPath).read_bytes() for shape in shapes} == beside
    assert sorted(path.name for path in (workshop).iterdir()) == ["arm.raff", "cache", "generated", "parts"]


def test_a_damaged_mesh_of_the_cache_is_mended(cache: Path) -> None:
    path = keep(b"some bytes", ".stl")
    for damaged in (b"", b"some bytez", b"some"):
        path.write_bytes(damaged)
        assert keep(b"some bytes", ".stl") == path
        assert path.read_bytes() == b"some bytes"


def test_where_the_cache_cannot_be_written_a_temporary_folder_will_do(workshop: Path, tmp_path: Path) -> None:
    (tmp_path / "cache").write_bytes(b"no folder")
    path = keep(b"some bytes", ".stl")
    assert tmp_path / "cache" not in path.parents
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    assert keep(b"some bytes", ".stl") == path
    assert cinegen.load(write(workshop, 'base { filename { "red.nff" } }')).visual.ngeoms == 1


def test_an_archive_that_unpacks_to_more_than_is_allowed_is_not_read(workshop: Path, monkeypatch) -> None:
    assert scene_file.LARGEST_MESH == 512_000_000
    monkeypatch.setattr(scene_file, "LARGEST_MESH", 5_000_000)
    with zipfile.ZipFile(workshop / "parts" / "bomb.3mf", "w", zipfile.ZIP_DEFLATED) as archive:
        for i in range(2):
            archive.writestr(f"3D/{i}.model", bytes(3_000_000))
    (warning,) = convert(workshop, 'base { filename { "bomb.3mf" } }')[1]
    assert "bomb.3mf (holds 6 MB when unpacked: the most is 5 MB)" in warning


@pytest.mark.parametrize(("name", "content"), [
    ("cut.dxf", "  0\nSECTION\n  2\nENTITIES\n  0\nENDSEC\n  0\nLINE\n  8\n0\n  0\nEOF\n"),
    ("cut.stl", "solid x\nfacet normal 0 0 --1\nouter loop\nvertex 0 0 0\nendsolid\n"),
])  # fmt: skip
def test_libraries_log_nothing_about_damaged_files(workshop: Path, name: str, content: str, capfd) -> None:
    (workshop / "parts" / name).write_text(content)
    convert(workshop, f'base {{ filename {{ "{name}" }} }}')
    assert capfd.readouterr() == ("", "")
