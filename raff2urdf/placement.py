"""Placements: where a frame stands in another, as (4, 4) matrices; metres and radians."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def inverse(placement: ArrayLike) -> Array:
    """The placement the other way round: of the outer frame in the inner one."""
    given = np.asarray(placement, dtype=float)
    found = np.eye(4)
    found[:3, :3] = given[:3, :3].T
    found[:3, 3] = -given[:3, :3].T @ given[:3, 3]
    return found


def of_origin(xyz: Sequence[float], rpy: Sequence[float]) -> Array:
    """The placement that a URDF's or an SDF's origin says: xyz, and R = Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = map(math.cos, rpy), map(math.sin, rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
            [-sp, cp * sr, cp * cr, xyz[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def turn(axis: Sequence[float] | Array, angle: float) -> Array:
    """The turn by an angle about an axis (3,) of length 1, as a placement."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned = np.eye(4)
    turned[:3, :3] += math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
    return turned


def of_quaternion(w: float, x: float, y: float, z: float) -> Array:
    """The rotation (3, 3) of a quaternion, of any length above 0."""
    w, x, y, z = np.array([w, x, y, z], dtype=float) / math.hypot(w, x, y, z)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def roll_pitch_yaw(placement: ArrayLike) -> tuple[float, float, float]:
    """URDF's angles, R = Rz(yaw) Ry(pitch) Rx(roll), of a placement's rotation.

    Roll is read off after undoing yaw, so that the product is exact to rounding at any pitch: there roll and yaw
    are each badly determined, but not their sum.
    """
    (a, b, c), (d, e, f), (g, _, _) = np.asarray(placement, dtype=float)[:3, :3].tolist()
    yaw = math.atan2(d, a)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return math.atan2(sy * c - cy * f, cy * e - sy * b), math.atan2(-g, cy * a + sy * d), yaw
