"""Regions: cells, chunks, coordinates and sizes."""

import json
import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cinegen.workspace import GridAxis, MapError, Region, line_region
from cinegen.workspace.chunks import chunk_cells, chunk_counts, chunk_shape

HOME = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.2, 0.3), np.array([0.4, 0.5, 0.6]))


def whole(region):
    return tuple(slice(0, count) for count in region.shape)


@pytest.mark.parametrize("cube", [True, False])
@given(st.lists(st.integers(1, 40), min_size=1, max_size=5), st.integers(1, 5000))
def test_chunks_cover_each_cell_once_and_are_no_larger_than_asked(cube, counts, most):
    region = Region(tuple(GridAxis(name, 0.0, 1.0, n) for name, n in zip("abcde", counts, strict=False)))
    chunks = chunk_shape(region.shape, most, cube)
    assert math.prod(chunks) <= most
    covered = np.zeros(region.shape, dtype=int) if region.size <= 10**5 else None
    total = 0
    for chunk in range(math.prod(chunk_counts(region.shape, chunks))):
        cells = chunk_cells(chunk, region.shape, chunks)
        total += math.prod(s.stop - s.start for s in cells)
        if covered is not None:
            covered[cells] += 1
        if total > 10**5:
            return
    assert total == region.size
    assert covered is None or (covered == 1).all()


@given(st.tuples(*(st.floats(-3.0, 3.0) for _ in range(6))))
def test_a_pose_of_six_coordinates_is_roll_pitch_yaw_about_fixed_axes(values):
    names = ("x", "y", "z", "rx", "ry", "rz")
    region = Region(tuple(GridAxis(n, v - 0.1, v + 0.1, 1) for n, v in zip(names, values, strict=True)))
    points, rotations = region.poses(HOME, region.values(whole(region)))
    np.testing.assert_allclose(points[0], values[:3], atol=1e-12)
    np.testing.assert_allclose(rotations[0], pin.rpy.rpyToMatrix(*values[3:]), atol=1e-12)


def test_what_is_not_given_is_as_at_home():
    region = Region((GridAxis("x", 0.0, 1.0, 4),), {"rz": 0.7})
    points, rotations = region.poses(HOME, region.values(whole(region)))
    np.testing.assert_allclose(points, [[x, 0.5, 0.6] for x in (0.125, 0.375, 0.625, 0.875)])
    np.testing.assert_allclose(rotations[0], pin.rpy.rpyToMatrix(0.1, -0.2, 0.7), atol=1e-12)


def test_a_ball_seen_from_a_centre_measures_what_it_should():
    ball = Region(
        (
            GridAxis("azimuth", -math.pi, math.pi, 12),
            GridAxis("elevation", -math.pi / 2, math.pi / 2, 8),
            GridAxis("radius", 0.5, 2.0, 5),
        ),
        centre=(1.0, 2.0, 3.0),
    )
    a, b, c = ball.sizes
    assert math.isclose(np.einsum("i,j,k->", a, b, c), 4.0 / 3.0 * math.pi * (2.0**3 - 0.5**3))
    points, _ = ball.poses(HOME, ball.values(whole(ball)))
    radii = np.linalg.norm(points - [1.0, 2.0, 3.0], axis=1).reshape(ball.shape)
    np.testing.assert_allclose(radii, np.broadcast_to(ball.axes[2].middles(), ball.shape))
    sphere = Region(ball.axes[:2], {"radius": 0.5}, centre=(0.0, 0.0, 0.0))
    assert math.isclose(np.einsum("i,j->", *sphere.sizes), 4.0 * math.pi * 0.25)


def test_a_region_reads_back_from_its_document():
    region = Region((GridAxis("azimuth", 0.0, 1.0, 3), GridAxis("elevation", 0.0, 1.0, 3)), {"radius": 1.0, "rx": 0.1},
                    "fixed", (0.0, 1.0, 2.0))  # fmt: skip
    assert Region.of_document(region.document()) == region
    line = line_region((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 7)
    assert Region.of_document(line.document()) == line


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: GridAxis("x", 1.0, 0.0, 5), "give the lower end first"),
        (lambda: GridAxis("x", 0.0, 1.0, 0), "give 1 or more"),
        (lambda: Region((GridAxis("x", 0, 1, 2),), {"x": 0.5}), "x is given twice"),
        (lambda: Region((GridAxis("x", 0, 1, 2),), {}, "fixd"), "fixed"),
        (lambda: Region((GridAxis("azimuth", 0, 1, 2),)), "only together with elevation, radius"),
        (lambda: Region((GridAxis("distance", 0, 1, 2),), {"x": 0.0}), "leave one out"),
    ],
)
def test_what_makes_no_sense_is_refused(make, says):
    with pytest.raises(MapError, match=says):
        make()


@pytest.mark.parametrize("axis", [("elevation", 0.0, 2.0, 4), ("azimuth", -5.0, 5.0, 4)])
def test_more_than_a_sphere_is_refused(axis):
    with pytest.raises(MapError, match=r"-90 to 90 degrees|more than a revolution"):
        Region((GridAxis(*axis),), {name: 0.5 for name in ("azimuth", "elevation", "radius") if name != axis[0]})


@pytest.mark.parametrize("kind", [int, np.float64, np.int64])
def test_numbers_of_all_kinds_are_written_like_floats(kind):
    """A map is compared with the document in its folder as text."""
    other = Region((GridAxis("x", kind(-1), kind(2), 3),), {"y": kind(0)}, centre=(kind(0), kind(0), kind(1)))
    floats = Region((GridAxis("x", -1.0, 2.0, 3),), {"y": 0.0}, centre=(0.0, 0.0, 1.0))
    assert json.dumps(other.document()) == json.dumps(floats.document())


def test_a_line_goes_from_one_point_to_the_other():
    region = line_region((0.0, 0.0, 1.0), (3.0, 4.0, 1.0), 5)
    points, _ = region.poses(HOME, region.values(whole(region)))
    np.testing.assert_allclose(points[:, 0], [0.3, 0.9, 1.5, 2.1, 2.7])
    np.testing.assert_allclose(points[:, 1], np.array([0.3, 0.9, 1.5, 2.1, 2.7]) * 4 / 3)
    np.testing.assert_allclose(points[:, 2], 1.0)
