"""Curves through points by arc length, and speed profiles from rest to rest."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cinegen.devices import SensorError
from cinegen.toolpath.curve import PointError, smooth_runs
from cinegen.toolpath.seam import SpeedProfile

UP = np.array([0.0, 0.0, 1.0])


def wandering(seed: int, bend: float, count: int = 9) -> np.ndarray:
    """(count, 3) m: points that bend by less than an angle (rad), at very uneven distances."""
    random = np.random.default_rng(seed)
    path = np.array([1.0, 0.0, 0.0])
    points = [random.normal(size=3)]
    for _ in range(count - 1):
        aside = np.cross(path, random.normal(size=3))
        turn = random.uniform(0, bend)
        path = math.cos(turn) * path + math.sin(turn) * aside / np.linalg.norm(aside)
        points.append(points[-1] + 10.0 ** random.uniform(-3, -0.5) * path)
    return np.array(points)


def flat(points: np.ndarray) -> np.ndarray:
    return np.tile(UP, (len(points), 1))


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_its_speed_is_1_along_its_tangent(seed):
    points = wandering(seed, math.radians(29)) * [1, 1, 0.1]
    for curve in smooth_runs(points, flat(points)):
        along = np.linspace(0, curve.length, 400)
        positions, tangents, normals = map(np.array, zip(*map(curve.at, along), strict=True))
        assert np.linalg.norm(tangents, axis=1) == pytest.approx(1.0, abs=1e-12)
        assert normals == pytest.approx(np.tile(UP, (400, 1)), abs=1e-12)
        h = 1e-6 * curve.length
        for s, tangent in zip(along[1:-1:17], tangents[1:-1:17], strict=True):
            step = (curve.at(s + h)[0] - curve.at(s - h)[0]) / (2 * h)
            assert step == pytest.approx(tangent, abs=1e-5)
        jumps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
        assert jumps.max() <= curve.length / 399 * (1 + 1e-5)


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_it_is_the_same_curve_from_its_other_end(seed):
    points = wandering(seed, math.radians(29)) * [1, 1, 0.1]
    forward, back = (smooth_runs(path, flat(path)) for path in (points, points[::-1]))
    for curve, other in zip(forward, back[::-1], strict=True):
        assert other.length == pytest.approx(curve.length)
        along = np.linspace(0, curve.length, 50)
        places, passed = (np.array([run.at(s)[0] for s in along]) for run in (curve, other))
        assert passed[::-1] == pytest.approx(places, abs=1e-9)


def test_long_straight_parts_stay_so_and_short_ones_do_no_harm():
    """A line of 300 mm, a quarter of a circle of 5 mm in steps of 9 degrees, and a line of 300 mm."""
    turn = np.radians(np.arange(0, 91, 9))
    points = np.vstack([[-0.3, 0], np.stack([0.005 * np.sin(turn), 0.005 * (1 - np.cos(turn))], axis=1), [0.005, 0.3]])
    points = np.column_stack([points, 0 * points[:, 0]])
    (curve,) = smooth_runs(points, flat(points))
    line = np.array([curve.at(s)[0] for s in np.linspace(0, 0.29, 200)])
    assert np.abs(line[:, 1]).max() < 3e-4
    for short in (1e-3, 1e-5, 1e-8):  # a first step as good as none: the seam still begins along it, more or less
        points = np.array([[0, 0, 0], [short, 0, 0], [short + 0.1, 0.04, 0], [short + 0.2, 0.08, 0]])
        (curve,) = smooth_runs(points, flat(points))
        assert curve.at(0.0)[1][0] > 0.95
        assert curve.length == pytest.approx(0.2 * math.sqrt(1.16), rel=0.02)


@pytest.mark.parametrize(("degrees", "runs"), [(29.0, 1), (31.0, 2), (180.0, 2)])
def test_corners(degrees, runs):
    turn = math.radians(degrees)
    points = np.array([[-1, 0, 0], [0, 0, 0], [math.cos(turn), math.sin(turn), 0]])
    curves = smooth_runs(points, flat(points))
    assert len(curves) == runs
    if runs == 2:
        assert curves[0].at(1.0)[1] == pytest.approx([1, 0, 0])
        assert curves[1].at(0.0)[1] == pytest.approx([math.cos(turn), math.sin(turn), 0], abs=1e-12)
        assert curves[1].at(0.0)[0] == pytest.approx([0, 0, 0], abs=1e-12)


def test_edges_and_points_that_stand_twice():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0], [2, 0, 0], [3, 0, 0]], dtype=float)
    normals = np.array([UP, UP, [0, 1, 0], [0, 1, 0], [0, 1, 0], [0, 1, 0]])
    first, second = smooth_runs(points, normals)  # the second that stands twice says the same twice
    assert (first.length, second.length) == pytest.approx((1.0, 2.0))
    assert first.at(1.0)[2] == pytest.approx(UP)
    assert second.at(0.0)[2] == pytest.approx([0, 1, 0])
    normals[4:] = UP
    assert len(smooth_runs(points, normals)) == 3
    with pytest.raises(PointError, match=r"point 1: it is where its neighbour is"):
        smooth_runs(points[1:], normals[1:])
    with pytest.raises(PointError, match=r"point 3: it is where"):
        smooth_runs(points[[0, 1, 1, 1, 3]], np.array([UP, UP, [0, 1, 0], [0, 0, -1], [0, 0, -1]]))


def test_what_no_curve_goes_through():
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=float)
    with pytest.raises(PointError, match="point 3: its normal is opposite") as caught:
        smooth_runs(points, np.array([UP, UP, -UP]))
    again = pickle.loads(pickle.dumps(caught.value))
    assert (again.index, str(again)) == (2, str(caught.value))
    for number, normals in ((1, [[1, 0, 0.05], UP, UP]), (2, [UP, [1, 0, 0], UP]), (3, [UP, UP, [-1, 0, 0.01]])):
        unit = np.array(normals) / np.linalg.norm(normals, axis=1)[:, None]
        with pytest.raises(PointError, match=f"point {number}: the seam is parallel to its normal here"):
            smooth_runs(points, unit)
    for few in (points[:1], points[:0], points[[0, 0, 0]]):
        with pytest.raises(SensorError, match="two points at least"):
            smooth_runs(few, flat(few))


profiles = st.builds(SpeedProfile, st.floats(1e-6, 10), st.floats(1e-4, 10), st.floats(0, 3))


@given(profiles)
def test_a_profile_begins_and_ends_at_rest(profile):
    length, duration = profile.length, profile.duration
    assert (profile.at(-1.0), profile.at(0.0)) == (0.0, 0.0)
    assert profile.at(duration) == profile.at(duration + 1.0) == length
    assert profile.at(0.5 * duration) == pytest.approx(0.5 * length, rel=1e-9)
    times = np.linspace(0, duration, 1001)
    path = np.array([profile.at(time) for time in times])
    speeds = np.diff(path) / np.diff(times)
    assert speeds.min() >= -1e-9 * profile.top
    assert speeds.max() <= profile.speed * (1 + 1e-6)
    if profile.ramp > 0.01 * duration:
        assert speeds[0] < 0.1 * profile.top  # from rest
        assert np.abs(np.diff(speeds)).max() < 1.6 * profile.top / profile.ramp * (times[1] - times[0]) + 1e-9
    if duration > 2.5 * profile.ramp:
        middle, step = 0.5 * duration, 1e-3 * duration
        assert profile.at(middle + step) - profile.at(middle) == pytest.approx(profile.speed * step, rel=1e-6)
