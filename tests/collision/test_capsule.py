"""The tightest capsule around points: it holds them all, and finds capsules again that are known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from cinegen.collision.capsule import bounding_capsule as around
from cinegen.collision.convex_hull import hull, simplified


def outside(points, capsule):
    """How far the farthest point is outside of a capsule's shape, where that stands."""
    shape, place = capsule.shape, capsule.placement
    half = getattr(shape, "halfLength", 0.0) * place.rotation[:, 2]
    ends = place.translation - half, place.translation + half
    span = ends[1] - ends[0]
    along = np.clip((points - ends[0]) @ span / max(span @ span, 1e-300), 0.0, 1.0)
    return float(np.linalg.norm(points - ends[0] - along[:, None] * span, axis=1).max() - shape.radius)


def surface(rng, radius, length, count):
    """Points on a capsule's surface, on its round ends and between them, turned and moved anyhow."""
    ball = rng.normal(size=(count, 3))
    ball *= radius / np.linalg.norm(ball, axis=1)[:, None]
    ball[:, 2] += np.where(ball[:, 2] > 0.0, 0.5, -0.5) * length
    turn = rng.uniform(0.0, 2.0 * math.pi, count)
    round_it = np.column_stack([np.cos(turn), np.sin(turn)]) * radius
    side = np.column_stack([round_it, rng.uniform(-0.5, 0.5, count) * length])
    pose = Rotation.random(random_state=int(rng.integers(1 << 30)))
    return pose.apply(np.vstack([ball, side])) + rng.normal(size=3), pose.as_matrix()[:, 2]


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.integers(1, 200), st.floats(-4.0, 1.0), st.floats(-6.0, 0.0), st.floats(-6.0, 0.0))
def test_every_point_is_inside(seed, count, size, width, height):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) * [1.0, 10.0**width, 10.0**height] * 10.0**size
    points = Rotation.random(random_state=seed).apply(points) + rng.normal(size=3)
    assert outside(points, around(points)) <= 1e-12


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.floats(0.02, 0.3), st.floats(0.05, 2.0))
def test_a_capsule_is_found_again_from_points_of_its_surface(seed, radius, length):
    points, axis = surface(np.random.default_rng(seed), radius, length, 1000)
    found = around(points)
    assert found.volume <= 1.01 * math.pi * radius**2 * (length + 4.0 / 3.0 * radius)
    assert found.radius == pytest.approx(radius, rel=0.02)
    assert found.length + 2.0 * found.radius == pytest.approx(length + 2.0 * radius, rel=0.02)
    if length > radius:
        assert abs(found.axis @ axis) > math.cos(0.03)


# --- convex hull ------------------------------------------------------------------------------------------------------
# Convex hulls: of points however flat, and with fewer corners around them.


def outside_hull(points, corners):
    """How far the farthest point is outside of the convex hull of corners."""
    faces = ConvexHull(corners).equations
    normals = faces[:, :3]
    return float((points @ normals.T - (corners @ normals.T).max(axis=0)).max())


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
        corners = np.array(made.shape.points())
        assert outside_hull(points, corners) <= 1e-9
        assert made.shape.computeVolume() == pytest.approx(made.volume, rel=1e-6, abs=1e-15)


@pytest.mark.parametrize("points", [[[1, 2, 3]], [[0, 0, 0], [1, 1, 1]], [[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
def test_what_has_no_volume_is_made_a_little_thick(points):
    points = np.array(points, dtype=float)
    made = hull(points)
    assert outside_hull(points, made.corners) <= 0.0
    assert 0.0 < made.volume < 1e-4
    assert made.shape.num_points >= 6
