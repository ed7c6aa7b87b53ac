"""The kinds of shapes: everything that differs between coal's types of shapes is a row of `SHAPES`.

A new kind is a class here and a line in `SHAPES`. It needs nothing but `rounded`: then it is planned with, drawn and
recorded as the convex hull that this returns. Lengths are in m, in the frame of the shape.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import pairwise, product
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike
from cinegen.collision.capsule import BoundingCapsule, bounding_capsule
from cinegen.collision.convex_hull import Hull, hull, simplified
from cinegen.collision.triangle_mesh import Surface, TriangleMesh, faceted, tree_of

SIDES = 32
"""Sides of the prism around a cylinder: it is half a percent thicker than that."""


class ShapeKind:
    """A kind of shape. This one takes any bounded shape as its bounding box.

    Attributes:
        name: in recordings and reports; those of a kind without numbers of its own are a "hull".
        is_polyhedron: whether the points that `rounded` returns are corners of the shape.
        is_fast: whether no shape around it makes distances faster.
    """

    name = "hull"
    is_polyhedron = False
    is_fast = False

    def rounded(self, shape: Any, sides: int) -> tuple[Array, float]:
        """Return points (n, 3) and a radius: their convex hull, grown by the radius, contains the shape."""
        return bounding_box_corners(shape), 0.0

    def ball(self, shape: Any) -> tuple[Array, float]:
        """Return the centre (3,) and the radius of a ball that contains the shape."""
        points, radius = rounded_hull(shape)
        middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
        return middle, float(np.linalg.norm(points - middle, axis=1).max()) + radius

    def axis(self, shape: Any) -> Array | None:
        """Return the centre (1, 3) of a sphere, or the ends (2, 3) of the axis of a shape of revolution; None of
        another."""
        return None

    def round_ends(self, shape: Any) -> Array:
        """Return the centres (n, 3) of the balls, of its radius, that make it a capsule; none of most kinds."""
        return np.zeros((0, 3))

    def outside(self, shape: Any, points: Array) -> Array:
        """Return how far points (n, 3) are outside at least (n,); negative inside, infinite where it is not known.

        A ball around a point is inside the shape where the ball's radius and this add up to 0 or less. Near an edge,
        where a point is outside of several faces, it is the distance from one of them.
        """
        return np.full(len(points), np.inf)

    def convex(self, shape: Any) -> tuple[BoundingCapsule | None, coal.ShapeBase, float]:
        """Return a tight capsule around the shape, the shape or a hull that contains it, and the volume of its hull.
        None in place of the capsule where nothing is faster than the shape itself."""
        if self.is_fast:
            return None, shape, shape.computeVolume()
        exact = hull(rounded_hull(shape)[0])
        return bounding_capsule(exact.corners), simplified(exact).shape, exact.volume

    def text(self, shape: Any) -> str:
        """Return the shape in a few words."""
        return type(shape).__name__.lower()

    def numbers(self, shape: Any) -> Array:
        """Return the shape as numbers, which `made` takes: those of a hull are its corners."""
        return rounded_hull(shape)[0].ravel()

    def made(self, numbers: Sequence[float]) -> coal.CollisionGeometry:
        """Return the shape of some numbers."""
        return hull(np.reshape(numbers, (-1, 3))).shape

    def surface(self, shape: Any, sides: int = SIDES) -> Surface:
        """Return its surface as triangles; where it is round, with so many sides."""
        return _facets(hull(rounded_hull(shape, sides)[0]).shape)

    def stretched(self, shape: Any, factor: float) -> coal.ShapeBase:
        """Return the shape stretched along z."""
        return hull(rounded_hull(shape)[0] * np.array([1.0, 1.0, factor])).shape


class _HalfSpace(ShapeKind):
    def ball(self, shape: Any) -> tuple[Array, float]:
        return np.array(shape.n) * shape.d, np.inf


class _Sphere(ShapeKind):
    name, is_fast = "sphere", True

    def rounded(self, shape: Any, sides: int) -> tuple[Array, float]:
        return np.zeros((1, 3)), float(shape.radius)

    def axis(self, shape: Any) -> Array:
        return np.zeros((1, 3))

    def outside(self, shape: Any, points: Array) -> Array:
        return np.asarray(np.linalg.norm(points, axis=1) - shape.radius)

    def numbers(self, shape: Any) -> Array:
        return np.array([shape.radius])

    def made(self, numbers: Sequence[float]) -> coal.CollisionGeometry:
        return coal.Sphere(*numbers)

    def surface(self, shape: Any, sides: int = SIDES) -> Surface:
        corners, faces = _ball(sides)
        return shape.radius * corners, faces


class _OfRevolution(ShapeKind):
    """A shape about z, with `radius` and `halfLength`."""

    def __init__(self, type: Any, name: str) -> None:
        self._type, self.name = type, name

    def axis(self, shape: Any) -> Array:
        return np.array([[0.0, 0.0, shape.halfLength], [0.0, 0.0, -shape.halfLength]])

    def numbers(self, shape: Any) -> Array:
        return np.array([shape.radius, 2.0 * shape.halfLength])

    def made(self, numbers: Sequence[float]) -> coal.CollisionGeometry:
        return self._type(*numbers)

    def stretched(self, shape: Any, factor: float) -> coal.ShapeBase:
        return self._type(shape.radius, 2.0 * factor * shape.halfLength)


class _Capsule(_OfRevolution):
    is_fast = True

    def rounded(self, shape: Any, sides: int) -> tuple[Array, float]:
        return self.axis(shape), float(shape.radius)

    def outside(self, shape: Any, points: Array) -> Array:
        beyond = points.copy()
        beyond[:, 2] -= np.clip(points[:, 2], -shape.halfLength, shape.halfLength)
        return np.asarray(np.linalg.norm(beyond, axis=1) - shape.radius)

    def surface(self, shape: Any, sides: int = SIDES) -> Surface:
        corners, faces = _ball(sides, 1.0)
        ends = np.outer(np.sign(corners[:, 2]), [0.0, 0.0, shape.halfLength - shape.radius])
        return shape.radius * corners + ends, faces


class _Cylinder(_OfRevolution):
    def rounded(self, shape: Any, sides: int) -> tuple[Array, float]:
        ring = _circumscribed(shape.radius, sides)
        return np.vstack([np.column_stack([ring, np.full(sides, z * shape.halfLength)]) for z in (-1.0, 1.0)]), 0.0

    def ball(self, shape: Any) -> tuple[Array, float]:
        return np.zeros(3), float(np.hypot(shape.halfLength, shape.radius) + shape.getSweptSphereRadius())

    def round_ends(self, shape: Any) -> Array:
        return self.axis(shape)

    def outside(self, shape: Any, points: Array) -> Array:
        across = np.hypot(points[:, 0], points[:, 1]) - shape.radius
        return np.asarray(np.maximum(across, np.abs(points[:, 2]) - shape.halfLength))

    def convex(self, shape: Any) -> tuple[BoundingCapsule | None, coal.ShapeBase, float]:
        # URDFs that describe a capsule by a cylinder and two spheres get a single body
        return _along(2, shape.radius, shape.halfLength), shape, shape.computeVolume()

    def surface(self, shape: Any, sides: int = SIDES) -> Surface:
        corners, faces = _can(sides)
        return corners * [shape.radius, shape.radius, shape.halfLength], faces


class _Cone(ShapeKind):
    def rounded(self, shape: Any, sides: int) -> tuple[Array, float]:
        ring = np.column_stack([_circumscribed(shape.radius, sides), np.full(sides, -shape.halfLength)])
        return np.vstack([ring, [0.0, 0.0, shape.halfLength]]), 0.0

    def axis(self, shape: Any) -> Array:
        return np.array([[0.0, 0.0, shape.halfLength], [0.0, 0.0, -shape.halfLength]])


class _Box(ShapeKind):
    name, is_polyhedron = "box", True

    def rounded(self, shape: Any, sides: int) -> tuple[Array, float]:
        return box_corners(-np.array(shape.halfSide), np.array(shape.halfSide)), 0.0

    def outside(self, shape: Any, points: Array) -> Array:
        return np.asarray((np.abs(points) - np.array(shape.halfSide)).max(axis=1))

    def convex(self, shape: Any) -> tuple[BoundingCapsule | None, coal.ShapeBase, float]:
        half = np.array(shape.halfSide)
        capsules = [_along(i, math.hypot(half[i - 2], half[i - 1]), half[i]) for i in range(3)]
        return min(capsules, key=lambda capsule: capsule.volume), shape, shape.computeVolume()

    def numbers(self, shape: Any) -> Array:
        return np.asarray(2.0 * shape.halfSide)

    def made(self, numbers: Sequence[float]) -> coal.CollisionGeometry:
        return coal.Box(np.array(numbers))

    def surface(self, shape: Any, sides: int = SIDES) -> Surface:
        corners, faces = _cube()
        return corners * shape.halfSide, faces

    def stretched(self, shape: Any, factor: float) -> coal.ShapeBase:
        return coal.Box(2.0 * shape.halfSide * np.array([1.0, 1.0, factor]))


class _Hull(ShapeKind):
    is_polyhedron = True

    def rounded(self, shape: Any, sides: int) -> tuple[Array, float]:
        return np.array(shape.points()), 0.0

    def outside(self, shape: Any, points: Array) -> Array:
        normals = np.array(shape.normals())
        offsets = (np.array(shape.points()) @ normals.T).max(axis=0)
        return np.asarray((points @ normals.T - offsets).max(axis=1))

    def text(self, shape: Any) -> str:
        return f"hull of {shape.num_points} corners"


class _Mesh(ShapeKind):
    name, is_polyhedron = "mesh", True

    def rounded(self, shape: Any, sides: int) -> tuple[Array, float]:
        return np.array(shape.vertices()), 0.0

    def text(self, shape: Any) -> str:
        return f"mesh of {shape.num_tris} triangles"

    def numbers(self, shape: Any) -> Array:
        return TriangleMesh(shape).corners.ravel()

    def made(self, numbers: Sequence[float]) -> coal.CollisionGeometry:
        corners = np.reshape(numbers, (-1, 3))
        return tree_of(corners, np.arange(len(corners)).reshape(-1, 3))

    def surface(self, shape: Any, sides: int = SIDES) -> Surface:
        return faceted(TriangleMesh(shape).corners)


SHAPES: Mapping[type, ShapeKind] = {
    coal.Halfspace: _HalfSpace(),
    coal.Plane: _HalfSpace(),
    coal.Sphere: _Sphere(),
    coal.Capsule: _Capsule(coal.Capsule, "capsule"),
    coal.Cylinder: _Cylinder(coal.Cylinder, "cylinder"),
    coal.Cone: _Cone(),
    coal.Box: _Box(),
    coal.Convex: _Hull(),
    coal.BVHModelOBBRSS: _Mesh(),
}
"""What is known of each of coal's types."""

