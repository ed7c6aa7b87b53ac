"""Outlines of convex bodies and edges of half-spaces: the part of a picture's plane that they cover."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body, rounded_hull

Array = NDArray[np.float64]

_DIRECTIONS = 180  # of an outline
_SIDES = 720  # of the prism around a cylinder
_EDGE_ON = 1e-6  # how far the normal of a half-space may point out of the picture


def outline(body: Body, placement: pin.SE3, view: Array, margin: float = 0.0) -> Array:
    """Return the corners (k, 2) of a body's outline, in order, m; one corner for a point.

    A convex body is the hull of some points, grown by a ball. So is its outline: in each direction u of the picture it
    ends at the point that is outermost, and beyond that by the ball's radius.

    Args:
        body: not a half-space, see `edge`.
        placement: pose of its joint in the world.
        view: (2, 3) unit vectors of the picture in the world: to the right, and up.
        margin: m: the body is grown by this on all sides.
    """
    points, radius = rounded_hull(body.shape, _SIDES)
    place = placement * body.placement
    flat = (points @ place.rotation.T + place.translation) @ view.T
    angles = np.arange(_DIRECTIONS) * (2.0 * np.pi / _DIRECTIONS)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    found = flat[(directions @ flat.T).argmax(axis=1)] + (radius + margin) * directions
    new = (found != np.roll(found, 1, axis=0)).any(axis=1)
    return np.asarray(found[new] if new.any() else found[:1])


def edge(body: Body, view: Array) -> tuple[Array, float] | None:
    """Return the normal n (2,) and the offset c, m, of a half-space in the world: in the picture it covers all points p
    with n.p <= c. None if it is not seen edge-on: it covers the whole picture."""
    normal = body.placement.rotation @ np.array(body.shape.n)
    projected = view @ normal
    if np.linalg.norm(projected) < 1.0 - _EDGE_ON:
        return None
    return projected, float(body.shape.d + normal @ body.placement.translation)
