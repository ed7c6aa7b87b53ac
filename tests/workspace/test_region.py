"""Regions: cells, chunks, coordinates and sizes."""

import json
import math
import time

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mapped import middles, over
from small_maps import map_of

import cinegen.workspace.extent as module
from cinegen.workspace import CellStatus, GridAxis, MapError, MapSpecification, Region, line_region
from cinegen.workspace.chunks import chunk_cells, chunk_counts, chunk_shape
from cinegen.workspace.default_range import default_range
from cinegen.workspace.evaluator import estimate
from cinegen.workspace.extent import Extent, bounds, extent, extent_of
from cinegen.workspace.reach_bounds import _SPHERICAL, ReachBounds, _Connection, _prismatic_bounds, _revolute_bounds

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
    turns = GridAxis("azimuth", -math.pi, math.pi, 12), GridAxis("elevation", -math.pi / 2, math.pi / 2, 8)
    ball = Region((*turns, GridAxis("radius", 0.5, 2.0, 5)), centre=(1.0, 2.0, 3.0))
    a, b, c = ball.sizes
    assert math.isclose(np.einsum("i,j,k->", a, b, c), 4.0 / 3.0 * math.pi * (2.0**3 - 0.5**3))
    points, _ = ball.poses(HOME, ball.values(whole(ball)))
    radii = np.linalg.norm(points - [1.0, 2.0, 3.0], axis=1).reshape(ball.shape)
    np.testing.assert_allclose(radii, np.broadcast_to(ball.axes[2].middles(), ball.shape))
    sphere = Region(ball.axes[:2], {"radius": 0.5}, centre=(0.0, 0.0, 0.0))
    assert math.isclose(np.einsum("i,j->", *sphere.sizes), 4.0 * math.pi * 0.25)


def test_a_region_reads_back_from_its_document():
    axes = GridAxis("azimuth", 0.0, 1.0, 3), GridAxis("elevation", 0.0, 1.0, 3)
    region = Region(axes, {"radius": 1.0, "rx": 0.1}, "fixed", (0.0, 1.0, 2.0))
    for made in (region, line_region((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 7)):
        assert Region.of_document(made.document()) == made


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: GridAxis("x", 1.0, 0.0, 5), "give the lower end first"),
        (lambda: GridAxis("x", 0.0, 1.0, 0), "give 1 or more"),
        (lambda: Region((GridAxis("x", 0, 1, 2),), {"x": 0.5}), "x is given twice"),
        (lambda: Region((GridAxis("x", 0, 1, 2),), {}, "fixd"), "fixed"),
        (lambda: Region((GridAxis("azimuth", 0, 1, 2),)), "only together with elevation, radius"),
        (lambda: Region((GridAxis("distance", 0, 1, 2),), {"x": 0.0}), "leave one out"),
        (lambda: Region((GridAxis("elevation", 0, 2, 4),), {"azimuth": 0.5, "radius": 0.5}), "-90 to 90 degrees"),
        (lambda: Region((GridAxis("azimuth", -5, 5, 4),), {"elevation": 0.5, "radius": 0.5}), "more than a revolution"),
    ],
)
def test_what_makes_no_sense_is_refused(make, says):
    with pytest.raises(MapError, match=says):
        make()


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


# --- chunks -----------------------------------------------------------------------------------------------------------


def test_a_map_of_no_more_cells_than_an_estimate_tries_takes_no_longer_than_the_estimate(robot):
    begin = time.perf_counter()
    cost = estimate(MapSpecification(robot("planar_3r"), line_region((0.1, 0.0, 0.0), (0.3, 0.0, 0.0), 2), ()))
    assert 0.0 < cost.seconds <= time.perf_counter() - begin
    assert cost.cells == 2


# --- reach bounds -----------------------------------------------------------------------------------------------------
# ReachBounds: least and largest distances across one joint are bounds, and are attained.


VECTORS = st.tuples(*(st.floats(-2.0, 2.0) for _ in range(3))).map(np.array)
AXES = VECTORS.filter(lambda v: np.linalg.norm(v) > 0.1).map(lambda v: v / np.linalg.norm(v))
RANGES = st.tuples(st.floats(-7.0, 7.0), st.floats(0.0, 8.0)).map(lambda r: (r[0], r[0] + r[1]))


def turned(axis, angles, w):
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    return w * c + np.cross(axis, w) * s + axis * (axis @ w) * (1.0 - c)