OTHER = ShapeKind()
"""What is known of all other types."""

NAMED: Mapping[str, ShapeKind] = {kind.name: kind for kind in SHAPES.values()}
"""The kinds by the names that recordings have."""


def kind_of(shape: coal.CollisionGeometry) -> ShapeKind:
    """Return the kind of a shape."""
    return SHAPES.get(type(shape), OTHER)


def rounded_hull(shape: coal.CollisionGeometry, sides: int = SIDES) -> tuple[Array, float]:
    """Return points (n, 3) in the shape's frame and a radius, m: the convex hull of the points, grown by the radius,
    contains the shape.

    It is the shape itself for spheres, capsules, boxes and convex hulls; the convex hull of a mesh; a circumscribed
    polyhedron for a cylinder or a cone; the bounding box for other shapes.

    Args:
        shape: any but a half-space or a plane.
        sides: number of sides of the polyhedron around a cylinder.
    """
    points, radius = kind_of(shape).rounded(shape, sides)
    return points, radius + (float(shape.getSweptSphereRadius()) if isinstance(shape, coal.ShapeBase) else 0.0)


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


def exact_hull(mesh: coal.CollisionGeometry) -> Hull | None:
    """Return the convex hull of a mesh that is convex; None of any other shape."""
    if not isinstance(mesh, coal.BVHModelOBBRSS):
        return None
    surface = TriangleMesh(mesh)
    return surface.hull if surface.is_convex else None


