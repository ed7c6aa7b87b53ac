"""Polygons become triangles of the same area, on the same side; colours stay few; STL is read by others."""

import io
import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import ezdxf
import numpy as np
import pytest
import trimesh
from ezdxf.colors import aci2rgb
from ezdxf.document import Drawing
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mechanisms import turn

from raff2urdf import RaffError
from raff2urdf.graphics import dxf, nff
from raff2urdf.graphics.surface import LARGEST, MOST_CORNERS, Polygons, area, fewer_colours, stl

COLOURS = st.tuples(*[st.integers(0, 255)] * 4)


@st.composite
def outlines(draw: st.DrawFn, most: int = 14) -> list[tuple[float, float]]:
    """A polygon of any shape about the origin, counter-clockwise: its corners see the origin in order of angle."""
    count = draw(st.integers(3, most))
    radii = draw(st.lists(st.floats(0.1, 10.0), min_size=count, max_size=count))
    return [(r * math.cos(math.tau * i / count), r * math.sin(math.tau * i / count)) for i, r in enumerate(radii)]


@st.composite
def rotations(draw: st.DrawFn) -> np.ndarray:
    a, b, c = draw(st.tuples(*[st.floats(-3.2, 3.2)] * 3))
    return (turn("z", a) @ turn("x", b) @ turn("z", c))[:3, :3]


def shoelace(outline: list[tuple[float, float]]) -> float:
    """Twice the area, by Meister's and Gauss' formula, halved."""
    ahead = [*outline[1:], outline[0]]
    return sum(x * b - a * y for (x, y), (a, b) in zip(outline, ahead, strict=True)) / 2.0


def cut(corners: np.ndarray, both: bool = False) -> np.ndarray:
    polygons = Polygons()
    polygons.add(corners.tolist(), None, both)
    (surface,) = polygons.surfaces()
    return surface.triangles


# --- triangles ---------------------------------------------------------------------------------------------------


@given(outlines(), rotations(), st.tuples(*[st.floats(-20.0, 20.0)] * 3))
@settings(max_examples=200)
def test_triangles_have_the_area_of_their_polygon_and_face_where_it_does(outline, rotation, offset) -> None:
    """All of them the same way: overlapping ones that cancel out would show in the sum of their sizes. What is seen
    from both sides faces both."""
    plane = np.column_stack([np.array(outline), np.zeros(len(outline))])
    expected = shoelace(outline)
    for sides, normal in ((1, rotation[:, 2]), (2, np.zeros(3))):
        wide = cut(plane @ rotation.T + offset, both=sides == 2).astype(float)
        vectors = np.cross(wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0]) / 2.0
        assert vectors.sum(axis=0) == pytest.approx(expected * normal, abs=1e-3)
        assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(sides * expected, rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("corners", [
    [(i, i, i) for i in range(3)],
    [(i, 0, 0) for i in range(5)],
    [(5, 5, 5)] * 7,
    [(1e-46, 0, 0), (0, 1e-46, 0), (0, 0, 0)],
])  # fmt: skip
def test_what_has_no_area_is_left_out(corners: list[tuple[float, float, float]]) -> None:
    polygons = Polygons()
    polygons.add(corners, (1, 2, 3, 255))
    assert polygons.surfaces() == []


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 1.01 * LARGEST, 1e300])
@pytest.mark.parametrize("count", [3, 4, 6])
def test_what_is_no_number_for_stl_is_refused(number: float, count: int) -> None:
    polygons = Polygons()
    polygons.add([(0.0, 0.0, float(i * i)) for i in range(count - 1)] + [(0.0, 1.0, number)], None)
    with pytest.raises(RaffError, match="not a number up to 1e\\+37"):
        polygons.surfaces()


def test_a_polygon_of_too_many_corners_is_refused() -> None:
    circle = [(math.cos(i), math.sin(i), 0.0) for i in np.linspace(0.0, 6.0, MOST_CORNERS)]
    polygons = Polygons()
    polygons.add(circle, None)
    assert len(polygons.surfaces()[0].triangles) == MOST_CORNERS - 2
    with pytest.raises(RaffError, match="1001 corners"):
        polygons.add([*circle, (0.0, 0.0, 0.0)], None)


# --- colours -----------------------------------------------------------------------------------------------------


