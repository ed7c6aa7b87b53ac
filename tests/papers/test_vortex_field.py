"""Vortices of shapes, against distances that are computed otherwise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from polygons import NOTCHED, convex, distance, holds, normal
from vortex_field import Vortex

from cinegen.planning.descent import Firas

Z = np.array([0.0, 0.0, 1.0])
lengths = st.floats(-2.0, 2.0).map(lambda x: round(x, 4))
points = arrays(float, 3, elements=lengths)


def jacobian(field, point, step=1e-6):
    """(3, 3) central differences of a vector field; column by coordinate."""
    return np.array([(field(point + e) - field(point - e)) / (2.0 * step) for e in step * np.eye(3)]).T


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


@given(convex(), points)
def test_around_a_convex_polygon_it_has_no_divergence_and_the_curl_that_is_said(polygon, point):
    point = point * [1.0, 1.0, 0.0]
    d = distance(polygon, point)
    assume(not holds(polygon, point) and 0.05 < d < 1.9)
    vortex = Vortex(1.0, 2.0)
    normals = [normal(polygon, point + e) for e in 1e-3 * np.vstack([np.eye(3), -np.eye(3)])]
    corner = [min(np.linalg.norm(point[:2] - place) for place in polygon) < d + 1e-9 for _ in normals]
    flat = all(n == pytest.approx(normals[0], abs=1e-12) for n in normals)
    round_ = corner[0] and all(n @ normals[0] > 0.99 for n in normals) and not flat
    slopes = jacobian(lambda p: vortex.velocity(distance(polygon, p), normal(polygon, p), Z), point)
    near_seam = not (flat or round_) or (round_ and _seam(polygon, point))
    assume(not near_seam)
    assert np.trace(slopes) == pytest.approx(0.0, abs=1e-3 / d**2)
    bend = 0.0 if flat else 1.0 / d
    curl = -1.0 / d**2 + (1.0 / d - 0.5) * bend
    assert slopes[1, 0] - slopes[0, 1] == pytest.approx(curl, abs=1e-3 / d**2)


def _seam(polygon, point):
    """Whether a point is about where a contour's arc meets its straight piece."""
    places = [np.linalg.norm(point[:2] + e - q) for q in polygon for e in 1e-3 * np.vstack([np.eye(2), -np.eye(2)])]
    ds = [distance(polygon, point + np.append(e, 0.0)) for e in 1e-3 * np.vstack([np.eye(2), -np.eye(2)])]
    return any(min(places[k::4]) > d + 1e-12 for k, d in enumerate(ds))


@given(arrays(float, 3, elements=lengths), arrays(float, 3, elements=lengths))
def test_in_space_it_has_no_divergence_either(point, axis):
    """Around a capsule, with any constant axis."""
    a, b, radius = np.array([-0.5, 0.0, 0.1]), np.array([0.5, 0.2, -0.2]), 0.1
    assume(np.linalg.norm(axis) > 0.1)
    axis = axis / np.linalg.norm(axis)

    def away(p):
        t = (p - a) @ (b - a) / ((b - a) @ (b - a))
        offset = p - a - np.clip(t, 0.0, 1.0) * (b - a)
        size = np.linalg.norm(offset)
        return size - radius, offset / size, t

    d, _, t = away(point)
    assume(0.05 < d < 1.95 and min(abs(t), abs(t - 1.0)) > 1e-3)
    vortex = Vortex(1.0, 2.0)
    slopes = jacobian(lambda p: vortex.velocity(*away(p)[:2], axis), point)
    assert np.trace(slopes) == pytest.approx(0.0, abs=1e-3 / d**2)


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


def test_on_the_medial_axis_of_a_notch_it_jumps():
    """Between two walls the nearest side changes: there the paper's field is not continuous, nor is this."""
    left, right = np.array([1.5 - 1e-9, 2.0, 0.0]), np.array([1.5 + 1e-9, 2.0, 0.0])
    vortex = Vortex(1.0, 2.0)
    one, other = (vortex.velocity(distance(NOTCHED, p), normal(NOTCHED, p), Z) for p in (left, right))
    assert one == pytest.approx(-other, abs=1e-6)
    assert np.linalg.norm(one) > 1.0


def test_the_modulus_ends_continuously():
    d = np.array([0.5 - 1e-9, 0.5, 0.6])
    assert Vortex(2.0, 0.5).modulus(d) == pytest.approx(0.0, abs=1e-7)
    assert Vortex(2.0, 0.5).modulus(0.25) == pytest.approx(4.0)
    assert np.isnan(Vortex(2.0, 0.5).modulus([0.0, -1.0])).all()
