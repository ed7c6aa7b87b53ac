"""Configurations all along a path."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pinocchio as pin

from cinegen import Mechanism


def along(mechanism: Mechanism, path: np.ndarray, step: float) -> Iterator[np.ndarray]:
    """Yield configurations, joints straight between two of a path, none further from the next than a step (rad or
    characteristic lengths)."""
    model, scale = mechanism.model, mechanism.scale
    for begin, end in pairwise(path):
        count = max(1, math.ceil(float(np.abs(pin.difference(model, begin, end) / scale).max()) / step))
        yield from (pin.interpolate(model, begin, end, k / count) for k in range(count))
    yield path[-1]
