"""`about`: how far a coordinate can go, for who gives no range: a map that holds all that can be reached."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik.seeker import Seeker
from cinegen.ik.task import FrameTask
from cinegen.model import Mechanism
from cinegen.singularities.slice import POSE
from cinegen.workspace.errors import MapError
from cinegen.workspace.reach_bounds import bounds, radius_about
from cinegen.workspace.region import AROUND
from raff2urdf.errors import did_you_mean

Array = NDArray[np.float64]

_SPREAD = 400  # configurations that are looked at
_MORE = 0.15  # of the range, to both sides: configurations are only some
_FURTHEST = 8  # of them, from which a node is led on outwards
_STEPS = (0.1, 0.005)  # of the range: at first, and the last
_GOAL = 1e-8  # rad or lengths that may be left


def about(
    mechanism: Mechanism, name: str, node: str | None = None, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[float, float]:
    """From where to where a coordinate goes in what a mechanism can reach, m or rad.

    Of motors these are their limits, or half a turn, or a characteristic length, about home. Of a pose they are what
    was seen in many configurations all over, led on outwards as far as that goes, and a little more; but no more than
    the lengths of links allow.

    Args:
        mechanism: which.
        name: of a pose (x, y, z, rx, ry, rz), seen from a centre (azimuth, elevation, radius), or a motor.
        node: whose pose; the mechanism's end unless given.
        centre: (3,) m, what a radius is seen from.

    Raises:
        MapError: no such coordinate.
        UnknownNameError: no such node.
    """
    node = mechanism.end if node is None else node
    if name in mechanism.actuated:
        return _of_motor(mechanism, name)
    if name in POSE:
        axis = POSE.index(name)
        seen = _seen(mechanism, node)[:, axis]
        low, high = float(seen.min()), float(seen.max())
        if high - low < 1e-9:
            raise MapError(f"{mechanism.name}: {node} can't move along {name}: it stays at {low:g}. Leave it out")
        if axis >= 3:
            more = _MORE * (high - low)
            low, high = _rounded(low - more, high + more)
            return max(low, -math.pi), min(high, math.pi)
        low, high = _led_on(mechanism, node, axis, -1.0), _led_on(mechanism, node, axis, 1.0)
        more, (least, most) = _MORE * (high - low), bounds(mechanism, node, axis)
        return _rounded(max(low - more, least), min(high + more, most))
    if name in AROUND[:2]:
        return (-math.pi, math.pi) if name == AROUND[0] else (-0.5 * math.pi, 0.5 * math.pi)
    if name == AROUND[2]:
        radius = radius_about(mechanism, node, centre)
        return 0.0, radius if math.isfinite(radius) else 4.0 * mechanism.length
    known = (*POSE, *AROUND, *mechanism.actuated)
    raise MapError(f"{mechanism.name}: no coordinate '{name}'{did_you_mean(name, known)}")


def _rounded(low: float, high: float) -> tuple[float, float]:
    """A range that is a little longer, in numbers that are easily read."""
    digits = 1 - math.floor(math.log10(high - low))
    step = 10.0**-digits
    return round(math.floor(low / step) * step, max(digits, 0)), round(math.ceil(high / step) * step, max(digits, 0))


def _of_motor(mechanism: Mechanism, name: str) -> tuple[float, float]:
    at = mechanism.q_index(name)
    home = float(mechanism.q_home[at])
    reach = mechanism.length if mechanism.is_prismatic(name) else math.pi
    low, high, *_ = mechanism.limits[name]
    return (low if math.isfinite(low) else home - reach), (high if math.isfinite(high) else home + reach)


@lru_cache(maxsize=4)
def _spread(mechanism: Mechanism) -> Array:
    """(n, nq) configurations all over what can be reached."""
    return Seeker(mechanism, ()).spread(_SPREAD, np.random.default_rng(0))


@lru_cache(maxsize=8)
def _seen(mechanism: Mechanism, node: str) -> Array:
    """(n, 6) poses of a node all over what can be reached."""
    places = [mechanism.placement(q, node) for q in _spread(mechanism)]
    return np.array([[*at.translation, *pin.rpy.matrixToRpy(at.rotation)] for at in places])


@lru_cache(maxsize=32)
def _led_on(mechanism: Mechanism, node: str, axis: int, way: float) -> float:
    """How far a node can be led along an axis of the world (way 1) or against it (-1), straight on from those of the
    configurations in which it is furthest."""
    configurations, places = _spread(mechanism), _seen(mechanism, node)[:, :3]
    outwards = np.zeros(3)
    outwards[axis] = way
    first, last = _STEPS[0] * np.ptp(places, axis=0).max(), _STEPS[1] * np.ptp(places, axis=0).max()
    seeker = Seeker(mechanism, (FrameTask(node, pin.SE3.Identity(), 3, 0),))
    furthest = float((places @ outwards).max())
    for k in np.argsort(-(places @ outwards), kind="stable")[:_FURTHEST]:
        q, at, step = configurations[k], places[k], first
        while step > last:
            seeker.tasks[0].target = pin.SE3(np.eye(3), at + step * outwards)
            if seeker.seek(q, _GOAL):
                q, at = seeker.best, at + step * outwards
            else:
                step *= 0.5
        furthest = max(furthest, float(at @ outwards))
    return way * furthest
