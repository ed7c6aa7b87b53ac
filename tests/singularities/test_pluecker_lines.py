"""Pluecker lines and screws against points and motions: what they are made of, computed without moments."""

import math

import numpy as np
import pytest
import varieties
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cinegen.errors import CinegenError
from cinegen.singularities.pluecker import LineFrame, PlueckerError, PlueckerLine, Screw

seeds = st.integers(0, 2**32 - 1)


def _random(rng):
    return PlueckerLine.through(*rng.normal(size=(2, 3)))


# --- one line ---------------------------------------------------------------------------------------------------------


@given(seeds, st.floats(1e-6, 1e6))
def test_its_moment_is_that_of_all_its_points(seed, length):
    a, b = length * np.random.default_rng(seed).normal(size=(2, 3))
    line = PlueckerLine.through(a, b)
    assert np.linalg.norm(line.direction) == pytest.approx(1.0)
    for s in (-3.0, 0.0, 0.5, 1.0, 7.0):
        assert np.cross(a + s * (b - a), line.direction) == pytest.approx(line.moment, abs=1e-13 * length)
    assert line.coordinates == pytest.approx(np.hstack([line.direction, line.moment]))
    assert line.point == pytest.approx((a + b) / 2)
    assert line.direction @ (b - a) > 0.0


@given(seeds)
def test_it_moves_with_its_points(seed):
    rng = np.random.default_rng(seed)
    a, b, shift = rng.normal(size=(3, 3))
    turn = varieties.rotation(rng)
    moved, expected = (
        varieties.moved(PlueckerLine.through(a, b), turn, shift),
        PlueckerLine.through(turn @ a + shift, turn @ b + shift),
    )
    for name in ("direction", "moment", "point"):
        assert getattr(moved, name) == pytest.approx(getattr(expected, name), abs=1e-12)


@pytest.mark.parametrize(("make", "says"), [
    (lambda: PlueckerLine.through([1, 2, 3], [1, 2, 3]), "two points are one"),
    (lambda: PlueckerLine.along([0, 0, 0], [0, 0, 0]), "direction is zero"),
    (lambda: PlueckerLine.along([0, math.nan, 0], [1, 0, 0]), "three finite numbers"),
    (lambda: PlueckerLine.along([0, 0], [1, 0, 0]), "three finite numbers"),
    (lambda: LineFrame.of([], 1.0), "no lines"),
    (lambda: LineFrame.of([PlueckerLine.along([0, 0, 0], [1, 0, 0])], 0.0), "positive"),
])  # fmt: skip
def test_what_makes_no_line_says_why(make, says):
    with pytest.raises(PlueckerError, match=says) as caught:
        make()
    assert isinstance(caught.value, CinegenError)


# --- screws -----------------------------------------------------------------------------------------------------------


@given(seeds, st.floats(-2.0, 2.0))
def test_a_screw_is_the_velocity_of_its_motion(seed, pitch):
    rng = np.random.default_rng(seed)
    axis, step, point = _random(rng), 1e-6, rng.normal(size=3)
    screw = Screw(axis, pitch)
    w, v = screw.coordinates[:3], screw.coordinates[3:]
    turn = Rotation.from_rotvec(step * axis.direction).as_matrix()
    moved = axis.point + turn @ (point - axis.point) + pitch * step * axis.direction
    assert (moved - point) / step == pytest.approx(v + np.cross(w, point), abs=2e-5)
    back = LineFrame(np.zeros(3), 1.0).screw(3.0 * screw.coordinates, 1e-9)
    assert back.pitch == pytest.approx(pitch, abs=1e-8)
    assert abs(back.axis.direction @ axis.direction) == pytest.approx(1.0)
    assert back.axis.nearest(axis.point) == pytest.approx(axis.point, abs=1e-9)