@given(st.lists(st.tuples(outlines(6), st.none() | COLOURS), min_size=1, max_size=60))
@settings(max_examples=60)
def test_colours_become_few_and_no_area_is_lost(parts: list[tuple[list[tuple[float, float]], None]]) -> None:
    polygons = Polygons()
    for outline, colour in parts:
        polygons.add([(x, y, 0.0) for x, y in outline], colour)
    surfaces = polygons.surfaces()
    assert len(surfaces) == len({colour for _, colour in parts})
    for most in (17, 32):
        few = fewer_colours(surfaces, most)
        assert len(few) <= most
        before, after = (sum(area(surface.triangles) for surface in some) for some in (surfaces, few))
        assert after == pytest.approx(before)
        assert (None in {surface.colour for surface in few}) == (None in {colour for _, colour in parts})
        if len(surfaces) <= most:
            assert [surface.colour for surface in few] == [surface.colour for surface in surfaces]


# --- STL ---------------------------------------------------------------------------------------------------------


@given(outlines(), st.sampled_from([1e-15, 1.0, 1e30]))
@settings(max_examples=40)
def test_stl_is_read_back_by_another_reader(outline: list[tuple[float, float]], size: float) -> None:
    triangles = cut(size * np.column_stack([np.array(outline), np.zeros(len(outline))]))
    content = stl(triangles)
    assert content == stl(triangles.copy())
    assert len(content) == 84 + 50 * len(triangles)
    assert not content.startswith(b"solid")
    facets = np.frombuffer(content[84:], np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("end", "<u2")]))
    assert np.array_equal(facets["corners"], triangles)
    assert facets["normal"] == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(triangles), 1)), abs=1e-6)
    assume(size == 1.0)  # trimesh joins corners nearer than 1e-8
    read = trimesh.load(io.BytesIO(content), file_type="stl")
    assert read.area == pytest.approx(area(triangles), rel=1e-4)


# --- nff --------------------------------------------------------------------------------------------------------------
# The Neutral File Format of WorldToolKit: what is written is read back, and what is wrong is said with its line.


CUBE = """\
nff
version 2.1
viewpos 0.0 0.0 -5.0
viewdir 0 0 1

cube                    // the name of the object
8                       // its vertices
0 0 0   norm 0 0 1  uv 0 1
2 0 0   uv 0.5 0.5  0xff0000
2 2 0   0xff0000 norm 1 0 0
0 2 0

0 0 2
2 0 2
2 2 2
0 2 2
6
4 3 2 1 0 0xf00
4 4 5 6 7 0x00ff00 _V_brick
4 0 1 5 4 0x00f both
4 1 2 6 5 0xff0 both _T_wood rot 0.5 scale 2 2 id=4
4 2 3 7 6 0xfff -hall
4 3 0 4 7 0x123456 matid 3
"""


def nff_areas(text: str) -> dict[Any, float]:
    """The area of each colour."""
    return {surface.colour: area(surface.triangles) for surface in nff.loads(text)}


def wrong_nff(text: str) -> str:
    with pytest.raises(RaffError) as error:
        nff.loads(text, "part.nff")
    return str(error.value)


def test_a_cube_has_six_faces_of_its_colours() -> None:
    one_side = dict.fromkeys([(255, 0, 0, 255), (0, 255, 0, 255), WHITE, (0x12, 0x34, 0x56, 255)], 4.0)
    both_sides = dict.fromkeys([(0, 0, 255, 255), (255, 255, 0, 255)], 8.0)
    assert nff_areas(CUBE) == one_side | both_sides


def test_it_is_read_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "cube.nff").write_bytes(b"\xef\xbb\xbf" + CUBE.replace("cube ", "w\xfcrfel ").encode("latin-1"))
    assert len(nff.read(tmp_path / "cube.nff")) == 6
    with pytest.raises(RaffError, match=r"gone\.nff: can't be read: No such file"):
        nff.read(tmp_path / "gone.nff")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_any_end_of_line_any_space_and_comments_will_do(end: str) -> None:
    text = "// one more\n\n" + CUBE.replace(" ", "\t  ").replace("\n", " // said\n//\n \n") + "\n"
    assert nff_areas(text.replace("\n", end)) == nff_areas(CUBE)


