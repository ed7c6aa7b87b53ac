"""Mechanisms that move in a plane."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.model import Mechanism

Array = NDArray[np.float64]

_PARALLEL = 1e-9


def plane_of(mechanism: Mechanism) -> Array | None:
    """(3,) the normal of the plane that all points move in, along which no joint moves and about which all turn; None
    for mechanisms that move in space. Of a single slide, or several in one direction, some normal that is at a right
    angle to it."""
    model = mechanism.model
    if model.nv == 0:
        return None
    data = model.createData()
    columns = [np.array(pin.computeJointJacobians(model, data, q)) for q in mechanism.samples]
    turns = np.hstack([each[3:] for each in columns])
    slides = np.hstack([each[:3, np.linalg.norm(each[3:], axis=0) < _PARALLEL] for each in columns])
    turning = turns[:, np.linalg.norm(turns, axis=0) > _PARALLEL]
    if turning.size:
        normal = turning[:, 0] / np.linalg.norm(turning[:, 0])
        if np.abs(np.cross(turning.T, normal)).max() > _PARALLEL:
            return None
    else:
        sides = np.linalg.svd(slides)[0]
        normal = sides[:, 2] * np.sign(sides[np.abs(sides[:, 2]).argmax(), 2])
    if slides.size and np.abs(normal @ slides).max() > _PARALLEL * max(1.0, float(np.abs(slides).max())):
        return None
    # a screw's column turns and slides at once
    along = np.concatenate([normal @ each[:3] for each in columns])
    if np.abs(along).max() > 1e-9 * max(1.0, float(np.abs(slides).max(initial=0.0))):
        return None
    return np.asarray(normal)
