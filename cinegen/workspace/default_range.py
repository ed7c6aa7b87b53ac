"""`default_range`: the range of a coordinate that is not given: a map over it holds everything that can be reached."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.ik.local_ik import LocalIK
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism
from cinegen.singularities.slice import POSE
from cinegen.workspace.errors import MapError
from cinegen.workspace.reach_bounds import ReachBounds
from cinegen.workspace.region import SPHERICAL
from raff2urdf.errors import did_you_mean

_SAMPLES = 400
_MARGIN = 0.15  # of the range, to both sides, as samples are only some configurations
_FURTHEST = 8  # of the samples, from which a node is moved on outwards
_STEPS = (0.1, 0.005)  # of the range: the first step and the last
_GOAL = 1e-8  # rad or lengths: largest remaining error
_FIXED = 1e-9  # m or rad


def default_range(
    mechanism: Mechanism, name: str, node: str | None = None, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[float, float]:
    """Return the range of a coordinate in what a mechanism can reach, m or rad.

    Of an actuated joint these are its limits or, without limits, half a revolution or a characteristic length to both
    sides of home. Of a pose it is the range of samples of the configuration space, moved on outwards as far as
    possible, and a margin, within the bounds that the lengths of the links imply.

    Args:
        mechanism: the robot.
        name: a coordinate of a pose (x, y, z, rx, ry, rz), one seen from a centre (azimuth, elevation, radius), or an
            actuated joint.
        node: whose pose; the mechanism's end unless given.
        centre: (3,) m, the centre of a radius.

    Raises:
        MapError: no such coordinate, or it can't change.
        UnknownNameError: no such node.
    """
    node = mechanism.end if node is None else node
    if name in mechanism.actuated:
        home = float(mechanism.q_home[mechanism.q_index(name)])
        reach = mechanism.length if mechanism.is_prismatic(name) else math.pi
        low, high, *_ = mechanism.limits[name]
        if low == high:
            raise MapError(f"{mechanism.name}: {name} can't move: its limits are equal. Leave it out")
        return low if math.isfinite(low) else home - reach, high if math.isfinite(high) else home + reach
    if name in POSE:
        return _pose_range(mechanism, node, POSE.index(name))
    if name == "azimuth":
        return -math.pi, math.pi
    if name == "elevation":
        return -0.5 * math.pi, 0.5 * math.pi
    if name == "radius":
        radius = ReachBounds(mechanism, node).radius(centre)
        return 0.0, radius if math.isfinite(radius) else 4.0 * mechanism.length
    known = (*POSE, *SPHERICAL, *mechanism.actuated)
    raise MapError(f"{mechanism.name}: unknown coordinate '{name}'{did_you_mean(name, known)}")


def _pose_range(mechanism: Mechanism, node: str, axis: int) -> tuple[float, float]:
    """Return the range of x (0), y, z, roll (3), pitch or yaw of a node."""
    seen = _poses(mechanism, node)[:, axis]
    low, high = float(seen.min()), float(seen.max())
    if high - low < _FIXED:
        raise MapError(f"{mechanism.name}: {node} can't move along {POSE[axis]}: it stays at {low:g}. Leave it out")
    least, most = -math.pi, math.pi
    if axis < 3:
        low, high = (sign * _furthest(mechanism, node, axis, sign) for sign in (-1.0, 1.0))
        least, most = ReachBounds(mechanism, node).interval(axis)
    margin = _MARGIN * (high - low)
    low, high = max(low - margin, least), min(high + margin, most)
    digits = 1 - math.floor(math.log10(high - low))
    step = 10.0**-digits  # rounded outwards, to numbers that are easy to read
    low, high = (round(end(x / step) * step, max(digits, 0)) for x, end in ((low, math.floor), (high, math.ceil)))
    return (max(low, least), min(high, most)) if axis >= 3 else (low, high)


def _samples(mechanism: Mechanism) -> Array:
    """Return samples (n, nq) of the configuration space."""
    return LocalIK(mechanism, holds_base=True).samples(_SAMPLES, np.random.default_rng(0))


@lru_cache(maxsize=8)
def _poses(mechanism: Mechanism, node: str) -> Array:
    """Return the poses (n, 6) of a node in all samples: m, and roll, pitch and yaw, rad."""
    poses = [mechanism.placement(q, node) for q in mechanism.structure.derived(_samples)]
    return np.array([[*pose.translation, *pin.rpy.matrixToRpy(pose.rotation)] for pose in poses])


@lru_cache(maxsize=32)
def _furthest(mechanism: Mechanism, node: str, axis: int, sign: float) -> float:
    """Return how far a node gets along an axis of the world (sign 1) or against it (-1), m, straight on from those of
    the samples in which it is furthest."""
    points, outwards = _poses(mechanism, node)[:, :3], sign * np.eye(3)[axis]
    first, last = (part * np.ptp(points, axis=0).max() for part in _STEPS)
    local = LocalIK(mechanism, (FrameTask(node, pin.SE3.Identity(), 3, 0),), holds_base=True)
    furthest = float((points @ outwards).max())
    for k in np.argsort(-(points @ outwards), kind="stable")[:_FURTHEST]:
        q, at, step = mechanism.structure.derived(_samples)[k], points[k], first
        while step > last:
            local.tasks[0].target = pin.SE3(np.eye(3), at + step * outwards)
            if local.solve(q, _GOAL):
                q, at = local.best, at + step * outwards
            else:
                step *= 0.5
        furthest = max(furthest, float(at @ outwards))
    return furthest
