"""Closures of six revolute joints by elimination: against the loop itself, and where there is nothing to count."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cinegen.assembly.elimination import BITS, DegenerateError, closures
from cinegen.balls import frame, precise

RIGHT = math.pi / 2.0


def step(a, d, alpha) -> pin.SE3:
    return pin.SE3(pin.exp3(np.array([alpha, 0.0, 0.0])), np.array([a, 0.0, d]))


def turn(angle) -> pin.SE3:
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3))


def closed(steps, angles) -> tuple[list[pin.SE3], np.ndarray]:
    """A loop that is closed at these angles: the last placement brings it back."""
    placement = pin.SE3.Identity()
    for k, (constant, angle) in enumerate(zip(steps, angles, strict=True)):
        placement = placement * turn(angle) * (constant if k < 5 else pin.SE3.Identity())
    return [*steps[:5], placement.inverse()], np.array(angles)


def counted(loop):
    with precise(BITS):
        return closures([frame(constant.rotation, constant.translation) for constant in loop])


def gap(loop, angles) -> float:
    placement = pin.SE3.Identity()
    for constant, angle in zip(loop, angles, strict=True):
        placement = placement * turn(angle) * constant
    return float(np.abs(placement.homogeneous - np.eye(4)).max())


def near(angles, other) -> float:
    return float(np.abs((angles - other + math.pi) % (2.0 * math.pi) - math.pi).max())


def general(rng):
    return [step(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3.0, 3.0)) for _ in range(6)]


def almost_parallel(rng, off):
    """Joints 2, 3 and 4 of a UR, off by this much."""
    a, d = (0.0, -0.6, -0.57, 0.0, 0.0, 0.0), (0.18, 0.0, 0.0, 0.17, 0.12, 0.1)
    alpha = (RIGHT, 0.0, 0.0, RIGHT, -RIGHT, 0.0)
    return [step(*(np.array(numbers) + off * rng.normal(size=3))) for numbers in zip(a, d, alpha, strict=True)]


@pytest.mark.parametrize(("made", "seed"), [
    (general, 0), (general, 1), *(((lambda rng, off=off: almost_parallel(rng, off)), 2) for off in (
        1e-3, 1e-6, 1e-9, 1e-13))
])  # fmt: skip
def test_as_many_closures_as_real_roots_and_the_known_one_is_among_them(made, seed):
    rng = np.random.default_rng(seed)
    loop, angles = closed(made(rng), rng.uniform(-3.0, 3.0, 6))
    roots = counted(loop)
    assert len(roots.angles) == roots.real
    assert roots.real % 2 == 0
    assert max(gap(loop, solved) for solved in roots.angles) < 1e-12
    assert min(near(solved, angles) for solved in roots.angles) < 1e-10
    assert all(near(solved, other) > 1e-6 for k, solved in enumerate(roots.angles) for other in roots.angles[:k])


@settings(max_examples=10)
@given(st.integers(0, 10**6), st.floats(-10.0, -1.0), st.integers(1, 5))
def test_closures_do_not_depend_on_where_the_loop_begins(seed, exponent, first):
    rng = np.random.default_rng(seed)
    loop, angles = closed(almost_parallel(rng, 10.0**exponent), rng.uniform(-3.0, 3.0, 6))
    roots, turned = counted(loop), counted([*loop[first:], *loop[:first]])
    assert roots.real == turned.real
    assert min(near(solved, angles) for solved in roots.angles) < 1e-6
    for solved in roots.angles:
        assert min(near(np.roll(solved, -first), other) for other in turned.angles) < 1e-6


def test_a_loop_that_can_not_be_closed_has_no_real_root():
    rng = np.random.default_rng(0)
    loop, _ = closed(general(rng), rng.uniform(-3.0, 3.0, 6))
    loop[5].translation = np.array([50.0, 0.0, 0.0])
    assert counted(loop).real == len(counted(loop).angles) == 0


def test_axes_that_are_exactly_special_are_not_counted():
    rng = np.random.default_rng(1)
    loop, _ = closed(almost_parallel(rng, 0.0), rng.uniform(-3.0, 3.0, 6))
    with pytest.raises(DegenerateError):
        counted(loop)


def test_a_loop_whose_first_and_last_axis_are_one_line_turns_about_it_and_is_not_counted():
    rng = np.random.default_rng(2)
    steps = general(rng)
    loop, angles = closed(steps, rng.uniform(-3.0, 3.0, 6))
    loop[5] = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.4]))
    inner = pin.SE3.Identity()
    for constant, angle in zip(loop[1:5], angles[1:5], strict=True):
        inner = inner * turn(angle) * constant
    loop[0] = (inner * loop[5]).inverse()
    assert gap(loop, [0.7, *angles[1:5], -0.7]) < 1e-12
    with pytest.raises(DegenerateError):
        counted(loop)


def test_two_closures_that_coincide_are_both_found_though_rounding_may_make_them_complex():
    """At angles of 0 all axes are at right angles to x, about which nothing rotates: a singularity."""
    loop, angles = closed(general(np.random.default_rng(3)), np.zeros(6))
    roots = counted(loop)
    assert sum(near(solved, angles) < 1e-6 for solved in roots.angles) == 2
