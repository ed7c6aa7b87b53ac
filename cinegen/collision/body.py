"""Bodies between which distances are measured: convex shapes on the joints of a robot, or in the world."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.convex_hull import hull
from cinegen.collision.triangle_mesh import TriangleMesh
from cinegen.model.mechanism import Mechanism

Pairs = Sequence[tuple[int, int]]
"""Indices of two bodies each."""


class PlacedShape(NamedTuple):
    """A shape (m) and its pose in some frame."""

    placement: pin.SE3
    shape: coal.CollisionGeometry


class Interior(NamedTuple):
    """Facts about the inside of a mesh that is not one closed surface.

    Attributes:
        contains: returns whether a point (3,), in the frame of the mesh, is inside.
        parts: (n, 3) a point of each connected part, in the frame of the mesh, m.
        thickness: lower bound of the distance between two parallel planes that enclose a part, m.
    """

    contains: Callable[[Array], bool]
    parts: Array
    thickness: float


class Piece(NamedTuple):
    """A part of an obstacle: see the attributes of `Body`."""

    placement: pin.SE3
    shape: coal.CollisionGeometry
    exact: PlacedShape | None
    interior: Interior | None = None


@dataclass(frozen=True, eq=False)
class Body:
    """A shape that moves with a joint.

    Attributes:
        name: name in reports.
        joint: Pinocchio's index of the joint; 0 is the world.
        placement: pose of the shape in the frame of that joint.
        shape: coal's shape, m. `Clearance` takes convex ones: sphere, box, capsule, hull ...
        exact: the shape of the description where `shape` only contains it, placed in the frame of `shape`: a mesh that
            is not convex, a box in a capsule ...; None where `shape` is exact.
        interior: of an exact mesh; None where it is a single closed surface.
        touches: names of bodies of obstacles that may touch it.
    """

    name: str
    joint: int
    placement: pin.SE3
    shape: coal.CollisionGeometry
    exact: PlacedShape | None = None
    interior: Interior | None = None
    touches: frozenset[str] = frozenset()

    @cached_property
    def as_described(self) -> Body:
        """The same body with its exact shape."""
        if self.exact is None:
            return self
        placement = self.placement * self.exact.placement
        return replace(self, placement=placement, shape=self.exact.shape, exact=None)

    @cached_property
    def centre(self) -> Array:
        """(3,) centre of the bounding ball in the frame of the joint, m; for a half-space, a point of its plane."""
        return np.asarray(self.placement.act(_bounding_ball(self.shape)[0]))

    @cached_property
    def radius(self) -> float:
        """Radius of the bounding ball, m: the smallest for spheres, capsules, boxes and cylinders; infinite for a
        half-space."""
        return _bounding_ball(self.shape)[1]

    @cached_property
    def mesh(self) -> TriangleMesh | None:
        """Shape as triangles; None if it is not a mesh."""
        return TriangleMesh(self.shape) if isinstance(self.shape, coal.BVHModelOBBRSS) else None

    @cached_property
    def thickness(self) -> float:
        """Lower bound of the distance between two parallel planes that enclose the shape, m.

        Half of the least distance over planes along the faces of its hull, which is not far above the least over all.
        """
        if isinstance(self.shape, coal.Halfspace | coal.Plane):
            return np.inf
        points, radius = rounded_hull(self.shape)
        if len(points) < 4:
            return 2.0 * radius
        found = hull(points) if self.mesh is None else self.mesh.hull
        return 2.0 * radius + 0.5 * float(np.ptp(found.corners @ found.normals.T, axis=0).min())


def _bounding_ball(shape: coal.CollisionGeometry) -> tuple[Array, float]:
    """Return the centre (3,), in the shape's frame, and the radius of a ball that contains a shape."""
    match shape:
        case coal.Halfspace() | coal.Plane():
            return np.array(shape.n) * shape.d, np.inf
        case coal.Cylinder():
            return np.zeros(3), float(np.hypot(shape.halfLength, shape.radius) + shape.getSweptSphereRadius())
    points, radius = rounded_hull(shape)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    return middle, float(np.linalg.norm(points - middle, axis=1).max()) + radius


