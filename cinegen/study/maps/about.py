"""`about`: how far a coordinate can go, for who gives no range: a map that holds all that can be reached."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.model import Mechanism
from cinegen.solve.inverse.seeker import Seeker
from cinegen.study.maps.errors import MapError
from cinegen.study.maps.region import AROUND
from cinegen.study.maps.shells import farthest
from cinegen.study.singular.slice import POSE
from raff2urdf.errors import did_you_mean

Array = NDArray[np.float64]

_SPREAD = 400  # configurations that are looked at
_MORE = 0.15  # of the range, to both sides: configurations are only some


def about(mechanism: Mechanism, name: str, node: str | None = None) -> tuple[float, float]:
    """From where to where a coordinate goes in what a mechanism can reach, m or rad.

    Of motors these are their limits, or half a turn, or a characteristic length, about home. Of a pose they are what
    was seen in many configurations all over, and a little more.

    Args:
        mechanism: which.
        name: of a pose (x, y, z, rx, ry, rz), seen from a centre (azimuth, elevation, radius), or a motor.
        node: whose pose; the mechanism's end unless given.

    Raises:
        MapError: no such coordinate.
        UnknownNameError: no such node.
    """
    node = mechanism.end if node is None else node
    if name in mechanism.actuated:
        return _of_motor(mechanism, name)
    if name in POSE:
        seen = _seen(mechanism, node)[:, POSE.index(name)]
        low, high = float(seen.min()), float(seen.max())
        if high - low < 1e-9:
            raise MapError(f"{mechanism.name}: {node} can't move along {name}: it stays at {low:g}. Leave it out")
        more = _MORE * (high - low)
        low, high = _rounded(low - more, high + more)
        return (low, high) if name in POSE[:3] else (max(low, -math.pi), min(high, math.pi))
    if name in AROUND[:2]:
        return (-math.pi, math.pi) if name == AROUND[0] else (-0.5 * math.pi, 0.5 * math.pi)
    if name == AROUND[2]:
        radius = farthest(mechanism, node)[1]
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
    reach = mechanism.length if mechanism.slides(name) else math.pi
    low, high = float(mechanism.model.lowerPositionLimit[at]), float(mechanism.model.upperPositionLimit[at])
    return (low if math.isfinite(low) else home - reach), (high if math.isfinite(high) else home + reach)


@lru_cache(maxsize=8)
def _seen(mechanism: Mechanism, node: str) -> Array:
    """(n, 6) poses of a node all over what can be reached."""
    spread = Seeker(mechanism, ()).spread(_SPREAD, np.random.default_rng(0))
    places = [mechanism.placement(q, node) for q in spread]
    return np.array([[*at.translation, *pin.rpy.matrixToRpy(at.rotation)] for at in places])
