"""Joint limits: which there are, and which joints are beyond theirs."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cinegen.model.mechanism import Mechanism

Array = NDArray[np.float64]

_ROUNDING = 1e-9  # rad or m at a limit


def limits(mechanism: Mechanism, joint: str) -> tuple[float, float]:
    """Of a joint, rad or m; infinite where it has none.

    Raises:
        UnknownNameError: no such joint.
    """
    i, model = mechanism.q_index(joint), mechanism.model
    return float(model.lowerPositionLimit[i]), float(model.upperPositionLimit[i])


def beyond(mechanism: Mechanism, q: Array, rounding: float = 0.0) -> dict[str, float]:
    """Joints that are beyond a limit, each with that limit (rad, m), in file order.

    Args:
        mechanism: whose.
        q: (nq,).
        rounding: rad or m by which a limit may be passed.
    """
    found = {}
    for joint in mechanism.joints:
        low, high = limits(mechanism, joint)
        value = float(q[mechanism.q_index(joint)])
        if not low - rounding <= value <= high + rounding:
            found[joint] = low if value < low else high
    return found


def unwound(mechanism: Mechanism, q: Array) -> Array:
    """(nq,) the same places, each joint that turns by whole turns as near to the middle of its limits as it can be.

    Args:
        mechanism: whose.
        q: (nq,).
    """
    found = np.array(q, dtype=float)
    for joint in mechanism.joints:
        low, high = limits(mechanism, joint)
        if not mechanism.slides(joint) and math.isfinite(low) and math.isfinite(high):
            i, middle = mechanism.q_index(joint), (low + high) / 2.0
            found[i] = middle + math.remainder(found[i] - middle, 2.0 * math.pi)
    return found


def outside(mechanism: Mechanism, q: Array) -> dict[str, float]:
    """Joints that are beyond a limit however often they are turned, each with that limit (rad, m), in file order.

    Args:
        mechanism: whose.
        q: (nq,).
    """
    return beyond(mechanism, unwound(mechanism, q), _ROUNDING)