def test_the_version_may_be_left_out_and_unknown_lines_of_the_head_too() -> None:
    head, body = CUBE.split("\n\n", 1)
    assert nff_areas(f"NFF\n{body}") == nff_areas(CUBE)
    assert nff_areas(f"{head}\nlight 0 0 1 0.5\nambient 0.3\n{body}") == nff_areas(CUBE)


@pytest.mark.parametrize(("vertices", "colour"), [
    (("0x00ff00", "0x00ff00", "0x00ff00"), (0, 255, 0, 255)),  # as WorldToolKit has it: they count more
    (("0x00ff00", "0x00ff00", "0x0000ff"), (255, 0, 0, 255)),  # shaded: one colour can't say it
    (("0x00ff00", "", ""), (255, 0, 0, 255)),
])  # fmt: skip
def test_a_colour_that_all_corners_share_is_the_polygons(vertices: tuple[str, ...], colour: tuple[int, ...]) -> None:
    a, b, c = vertices
    assert list(nff_areas(f"nff\na\n3\n0 0 0 {a}\n1 0 0 {b}\n0 1 0 {c}\n1\n3 0 1 2 0xf00\n")) == [colour]


# --- written and read back ---------------------------------------------------------------------------------------

HEX = st.integers(0, 0xFFFFFF)


@given(st.lists(st.lists(st.tuples(outlines(), HEX, st.booleans()), max_size=4), min_size=1, max_size=3))
@settings(max_examples=80)
def test_random_polygons_are_read_back(objects: list[list[tuple[list[tuple[float, float]], int, bool]]]) -> None:
    """Each object's polygons lie over each other, in planes of their own; area, colours and vertices are kept."""
    lines, areas, points = ["nff", "version 2.1"], {}, set()
    for number, polygons in enumerate(objects):
        vertices, faces = [], []
        for z, (outline, colour, both) in enumerate(polygons):
            at = range(len(vertices), len(vertices) + len(outline))
            vertices += [(x, y, float(z)) for x, y in outline]
            faces.append(f"{len(outline)} {' '.join(map(str, at))} 0x{colour:06x}{' both' if both else ''}")
            key = (colour >> 16, colour >> 8 & 255, colour & 255, 255)
            areas[key] = areas.get(key, 0.0) + shoelace(outline) * (1 + both)
        points |= {tuple(np.float32(vertex)) for vertex in vertices}
        lines += [f"object{number}", str(len(vertices)), *[" ".join(map(repr, v)) for v in vertices]]
        lines += [str(len(faces)), *faces]
    surfaces = nff.loads("\n".join(lines))
    assert {surface.colour: area(surface.triangles) for surface in surfaces} == pytest.approx(areas, rel=1e-4)
    assert {tuple(point) for surface in surfaces for point in surface.triangles.reshape(-1, 3)} == points


# --- what is wrong -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("line", range(2, len(CUBE.splitlines())))
def test_an_nff_that_ends_too_early_is_refused(line: int) -> None:
    """Behind any line but those of the head, which alone are no object."""
    said = wrong_nff("\n".join(CUBE.splitlines()[:line]))
    assert said.startswith("part.nff:")
    assert int(said.split(":")[1]) <= line


@pytest.mark.parametrize(("old", "new", "place", "reason"), [
    ("8     ", "1000000000000", 7, "1000000000000 vertices should follow, but 15 lines do"),
    ("8     ", "mtable mine\n8 8", 8, "the number of vertices of 'cube' must be alone on a line"),
    ("\n6\n", "\n1000000000000\n", 17, "1000000000000 polygons should follow, but 6 lines do"),
    ("2 0 2", "2 0", 14, "a vertex needs three coordinates"),
    ("2 0 2", "2 zero 2", 14, "'zero' is not a number"),
    ("2 0 2", "2 0 1e300", 14, "'1e300' is not a number up to 1e+37"),
    ("2 0 2", "2 0 \u0663", 14, "'\u0663' is not a number"),
    ("norm 0 0 1", "norm 0 0", 8, "'uv' is not a number"),
    ("uv 0 1", "uv 0", 8, "'uv' needs 2 numbers"),
    ("4 3 2 1 0 0xf00", "4 3 2 1 8 0xf00", 18, "'8' is not a vertex of this object (0 to 7)"),
    ("4 3 2 1 0 0xf00", "4 3 2 1", 18, "a polygon of 4 corners lists 3"),
    ("4 3 2 1 0 0xf00", "999999999 3 2 1 0 0xf00", 18, "999999999 corners: at most 1000 are allowed"),
])  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(old: str, new: str, place: int, reason: str) -> None:
    assert old in CUBE
    said = wrong_nff(CUBE.replace(old, new, 1))
    assert said.startswith(f"part.nff:{place}:")
    assert reason in said
    assert len(said) < 500


