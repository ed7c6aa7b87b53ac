"""The gap of a loop is zero where its ends meet, and only there; and its derivative is one."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mechanisms import Matrix, shift, turn

from raff2urdf.raff.document import LoopKind
from raff2urdf.residual import ROWS, log, log_derivative, loop_residual, skew

STEP = 1e-6
NUMERIC = 2e-9  # error of a central difference with STEP: 1e-16 / STEP, and third derivatives times STEP^2

kinds = st.sampled_from(LoopKind)
small = st.floats(-1, 1)
vectors = st.builds(lambda x, y, z: np.array([x, y, z]), small, small, small)


@st.composite
def directions(draw: st.DrawFn) -> np.ndarray:
    """Unit vectors, along the axes now and then."""
    if draw(st.booleans()):
        return np.eye(3)[draw(st.integers(0, 2))] * draw(st.sampled_from([1.0, -1.0]))
    v = draw(vectors)
    size = float(np.linalg.norm(v))
    assume(size > 0.1)
    return v / size


@st.composite
def placements(draw: st.DrawFn, farthest: float = 3.0) -> Matrix:
    """A second end seen from the first, turned by up to `farthest`, very little now and then."""
    angle = draw(st.floats(0, farthest) | st.floats(-12, -1).map(lambda exponent: 10.0**exponent))
    return pin.SE3(pin.exp3(angle * draw(directions())), draw(vectors)).homogeneous


# --- the rotation vector -----------------------------------------------------------------------------------------


small_angles = st.floats(-100, -1).map(lambda exponent: 10.0**exponent)


@given(directions(), st.floats(0, 3.1) | small_angles | small_angles.map(lambda below: math.pi - max(below, 1e-15)))
@settings(max_examples=350)
def test_the_rotation_vector_has_angle_and_direction(direction: np.ndarray, angle: float) -> None:
    """A small rotation is seen in the antisymmetric part of R alone: the trace is 3 to the last digit (Rodrigues)."""
    cross = skew(direction)
    rotation = np.eye(3) + math.sin(angle) * cross + 2.0 * math.sin(angle / 2.0) ** 2 * cross @ cross
    exact = angle * 1e-15 if angle < 0.1 else 2e-15 if angle > 3.1 else 1e-12
    assert np.allclose(log(rotation), angle * direction, rtol=1e-14 * (angle <= 0.1), atol=exact)


@given(directions())
@settings(max_examples=60)
def test_a_rotation_by_pi_has_one_of_its_two_vectors(direction: np.ndarray) -> None:
    half_turn = 2.0 * np.outer(direction, direction) - np.eye(3)
    vector = log(half_turn)
    assert min(np.abs(vector - math.pi * direction).max(), np.abs(vector + math.pi * direction).max()) <= 2e-15


SMALL = 3e-3  # rad: below, Pinocchio's is wrong by up to 2e-9


@given(directions(), st.floats(SMALL, 3.1) | st.floats(-2.5, -1.5).map(lambda exponent: 10.0**exponent))
@settings(max_examples=150)
def test_the_derivative_of_the_rotation_vector_is_pinocchios(direction: np.ndarray, angle: float) -> None:
    """Pinocchio's is by the velocity in the moving axes, one rotation away."""
    rotation = pin.exp3(angle * direction)
    assert np.allclose(log_derivative(angle * direction), pin.Jlog3(rotation) @ rotation.T, rtol=0, atol=1e-11)


@given(directions(), st.floats(0.0, SMALL))
@settings(max_examples=150)
def test_the_derivative_of_a_small_rotation_vector_is_its_series(direction: np.ndarray, angle: float) -> None:
    """The inverse of the left Jacobian of SO(3), by Bernoulli's numbers; what is left out is below 1e-19 here."""
    cross = angle * skew(direction)
    series = np.eye(3) - cross / 2.0 + cross @ cross / 12.0 - np.linalg.matrix_power(cross, 4) / 720.0
    assert np.allclose(log_derivative(angle * direction), series, rtol=0, atol=1e-15)


# --- the gap's derivative ----------------------------------------------------------------------------------------


def numeric(kind: LoopKind, placement: Matrix, length: float) -> np.ndarray:
    """Central differences by a twist of the second end, in the first end's axes and at its origin."""
    columns = []
    for i in range(6):
        twist = np.zeros(6)
        twist[i] = STEP
        ahead, behind = (pin.exp6(sign * twist).homogeneous @ placement for sign in (1.0, -1.0))
        columns.append((loop_residual(kind, ahead, length)[0] - loop_residual(kind, behind, length)[0]) / (2.0 * STEP))
    return np.column_stack(columns)