def rounded_hull(shape: coal.CollisionGeometry, sides: int = 32) -> tuple[Array, float]:
    """Return points (n, 3) in the shape's frame and a radius, m: the convex hull of the points, grown by the radius,
    contains the shape.

    It is the shape itself for spheres, capsules, boxes and convex hulls; the convex hull of a mesh; the circumscribed
    prism for a cylinder; the bounding box for other shapes.

    Args:
        shape: any but a half-space or a plane.
        sides: number of sides of the prism around a cylinder; with 32 it is half a percent thicker than that.
    """
    swept = float(shape.getSweptSphereRadius()) if isinstance(shape, coal.ShapeBase) else 0.0
    match shape:
        case coal.BVHModelOBBRSS():
            return np.array(shape.vertices()), swept
        case coal.Sphere():
            return np.zeros((1, 3)), float(shape.radius) + swept
        case coal.Capsule():
            return np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]) * shape.halfLength, float(shape.radius) + swept
        case coal.Box():
            return box_corners(-np.array(shape.halfSide), np.array(shape.halfSide)), swept
        case coal.Convex():
            return np.array(shape.points()), swept
        case coal.Cylinder():
            angles = (np.arange(sides) + 0.5) * (2.0 * math.pi / sides)
            ring = np.column_stack([np.cos(angles), np.sin(angles)]) * shape.radius / math.cos(math.pi / sides)
            ends = (np.column_stack([ring, np.full(sides, z * shape.halfLength)]) for z in (-1.0, 1.0))
            return np.vstack([*ends]), swept
    return bounding_box_corners(shape), 0.0


def box_corners(low: Array, high: Array) -> Array:
    """Return the corners (8, 3) of a box with extreme corners (3,)."""
    return np.array(list(product(*zip(low, high, strict=True))))


def bounding_box_corners(shape: coal.CollisionGeometry, placement: pin.SE3 | None = None) -> Array:
    """Return the corners (8, 3) of the box around a shape along its axes, m; in the frame in which it is placed, if
    that is given."""
    shape.computeLocalAABB()  # includes the swept radius
    corners = box_corners(np.array(shape.aabb_local.min_), np.array(shape.aabb_local.max_))
    if placement is None:
        return corners
    return np.asarray(corners @ placement.rotation.T + placement.translation)


def geometry_model(
    mechanism: Mechanism, bodies: Sequence[Body], obstacles: Sequence[Body] = (), pairs: Pairs = ()
) -> pin.GeometryModel:
    """Return bodies and obstacles as Pinocchio's geometry, for `pin.computeDistances`.

    Args:
        mechanism: robot whose joints carry the bodies.
        bodies: bodies of the robot, see `link_bodies`.
        obstacles: bodies on joint 0; their placements may be changed in the result.
        pairs: pairs of the robot's bodies, see `collision_pairs`.

    Returns:
        geometry objects: the bodies, then the obstacles, named `<index> <name>`. Collision pairs: `pairs`, in their
        order; then each body that is not fixed in the world with each obstacle that it may not touch, body by body.
    """
    geometry = pin.GeometryModel()
    for i, body in enumerate((*bodies, *obstacles)):
        geometry.addGeometryObject(pin.GeometryObject(f"{i} {body.name}", body.joint, body.placement, body.shape))
    for first, second in pairs:
        geometry.addCollisionPair(pin.CollisionPair(first, second))
    for i, body in enumerate(bodies):
        for k in range(len(obstacles)) if body.joint != 0 else ():
            if obstacles[k].name not in body.touches:
                geometry.addCollisionPair(pin.CollisionPair(i, len(bodies) + k))
    return geometry