# --- dxf --------------------------------------------------------------------------------------------------------------
# DXF files, made by ezdxf: which faces are drawn, where, and in which colour.


SQUARE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
CROSSWISE = [SQUARE[0], SQUARE[1], SQUARE[3], SQUARE[2]]  # as solids and traces store them
RED, YELLOW, GREEN, BLUE = ((*aci2rgb(index), 255) for index in (1, 2, 3, 5))
WHITE = (255, 255, 255, 255)


@pytest.fixture
def drawing() -> Drawing:
    return ezdxf.new("R2010")


def read(drawing: Drawing) -> Any:
    """Its surfaces, and what is left out: written and read back."""
    with TemporaryDirectory() as folder:
        drawing.saveas(Path(folder) / "part.dxf")
        return dxf.read(Path(folder) / "part.dxf")


def areas(drawing: Drawing) -> dict[Any, float]:
    surfaces, lacking = read(drawing)
    assert lacking is None
    return {surface.colour: pytest.approx(area(surface.triangles), rel=1e-6) for surface in surfaces}


def points(drawing: Drawing) -> set[tuple[float, ...]]:
    return {tuple(np.round(point, 4).tolist()) for mesh in read(drawing)[0] for point in mesh.triangles.reshape(-1, 3)}


def volume(drawing: Drawing) -> float:
    """Inside a closed surface; negative if it is turned inside out."""
    triangles = np.concatenate([surface.triangles for surface in read(drawing)[0]]).astype(float)
    return float(np.linalg.det(triangles).sum() / 6.0)


