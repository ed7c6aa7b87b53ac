"""The Neutral File Format of WorldToolKit: what is written is read back, and what is wrong is said with its line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples
from test_surface import outlines, shoelace

from raff2urdf import RaffError
from raff2urdf.graphics import nff
from raff2urdf.graphics.surface import area

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


def found(text: str) -> dict[Any, float]:
    """The area of each colour."""
    return {surface.colour: area(surface.triangles) for surface in nff.loads(text)}


def wrong(text: str) -> str:
    with pytest.raises(RaffError) as error:
        nff.loads(text, "part.nff")
    return str(error.value)


def test_a_cube_has_six_faces_of_its_colours() -> None:
    assert found(CUBE) == {
        (255, 0, 0, 255): 4.0,
        (0, 255, 0, 255): 4.0,
        (0, 0, 255, 255): 8.0,  # both sides
        (255, 255, 0, 255): 8.0,
        (255, 255, 255, 255): 4.0,
        (0x12, 0x34, 0x56, 255): 4.0,
    }


def test_it_is_read_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "cube.nff").write_bytes(b"\xef\xbb\xbf" + CUBE.replace("cube ", "w\xfcrfel ").encode("latin-1"))
    assert len(nff.read(tmp_path / "cube.nff")) == 6
    with pytest.raises(RaffError, match=r"gone\.nff: can't be read: No such file"):
        nff.read(tmp_path / "gone.nff")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_any_end_of_line_any_space_and_comments_will_do(end: str) -> None:
    text = "// one more\n\n" + CUBE.replace(" ", "\t  ").replace("\n", " // said\n//\n \n") + "\n"
    assert found(text.replace("\n", end)) == found(CUBE)


def test_the_version_may_be_left_out_and_unknown_lines_of_the_head_too() -> None:
    head, body = CUBE.split("\n\n", 1)
    assert found(f"NFF\n{body}") == found(CUBE)
    assert found(f"{head}\nlight 0 0 1 0.5\nambient 0.3\n{body}") == found(CUBE)


@pytest.mark.parametrize(
    ("vertices", "colour"),
    [
        (("0x00ff00", "0x00ff00", "0x00ff00"), (0, 255, 0, 255)),  # as WorldToolKit has it: they count more
        (("0x00ff00", "0x00ff00", "0x0000ff"), (255, 0, 0, 255)),  # shaded: one colour can't say it
        (("0x00ff00", "", ""), (255, 0, 0, 255)),
    ],
)
def test_a_colour_that_all_corners_share_is_the_polygons(vertices: tuple[str, ...], colour: tuple[int, ...]) -> None:
    a, b, c = vertices
    assert list(found(f"nff\na\n3\n0 0 0 {a}\n1 0 0 {b}\n0 1 0 {c}\n1\n3 0 1 2 0xf00\n")) == [colour]


# --- written and read back ---------------------------------------------------------------------------------------

HEX = st.integers(0, 0xFFFFFF)


@given(st.lists(st.lists(st.tuples(outlines(), HEX, st.booleans()), max_size=4), min_size=1, max_size=3))
@examples(80)
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
    assert {one.colour: area(one.triangles) for one in surfaces} == {
        colour: pytest.approx(expected, rel=1e-4) for colour, expected in areas.items()
    }
    assert {tuple(point) for one in surfaces for point in one.triangles.reshape(-1, 3)} == points


# --- what is wrong -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("line", range(2, len(CUBE.splitlines())))
def test_a_file_that_ends_too_early_is_refused(line: int) -> None:
    """Behind any line but those of the head, which alone are no object."""
    said = wrong("\n".join(CUBE.splitlines()[:line]))
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
    ("0x00ff00", "0xgggggg", 19, "'0xgggggg' is not a colour: write 0xRGB or 0xRRGGBB"),
])  # fmt: skip
def test_what_is_wrong_is_told_with_its_line(old: str, new: str, place: int, reason: str) -> None:
    assert old in CUBE
    said = wrong(CUBE.replace(old, new, 1))
    assert said.startswith(f"part.nff:{place}:")
    assert reason in said
    assert len(said) < 500
