"""Bodies between which distances are measured: convex shapes on the joints of a robot, or in the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.convex_hull import hull
from cinegen.collision.shapes import kind_of, rounded_hull
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
        return np.asarray(self.placement.act(kind_of(self.shape).ball(self.shape)[0]))

    @cached_property
    def radius(self) -> float:
        """Radius of the bounding ball, m: the smallest for spheres, capsules, boxes and cylinders; infinite for a
        half-space."""
        return kind_of(self.shape).ball(self.shape)[1]

    @cached_property
    def mesh(self) -> TriangleMesh | None:
        """Shape as triangles; None if it is not a mesh."""
        return TriangleMesh(self.shape) if isinstance(self.shape, coal.BVHModelOBBRSS) else None

    @cached_property
    def thickness(self) -> float:
        """Lower bound of the distance between two parallel planes that enclose the shape, m.

        Half of the least distance over planes along the faces of its hull, which is not far above the least over all.
        """
        if not np.isfinite(self.radius):
            return np.inf
        points, radius = rounded_hull(self.shape)
        if len(points) < 4:
            return 2.0 * radius
        polyhedron = hull(points) if self.mesh is None else self.mesh.hull
        return 2.0 * radius + 0.5 * float(np.ptp(polyhedron.corners @ polyhedron.normals.T, axis=0).min())


def geometry_model(
    mechanism: Mechanism, bodies: Sequence[Body], obstacles: Sequence[Body] = (), pairs: Pairs = ()
) -> pin.GeometryModel:
    """Return bodies and obstacles as Pinocchio's geometry, for `pin.computeDistances`.

    Args:
        mechanism: robot whose joints carry the bodies.
        bodies: bodies of the robot, see `link_bodies`.
        obstacles: bodies on joint 0; their placements may be changed in the result.
        pairs: pairs of the robot's bodies, see `pair_reasons`.

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