def box(size: float = 1.0) -> tuple[list[tuple[float, ...]], list[tuple[int, ...]]]:
    """Corners and faces, counter-clockwise as seen from outside."""
    corners = [(size * x, size * y, size * z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    sides = [(i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i) for i in range(4)]
    return corners, [(3, 2, 1, 0), (4, 5, 6, 7), *sides]


def add_box(layout: Any, size: float = 1.0, **attributes: Any) -> None:
    mesh = layout.add_mesh(dxfattribs=attributes)
    with mesh.edit_data() as data:
        data.vertices, data.faces = box(size)


# --- faces -------------------------------------------------------------------------------------------------------


def test_faces_of_three_corners_or_four_solids_and_traces_are_faces(drawing: Drawing) -> None:
    drawing.modelspace().add_solid(CROSSWISE, dxfattribs={"color": 1})
    drawing.modelspace().add_trace(CROSSWISE, dxfattribs={"color": 2})
    drawing.modelspace().add_3dface(SQUARE[:3], dxfattribs={"color": 3})
    drawing.modelspace().add_3dface(SQUARE, dxfattribs={"color": 5})
    assert areas(drawing) == {RED: 1.0, YELLOW: 1.0, GREEN: 0.5, BLUE: 1.0}


def test_a_polyface_mesh_has_faces_of_their_own_colours(drawing: Drawing) -> None:
    corners, faces = box()
    mesh = drawing.modelspace().add_polyface(dxfattribs={"color": 5})
    mesh.append_faces([[corners[i] for i in face] for face in faces])
    next(vertex for vertex in mesh.vertices if vertex.is_face_record).dxf.color = 1
    assert areas(drawing) == {RED: 1.0, BLUE: 5.0}
    assert volume(drawing) == pytest.approx(1.0)


# --- colours -----------------------------------------------------------------------------------------------------


def test_colours_are_of_the_index_true_or_the_layers(drawing: Drawing) -> None:
    drawing.layers.add("green", color=3)
    drawing.layers.add("true", color=3, true_color=0x112233)
    space = drawing.modelspace()
    space.add_3dface(SQUARE, dxfattribs={"color": 1, "layer": "green"})
    space.add_3dface(SQUARE, dxfattribs={"color": 1, "true_color": 0x405060})
    space.add_3dface(SQUARE, dxfattribs={"layer": "green"})
    space.add_3dface(SQUARE, dxfattribs={"layer": "true"})
    space.add_3dface(SQUARE, dxfattribs={"layer": "said nowhere"})
    space.add_3dface(SQUARE, dxfattribs={"color": 5, "transparency": ezdxf.colors.float2transparency(0.5)})
    by_colour = areas(drawing)
    (glass,) = [colour for colour in by_colour if colour[3] < 255]
    assert glass[:3] == BLUE[:3]
    assert glass[3] == pytest.approx(127, abs=2)
    expected = {RED, (0x40, 0x50, 0x60, 255), GREEN, (0x11, 0x22, 0x33, 255), WHITE, glass}
    assert set(by_colour) == expected


def test_what_stands_in_a_block_may_have_the_blocks_colour_and_layer(drawing: Drawing) -> None:
    drawing.layers.add("green", color=3)
    drawing.layers.add("blue", color=5)
    block = drawing.blocks.new("part")
    block.add_3dface(SQUARE, dxfattribs={"color": ezdxf.colors.BYBLOCK})
    block.add_3dface([(2 * x, y, z) for x, y, z in SQUARE])  # by layer, on layer 0: the layer of the INSERT
    block.add_3dface([(3 * x, y, z) for x, y, z in SQUARE], dxfattribs={"layer": "blue"})
    drawing.modelspace().add_blockref("part", (0, 0), dxfattribs={"color": 1, "layer": "green"})
    outer = drawing.blocks.new("outer")  # at 20: the same through a block in a block
    outer.add_blockref("part", (0, 0), dxfattribs={"color": ezdxf.colors.BYBLOCK})
    drawing.modelspace().add_blockref("outer", (20, 0), dxfattribs={"color": 2, "layer": "green"})
    assert areas(drawing) == {RED: 1.0, YELLOW: 1.0, GREEN: 4.0, BLUE: 6.0}


def test_what_is_hidden_stays_hidden(drawing: Drawing) -> None:
    drawing.layers.add("off", color=3).off()
    drawing.layers.add("frozen", color=3).freeze()
    drawing.blocks.new("part").add_3dface(SQUARE, dxfattribs={"color": 2})
    space = drawing.modelspace()
    space.add_3dface(SQUARE, dxfattribs={"color": 1})
    for layer in ("off", "frozen"):
        space.add_3dface(SQUARE, dxfattribs={"layer": layer})
        space.add_blockref("part", (0, 0), dxfattribs={"layer": layer})
    space.add_3dface(SQUARE, dxfattribs={"color": 2, "invisible": 1})
    drawing.layout("Layout1").add_3dface(SQUARE, dxfattribs={"color": 2})
    assert areas(drawing) == {RED: 1.0}


# --- blocks ------------------------------------------------------------------------------------------------------


def test_a_block_is_placed_scaled_and_turned(drawing: Drawing) -> None:
    drawing.blocks.new("part", base_point=(1, 0, 0)).add_3dface(SQUARE)
    attributes = {"xscale": 2.0, "yscale": 3.0, "zscale": 4.0, "rotation": 90.0}
    drawing.modelspace().add_blockref("part", (10, 20, 30), dxfattribs=attributes)
    placed = {(10, 18, 30), (10, 20, 30), (7, 18, 30), (7, 20, 30)}
    assert points(drawing) == placed
    drawing.blocks.new("inner").add_3dface(SQUARE[:3])
    drawing.blocks.new("outer").add_blockref("inner", (1, 0), dxfattribs={"rotation": 90.0})
    drawing.modelspace().add_blockref("outer", (0, 0, 5), dxfattribs={"xscale": 2.0})
    assert points(drawing) == placed | {(2, 0, 5), (2, 1, 5), (0, 1, 5)}


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -1, -1), (1, 1, -2)])
def test_a_mirrored_block_is_not_turned_inside_out(drawing: Drawing, scale: tuple[int, ...]) -> None:
    add_box(drawing.blocks.new("part"))
    attributes = dict(zip(("xscale", "yscale", "zscale"), scale, strict=True))
    drawing.modelspace().add_blockref("part", (3, 4, 5), dxfattribs=attributes)
    assert volume(drawing) == pytest.approx(abs(math.prod(scale)), rel=1e-5)


def test_an_entity_lies_in_its_own_plane(drawing: Drawing) -> None:
    """AutoCAD's arbitrary axis: a solid whose extrusion is along -y has its x along the drawing's x."""
    drawing.modelspace().add_solid(CROSSWISE, dxfattribs={"extrusion": (0, -1, 0)})
    assert points(drawing) == {(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)}


