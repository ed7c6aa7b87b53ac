"""The tightest capsule around points: it holds them all, and finds capsules again that are known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cinegen.collision.capsule import bounding_capsule as around


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
