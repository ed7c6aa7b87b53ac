"""FIRAS, spherical and elliptical potentials against their definitions and finite differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from polygons import convex, distance, holds, normal
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from cinegen.planning.potential_fields import CONTACT, Elliptical, FieldError, Firas, Spherical

lengths = st.floats(-2.0, 2.0).map(lambda x: round(x, 4))
points = arrays(float, 3, elements=lengths)
halves = arrays(float, 3, elements=st.floats(0.02, 0.6))


def slopes(value, point, step=1e-6):
    """Central differences."""
    return np.array([(value(point + e) - value(point - e)) / (2.0 * step) for e in step * np.eye(3)])


@given(convex(), points, st.floats(0.2, 3.0))
def test_firas_has_the_gradient_of_its_value_around_any_convex_polygon(polygon, point, reach):
    point = point * [1.0, 1.0, 0.0]
    d = distance(polygon, point)
    assume(not holds(polygon, point) and d > 0.02 and abs(d - reach) > 1e-4)
    field = Firas(0.3, reach)
    wanted = slopes(lambda p: float(field.value(distance(polygon, p))), point)
    got = field.gradient(d, normal(polygon, point))
    assert got == pytest.approx(wanted, abs=1e-4 * (1.0 + np.linalg.norm(got)))


def test_firas_ends_at_its_reach_and_is_continuous_there():
    field, n = Firas(2.0, 0.5), np.array([1.0, 0.0, 0.0])
    assert field.value([0.25, 0.5, 0.7]) == pytest.approx([4.0, 0.0, 0.0])
    assert field.gradient([0.25, 0.5, 9.0], [n, n, n])[:, 0] == pytest.approx([-64.0, 0.0, 0.0])
    assert 0.0 < field.value(0.5 - 1e-7) < 1e-12
    assert -1e-4 < field.gradient(0.5 - 1e-7, n)[0] < 0.0


@pytest.mark.parametrize("d", [CONTACT, 0.0, -0.1, math.nan])
def test_at_contact_potentials_are_infinite_and_have_no_gradient(d):
    for field in (Firas(1.0, 1.0), Spherical(1.0)):
        assert field.value(d) == math.inf
        assert np.isnan(field.gradient(d, [1.0, 0.0, 0.0])).all()
    box, inside = Elliptical([0, 0, 0], [0.5, 0.5, 0.5]), [0.5 + min(d, 0.0), 0.0, 0.0] if d == d else [0.0, 0.0, 0.0]
    assert box.value(inside) == math.inf
    assert np.isnan(box.gradient(inside)).all()


@given(points, points, st.floats(0.0, 1.0), st.floats(0.3, 3.0))
def test_spherical_is_equation_2_measured_from_the_ball(centre, point, radius, gamma):
    away = np.linalg.norm(point - centre)
    assume(away - radius > 0.1)
    field = Spherical(0.7, gamma)
    assert field.value(away - radius) == pytest.approx(0.7 / (away - radius) ** (2.0 * gamma))
    got = field.gradient(away - radius, (point - centre) / away)
    wanted = slopes(lambda p: field.value(np.linalg.norm(p - centre) - radius), point)
    assert got == pytest.approx(wanted, rel=1e-4, abs=1e-4 * (1.0 + np.linalg.norm(got)))


def test_spherical_of_a_point_is_equation_2():
    e = np.array([0.7, 0.6, -0.7])
    assert Spherical(1.0, 1.5).value(np.linalg.norm(e)) == pytest.approx(1.0 / (e @ e) ** 1.5)


def test_one_ball_in_the_way_makes_no_minimum():
    """ "No local minima arise": what starts beside the line arrives; where the gradient vanishes there is a saddle."""
    goal, ball = np.array([1.0, 0.0, 0.0]), Spherical(0.01)

    def total(p):
        p = np.append(p, 0.0)
        return float(0.5 * (p - goal) @ (p - goal) + ball.value(np.linalg.norm(p) - 0.2))

    ends = [minimize(total, [-1.0, y], method="Nelder-Mead", options={"xatol": 1e-8}).x for y in (-0.3, -1e-3, 0.1)]
    assert np.ptp(ends, axis=0) == pytest.approx(0.0, abs=1e-5)
    assert ends[0] == pytest.approx(goal[:2], abs=0.1)


@given(halves, points, st.floats(0.3, 1.7), st.integers(0, 2**32 - 1))
def test_the_elliptical_gradient_is_that_of_its_value(half, point, rounding, seed):
    axes = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    field = Elliptical([0.1, -0.2, 0.3], half, 0.4, 0.8, rounding, axes)
    assume(field.pseudo_distance(point) > 0.05)
    got = field.gradient(point)
    assert got == pytest.approx(slopes(field.value, point), abs=1e-4 * (1e-3 + np.linalg.norm(got)))


@given(halves, points, st.floats(0.3, 1.7))
def test_a_point_lies_on_the_contour_of_its_pseudo_distance(half, point, rounding):
    """The published equation, with the root put in."""
    field = Elliptical([0, 0, 0], half, rounding=rounding)
    k = float(field.pseudo_distance(point))
    if (np.abs(point) <= half).all():
        assert k == 0.0
        return
    assume(k > 0.01)
    n, longest = 1.0 / (1.0 - math.exp(-rounding * k)), half.max()
    norm = sum((h / longest) ** 2 * (abs(x) / h / (1.0 + k)) ** (2.0 * n) for x, h in zip(point, half, strict=True))
    assert norm == pytest.approx(1.0, rel=1e-6)


@given(halves, arrays(float, 3, elements=st.floats(-1.0, 1.0)), st.floats(0.3, 1.7))
def test_along_a_ray_the_pseudo_distance_rises(half, way, rounding):
    """So contours lie in one another, and do not meet."""
    assume(np.linalg.norm(way) > 0.1)
    ray = np.linspace(0.0, 4.0, 60)[:, None] * way
    k = Elliptical([0, 0, 0], half, rounding=rounding).pseudo_distance(ray)
    outside = k > 0.0
    assert (np.diff(k)[outside[1:]] > 0.0).all()


def test_contours_are_the_box_near_it_and_spheres_far_away():
    half = np.array([0.1, 0.2, 0.4])
    field = Elliptical([0, 0, 0], half)
    corner = half * (1.0 + 1e-9)
    on_faces = [[0.1 + 1e-9, 0.15, -0.3], [0.02, 0.2 + 1e-9, 0.1], [0.09, 0.19, 0.4 + 1e-9]]
    assert field.pseudo_distance([*on_faces, corner]) == pytest.approx(0.0, abs=1e-7)
    way = Rotation.random(20, rng=np.random.default_rng(1)).apply([0.0, 0.0, 1.0])
    far = field.pseudo_distance(1e3 * way)
    assert far == pytest.approx(1e3 / 0.4 - 1.0, rel=1e-9)
    assert field.gradient(20.0 * way) == pytest.approx(
        -np.linalg.norm(field.gradient(20.0 * way), axis=1)[:, None] * way, abs=1e-12
    )


def test_a_prism_does_not_know_of_height():
    rod = Elliptical([0, 0, 0], [0.02, 0.4, math.inf])
    low, high = rod.value([[-0.3, 0.1, 0.0], [-0.3, 0.1, 5.0]])
    assert low == high
    assert rod.gradient([-0.3, 0.1, 2.0])[2] == 0.0


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Firas(0.0, 1.0), "strength"),
        (lambda: Firas(1.0, math.inf), "reach"),
        (lambda: Spherical(-1.0), "strength"),
        (lambda: Spherical(1.0, 0.0), "exponent"),
        (lambda: Elliptical([0, 0, math.nan], [1.0, 1.0, 1.0]), "centre"),
        (lambda: Elliptical([0, 0, 0], [1.0, 0.0, 1.0]), "half the edges"),
        (lambda: Elliptical([0, 0, 0], [math.inf] * 3), "half the edges"),
        (lambda: Elliptical([0, 0, 0], [1.0, 1.0, 1.0], axes=np.ones((3, 3))), "rotation"),
        (lambda: Elliptical([0, 0, 0], [1.0, 1.0, 1.0], rounding=1.9), "less than 1.82"),
    ],
)
def test_what_is_no_potential_is_refused(make, said):
    with pytest.raises(FieldError, match=said):
        make()
