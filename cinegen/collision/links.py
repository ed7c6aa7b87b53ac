"""The links of a mechanism as convex bodies, made once, between which distances are fast.

Distances between capsules are ten times as fast as between hulls, and need no iteration: a capsule is used where it is
nearly as tight as the convex hull. Each body keeps the shape of the description, too, where it only contains that:
`Clearance` measures it where bodies are near.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin

from cinegen.collision.body import Body, PlacedShape
from cinegen.collision.shapes import exact_hull, kind_of, rounded_hull
from cinegen.model.mechanism import Mechanism

TIGHT = 1.75
"""Largest volume of a capsule, as a multiple of the convex hull's volume. A long bar of square section gets a capsule
(1.7), as does a cylinder as wide as it is long (1.7); a cube does not."""

_SAME = 1e-9  # m


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
        mechanism.collision.geometryObjects, key=lambda shape: rank.get(frames[shape.parentFrame].name, len(rank))
    )
    bodies = [_body(frames[part.parentFrame].name, part.parentJoint, part.geometry, part.placement) for part in drawn]
    return tuple(_outermost([_with_round_ends(body, bodies) for body in bodies]))


def _body(name: str, joint: int, drawn: coal.CollisionGeometry, placement: pin.SE3) -> Body:
    """Return the body of a shape, with the shape itself where the body only contains it."""
    enclosing, exact = convex_shape(drawn, placement), drawn
    if (solid := exact_hull(drawn)) is not None:
        with suppress(RuntimeError):  # a corner has more neighbours than coal counts: the mesh remains
            exact = solid.shape
    if exact is enclosing.shape or _is_same_hull(exact, enclosing.shape):
        return Body(name, joint, *enclosing)
    return Body(name, joint, *enclosing, PlacedShape(enclosing.placement.actInv(placement), exact))


def _is_same_hull(exact: coal.CollisionGeometry, enclosing: coal.ShapeBase) -> bool:
    """Return whether a convex hull was not simplified."""
    both = isinstance(exact, coal.Convex) and isinstance(enclosing, coal.Convex)
    return both and bool(exact.num_points == enclosing.num_points)


def _with_round_ends(body: Body, others: Sequence[Body]) -> Body:
    """Return the body itself; for a capsule around a cylinder between two balls, as URDFs describe one, the capsule."""
    placement, shape = body.as_described.placement, body.as_described.shape
    ends = kind_of(shape).round_ends(shape)
    if body.exact is None or not len(ends):
        return body
    balls = [PlacedShape(placement * pin.SE3(np.eye(3), end), coal.Sphere(shape.radius)) for end in ends]
    others = [other for other in others if other.joint == body.joint and other.exact is None]
    return replace(body, exact=None) if all(any(is_inside(ball, other) for other in others) for ball in balls) else body


def _outermost(bodies: Sequence[Body]) -> Iterator[Body]:
    """Yield the bodies whose shapes are not inside a convex one of their link; of several equal ones, the first."""
    exact = [body.as_described for body in bodies]
    for i, inner in enumerate(exact):
        others = [j for j, other in enumerate(exact) if j != i and other.name == inner.name]
        if not any(is_inside(inner, exact[j]) and not (i < j and is_inside(exact[j], inner)) for j in others):
            yield bodies[i]


# --- the tightest convex shape -----------------------------------------------------------------------------------


def convex_shape(drawn: coal.CollisionGeometry, placement: pin.SE3) -> PlacedShape:
    """Return the tightest convex shape around a shape to which distances are fast, placed in the same frame.

    Args:
        drawn: spheres and capsules are returned as they are; a box or a cylinder becomes a capsule if that is `TIGHT`,
            and so does the convex hull of a mesh, whether the mesh is convex or not. Any other shape becomes the hull
            of its `rounded_hull`.
        placement: pose of `drawn`.
    """
    capsule, shape, volume = kind_of(drawn).convex(drawn)
    if capsule is None or capsule.volume > TIGHT * volume:
        return PlacedShape(placement, shape)
    return PlacedShape(placement * capsule.placement, capsule.shape)


# --- inside ------------------------------------------------------------------------------------------------------


def is_inside(inner: PlacedShape | Body, outer: PlacedShape | Body) -> bool:
    """Return whether a convex shape is inside another in the same frame, to 1e-9 m.

    The outer one is a sphere, capsule, box, cylinder or hull; nothing is known to be inside of others. The inner one is
    any that `rounded_hull` takes: a cylinder counts as the prism of 32 sides around it, a mesh as its hull.
    """
    points, radius = rounded_hull(inner.shape)
    points = points @ inner.placement.rotation.T + inner.placement.translation
    local = (points - outer.placement.translation) @ outer.placement.rotation
    return float(kind_of(outer.shape).outside(outer.shape, local).max()) + radius <= _SAME
