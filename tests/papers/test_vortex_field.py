"""Vortices of shapes, against distances that are computed otherwise."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from polygons import convex, distance, holds, normal
from vortex_field import Vortex

from cinegen.planning.descent import Firas

Z = np.array([0.0, 0.0, 1.0])
lengths = st.floats(-2.0, 2.0).map(lambda x: round(x, 4))
points = arrays(float, 3, elements=lengths)


@given(points)
def test_the_vortex_of_a_shape_is_equation_4_for_a_point(point):
    d = float(np.hypot(*point[:2]))
    assume(d > 0.01)
    n = np.array([*point[:2] / d, 0.0])
    vortex = Vortex(1.0, 1e12)
    assert vortex.velocity(d, n, Z) == pytest.approx(np.array([-point[1], point[0], 0.0]) / d**2, abs=1e-9 / d)
    assert vortex.velocity(d, n, -Z) == pytest.approx(-vortex.velocity(d, n, Z))


@given(convex(), points)
def test_around_a_polygon_it_is_tangent_to_firas_contours(polygon, point):
    """To finite differences of the potential, which know only the distance."""
    point = point * [1.0, 1.0, 0.0]
    d = distance(polygon, point)
    assume(not holds(polygon, point) and 0.02 < d < 1.99)
    firas = Firas(1.0, 2.0)
    steps = 1e-6 * np.eye(3)
    slope = np.array(
        [float(firas.value(distance(polygon, point + e)) - firas.value(distance(polygon, point - e))) for e in steps]
    )
    slope /= np.linalg.norm(slope)
    velocity = Vortex(1.0, 2.0).velocity(d, normal(polygon, point), Z)
    size = np.linalg.norm(velocity)
    assert velocity @ slope == pytest.approx(0.0, abs=1e-4 * size)
    assert np.cross(-slope, velocity)[2] > 0.999 * size  # counterclockwise
    assert size == pytest.approx(1.0 / d - 0.5)


@settings(max_examples=25)
@given(convex(), st.integers(0, 2**32 - 1))
def test_around_a_convex_polygon_it_is_continuous(polygon, seed):
    """Along a way across all pieces of the contours, and the end of the range: steps shrink with the way's."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-3.0, 3.0, (2, 3)) * [1.0, 1.0, 0.0]
    vortex = Vortex(1.0, 1.0)
    way = a + np.linspace(0.0, 1.0, 301)[:, None] * (b - a)
    way = [p for p in way if not holds(polygon, p)]
    d = np.array([distance(polygon, p) for p in way])
    field = vortex.velocity(d, np.array([normal(polygon, p) for p in way]), Z)
    jumps, steps = np.linalg.norm(np.diff(field, axis=0), axis=1), np.linalg.norm(np.diff(way, axis=0), axis=1)
    near = np.minimum(d[1:], d[:-1])
    clear = (near > 0.05) & (steps < 0.04)  # not over the polygon itself
    # |dV| <= |m'| |dd| + m |dn|, with |dd| and |dn| at most a step, over d for the second.
    assert (jumps[clear] <= 2.5 * steps[clear] / near[clear] ** 2).all()


def test_the_modulus_ends_continuously():
    d = np.array([0.5 - 1e-9, 0.5, 0.6])
    assert Vortex(2.0, 0.5).modulus(d) == pytest.approx(0.0, abs=1e-7)
    assert Vortex(2.0, 0.5).modulus(0.25) == pytest.approx(4.0)
    assert np.isnan(Vortex(2.0, 0.5).modulus([0.0, -1.0])).all()