@given(AXES, VECTORS, VECTORS, RANGES)
def test_distances_across_a_joint_that_turns(axis, u, w, between):
    seen = np.linalg.norm(turned(axis, np.linspace(*between, 2000), w) - u, axis=1)
    least, most = _revolute_bounds(axis, u, w, *between)
    assert (least, most) == pytest.approx((seen.min(), seen.max()), abs=1e-2)
    assert least <= seen.min() + 1e-7
    assert most >= seen.max() - 1e-7


@given(AXES, VECTORS, RANGES)
def test_distances_across_a_joint_that_slides(axis, away, between):
    seen = np.linalg.norm(np.linspace(*between, 2000)[:, None] * axis - away, axis=1)
    least, most = _prismatic_bounds(axis, away, *between)
    assert (least, most) == pytest.approx((seen.min(), seen.max()), abs=1e-2)
    assert least <= seen.min() + 1e-9
    assert most >= seen.max() - 1e-9


@given(AXES, VECTORS, st.floats(0.0, 3.0))
def test_distances_across_a_ball_joint(along, u, length):
    """They are attained where one point is in the direction of the other, and opposite to it."""
    ball = _Connection(0, 1, pin.SE3.Identity(), pin.SE3.Identity(), _SPHERICAL, np.zeros(3), -math.inf, math.inf)
    size = np.linalg.norm(u)
    assert ball.bounds(u, length * along) == pytest.approx((abs(size - length), size + length), abs=1e-9)


def test_what_has_no_limits_has_no_largest_distance():
    endless = _prismatic_bounds(np.eye(3)[0], np.array([0.3, 0.4, 0.0]), -math.inf, math.inf)
    assert endless == pytest.approx((0.4, math.inf))
    ends = np.array([0.3, 0.0, 0.0]), np.array([0.0, 0.5, 0.0])
    assert _revolute_bounds(np.eye(3)[2], *ends, -math.inf, math.inf) == pytest.approx((0.2, 0.8))


def test_the_base_stays_where_it_is(robot):
    bounds = ReachBounds(robot("rx90"), "base")
    assert bounds.interval(0) == (-math.inf, math.inf)
    assert not bounds.exclude(np.ones((2, 3)), np.eye(3)[None]).any()


# --- default range ----------------------------------------------------------------------------------------------------
# Ranges for who gives none: they hold what can be reached.


@pytest.mark.parametrize("name", ["delta4", "planar_3r", "rx90"])
def test_what_is_reached_from_home_lies_in_the_range_of_each_coordinate_that_can_change(robot, name):
    mechanism = robot(name)
    low, high = mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit
    closed = (mechanism.q_home, *mechanism.random_closed(60, seed=5))
    within = [q for q in closed if ((q >= low) & (q <= high)).all()]
    places = [mechanism.placement(q, mechanism.end).translation for q in within]
    assert len(places) > 1
    for k, coordinate in enumerate("xyz"):
        values = np.array(places)[:, k]
        if np.ptp(values) < 1e-9:
            with pytest.raises(MapError, match=f"can't move along {coordinate}"):
                default_range(mechanism, coordinate)
            continue
        first, last = default_range(mechanism, coordinate)
        assert first <= values.min()
        assert values.max() <= last
        assert f"{first:.4g}" == f"{first}".removesuffix(".0")  # easily read


def test_a_range_is_little_wider_than_what_is_reached_and_that_of_a_motor_its_limits(robot):
    """Links of 400, 300 and 200 mm: a disc of 0.9 m."""
    for coordinate in "xy":
        low, high = default_range(robot("planar_3r"), coordinate)
        assert -1.0 <= low <= high <= 1.0
    assert default_range(robot("planar_3r"), "x")[1] >= 0.9
    assert default_range(robot("five_bar"), "joint1") == pytest.approx((math.radians(60.0), math.radians(200.0)))


# --- extent -----------------------------------------------------------------------------------------------------------
# Extents of maps: closed forms lie within the bound, which shrinks as cells do.


def counted(region, cells):
    """Extent of cells, of which all are known."""
    return extent_of(region, "m^2", cells, *bounds(region.periodic, cells, np.zeros_like(cells)))


@pytest.fixture(scope="module")
def wrist(tmp_path_factory):
    """planar_3r whose tool looks along x: its wrist, 200 behind, is that of an arm of 400 and 300."""
    axes = (("x", -0.75, 1.15, 76), ("y", -0.9, 0.9, 60))
    folder = tmp_path_factory.mktemp("wrist")
    return map_of(folder, "planar_3r", *axes, at={"rz": 0.0}, quantities=("manipulability",), limits=False)


# --- closed forms ------------------------------------------------------------------------------------------------


