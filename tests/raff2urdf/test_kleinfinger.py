"""Six parameters stand for one rigid transform, and back."""

import math

import numpy as np
import pytest
from elementary import kleinfinger
from hypothesis import given, settings
from hypothesis import strategies as st
from mechanisms import Matrix, turn

from raff2urdf.raff.kleinfinger import Kleinfinger, parameters, transform

EXACT = 1e-12  # m and rad, for lengths up to some metres: a few thousand roundings
SKEWED = 3e-8
"""What is lost (m or rad, for positions of 1 m) where two axes are nearly parallel and yet not quite: the common
perpendicular then lies at r = 1 / alpha, and its rounding costs some 1e-16 / alpha; leaving alpha away costs alpha. The
lesser of both is largest where they are equal, at the square root of some 1e-16."""

angles = st.sampled_from([math.radians(degrees) for degrees in (0, 90, -90, 180, -180, 270, 360)]) | st.floats(-7, 7)
lengths = st.just(0.0) | st.floats(-3, 3)
tiny = st.floats(-17, -3).map(lambda exponent: 10.0**exponent)
nearly_parallel = st.builds(lambda side, sign, angle: side + sign * angle, st.sampled_from([0.0, math.pi]),
                            st.sampled_from([1, -1]), tiny)  # fmt: skip
kleinfingers = st.builds(Kleinfinger, angles, lengths, angles | nearly_parallel, lengths, angles, lengths)
turns = st.floats(-3.1, 3.1)
generic = st.builds(Kleinfinger, turns, lengths, st.floats(0.1, 3.0), lengths, turns, lengths)


def off(matrix: Matrix, other: Matrix) -> float:
    return float(np.abs(matrix - other).max())


@given(kleinfingers)
@settings(max_examples=300)
def test_the_transform_is_the_product_of_its_six_elementary_ones_and_comes_back_exactly(k: Kleinfinger) -> None:
    """Rz(gamma) Tz(epsilon) Rx(alpha) Tx(d) Rz(theta) Tz(r), from father to link, however nearly parallel the axes."""
    placement = transform(k)
    assert off(placement, kleinfinger(*k)) <= EXACT
    assert off(transform(parameters(placement)), placement) <= EXACT


@given(generic)
@settings(max_examples=200)
def test_the_parameters_themselves_come_back_where_they_are_unique(k: Kleinfinger) -> None:
    """That is where the axes are not parallel, with alpha from 0 to 180 degrees, and the others from -180 to 180."""
    assert np.allclose(parameters(transform(k)), k, rtol=0, atol=1e-11)


@st.composite
def placements(draw: st.DrawFn, alphas: st.SearchStrategy[float]) -> Matrix:
    """Any rotation whose z is `alpha` off the father's, at any place: not made of moderate parameters."""
    placement = turn("z", draw(angles)) @ turn("x", draw(alphas)) @ turn("z", draw(angles))
    placement[:3, 3] = [draw(lengths) for _ in range(3)]
    return placement


@given(placements(tiny | tiny.map(lambda angle: math.pi - angle)))
@settings(max_examples=300)
def test_a_placement_on_a_nearly_parallel_axis_comes_back_as_well_as_doubles_allow(placement: Matrix) -> None:
    size = max(1.0, float(np.abs(placement[:3, 3]).max()))
    assert off(transform(parameters(placement)), placement) <= SKEWED * size


@pytest.mark.parametrize("side", [0.0, math.pi])
@pytest.mark.parametrize("far", [1.0, 1e6, 1e9, 1e11, 1e12, 1e13])
@pytest.mark.parametrize("angle", [2e-3, 5e-3, 1e-2])
def test_an_axis_keeps_its_tilt_however_far_away_it_is(angle: float, far: float, side: float) -> None:
    """Up to the largest coordinate that a URDF may have. The tilt is far above any rounding of a rotation."""
    placement = turn("z", 0.4) @ turn("x", side + angle) @ turn("z", -1.1)
    placement[:3, 3] = far * np.array([0.9, -0.6, 0.7])
    assert off(transform(parameters(placement))[:3, :3], placement[:3, :3]) <= EXACT


@given(placements(st.sampled_from([0.0, math.pi])))
@settings(max_examples=60)
def test_between_parallel_axes_the_perpendicular_is_taken_through_the_new_origin(placement: Matrix) -> None:
    k = parameters(placement)
    assert k.r == 0.0
    assert k.d == pytest.approx(math.hypot(placement[0, 3], placement[1, 3]), abs=1e-15)
    assert k.epsilon == placement[2, 3]


def changed(row: int, column: int, value: float) -> Matrix:
    placement = np.eye(4)
    placement[row, column] = value
    return placement


NO_RIGID_TRANSFORM = {
    "3x3": np.eye(3), "stack": np.zeros((2, 4, 4)), "zero": np.zeros((4, 4)), "nan": changed(0, 3, math.nan),
    "inf": changed(1, 1, math.inf), "mirror": changed(0, 0, -1.0), "scaled": changed(0, 0, 1.001),
    "sheared": changed(0, 1, 1e-3), "twice": 2.0 * np.eye(4), "perspective": changed(3, 0, 0.5),
    "bottom": changed(3, 3, 2.0),
}  # fmt: skip


@pytest.mark.parametrize("name", NO_RIGID_TRANSFORM)
def test_what_is_no_rigid_transform_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="placement"):
        parameters(NO_RIGID_TRANSFORM[name])
