"""Joint limits of a configuration that says where parts are, not how often each joint was turned."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cinegen.model import Mechanism
from cinegen.model.limits import beyond, limits

Array = NDArray[np.float64]

_ROUNDING = 1e-9  # rad or m at a limit


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
