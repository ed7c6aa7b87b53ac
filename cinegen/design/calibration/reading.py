"""`read`: a measured quantity of a node's pose, and its derivative by the node's twist."""

from __future__ import annotations

import math

import numpy as np

from cinegen.arrays import Array
from cinegen.design.calibration.measurements import MeasuredQuantity
from cinegen.design.errors import DesignError

_GIMBAL = math.radians(1.0)  # roll and yaw are not measured so near to a pitch of 90 degrees


def read(quantity: MeasuredQuantity, placement: Array) -> tuple[Array, Array]:
    """Return a quantity (poses,) of a node's pose (poses, 4, 4), and its derivative (poses, 6) by the node's twist at
    its origin in the world's axes."""
    rotation, origin = placement[:, :3, :3], placement[:, :3, 3]
    row = np.zeros((len(placement), 6))
    if quantity.kind in ("rx", "ry", "rz"):
        return _angle(quantity, rotation, row)
    arm = rotation @ np.array(quantity.point)
    point = origin + arm
    if quantity.kind == "distance":
        apart = point - np.array(quantity.reference)
        value = np.linalg.norm(apart, axis=1)
        if not value.all():
            raise DesignError(f"{quantity.name}: the point is the fixed point: its distance has no derivative")
        direction = apart / value[:, None]
    else:
        axis = quantity.reference if quantity.kind == "along" else np.eye(3)["xyz".index(quantity.kind)]
        direction = np.tile(axis, (len(arm), 1))
        value = np.einsum("ni,ni->n", direction, point)
    row[:, :3], row[:, 3:] = direction, np.cross(arm, direction)
    return value, row


def _angle(quantity: MeasuredQuantity, r: Array, row: Array) -> tuple[Array, Array]:
    """Return roll, pitch or yaw, and its derivative: w = rz' z + ry' Rz y + rx' R x."""
    yaw = np.arctan2(r[:, 1, 0], r[:, 0, 0])
    pitch = np.arctan2(-r[:, 2, 0], np.hypot(r[:, 2, 1], r[:, 2, 2]))
    cos, sin = np.cos(yaw), np.sin(yaw)
    if quantity.kind == "ry":
        row[:, 3], row[:, 4] = -sin, cos
        return pitch, row
    if (np.abs(np.abs(pitch) - math.pi / 2.0) < _GIMBAL).any():
        raise DesignError(
            f"{quantity.name}: the pitch of {quantity.of} comes within 1 degree of 90, where roll and yaw can't be "
            "told apart: measure positions of points on it instead"
        )
    if quantity.kind == "rx":
        row[:, 3], row[:, 4] = cos / np.cos(pitch), sin / np.cos(pitch)
        return np.arctan2(r[:, 2, 1], r[:, 2, 2]), row
    row[:, 3], row[:, 4], row[:, 5] = cos * np.tan(pitch), sin * np.tan(pitch), 1.0
    return yaw, row
