"""Placements: poses of frames as (4, 4) matrices; metres and radians."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from raff2urdf.arrays import Array, ArrayLike
from raff2urdf.residual import skew

_NEXT, _LAST = [1, 2, 0], [2, 0, 1]


def inverse(placement: ArrayLike) -> Array:
    """Return the inverse placement: of the outer frame in the inner one."""
    m = np.asarray(placement, dtype=float)
    inverted = np.eye(4)
    inverted[:3, :3] = m[:3, :3].T
    inverted[:3, 3] = -m[:3, :3].T @ m[:3, 3]
    return inverted


def translation(vector: ArrayLike) -> Array:
    """Return the placement of a frame that is translated by a vector (3,), m."""
    placement = np.eye(4)
    placement[:3, 3] = vector
    return placement


def cross(a: Array, b: Array) -> Array:
    """Return the cross products of vectors (..., 3); np.cross takes ten times as long for few of them."""
    return a[..., _NEXT] * b[..., _LAST] - a[..., _LAST] * b[..., _NEXT]


def _unit(vector: Array) -> Array:
    """Return a vector (3,) of length 1, to the last bit the same on any machine."""
    return np.asarray(vector / math.sqrt(math.fsum(x * x for x in vector.tolist())))


def along(origin: Array, z: Array) -> Array:
    """Return a placement at a point (3,) whose z axis has a direction (3,), of any length but 0."""
    z = _unit(z)
    y = _unit(cross(z, np.eye(3)[0 if abs(z[0]) < 0.6 else 1]))
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = np.column_stack([cross(y, z), y, z]), origin
    return placement


def rotation(axis: Sequence[float] | Array, angle: float) -> Array:
    """Return the placement of a frame that is rotated by an angle (rad) about a unit axis (3,)."""
    cross, placement = skew(axis), np.eye(4)
    placement[:3, :3] += math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
    return placement


def joint_motion(prismatic: bool, axis: Array, value: float) -> Array:
    """Return the placement that a joint with a unit axis (3,) has at a value, m or rad."""
    return translation(value * axis) if prismatic else rotation(axis, value)


def from_origin(xyz: Sequence[float], rpy: Sequence[float]) -> Array:
    """Return the placement of a URDF's or SDF's origin: xyz, and R = Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = map(math.cos, rpy), map(math.sin, rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
            [-sp, cp * sr, cp * cr, xyz[2]],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def from_quaternion(xyz: ArrayLike, wxyz: ArrayLike) -> Array:
    """Return the placement of a frame at a point (3,) whose rotation is a quaternion (4,) of any length above 0."""
    from scipy.spatial.transform import Rotation  # slow to import, and few files have quaternions

    placement = translation(xyz)
    placement[:3, :3] = Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
    return placement


def roll_pitch_yaw(placement: ArrayLike) -> tuple[float, float, float]:
    """Return URDF's angles (rad) of a placement's rotation, R = Rz(yaw) Ry(pitch) Rx(roll).

    Roll is computed after yaw is undone, so that the product is exact to rounding at any pitch: near 90 degrees roll
    and yaw are each badly determined, but not their sum.
    """
    (a, b, c), (d, e, f), (g, _, _) = np.asarray(placement, dtype=float)[:3, :3].tolist()
    yaw = math.atan2(d, a)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return math.atan2(sy * c - cy * f, cy * e - sy * b), math.atan2(-g, cy * a + sy * d), yaw


def with_z(axis: Array, x: Array | None = None) -> Array:
    """Return a rotation (3, 3) whose z is a unit axis (3,), and whose x is as near as possible to a given one."""
    across = np.zeros(3) if x is None else x - float(x @ axis) * axis
    if x is None or np.linalg.norm(across) < 0.1 * np.linalg.norm(x):  # x is nearly parallel to z
        aside = np.eye(3)[int(np.argmin(np.abs(axis)))]
        across = aside - float(aside @ axis) * axis
    across = across / np.linalg.norm(across)
    return np.column_stack([across, cross(axis, across), axis])