# --- what is wrong -----------------------------------------------------------------------------------------------


def wrong(path: Path) -> str:
    with pytest.raises(RaffError) as error:
        dxf.read(path)
    (problem,) = error.value.problems
    assert problem.source == str(path)
    return problem.message


def refused(tmp_path: Path, drawing: Drawing) -> str:
    drawing.saveas(tmp_path / "part.dxf")
    return wrong(tmp_path / "part.dxf")


def test_a_drawing_of_lines_has_no_surface(drawing: Drawing, tmp_path: Path) -> None:
    space = drawing.modelspace()
    space.add_line((0, 0), (1, 0))
    space.add_line((0, 0), (1, 1))
    space.add_circle((0, 0), 1.0)
    assert refused(tmp_path, drawing) == "holds no faces or meshes, only 1 CIRCLE, 2 LINE"
    assert refused(tmp_path, ezdxf.new()) == "holds no faces or meshes, nothing visible"


def test_solids_are_said_to_be_left_out(drawing: Drawing) -> None:
    drawing.modelspace().add_3dsolid().sat = ["400 0 1 0 ", "End-of-ACIS-data "]
    drawing.modelspace().add_3dface(SQUARE)
    drawing.modelspace().add_line((0, 0), (1, 0))
    surfaces, lacking = read(drawing)
    assert len(surfaces) == 1
    assert lacking == "without its 1 3DSOLID: solids can't be read"


@pytest.mark.parametrize("content", [b"", b"0\nEOF\n", b"\x00\x01\x02"])
def test_what_is_no_dxf_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "part.dxf").write_bytes(content)
    assert wrong(tmp_path / "part.dxf") == "this is no DXF file"


@pytest.mark.parametrize("part", [0.1, 0.8, 0.999])
def test_a_file_that_ends_too_early_is_refused(drawing: Drawing, tmp_path: Path, part: float) -> None:
    add_box(drawing.modelspace())
    drawing.saveas(tmp_path / "whole.dxf")
    whole = (tmp_path / "whole.dxf").read_bytes()
    (tmp_path / "part.dxf").write_bytes(whole[: int(part * len(whole))])
    assert wrong(tmp_path / "part.dxf").startswith("damaged: ")


def test_what_refers_to_what_is_not_there_is_refused(tmp_path: Path) -> None:
    ring, missing, mesh, grid = (ezdxf.new("R2010") for _ in range(4))
    ring.blocks.new("a").add_blockref("b", (0, 0))
    ring.blocks.new("b").add_blockref("a", (0, 0))
    ring.modelspace().add_blockref("a", (0, 0))
    missing.modelspace().add_blockref("gone", (0, 0))
    with mesh.modelspace().add_mesh().edit_data() as data:
        data.vertices, data.faces = SQUARE, [(0, 1, 4)]
    grid.modelspace().add_polymesh((3, 3)).dxf.m_count = 100
    assert refused(tmp_path, ring) == "block 'a' contains itself"
    assert refused(tmp_path, missing) == "the block 'gone' is missing"
    assert refused(tmp_path, mesh) == "a MESH of 4 points refers to point 5"
    assert refused(tmp_path, grid) == "a polygon mesh of 100 x 3 points has 9 points"


def test_more_blocks_than_any_memory_holds_are_refused(drawing: Drawing, tmp_path: Path, monkeypatch) -> None:
    """Ten of ten of ten ..., and rows of a thousand million."""
    monkeypatch.setattr(dxf, "MOST_IN_BLOCKS", 500)
    for i in range(9):
        block = drawing.blocks.new(f"b{i}")
        for _ in range(10):
            block.add_blockref(f"b{i + 1}", (0, 0))
    drawing.blocks.new("b9").add_3dface(SQUARE)
    insert = drawing.modelspace().add_blockref("b0", (0, 0))
    assert refused(tmp_path, drawing) == "its blocks have more than 500 entities in all"
    insert.dxf.name, insert.dxf.row_count, insert.dxf.row_spacing = "b9", 10**9, 1.0
    assert refused(tmp_path, drawing) == "its blocks have more than 500 entities in all"
    drawing.blocks.new("empty")
    insert.dxf.name = "empty"
    assert refused(tmp_path, drawing) == "its blocks have more than 500 entities in all"
