"""The paraboloid, and how far to go along a direction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import approx_fprime, minimize_scalar

from cinegen.collision.errors import AvoidError
from cinegen.planning.fields import FieldError, Paraboloid, exact_step, line_search

lengths = st.floats(-3.0, 3.0).map(lambda x: round(x, 4))
vectors = arrays(float, 3, elements=lengths)
LINKS = (0.5, 0.4, 0.3)


def tip(q):
    """The end of a planar 3R arm."""
    turned = np.cumsum(q)
    return np.array([LINKS @ np.cos(turned), LINKS @ np.sin(turned), 0.0])


def jacobian(q):
    turned = np.cumsum(q)
    parts = np.array([-np.multiply(LINKS, np.sin(turned)), np.multiply(LINKS, np.cos(turned)), np.zeros(3)])
    return np.cumsum(parts[:, ::-1], axis=1)[:, ::-1]


@given(vectors, arrays(float, (4, 3), elements=lengths), st.floats(0.1, 10.0))
def test_the_gradient_is_that_of_the_value(goal, points, stiffness):
    field = Paraboloid(goal, stiffness)
    for point, gradient in zip(points, field.gradient(points), strict=True):
        assert approx_fprime(point, field.value, 1e-6) == pytest.approx(gradient, abs=1e-4)
    assert field.value(goal) == 0.0
    assert field.value(points) == pytest.approx(0.5 * stiffness * np.linalg.norm(points - goal, axis=1) ** 2)


@given(vectors, arrays(float, 3, elements=st.floats(-math.pi, math.pi)))
def test_equation_1_is_the_derivative_by_the_joints(goal, q):
    field = Paraboloid(goal, 2.0)
    wanted = approx_fprime(q, lambda joints: float(field.value(tip(joints))), 1e-7)
    assert field.joint_gradient(jacobian(q), tip(q)) == pytest.approx(wanted, abs=1e-5)


@given(vectors, vectors)
def test_the_exact_step_is_the_lowest_point_of_the_line(error, motion):
    step = exact_step(error, motion)
    if np.linalg.norm(motion) < 1e-2:
        return
    found = minimize_scalar(lambda t: np.sum((error + t * motion) ** 2), bracket=(step - 1.0, step + 1.3))
    assert np.linalg.norm(error + step * motion) <= np.linalg.norm(error + found.x * motion) + 1e-9
    assert step == pytest.approx(found.x, abs=1e-5)


def test_what_does_not_move_takes_no_step():
    assert exact_step([1.0, 2.0, 3.0], [0.0, 0.0, 0.0]) == 0.0


@given(st.floats(0.1, 10.0), st.floats(-10.0, -0.1), st.floats(1.05, 50.0))
def test_the_search_finds_the_minimum_of_a_parabola(bend, slope, times):
    lowest = -slope / bend
    step = line_search(lambda t: slope * t + 0.5 * bend * t * t, slope, times * lowest)
    assert step == pytest.approx(lowest, rel=2e-4)


def test_the_search_goes_as_far_as_it_may_where_all_falls():
    assert line_search(lambda t: -t, -1.0, 0.3) == 0.3


def test_the_search_stays_out_of_where_nothing_is_defined():
    for wall in (math.inf, math.nan):
        step = line_search(lambda t, wall=wall: wall if t >= 0.2 else -t, -1.0, 1.0)
        assert 0.0 < step < 0.2


@pytest.mark.parametrize("slope", [0.0, 1.0, math.nan])
def test_uphill_there_is_no_step(slope):
    assert line_search(lambda t: slope * t, slope, 1.0) == 0.0


def test_no_step_leads_down_where_the_slope_lies():
    assert line_search(lambda t: abs(t), -1.0, 1.0) == 0.0


def test_an_arm_comes_to_its_goal_by_steepest_descent():
    goal = tip(np.array([0.9, -0.7, 0.8]))
    field, q = Paraboloid(goal), np.array([0.1, 0.3, 0.2])
    values = [float(field.value(tip(q)))]
    for _ in range(300):
        down = -field.joint_gradient(jacobian(q), tip(q))
        q = q + down * line_search(lambda t, q=q, d=down: float(field.value(tip(q + t * d))), -float(down @ down), 10.0)
        values.append(float(field.value(tip(q))))
    assert (np.diff(values) <= 0.0).all()
    assert tip(q) == pytest.approx(goal, abs=1e-6)


@pytest.mark.parametrize(("goal", "stiffness"), [([0, 0], 1.0), ([0, 0, math.nan], 1.0), ([0, 0, 0], 0.0)])
def test_what_is_no_paraboloid_is_refused(goal, stiffness):
    with pytest.raises(FieldError, match="attraction"):
        Paraboloid(goal, stiffness)
    assert issubclass(FieldError, AvoidError)
