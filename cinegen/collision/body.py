"""A solid on a joint of a robot, or in the world: what distances are measured between."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Body:
    """A solid, fixed on a joint.

    Attributes:
        name: what reports call it.
        joint: Pinocchio's number of the joint that it moves with; 0 is the world.
        placement: of the shape, in the frame of that joint.
        shape: as coal measures it, in m. Clearance takes convex ones: a ball, a box, a capsule, a hull ...
    """

    name: str
    joint: int
    placement: pin.SE3
    shape: coal.CollisionGeometry

    @cached_property
    def centre(self) -> Array:
        """(3,) the middle of its bounding ball, in the frame of its joint, m; of a half-space, a point of its plane."""
        return np.asarray(self.placement.act(_ball(self.shape)[0]))

    @cached_property
    def radius(self) -> float:
        """Of its bounding ball, m: the smallest for balls, capsules, boxes and cylinders; infinite for a half-space."""
        return _ball(self.shape)[1]


def _ball(shape: coal.CollisionGeometry) -> tuple[Array, float]:
    """A ball that holds a shape: its centre (3,) in the shape's frame, and its radius."""
    middle, swept = np.zeros(3), float(shape.getSweptSphereRadius()) if isinstance(shape, coal.ShapeBase) else 0.0
    match shape:
        case coal.Halfspace() | coal.Plane():
            return np.array(shape.n) * shape.d, np.inf
        case coal.Sphere():
            return middle, shape.radius + swept
        case coal.Capsule():
            return middle, shape.halfLength + shape.radius + swept
        case coal.Cylinder():
            return middle, float(np.hypot(shape.halfLength, shape.radius)) + swept
        case coal.Box():
            return middle, float(np.linalg.norm(shape.halfSide)) + swept
        case coal.Convex():
            corners = np.array(shape.points())
            middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
            return middle, float(np.linalg.norm(corners - middle, axis=1).max()) + swept
    shape.computeLocalAABB()  # with what is swept
    return np.array(shape.aabb_local.center()), float(shape.aabb_radius)
