"""Polygons become triangles of the same area, on the same side; colours stay few; STL is read by others."""

import io
import math

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given
from hypothesis import strategies as st
from mechanisms import turn
from strategies import examples

from raff2urdf import RaffError
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


def directed_area(triangles: np.ndarray) -> np.ndarray:
    wide = triangles.astype(float)
    return np.cross(wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0]) / 2.0


# --- triangles ---------------------------------------------------------------------------------------------------


@given(outlines(), rotations(), st.tuples(*[st.floats(-20.0, 20.0)] * 3))
@examples(200)
def test_triangles_have_the_area_of_their_polygon_and_face_where_it_does(
    outline: list[tuple[float, float]], rotation: np.ndarray, offset: tuple[float, float, float]
) -> None:
    """All of them the same way: overlapping ones that cancel out would show in the sum of their sizes."""
    plane = np.column_stack([np.array(outline), np.zeros(len(outline))])
    found = directed_area(cut(plane @ rotation.T + offset))
    expected = shoelace(outline)
    assert found.sum(axis=0) == pytest.approx(expected * rotation[:, 2], abs=1e-3)
    assert np.linalg.norm(found, axis=1).sum() == pytest.approx(expected, rel=1e-4, abs=1e-3)


def test_a_concave_quadrangle_is_cut_along_its_inner_diagonal() -> None:
    """Whichever corner is the inner one. A fan from the first corner has 3 times the area where it is wrong."""
    dart = [(0.0, 0.0, 0.0), (2.0, -1.0, 0.0), (0.5, 0.0, 0.0), (2.0, 1.0, 0.0)]
    for shift in range(4):
        corners = np.array(dart[shift:] + dart[:shift])
        assert area(cut(corners)) == pytest.approx(0.5)


@given(outlines())
@examples(30)
def test_what_is_seen_from_both_sides_faces_both(outline: list[tuple[float, float]]) -> None:
    corners = np.column_stack([np.array(outline), np.zeros(len(outline))])
    found = directed_area(cut(corners, both=True))
    assert found.sum(axis=0) == pytest.approx(0.0, abs=1e-3)
    assert np.linalg.norm(found, axis=1).sum() == pytest.approx(2.0 * shoelace(outline), rel=1e-4)


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0, 0)] * 3,
        [(0, 0, 0), (1, 1, 1), (2, 2, 2)],
        [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)],
        [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0), (4, 0, 0)],
        [(5, 5, 5)] * 7,
        [(1e-46, 0, 0), (0, 1e-46, 0), (0, 0, 0)],
    ],
)
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
@examples(60)
def test_colours_become_few_and_no_area_is_lost(parts: list[tuple[list[tuple[float, float]], None]]) -> None:
    polygons = Polygons()
    for outline, colour in parts:
        polygons.add([(x, y, 0.0) for x, y in outline], colour)
    surfaces = polygons.surfaces()
    assert len(surfaces) == len({colour for _, colour in parts})
    for most in (17, 32):
        few = fewer_colours(surfaces, most)
        assert len(few) <= most
        assert sum(area(one.triangles) for one in few) == pytest.approx(sum(area(one.triangles) for one in surfaces))
        assert (None in {one.colour for one in few}) == (None in {colour for _, colour in parts})
        if len(surfaces) <= most:
            assert [one.colour for one in few] == [one.colour for one in surfaces]


# --- STL ---------------------------------------------------------------------------------------------------------


@given(outlines(), st.sampled_from([1e-15, 1.0, 1e30]))
@examples(40)
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
