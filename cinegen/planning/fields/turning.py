"""About which axis a vortex turns. In the plane only the sense is to be chosen: +z or -z. In space a whole axis is.

A direction tau says along which side of the obstacle the robot should go. With the outward normal n, the axis is

    w = n x tau / |n x tau|,

so that the vortex w x n is along the part of tau that is tangent to the contours, there and then. The axis is kept as
long as the obstacle is in the way, the field is w x n as n changes: the robot goes round the obstacle in the plane of n
and tau, as far as the obstacle's shape lets it.

Why this is the paper's field, continued to space: where everything lies in a plane, n and tau are in it, w is +z or -z,
and w x n is the paper's tangent with the sense that goes along tau. And there is no other axis that does what a vortex
is for: w must be perpendicular to n for the field to have its full size where it begins, and w x n is the tangent that
w was chosen for.

Others choose a direction, too, and get the axis from it. J. Singh, H. Stephanou and J. Wen, "Real-time robot motion
control with circulatory fields", IEEE International Conference on Robotics and Automation, 1996, let artificial
currents on the surfaces make magnetic fields that bend the way. S. Haddadin, R. Belder and A. Albu-Schäffer, "Dynamic
motion planning for robots in partially unknown environments", 18th IFAC World Congress, 2011, do so in space. A. Ataka,
H.-K. Lam and K. Althoefer, "Reactive magnetic-field-inspired navigation method for robots in unknown convex 3-D
environments", IEEE Robotics and Automation Letters 3(4), 2018, have the robot's own motion induce the current: that is
`shorter`. M. Becker, T. Lilge, M. Müller and S. Haddadin, "Circular fields and predictive multi-agents for online
global trajectory planning", IEEE Robotics and Automation Letters 6(2), 2021, have simulated agents try several axes,
and take the best.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cinegen.planning.fields.parameter import FieldError

Array = NDArray[np.float64]

_TANGENT = 1e-9  # sine of the angle to the normal below which a direction says nothing
_ELSE = (np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))  # where no direction does


def shorter(attraction: ArrayLike) -> Array:
    """(3,) the shorter way, as a point sees it: along the attraction (3,). What mobile robots take."""
    return np.asarray(attraction, dtype=float)


def folding(point: ArrayLike, base: ArrayLike, axis: ArrayLike | None = None) -> Array:
    """(3,) toward the base, m: "folding rather than stretching", which keeps the arm from being caught by the obstacle.

    Args:
        point: (3,) where the vortex acts, m.
        base: (3,) of the robot, m.
        axis: (3,) of the base's joint, if it turns: then it is toward this axis, and height does not matter.
    """
    way: Array = np.asarray(base, dtype=float) - np.asarray(point, dtype=float)
    if axis is None:
        return way
    along = np.asarray(axis, dtype=float)
    return np.asarray(way - (way @ along) / (along @ along) * along)


def turning_axis(normal: ArrayLike, *towards: ArrayLike, plane: ArrayLike | None = None) -> Array:
    """(3,) unit axis w of a vortex that begins along a direction.

    Args:
        normal: (3,) unit vector n out of the obstacle.
        towards: (3,) directions of any size; the first that is not along n counts. Where none is left, the vortex
            begins upward, along z (along x where z is along n): head-on, every way is as good.
        plane: (3,) unit normal of the plane in which all lies; then w is plus or minus that, plus where no
            direction is left.

    Raises:
        FieldError: the normal is zero or not finite.
    """
    n = np.asarray(normal, dtype=float)
    if not (np.isfinite(n).all() and n.any()):
        raise FieldError(f"the normal of an obstacle is {normal!r}; give a unit vector")
    across = [_across(n, np.asarray(tau, dtype=float)) for tau in (*towards, *(_ELSE if plane is None else ()))]
    if plane is not None:
        up = np.asarray(plane, dtype=float)
        senses = (float(up @ turn) for turn in across)
        return np.asarray(math.copysign(1.0, next((s for s in senses if abs(s) > _TANGENT), 1.0)) * up)
    sizes = [float(np.linalg.norm(turn)) for turn in across]
    return next(turn / size for turn, size in zip(across, sizes, strict=True) if size > _TANGENT)


def _across(normal: Array, direction: Array) -> Array:
    """(3,) n x tau for tau of size 1; 0 where it is 0."""
    size = float(np.linalg.norm(direction))
    return np.cross(normal, direction / size) if size > 0.0 else np.zeros(3)
