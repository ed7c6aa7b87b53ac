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


def roll_pitch_yaw(placement: ArrayLike) -> tuple[float, float, float]:
    """URDF's angles, R = Rz(yaw) Ry(pitch) Rx(roll), of a placement's rotation.

    Roll is read off after undoing yaw, so that the product is exact to rounding at any pitch: there roll and yaw
    are each badly determined, but not their sum.
    """
    (a, b, c), (d, e, f), (g, _, _) = np.asarray(placement, dtype=float)[:3, :3].tolist()
    yaw = math.atan2(d, a)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return math.atan2(sy * c - cy * f, cy * e - sy * b), math.atan2(-g, cy * a + sy * d), yaw
