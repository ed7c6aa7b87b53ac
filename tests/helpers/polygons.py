"""Polygons in the plane z = 0, and the distance to them by its definition: the smallest to any of their edges."""

import numpy as np
from hypothesis import strategies as st
from scipy.spatial import ConvexHull


def nearest(polygon, point):
    """(2,) the point of a polygon's edges (k, 2) that is nearest to a point (3,)."""
    best, least = None, np.inf
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        t = np.clip((point[:2] - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        distance = np.linalg.norm(point[:2] - a - t * (b - a))
        if distance < least:
            best, least = a + t * (b - a), distance
    return best


def distance(polygon, point):
    return float(np.linalg.norm(point[:2] - nearest(polygon, point)))


def normal(polygon, point):
    """(3,) the unit vector from the nearest point to a point."""
    away = np.append(point[:2] - nearest(polygon, point), 0.0)
    return away / np.linalg.norm(away)


def holds(polygon, point):
    """Whether a convex polygon, counterclockwise, holds a point."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    rest = point[:2] - polygon
    return bool((edges[:, 0] * rest[:, 1] - edges[:, 1] * rest[:, 0] >= 0.0).all())


@st.composite
def convex(draw):
    """(k, 2) corners of a convex polygon about the origin, counterclockwise, about 1 m large."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1.0, 1.0, (draw(st.integers(4, 12)), 2)) * [1.0, draw(st.floats(0.1, 1.0))]
    return corners[ConvexHull(corners).vertices]
