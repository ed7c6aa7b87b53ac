"""DXF files, made by ezdxf: which faces are drawn, where, and in which colour."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
from ezdxf.colors import aci2rgb
from ezdxf.document import Drawing

from raff2urdf import RaffError
from raff2urdf.graphics import dxf
from raff2urdf.graphics.surface import Colour, ColouredSurface, area

SQUARE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
RED, YELLOW, GREEN, BLUE = ((*aci2rgb(index), 255) for index in (1, 2, 3, 5))
WHITE = (255, 255, 255, 255)


@pytest.fixture
def drawing() -> Drawing:
    return ezdxf.new("R2010")


@pytest.fixture
def read(tmp_path: Path) -> Callable[[Drawing], tuple[list[ColouredSurface], str | None]]:
    """Writes a drawing and reads it back."""

    def read(drawing: Drawing) -> tuple[list[ColouredSurface], str | None]:
        drawing.saveas(tmp_path / "part.dxf")
        return dxf.read(tmp_path / "part.dxf")

    return read


Read = Callable[[Drawing], tuple[list[ColouredSurface], str | None]]


def areas(read: Read, drawing: Drawing) -> dict[Colour | None, float]:
    surfaces, lacking = read(drawing)
    assert lacking is None
    return {one.colour: pytest.approx(area(one.triangles), rel=1e-6) for one in surfaces}


def points(read: Read, drawing: Drawing) -> set[tuple[float, ...]]:
    return {tuple(np.round(point, 4).tolist()) for one in read(drawing)[0] for point in one.triangles.reshape(-1, 3)}


def volume(read: Read, drawing: Drawing) -> float:
    """Inside a closed surface; negative if it is turned inside out."""
    triangles = np.concatenate([one.triangles for one in read(drawing)[0]]).astype(float)
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


def test_faces_of_three_corners_or_four_solids_and_traces_are_faces(drawing: Drawing, read: Read) -> None:
    """The last corners of solids and traces are stored crosswise."""
    crosswise = [SQUARE[0], SQUARE[1], SQUARE[3], SQUARE[2]]
    drawing.modelspace().add_solid(crosswise, dxfattribs={"color": 1})
    drawing.modelspace().add_trace(crosswise, dxfattribs={"color": 2})
    drawing.modelspace().add_3dface(SQUARE[:3], dxfattribs={"color": 3})
    drawing.modelspace().add_3dface(SQUARE, dxfattribs={"color": 5})
    assert areas(read, drawing) == {RED: 1.0, YELLOW: 1.0, GREEN: 0.5, BLUE: 1.0}


def test_a_polyface_mesh_has_faces_of_their_own_colours(drawing: Drawing, read: Read) -> None:
    corners, faces = box()
    mesh = drawing.modelspace().add_polyface(dxfattribs={"color": 5})
    mesh.append_faces([[corners[i] for i in face] for face in faces])
    next(vertex for vertex in mesh.vertices if vertex.is_face_record).dxf.color = 1
    assert areas(read, drawing) == {RED: 1.0, BLUE: 5.0}
    assert volume(read, drawing) == pytest.approx(1.0)


# --- colours -----------------------------------------------------------------------------------------------------


def test_colours_are_of_the_index_true_or_the_layers(drawing: Drawing, read: Read) -> None:
    drawing.layers.add("green", color=3)
    drawing.layers.add("true", color=3, true_color=0x112233)
    space = drawing.modelspace()
    space.add_3dface(SQUARE, dxfattribs={"color": 1, "layer": "green"})
    space.add_3dface(SQUARE, dxfattribs={"color": 1, "true_color": 0x405060})
    space.add_3dface(SQUARE, dxfattribs={"layer": "green"})
    space.add_3dface(SQUARE, dxfattribs={"layer": "true"})
    space.add_3dface(SQUARE, dxfattribs={"layer": "said nowhere"})
    space.add_3dface(SQUARE, dxfattribs={"color": 5, "transparency": ezdxf.colors.float2transparency(0.5)})
    found = areas(read, drawing)
    (glass,) = [colour for colour in found if colour[3] < 255]
    assert glass[:3] == BLUE[:3]
    assert glass[3] == pytest.approx(127, abs=2)
    expected = {RED, (0x40, 0x50, 0x60, 255), GREEN, (0x11, 0x22, 0x33, 255), WHITE, glass}
    assert set(found) == expected


def test_what_stands_in_a_block_may_have_the_blocks_colour_and_layer(drawing: Drawing, read: Read) -> None:
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
    assert areas(read, drawing) == {RED: 1.0, YELLOW: 1.0, GREEN: 4.0, BLUE: 6.0}


def test_what_is_hidden_stays_hidden(drawing: Drawing, read: Read) -> None:
    drawing.layers.add("off", color=3).off()
    drawing.layers.add("frozen", color=3).freeze()
    block = drawing.blocks.new("part")
    block.add_3dface(SQUARE, dxfattribs={"color": 2})
    space = drawing.modelspace()
    space.add_3dface(SQUARE, dxfattribs={"color": 1})
    for layer in ("off", "frozen"):
        space.add_3dface(SQUARE, dxfattribs={"layer": layer})
        space.add_blockref("part", (0, 0), dxfattribs={"layer": layer})
    space.add_3dface(SQUARE, dxfattribs={"color": 2, "invisible": 1})
    drawing.layout("Layout1").add_3dface(SQUARE, dxfattribs={"color": 2})
    assert areas(read, drawing) == {RED: 1.0}


# --- blocks ------------------------------------------------------------------------------------------------------


def test_a_block_is_placed_scaled_and_turned(drawing: Drawing, read: Read) -> None:
    drawing.blocks.new("part", base_point=(1, 0, 0)).add_3dface(SQUARE)
    attributes = {"xscale": 2.0, "yscale": 3.0, "zscale": 4.0, "rotation": 90.0}
    drawing.modelspace().add_blockref("part", (10, 20, 30), dxfattribs=attributes)
    placed = {(10, 18, 30), (10, 20, 30), (7, 18, 30), (7, 20, 30)}
    assert points(read, drawing) == placed
    drawing.blocks.new("inner").add_3dface(SQUARE[:3])
    drawing.blocks.new("outer").add_blockref("inner", (1, 0), dxfattribs={"rotation": 90.0})
    drawing.modelspace().add_blockref("outer", (0, 0, 5), dxfattribs={"xscale": 2.0})
    assert points(read, drawing) == placed | {(2, 0, 5), (2, 1, 5), (0, 1, 5)}


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -1, -1), (1, 1, -2)])
def test_a_mirrored_block_is_not_turned_inside_out(drawing: Drawing, read: Read, scale: tuple[int, ...]) -> None:
    add_box(drawing.blocks.new("part"))
    attributes = dict(zip(("xscale", "yscale", "zscale"), scale, strict=True))
    drawing.modelspace().add_blockref("part", (3, 4, 5), dxfattribs=attributes)
    assert volume(read, drawing) == pytest.approx(abs(math.prod(scale)), rel=1e-5)


def test_an_entity_lies_in_its_own_plane(drawing: Drawing, read: Read) -> None:
    """AutoCAD's arbitrary axis: a solid whose extrusion is along -y has its x along the drawing's x."""
    crosswise = [SQUARE[0], SQUARE[1], SQUARE[3], SQUARE[2]]
    drawing.modelspace().add_solid(crosswise, dxfattribs={"extrusion": (0, -1, 0)})
    assert points(read, drawing) == {(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)}


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


def test_solids_are_said_to_be_left_out(drawing: Drawing, read: Read, tmp_path: Path) -> None:
    drawing.modelspace().add_3dsolid().sat = ["400 0 1 0 ", "End-of-ACIS-data "]
    assert refused(tmp_path, drawing) == "holds no faces or meshes, only 1 3DSOLID"
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


def test_more_blocks_than_any_memory_holds_are_refused(
    drawing: Drawing, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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
