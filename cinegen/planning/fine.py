"""`fine`: a path with so many configurations that what lies between two of them hardly matters to the eye."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cinegen.errors import ClosureError
from cinegen.model import Mechanism

Array = NDArray[np.float64]

STEP = 0.03
"""Rad or characteristic lengths."""


def fine(mechanism: Mechanism, path: Array, step: float = STEP) -> Array:
    """(m, nq) the path (n, nq) with configurations between, joints going straight and loops closed, so that no joint
    moves by more than a step (rad or characteristic lengths) from one to the next. Those of the path are among them.

    Where loops can't be closed between two configurations, none are put there.
    """
    found = [path[:1]]
    for begin, end in pairwise(path):
        way = mechanism.distance(begin, end)
        parts = np.arange(1, max(1, int(np.ceil(way / step)))) / max(1, int(np.ceil(way / step)))
        between = [mechanism.interpolate(begin, end, part) for part in parts.tolist()]
        if mechanism.loops:
            try:
                between = [mechanism.close(q) for q in between]
            except ClosureError:
                between = []
        found.append(np.array([*between, end]))
    return np.vstack(found)
