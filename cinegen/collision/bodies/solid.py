"""From what is drawn to what distances are measured to: a convex solid around it, a capsule where that is nearly as
tight.

Distances between capsules are ten times as fast as between hulls, and need no search.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.bodies.capsule import Capsule, around
from cinegen.collision.bodies.hull import hull, with_fewer_corners

Array = NDArray[np.float64]

TIGHT = 1.75
"""A capsule is taken where its volume is at most this times that of the convex hull of what it holds. A long bar of
square section gets one (1.7), as does a cylinder as wide as it is long (1.7); a cube does not."""


class Solid(NamedTuple):
    """A convex shape, and where it stands."""

    placement: pin.SE3
    shape: coal.ShapeBase


def solid(drawn: coal.CollisionGeometry, placement: pin.SE3) -> Solid:
    """The tightest convex solid around a shape that is fast to measure to.

    Args:
        drawn: a ball or a capsule, which stay what they are; a box or a cylinder, which become a capsule if that is
            `TIGHT`; a mesh, whose convex hull does so, whether the mesh is convex or not: hollows are filled. Any other
            shape becomes the box around it.
        placement: of what is drawn.

    Returns:
        a solid that holds all of it, placed in the same frame.
    """
    match drawn:
        case coal.Sphere() | coal.Capsule():
            return Solid(placement, drawn)
        case coal.Cylinder():
            return _tighter(_on_axis(drawn.radius, drawn.halfLength, 2), drawn, drawn.computeVolume(), placement)
        case coal.Box():
            half = np.array(drawn.halfSide)
            each = [_on_axis(math.hypot(half[i - 2], half[i - 1]), half[i], i) for i in range(3)]
            return _tighter(min(each, key=lambda some: some.volume), drawn, drawn.computeVolume(), placement)
        case coal.BVHModelOBBRSS() | coal.Convex():
            exact = hull(np.array(drawn.vertices() if isinstance(drawn, coal.BVHModelOBBRSS) else drawn.points()))
            return _tighter(around(exact.corners), with_fewer_corners(exact).shape, exact.volume, placement)
    drawn.computeLocalAABB()
    low, high = np.array(drawn.aabb_local.min_), np.array(drawn.aabb_local.max_)
    return solid(coal.Box(high - low), placement * pin.SE3(np.eye(3), (low + high) / 2.0))


def _tighter(capsule: Capsule, shape: coal.ShapeBase, volume: float, placement: pin.SE3) -> Solid:
    """The capsule around a shape, if it is not much larger than the volume that it holds; else the shape itself."""
    if capsule.volume > TIGHT * volume:
        return Solid(placement, shape)
    return Solid(placement * capsule.placement, capsule.shape)


def _on_axis(radius: float, half: float, axis: int) -> Capsule:
    """A cylinder with round ends, which some write as a cylinder and two balls: these are then inside of it."""
    return Capsule(np.zeros(3), np.eye(3)[axis], radius, 2.0 * half)
