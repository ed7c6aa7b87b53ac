"""The elliptical potential against its definition and finite differences."""

import math

import numpy as np
import pytest
from descents import slopes_at
from elliptical_potential import Elliptical
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

lengths = st.floats(-2.0, 2.0).map(lambda x: round(x, 4))
points = arrays(float, 3, elements=lengths)
halves = arrays(float, 3, elements=st.floats(0.02, 0.6))


@given(halves, points, st.floats(0.3, 1.7), st.integers(0, 2**32 - 1))
def test_the_elliptical_gradient_is_that_of_its_value(half, point, rounding, seed):
    axes = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    field = Elliptical([0.1, -0.2, 0.3], half, 0.4, 0.8, rounding, axes)
    assume(field.pseudo_distance(point) > 0.05)
    got = field.gradient(point)
    assert got == pytest.approx(slopes_at(field.value, point, 1e-6), abs=1e-4 * (1e-3 + np.linalg.norm(got)))


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


def test_contours_are_the_box_near_it_and_spheres_far_away():
    half = np.array([0.1, 0.2, 0.4])
    field = Elliptical([0, 0, 0], half)
    corner = half * (1.0 + 1e-9)
    on_faces = [[0.1 + 1e-9, 0.15, -0.3], [0.02, 0.2 + 1e-9, 0.1], [0.09, 0.19, 0.4 + 1e-9]]
    assert field.pseudo_distance([*on_faces, corner]) == pytest.approx(0.0, abs=1e-7)
    way = Rotation.random(20, rng=np.random.default_rng(1)).apply([0.0, 0.0, 1.0])
    far = field.pseudo_distance(1e3 * way)
    assert far == pytest.approx(1e3 / 0.4 - 1.0, rel=1e-9)
    gradients = field.gradient(20.0 * way)
    assert gradients == pytest.approx(-np.linalg.norm(gradients, axis=1)[:, None] * way, abs=1e-12)
