"""Shapes of coal: any of them, points on their surfaces, and how far points are outside, without coal's distances."""

import math

import coal
import numpy as np
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from cinegen.collision.convex_hull import hull

shapes = st.one_of(
    st.builds(coal.Sphere, st.floats(0.05, 0.5)),
    st.builds(coal.Capsule, st.floats(0.05, 0.3), st.floats(0.1, 0.8)),
    st.builds(coal.Cylinder, st.floats(0.05, 0.5), st.floats(0.1, 0.8)),
    st.builds(coal.Box, st.floats(0.1, 0.8), st.floats(0.1, 0.8), st.floats(0.1, 0.8)),
    st.integers(0, 10**6).map(lambda seed: hull(np.random.default_rng(seed).normal(size=(12, 3)) * 0.2).shape),
)
"""Shapes of all kinds."""


def surface(shape, rng, count=60):
    """Points on the surface of a shape, in its frame; all corners that it has."""
    if isinstance(shape, coal.BVHModelOBBRSS):
        corners = np.array(shape.vertices())
        picked = [shape.tri_indices(int(i)) for i in rng.integers(shape.num_tris, size=count)]
        triangles = np.array([[triangle[0], triangle[1], triangle[2]] for triangle in picked])
        weights = rng.dirichlet([1.0, 1.0, 1.0], size=count)
        return np.vstack([corners, np.einsum("ij,ijk->ik", weights, corners[triangles])])
    if isinstance(shape, coal.Box):
        points = rng.uniform(-1.0, 1.0, (count, 3))
        points[np.arange(count), rng.integers(3, size=count)] = rng.choice([-1.0, 1.0], count)
        return np.vstack([points, np.sign(points)]) * np.array(shape.halfSide)
    if isinstance(shape, coal.Convex):
        return np.array(shape.points())
    turn = rng.uniform(0.0, 2.0 * math.pi, count)
    if isinstance(shape, coal.Cylinder):
        rim = shape.radius * np.column_stack([np.cos(turn), np.sin(turn)])
        return np.column_stack([rim, rng.choice([-1.0, 1.0], count) * shape.halfLength])
    ball = rng.normal(size=(count, 3))
    ball *= shape.radius / np.linalg.norm(ball, axis=1)[:, None]
    if isinstance(shape, coal.Capsule):
        ball[:, 2] += np.sign(ball[:, 2]) * shape.halfLength
    return ball


def outside(points, shape):
    """(n,) how far points, in the frame of a shape, are outside of it; not more than 0 inside."""
    if isinstance(shape, (coal.Sphere, coal.Capsule)):
        beyond = np.maximum(np.abs(points[:, 2]) - getattr(shape, "halfLength", 0.0), 0.0)
        return np.linalg.norm(np.c_[points[:, :2], beyond], axis=1) - shape.radius
    if isinstance(shape, coal.Cylinder):
        return np.maximum(np.linalg.norm(points[:, :2], axis=1) - shape.radius, np.abs(points[:, 2]) - shape.halfLength)
    if isinstance(shape, coal.Box):
        return (np.abs(points) - np.array(shape.halfSide)).max(axis=1)
    corners = np.array(shape.points())
    normals = ConvexHull(corners).equations[:, :3]
    return (points @ normals.T - (corners @ normals.T).max(axis=0)).max(axis=1)


def placed(placement, points):
    return points @ placement.rotation.T + placement.translation


def seen(placement, points):
    return (points - placement.translation) @ placement.rotation
