"""Values of a task of a frame: what they must be, and checks of them."""

from __future__ import annotations

from operator import index
from typing import Any, SupportsIndex

import numpy as np
import pinocchio as pin

from cinegen.arrays import ArrayLike
from cinegen.errors import CinegenError
from cinegen.ik.thresholds import ROTATION

TRANSLATIONS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0))
ROTATIONS = ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0))
"""Weights of the axes for a number of constrained translations or rotations."""

WANTED = {
    "node": "the name of a base, link or frame",
    "axes": "target, world, or the name of a base, link or frame",
    "offset": "a point of three finite numbers (m) or a pinocchio.SE3",
    "target": "a pinocchio.SE3, or as a twist six finite numbers",
    "translation": "a number of constrained axes, 0 to 3",
    "rotation": "a number of constrained axes, 0 to 3",
    "weights": "six finite numbers of at least 0",
    "weight": "a positive, finite number",
}
"""What a task's value must be, by its name."""


def pose(offset: pin.SE3 | ArrayLike | None) -> pin.SE3:
    """Return an offset as a pose in the node's frame, a copy.

    Raises:
        CinegenError: it is neither an SE3 nor three finite numbers.
    """
    if offset is None:
        return pin.SE3.Identity()
    try:
        if isinstance(offset, pin.SE3):
            pose = offset.copy()
        else:
            pose = pin.SE3(np.eye(3), np.asarray(offset, dtype=float).reshape(3))
    except (TypeError, ValueError):
        pose = None
    if pose is None or not np.isfinite(pose.homogeneous).all():
        raise CinegenError("offset must be a point of three finite numbers (m) or a pinocchio.SE3")
    return pose


def checked_priority(priority: Any) -> int:
    """Return a valid priority.

    Raises:
        CinegenError: it is no whole number of at least 0.
    """
    if isinstance(priority, bool) or not isinstance(priority, int | np.integer) or priority < 0:
        raise CinegenError(f"a task's priority is a whole number, 0 or more (0 is served first), not {priority!r:.80}")
    return int(priority)


def is_count(count: object) -> bool:
    """Return whether this is a number of constrained axes, 0 to 3; True and False are none."""
    return isinstance(count, SupportsIndex) and not isinstance(count, bool | np.bool_) and 0 <= index(count) < 4


def fault_of(target: pin.SE3) -> str:
    """Return why a target can't be followed, and what it must be; empty if it can."""
    if not np.isfinite(target.translation).all():
        return f"the position {target.translation.tolist()}: give three finite numbers (m)"
    rotation = target.rotation
    with np.errstate(all="ignore"):  # where squares overflow, too
        off = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
        if off <= ROTATION and np.linalg.det(rotation) > 0.0:
            return ""
    why = "a reflection" if off <= ROTATION else f"no rotation, by {off:.2g}"
    return f"an orientation that is {why}: give an orthonormal matrix of determinant 1"
