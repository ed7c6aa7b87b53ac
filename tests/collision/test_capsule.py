"""The tightest capsule around points: it holds them all, and finds capsules again that are known."""

import math

import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from test_link_bodies import outside, seen, surface

from cinegen.collision.capsule import bounding_capsule as around
from cinegen.collision.convex_hull import hull, simplified


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.integers(1, 200), st.floats(-4.0, 1.0), st.floats(-6.0, 0.0), st.floats(-6.0, 0.0))
def test_every_point_is_inside(seed, count, size, width, height):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) * [1.0, 10.0**width, 10.0**height] * 10.0**size
    points = Rotation.random(random_state=seed).apply(points) + rng.normal(size=3)
    capsule = around(points)
    assert outside(seen(capsule.placement, points), capsule.shape).max() <= 1e-12


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.floats(0.02, 0.3), st.floats(0.05, 2.0))
def test_a_capsule_is_found_again_from_points_of_its_surface(seed, radius, length):
    rng, pose = np.random.default_rng(seed), Rotation.random(random_state=seed)
    points = pose.apply(surface(coal.Capsule(radius, length), rng, 2000)) + rng.normal(size=3)
    capsule = around(points)
    assert capsule.volume <= 1.01 * math.pi * radius**2 * (length + 4.0 / 3.0 * radius)
    assert capsule.radius == pytest.approx(radius, rel=0.02)
    assert capsule.length + 2.0 * capsule.radius == pytest.approx(length + 2.0 * radius, rel=0.02)
    if length > radius:
        assert abs(capsule.axis @ pose.as_matrix()[:, 2]) > math.cos(0.03)


# --- convex hull ------------------------------------------------------------------------------------------------------
# Convex hulls: of points however flat, and with fewer corners around them.


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(1, 900), st.booleans(), st.floats(-9.0, 0.0), st.floats(-9.0, 0.0))
def test_every_point_is_inside_of_both_and_coal_makes_both(seed, count, round_, width, height):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    if round_:  # then all are corners
        points /= np.linalg.norm(points, axis=1)[:, None]
    points = Rotation.random(random_state=seed).apply(points * [1.0, 10.0**width, 10.0**height]) + rng.normal(size=3)
    exact = hull(points)
    fewer = simplified(exact)
    assert len(fewer.corners) <= 256
    assert fewer.volume >= exact.volume * (1.0 - 1e-9)
    for made in (exact, fewer):
        assert outside(points, made.shape).max() <= 1e-9
        assert made.shape.computeVolume() == pytest.approx(made.volume, rel=1e-6, abs=1e-15)


@pytest.mark.parametrize("points", [[[1, 2, 3]], [[0, 0, 0], [1, 1, 1]], [[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
def test_what_has_no_volume_is_made_a_little_thick(points):
    points = np.array(points, dtype=float)
    made = hull(points)
    assert outside(points, made.shape).max() <= 0.0
    assert 0.0 < made.volume < 1e-4
    assert made.shape.num_points >= 6