def _circumscribed(radius: float, sides: int) -> Array:
    """Return the corners (sides, 2) of a regular polygon around a circle."""
    angles = (np.arange(sides) + 0.5) * (2.0 * math.pi / sides)
    return np.column_stack([np.cos(angles), np.sin(angles)]) * radius / math.cos(math.pi / sides)


def _along(axis: int, radius: float, half: float) -> BoundingCapsule:
    """Return a cylinder along an axis with round ends."""
    return BoundingCapsule(np.zeros(3), np.eye(3)[axis], radius, 2.0 * half)


def _facets(convex: coal.Convex) -> Surface:
    """Return the faces of a polyhedron."""
    faces = [[face[i] for i in range(3)] for face in map(convex.polygons, range(convex.num_polygons))]
    return faceted(np.array(convex.points())[faces])


@cache
def _cube() -> Surface:
    """Return a box from -1 to 1."""
    return _facets(hull(box_corners(-np.ones(3), np.ones(3))).shape)


@cache
def _can(sides: int) -> Surface:
    """Return a cylinder of radius 1 from -1 to 1."""
    return _turned(sides, [[0, -1], [1, -1]], [[1, -1], [1, 1]], [[1, 1], [0, 1]])


@cache
def _ball(sides: int, half: float = 0.0) -> Surface:
    """Return a capsule of radius 1 about an axis from -half to half."""
    rise = np.linspace(0.0, 0.5 * math.pi, sides // 4 + 1)
    angles = np.concatenate([-rise[::-1], rise[half == 0.0 :]])
    ends = np.repeat([-half, half], [len(rise), len(angles) - len(rise)])
    return _turned(sides, np.column_stack([np.cos(angles).round(15), np.sin(angles) + ends]))


def _turned(sides: int, *profiles: ArrayLike) -> Surface:
    """Return profiles (n, 2) of radii and heights, upwards outside, turned about z; each of them is smooth."""
    angles = np.arange(sides) * (2.0 * math.pi / sides)
    circle, corners, faces, count = np.column_stack([np.cos(angles), np.sin(angles)]), [], [], 0
    for profile in profiles:
        rings = []
        for radius, z in np.asarray(profile):
            ring = radius * circle if radius else np.zeros((1, 2))
            corners.append(np.column_stack([ring, np.full(len(ring), z)]))
            rings.append(count + np.arange(sides) % len(ring))
            count += len(ring)
        for low, high in pairwise(rings):
            after, above = np.roll(low, -1), np.roll(high, -1)
            faces += [np.column_stack([low, after, above]), np.column_stack([low, above, high])]
    triangles = np.concatenate(faces)
    return np.concatenate(corners), triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