@given(kinds, placements(), st.floats(0.3, 3.0))
@settings(max_examples=250)
def test_the_derivative_of_a_gap_is_that_of_finite_differences(kind: LoopKind, placement: Matrix, length) -> None:
    """However far open the loop; only beside a half turn, where the rotation vector jumps, is there none."""
    assume(kind is not LoopKind.REVOLUTE or placement[2, 2] > -0.95)
    derivative = loop_residual(kind, placement, length)[1]
    error = np.abs(derivative - numeric(kind, placement, length)).max()
    assert error <= NUMERIC * max(1.0, np.abs(derivative).max()) ** 3


# --- where it is zero --------------------------------------------------------------------------------------------


@st.composite
def freedoms(draw: st.DrawFn, kind: LoopKind) -> Matrix:
    """A placement of the second end that the joint allows."""
    if kind is LoopKind.PRISMATIC:
        return shift("z", draw(st.floats(-5, 5)))
    if kind is LoopKind.REVOLUTE:
        return turn("z", draw(st.floats(-7, 7)))
    if kind is LoopKind.BALL:
        return pin.SE3(pin.exp3(draw(st.floats(0, 7)) * draw(directions())), np.zeros(3)).homogeneous
    return np.eye(4)


# What each joint forbids, as columns of twists (linear, then angular) in its own axes.
FORBIDDEN = {
    LoopKind.RIGID: [0, 1, 2, 3, 4, 5],
    LoopKind.PRISMATIC: [0, 1, 3, 4, 5],
    LoopKind.REVOLUTE: [0, 1, 2, 3, 4],
    LoopKind.BALL: [0, 1, 2],
}


@given(st.data(), kinds, st.floats(1e-6, 1.0), st.sampled_from([0.5, 1.0, 2.0]))
@settings(max_examples=200)
def test_a_gap_is_as_large_as_the_ends_are_off_what_the_joint_allows(data, kind: LoopKind, size, length) -> None:
    """Off by `size` in one forbidden direction (rad or m), the residual is that, in rad or characteristic lengths."""
    allowed = data.draw(freedoms(kind))
    direction = data.draw(st.sampled_from(FORBIDDEN[kind]))
    twist = np.zeros(6)
    twist[direction] = size
    assert np.abs(loop_residual(kind, allowed, length)[0]).max() <= 1e-15
    residual = loop_residual(kind, pin.exp6(twist).homogeneous @ allowed, length)[0]
    assert np.linalg.norm(residual) >= 0.999 * size * (1.0 / length if direction < 3 else 1.0)


@given(st.data(), kinds)
@settings(max_examples=100)
def test_a_closed_joint_moves_freely_as_it_may_and_not_at_all_else(data: st.DataObject, kind: LoopKind) -> None:
    """The derivative's null space, at a closed loop, is the joint's freedom: in the first end's axes."""
    derivative = loop_residual(kind, data.draw(freedoms(kind)), 1.0)[1]
    free = [i for i in range(6) if i not in FORBIDDEN[kind]]
    assert np.linalg.matrix_rank(derivative, tol=1e-8) == ROWS[kind]
    assert np.abs(derivative[:, free]).max(initial=0.0) <= 1e-14 or kind is LoopKind.PRISMATIC
    if kind is LoopKind.PRISMATIC:  # p_z turns into p_x and p_y: only the slide itself is free
        assert np.abs(derivative[:, 2]).max() <= 1e-14


@pytest.mark.parametrize("flip", [turn("x", math.pi), turn("y", math.pi), turn("z", 1.0) @ turn("x", math.pi)])
def test_a_hinge_with_opposite_axes_is_not_closed(flip: Matrix) -> None:
    residual, derivative = loop_residual(LoopKind.REVOLUTE, flip, 1.0)
    assert np.linalg.norm(residual) == pytest.approx(math.pi)
    assert np.isfinite(derivative).all()


nearly_pi = st.floats(-12, -2).map(lambda exponent: math.pi - 10.0**exponent)


@given(st.floats(-7, 7), st.floats(0, 3.1) | nearly_pi, st.floats(-7, 7))
@settings(max_examples=160)
def test_a_hinges_gap_is_the_angle_between_its_axes_whatever_the_turn_about_them(before, angle, after) -> None:
    swung = turn("z", before) @ turn("x", angle) @ turn("z", after)
    gap = np.linalg.norm(loop_residual(LoopKind.REVOLUTE, swung, 1.0)[0])
    assert gap == pytest.approx(angle, rel=0, abs=1e-14 if angle <= 3.1 else 2e-9)