@given(st.floats(0.2, 1.0), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.integers(20, 60), st.integers(20, 60))
@settings(max_examples=200)
def test_a_disc_is_always_within_the_bound(radius, x, y, rows, columns):
    region = over(("x", -1.4, 1.4, rows), ("y", -1.4, 1.4, columns))
    assume(radius > 1.5 * max(axis.width for axis in region.axes))
    u, v = middles(region)
    area = counted(region, np.hypot(u - x, v - y) <= radius)
    assert area.low <= math.pi * radius**2 <= area.high
    ring = math.hypot(*(axis.width for axis in region.axes))  # nothing is further from the border
    assert area.high - area.low <= 2.0 * math.pi * radius * 4.0 * ring


def test_a_full_region_is_exact():
    area = counted(over(("x", -1.0, 1.0, 7), ("y", -1.0, 1.0, 7)), np.ones((7, 7), dtype=bool))
    assert (area.value, area.error) == (pytest.approx(4.0), 0.0)
    assert str(area) == "4 m^2"


# --- how it is counted -------------------------------------------------------------------------------------------


@given(st.integers(1, 29))
def test_where_a_whole_turn_begins_makes_no_difference(turn):
    region = over(("azimuth", -math.pi, math.pi, 30), ("elevation", -1.5, 1.5, 15), at={"radius": 1.0})
    azimuth, elevation = middles(region)
    cells = np.hypot(azimuth - 0.3, elevation) < 1.0
    original, other = (counted(region, these) for these in (cells, np.roll(cells, turn, axis=0)))
    assert (other.value, other.low, other.high) == pytest.approx((original.value, original.low, original.high))


@pytest.mark.parametrize("at_once", [1, 100, 700])
@pytest.mark.parametrize("names", [("x", "y"), ("azimuth", "elevation")])
def test_slabs_count_as_the_whole_does(monkeypatch, names, at_once):
    axes = (names[0], -math.pi, math.pi, 23), (names[1], -1.5, 1.5, 31)
    region = over(*axes, at={"radius": 1.0} if names[0] == "azimuth" else {})
    rng = np.random.default_rng(3)
    u, v = middles(region)
    cells, unknown = (np.abs(u) > 2.0) & (np.abs(v) < 1.0), rng.random(region.shape) < 0.02
    whole = extent_of(region, "m^2", cells & ~unknown, *bounds(region.periodic, cells, unknown))
    monkeypatch.setattr(module, "_AT_ONCE", at_once)
    slabs = module._in_slabs(region, "m^2", lambda rows: (cells[rows], unknown[rows]))
    for name in ("value", "low", "high", "cells"):
        assert getattr(slabs, name) == pytest.approx(getattr(whole, name))


def test_what_nobody_has_looked_at_may_be_there(wrist):
    part = wrist.load().copy(deep=True)
    gone = np.zeros(part.status.shape, dtype=bool)
    gone[30:40, 20:40] = True
    part["status"] = part.status.where(~gone, CellStatus.NOT_EVALUATED).astype("uint8")
    part["reachable"] = part.reachable & ~gone
    known, all_of_it = extent(part), extent(wrist)
    assert known.value < all_of_it.value
    assert known.low < math.pi * (0.7**2 - 0.1**2) < known.high
    assert known.high >= all_of_it.value


@pytest.mark.parametrize(
    ("value", "error", "says"),
    [(2.5446, 0.183, "2.54 ± 0.18 m"), (1234.5, 21.0, "1234 ± 21 m"), (0.0, 0.5, "0.00 ± 0.50 m"),
     (3e-9, 1e-10, "3e-09 ± 1e-10 m"), (0.2, 0.0, "0.2 m")],
)  # fmt: skip
def test_as_many_digits_are_said_as_are_worth_it(value, error, says):
    assert str(Extent(value, value - error, value + error, "m", 1)) == says


# --- what makes no sense -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda m: extent(m, m.manipulability), r"true or false, not float32: write .* dataset.sigma_1 > 0.1"),
        (lambda m: extent(m, m.reachable.isel(x=0)), "a condition over y: make it of this map's own cells, over x, y"),
        (lambda m: extent(m.isel(x=slice(3))), "a part of a map, 3 x 60 of its 76 x 60 cells"),
        (lambda m: extent(m.drop_attrs()), "this dataset is not a map"),
    ],
)
def test_an_extent_that_makes_no_sense_is_refused(wrist, ask, says):
    with pytest.raises(MapError, match=says):
        ask(wrist)


def test_a_joint_with_equal_limits_has_no_range(raff):
    arm = raff("robot r { base { } link 1 { type 2 pred 0 parameters { theta 10 d 300 } limits { 10 10 } } }")
    with pytest.raises(MapError, match=r"joint1 can't move: its limits are equal\. Leave it out"):
        default_range(arm, "joint1")
