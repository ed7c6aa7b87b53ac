"""Whether one convex solid is inside another.

Every solid that is asked about is inside of a rounded hull, all that is within a radius of some points' hull; and that
is inside of a convex solid where the balls around the points are.
"""

from __future__ import annotations

import math
from itertools import product

import coal
import numpy as np
from numpy.typing import NDArray

from cinegen.collision.bodies.solid import Solid

Array = NDArray[np.float64]

_SIDES = 32  # of the prism around a cylinder, half a percent thicker than that
_SAME = 1e-9  # m: what is rounded


def is_inside(inner: Solid, outer: Solid) -> bool:
    """Whether a solid is inside another, to 1e-9 m; a cylinder counts as the prism of 32 sides around it.

    Args:
        inner: a ball, capsule, box, cylinder or hull.
        outer: likewise, in the same frame.
    """
    points, radius = rounded(inner.shape)
    seen = (inner.placement.homogeneous[:3, :3] @ points.T).T + inner.placement.translation
    local = (seen - outer.placement.translation) @ outer.placement.rotation
    return float(outside(local, outer.shape).max()) + radius <= _SAME


def rounded(shape: coal.ShapeBase) -> tuple[Array, float]:
    """Points (n, 3) and a radius, m: all that is within the radius of the points' hull holds the shape."""
    match shape:
        case coal.Sphere():
            return np.zeros((1, 3)), shape.radius
        case coal.Capsule():
            return np.array([[0.0, 0.0, shape.halfLength], [0.0, 0.0, -shape.halfLength]]), shape.radius
        case coal.Box():
            return np.array(list(product((-1.0, 1.0), repeat=3))) * np.array(shape.halfSide), 0.0
        case coal.Cylinder():
            turn = np.arange(_SIDES) * (2.0 * math.pi / _SIDES)
            reach = shape.radius / math.cos(math.pi / _SIDES)
            ends = np.repeat([shape.halfLength, -shape.halfLength], _SIDES)
            return np.column_stack([reach * np.tile(np.cos(turn), 2), reach * np.tile(np.sin(turn), 2), ends]), 0.0
    return np.array(shape.points()), 0.0


def outside(points: Array, shape: coal.ShapeBase) -> Array:
    """How far each point is outside of a shape, in whose frame it is seen; inside, how far from its surface.

    A ball around a point is inside of the shape where its radius and this are not positive together. Beside an edge,
    where a point is outside of more than one face, it is how far the point is outside of one of them.

    Args:
        points: (n, 3) m.
        shape: a ball, capsule, box, cylinder or hull.

    Returns:
        (n,) m, negative inside.
    """
    match shape:
        case coal.Sphere():
            return np.asarray(np.linalg.norm(points, axis=1) - shape.radius)
        case coal.Capsule():
            beyond = points.copy()
            beyond[:, 2] -= np.clip(points[:, 2], -shape.halfLength, shape.halfLength)
            return np.asarray(np.linalg.norm(beyond, axis=1) - shape.radius)
        case coal.Box():
            return np.asarray((np.abs(points) - np.array(shape.halfSide)).max(axis=1))
        case coal.Cylinder():
            across = np.hypot(points[:, 0], points[:, 1]) - shape.radius
            return np.asarray(np.maximum(across, np.abs(points[:, 2]) - shape.halfLength))
    normals = np.array(shape.normals())
    offsets = (np.array(shape.points()) @ normals.T).max(axis=0)
    return np.asarray((points @ normals.T - offsets).max(axis=1))
