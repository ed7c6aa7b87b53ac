"""Convex hulls: of points however flat, and with fewer corners around them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from cinegen.collision.convex_hull import hull, simplified


def outside(points, corners):
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
        assert outside(points, corners) <= 1e-9
        assert made.shape.computeVolume() == pytest.approx(made.volume, rel=1e-6, abs=1e-15)


@pytest.mark.parametrize("points", [[[1, 2, 3]], [[0, 0, 0], [1, 1, 1]], [[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
def test_what_has_no_volume_is_made_a_little_thick(points):
    points = np.array(points, dtype=float)
    made = hull(points)
    assert outside(points, made.corners) <= 0.0
    assert 0.0 < made.volume < 1e-4
    assert made.shape.num_points >= 6
