"""The links of a mechanism as convex bodies, made once, between which distances are fast.

Distances between capsules are ten times as fast as between hulls, and need no iteration: a capsule is used where it is
nearly as tight as the convex hull. Each body keeps the shape of the description, too, where it only contains that:
`Clearance` measures it where bodies are near.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.body import Body, PlacedShape, bounding_box_corners, rounded_hull
from cinegen.collision.capsule import BoundingCapsule, bounding_capsule
from cinegen.collision.convex_hull import hull, simplified
from cinegen.collision.triangle_mesh import TriangleMesh
from cinegen.model.mechanism import Mechanism

TIGHT = 1.75
"""Largest volume of a capsule, as a multiple of the convex hull's volume. A long bar of square section gets a capsule
(1.7), as does a cylinder as wide as it is long (1.7); a cube does not."""

_SAME = 1e-9  # m
_SOLID = (coal.Sphere, coal.Capsule, coal.Box, coal.Cylinder, coal.Convex)  # outer shapes of `is_inside`


def link_bodies(mechanism: Mechanism) -> tuple[Body, ...]:
    """Return convex bodies around all links of a mechanism; fixed links are on joint 0.

    They contain the shapes with which the links collide (`Mechanism.collision`): those that a URDF gives for
    collisions; for a link without any, its visual shapes; where there are none either, the bars of the stick figure.
    Each shape has a body of its own, see `convex_shape`; a shape inside a convex one of the same link is left out.

    Returns:
        bodies in the order of the mechanism's nodes, each named after its node. m, in the frames of the joints.

    Raises:
        LoadError: the shapes can't be read.
    """
    frames = mechanism.model.frames
    rank = {node: i for i, node in enumerate(mechanism.nodes)}
    drawn = sorted(
        mechanism.collision.geometryObjects,
        key=lambda shape: rank.get(frames[shape.parentFrame].name, len(rank)),
    )
    found = [_body(frames[one.parentFrame].name, one.parentJoint, one.geometry, one.placement) for one in drawn]
    return tuple(_outermost([_with_round_ends(body, found) for body in found]))


def _body(name: str, joint: int, drawn: coal.CollisionGeometry, placement: pin.SE3) -> Body:
    """Return the body of a shape, with the shape itself where the body only contains it."""
    enclosing, exact = convex_shape(drawn, placement), drawn
    if isinstance(drawn, coal.BVHModelOBBRSS) and (mesh := TriangleMesh(drawn)).is_convex:
        with suppress(RuntimeError):  # a corner has more neighbours than coal counts: the mesh remains
            exact = mesh.hull.shape
    if exact is enclosing.shape or _is_same_hull(exact, enclosing.shape):
        return Body(name, joint, *enclosing)
    return Body(name, joint, *enclosing, PlacedShape(enclosing.placement.actInv(placement), exact))


def _is_same_hull(exact: coal.CollisionGeometry, enclosing: coal.ShapeBase) -> bool:
    """Return whether a convex hull was not simplified."""
    both = isinstance(exact, coal.Convex) and isinstance(enclosing, coal.Convex)
    return both and bool(exact.num_points == enclosing.num_points)


def _with_round_ends(body: Body, others: Sequence[Body]) -> Body:
    """Return the body itself; for a capsule around a cylinder between two balls, as URDFs describe one, the capsule."""
    if body.exact is None or not (isinstance(body.exact.shape, coal.Cylinder) and isinstance(body.shape, coal.Capsule)):
        return body
    ends = [pin.SE3(np.eye(3), np.array([0.0, 0.0, z * body.shape.halfLength])) for z in (-1.0, 1.0)]
    balls = [PlacedShape(body.placement * end, coal.Sphere(body.shape.radius)) for end in ends]
    own = [other for other in others if other.joint == body.joint and isinstance(other.shape, coal.Sphere)]
    return replace(body, exact=None) if all(any(is_inside(ball, one) for one in own) for ball in balls) else body


def _outermost(bodies: Sequence[Body]) -> Iterator[Body]:
    """Yield the bodies whose shapes are not inside a convex one of their link; of several equal ones, the first."""
    exact = [body.as_described for body in bodies]
    for i, inner in enumerate(exact):
        others = [j for j, other in enumerate(exact) if j != i and other.name == inner.name]
        if not any(_holds(exact[j], inner) and not (i < j and _holds(inner, exact[j])) for j in others):
            yield bodies[i]


def _holds(outer: Body, inner: Body) -> bool:
    return isinstance(outer.shape, _SOLID) and is_inside(inner, outer)


# --- the tightest convex shape -----------------------------------------------------------------------------------


def convex_shape(drawn: coal.CollisionGeometry, placement: pin.SE3) -> PlacedShape:
    """Return the tightest convex shape around a shape to which distances are fast, placed in the same frame.

    Args:
        drawn: spheres and capsules are returned as they are; a box or a cylinder becomes a capsule if that is `TIGHT`,
            and so does the convex hull of a mesh, whether the mesh is convex or not. Any other shape becomes its
            bounding box.
        placement: pose of `drawn`.
    """
    match drawn:
        case coal.Sphere() | coal.Capsule():
            return PlacedShape(placement, drawn)
        case coal.Cylinder():
            return _tighter(_on_axis(drawn.radius, drawn.halfLength, 2), drawn, drawn.computeVolume(), placement)
        case coal.Box():
            half = np.array(drawn.halfSide)
            capsules = [_on_axis(math.hypot(half[i - 2], half[i - 1]), half[i], i) for i in range(3)]
            least = min(capsules, key=lambda capsule: capsule.volume)
            return _tighter(least, drawn, drawn.computeVolume(), placement)
        case coal.BVHModelOBBRSS() | coal.Convex():
            exact = hull(np.array(drawn.vertices() if isinstance(drawn, coal.BVHModelOBBRSS) else drawn.points()))
            return _tighter(bounding_capsule(exact.corners), simplified(exact).shape, exact.volume, placement)
    low, *_, high = bounding_box_corners(drawn)
    return convex_shape(coal.Box(high - low), placement * pin.SE3(np.eye(3), (low + high) / 2.0))


def _tighter(capsule: BoundingCapsule, shape: coal.ShapeBase, volume: float, placement: pin.SE3) -> PlacedShape:
    """Return the capsule around a shape if it is not much larger than that volume, else the shape itself."""
    if capsule.volume > TIGHT * volume:
        return PlacedShape(placement, shape)
    return PlacedShape(placement * capsule.placement, capsule.shape)


def _on_axis(radius: float, half: float, axis: int) -> BoundingCapsule:
    """Return a cylinder with round ends: URDFs that describe one by a cylinder and two spheres get a single body."""
    return BoundingCapsule(np.zeros(3), np.eye(3)[axis], radius, 2.0 * half)


# --- inside ------------------------------------------------------------------------------------------------------


def is_inside(inner: PlacedShape | Body, outer: PlacedShape | Body) -> bool:
    """Return whether a convex shape is inside another in the same frame, to 1e-9 m.

    The outer one is a sphere, capsule, box, cylinder or hull, the inner one any that `rounded_hull` takes: a cylinder
    counts as the prism of 32 sides around it, a mesh as its hull.
    """
    points, radius = rounded_hull(inner.shape)
    points = points @ inner.placement.rotation.T + inner.placement.translation
    local = (points - outer.placement.translation) @ outer.placement.rotation
    return float(_distances_outside(local, outer.shape).max()) + radius <= _SAME


def _distances_outside(points: Array, shape: coal.ShapeBase) -> Array:
    """Return how far points (n, 3) in the frame of a shape are outside of it (n,), m; negative inside.

    A ball around a point is inside the shape where the ball's radius and this add up to 0 or less. Near an edge, where
    a point is outside of several faces, it is the distance from one of them.
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
