"""Elementary geometry of lines against points and planes, computed without moments."""

from __future__ import annotations

import math

import numpy as np
import pytest
import varieties
from hypothesis import given
from hypothesis import strategies as st
from line_geometry import (
    angle,
    are_coplanar,
    are_parallel,
    common_plane,
    common_point,
    distance,
    meet,
    mutual_moment,
    transversals,
)

from cinegen.singularities.pluecker import LineAtInfinity, PlueckerLine

seeds = st.integers(0, 2**32 - 1)


def _random(rng):
    return PlueckerLine.through(*rng.normal(size=(2, 3)))


def _closest(p, d, q, e):
    """The points of two lines that are nearest to each other, by least squares over both parameters."""
    s, t = np.linalg.lstsq(np.column_stack([d, -e]), q - p, rcond=None)[0]
    return p + s * d, q + t * e


def _apart(a, b):
    p, q = _closest(a.point, a.direction, b.point, b.direction)
    return np.linalg.norm(p - q)


# --- two lines --------------------------------------------------------------------------------------------------------


@given(seeds)
def test_the_mutual_moment_is_distance_times_sine(seed):
    rng = np.random.default_rng(seed)
    a, b = _random(rng), _random(rng)
    sine = math.sin(math.acos(min(1.0, abs(a.direction @ b.direction))))
    assert abs(mutual_moment(a, b)) == pytest.approx(_apart(a, b) * sine, abs=1e-7)
    assert mutual_moment(a, b) == pytest.approx(mutual_moment(b, a))
    assert distance(a, b) == pytest.approx(_apart(a, b), abs=1e-9)


@given(st.floats(0.0, 3.1), st.floats(0.1, 10.0), seeds)
def test_lines_at_a_known_angle_and_distance(turn, apart, seed):
    rng = np.random.default_rng(seed)
    move = varieties.rotation(rng), rng.normal(size=3)
    a = varieties.moved(PlueckerLine.along([3, 0, 0], [1, 0, 0]), *move)
    b = varieties.moved(PlueckerLine.along([0, 0, apart], [math.cos(turn), math.sin(turn), 0]), *move)
    assert angle(a, b) == pytest.approx(min(turn, math.pi - turn), abs=1e-9)
    if math.sin(turn) > 1e-4 or turn == 0.0:
        assert distance(a, b) == pytest.approx(apart, rel=1e-9)


def test_tolerances_are_relative_to_the_characteristic_length():
    a, b = PlueckerLine.along([0, 0, 0], [1, 0, 0]), PlueckerLine.along([0, 0, 1e-7], [0, 1, 0])
    assert not meet(a, b, 1.0)
    assert meet(a, b, 1e3)
    assert are_coplanar(a, b, 1e3)
    assert not are_coplanar(a, b, 1.0)
    assert not are_parallel(a, b)


# --- several lines ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_a_common_point_is_found_wherever_it_is(seed):
    found = varieties.placed(varieties.bundle, np.random.default_rng(seed), others=0)
    point = common_point(found.lines, found.length)
    assert not point.at_infinity
    assert point.xyz == pytest.approx(found.point(found.built.points[0]), abs=1e-10 * found.length)
    found = varieties.placed(varieties.parallels, np.random.default_rng(seed), others=0)
    point = common_point(found.lines, found.length)
    assert point.at_infinity
    assert np.cross(point.xyz, found.turn @ found.built.directions[0]) == pytest.approx(np.zeros(3), abs=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_a_common_plane_holds_all_points(seed):
    found = varieties.placed(varieties.plane, np.random.default_rng(seed), others=0)
    plane = common_plane(found.lines, found.length)
    for segment in found.built.segments:
        for end in segment:
            assert plane.normal @ found.point(end) == pytest.approx(plane.offset, abs=1e-10 * found.length)


def test_lines_without_a_common_point_or_plane_have_none():
    rng = np.random.default_rng(0)
    lines = [_random(rng) for _ in range(3)]
    assert common_point(lines, 1.0) is None
    assert common_plane(lines, 1.0) is None


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("maker", "count"),
    [
        (varieties.hyperbolic, 2),
        (varieties.hyperbolic_one_far, 2),
        (varieties.parabolic, 1),
        (varieties.parabolic_far, 1),
        (varieties.elliptic, 0),
    ],
)
def test_four_lines_of_a_congruence_are_met_by_its_directors(maker, count, seed):
    found = varieties.placed(maker, np.random.default_rng(seed), others=0)
    across = transversals(found.lines[:4], found.length)
    assert not across.infinitely_many
    assert len(across.lines) == count
    for line in across.lines:
        if isinstance(line, LineAtInfinity):
            assert abs(line.normal @ found.turn @ found.built.normals[0]) == pytest.approx(1.0)
        else:
            slack = (1e-8 if count == 2 else 1e-6) * found.length  # a double root is half as accurate
            assert min(_apart(line, found.line(ends)) for ends in found.built.directors) < slack
            assert all(_apart(line, other) < slack for other in found.lines[:4])


@pytest.mark.parametrize("maker", [varieties.hyperboloid, varieties.two_pencils, varieties.plane])
def test_four_dependent_lines_have_infinitely_many_transversals(maker):
    found = varieties.placed(maker, np.random.default_rng(4), others=0)
    assert transversals(found.lines, found.length).infinitely_many
