"""Polygons in the plane z = 0, by shapely."""

import numpy as np
import shapely
from hypothesis import strategies as st
from scipy.spatial import ConvexHull


def distance(polygon, point):
    """The distance of a point (3,) from the edges of a polygon (k, 2)."""
    return shapely.LinearRing(polygon).distance(shapely.Point(point[:2]))


def normal(polygon, point):
    """(3,) the unit vector to a point from the nearest point of the edges."""
    line = shapely.shortest_line(shapely.LinearRing(polygon), shapely.Point(point[:2]))
    away = np.append(np.subtract(*line.coords[::-1]), 0.0)
    return away / np.linalg.norm(away)


def holds(polygon, point):
    """Whether a polygon holds a point."""
    return shapely.Polygon(polygon).covers(shapely.Point(point[:2]))


@st.composite
def convex(draw):
    """(k, 2) corners of a convex polygon about the origin, counterclockwise, about 1 m large."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1.0, 1.0, (draw(st.integers(4, 12)), 2)) * [1.0, draw(st.floats(0.1, 1.0))]
    return corners[ConvexHull(corners).vertices]
