"""`farthest`: a ball that a node can't leave, as its links are only so long."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cinegen.model import Mechanism
from cinegen.model.mechanism import translations

Array = NDArray[np.float64]

_MORE = 1.0 + 1e-9


def farthest(mechanism: Mechanism, node: str) -> tuple[Array, float]:
    """Centre (3,) and radius, m, of a ball that holds a node's origin in all configurations; infinite where a slide has
    no limits, or the base moves.

    From the first joint on each link adds its length, and a slide the most that it goes: the triangle inequality.
    """
    model = mechanism.model
    frame = model.frames[mechanism.frame_id(node)]
    chain = [joint for joint in model.supports[frame.parentJoint] if joint > 0]
    if not chain:
        return np.asarray(frame.placement.translation), 0.0
    radius = float(np.linalg.norm(frame.placement.translation))
    for joint in chain:
        one = model.joints[joint]
        if joint != chain[0]:
            radius += float(np.linalg.norm(model.jointPlacements[joint].translation))
        if translations(one) == 1 and one.nq == 1:
            radius += float(max(abs(model.lowerPositionLimit[one.idx_q]), abs(model.upperPositionLimit[one.idx_q])))
        elif translations(one):
            radius = np.inf
    return np.asarray(model.jointPlacements[chain[0]].translation), radius * _MORE
