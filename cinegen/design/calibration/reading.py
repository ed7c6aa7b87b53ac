"""`read`: a measured quantity of a node's pose, and its derivative by the node's twist."""

from __future__ import annotations

import math

import numpy as np

from cinegen.arrays import Array
from cinegen.design.calibration.measurements import MeasuredQuantity
from cinegen.design.errors import DesignError

_GIMBAL = math.radians(1.0)  # roll and yaw are not measured so near to a pitch of 90 degrees


def read(one: MeasuredQuantity, placement: Array) -> tuple[Array, Array]:
    """Return a quantity (poses,) of a node's pose (poses, 4, 4), and its derivative (poses, 6) by the node's twist at
    its origin in the world's axes."""
    rotation, origin = placement[:, :3, :3], placement[:, :3, 3]
    row = np.zeros((len(placement), 6))
    if one.kind in ("rx", "ry", "rz"):
        return _angle(one, rotation, row)
    arm = rotation @ np.array(one.point)
    point = origin + arm
    if one.kind == "distance":
        apart = point - np.array(one.reference)
        value = np.linalg.norm(apart, axis=1)
        if not value.all():
            raise DesignError(f"{one.name}: the point is the fixed point: its distance has no derivative")
        direction = apart / value[:, None]
    else:
        direction = np.tile(one.reference if one.kind == "along" else np.eye(3)["xyz".index(one.kind)], (len(arm), 1))
        value = np.einsum("ni,ni->n", direction, point)
    row[:, :3], row[:, 3:] = direction, np.cross(arm, direction)
    return value, row


def _angle(one: MeasuredQuantity, r: Array, row: Array) -> tuple[Array, Array]:
    """Return roll, pitch or yaw, and its derivative: w = rz' z + ry' Rz y + rx' R x."""
    yaw = np.arctan2(r[:, 1, 0], r[:, 0, 0])
    pitch = np.arctan2(-r[:, 2, 0], np.hypot(r[:, 2, 1], r[:, 2, 2]))
    cos, sin = np.cos(yaw), np.sin(yaw)
    if one.kind == "ry":
        row[:, 3], row[:, 4] = -sin, cos
        return pitch, row
    if (np.abs(np.abs(pitch) - math.pi / 2.0) < _GIMBAL).any():
        raise DesignError(
            f"{one.name}: the pitch of {one.of} comes within 1 degree of 90, where roll and yaw can't be told apart: "
            "measure positions of points on it instead"
        )
    if one.kind == "rx":
        row[:, 3], row[:, 4] = cos / np.cos(pitch), sin / np.cos(pitch)
        return np.arctan2(r[:, 2, 1], r[:, 2, 2]), row
    row[:, 3], row[:, 4], row[:, 5] = cos * np.tan(pitch), sin * np.tan(pitch), 1.0
    return yaw, row
