"""The outline of a convex body as it is seen from one side: what it covers of the picture's plane."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body

Array = NDArray[np.float64]

_AROUND = 180  # directions in which an outline is looked for, and corners of what is round
_SEEN = 1e-6  # how far the normal of a half-space may point out of the picture


def outline(body: Body, placement: pin.SE3, view: Array, wider: float = 0.0) -> Array:
    """The corners (k, 2) of a body's outline, in turn, m; of a point one.

    A convex body is the hull of some corners, made wider by a ball. So is its outline: in each direction u of the
    picture it ends at the corner that is outermost, and beyond that by the ball's radius.

    Args:
        body: not a half-space, see `edge`.
        placement: of its joint in the world.
        view: (2, 3) unit vectors of the picture in the world: to the right, and up.
        wider: m: as if the body had grown by so much to all sides.
    """
    corners, radius = _corners(body.shape)
    place = placement * body.placement
    flat = (corners @ place.rotation.T + place.translation) @ view.T
    angles = np.arange(_AROUND) * (2.0 * np.pi / _AROUND)
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    found = flat[(ways @ flat.T).argmax(axis=1)] + (radius + wider) * ways
    new = (found != np.roll(found, 1, axis=0)).any(axis=1)
    return np.asarray(found[new] if new.any() else found[:1])


def edge(body: Body, view: Array) -> tuple[Array, float] | None:
    """Of a half-space that stands in the world the normal (2,) and the offset c, m: in the picture it covers all points
    p with n.p <= c. None where it is not seen on its edge: it covers all of the picture."""
    normal = body.placement.rotation @ np.array(body.shape.n)
    seen = view @ normal
    if np.linalg.norm(seen) < 1.0 - _SEEN:
        return None
    return seen, float(body.shape.d + normal @ body.placement.translation)


def _corners(shape: coal.ShapeBase) -> tuple[Array, float]:
    """Corners (n, 3) in the shape's frame, and the radius of a ball around each, m: their hull is the shape. What has
    another shape is taken for the box around it."""
    swept = float(shape.getSweptSphereRadius())
    ends = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    match shape:
        case coal.Sphere():
            return np.zeros((1, 3)), float(shape.radius) + swept
        case coal.Capsule():
            return shape.halfLength * ends, float(shape.radius) + swept
        case coal.Cylinder():
            angles = np.arange(_AROUND) * (2.0 * np.pi / _AROUND)
            ring = shape.radius * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_AROUND)])
            return np.vstack([ring + shape.halfLength * end for end in ends]), swept
        case coal.Convex():
            return np.array(shape.points()), swept
    shape.computeLocalAABB()  # of a box itself; with what is swept
    low, high = np.array(shape.aabb_local.min_), np.array(shape.aabb_local.max_)
    signs = np.array(np.meshgrid(*[[0.0, 1.0]] * 3)).reshape(3, -1).T
    return low + signs * (high - low), 0.0
