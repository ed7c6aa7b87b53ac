"""The plane in which a planar mechanism moves."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.joints import kinematic_data
from cinegen.model.mechanism import Mechanism

_PARALLEL = 1e-9


def motion_plane(mechanism: Mechanism) -> Array | None:
    """Return the unit normal (3,) of the plane in which all points move; None for a mechanism that moves in space.

    No joint translates along the normal, and all rotate about it. If all joints are prismatic, and parallel, it is some
    normal perpendicular to them.
    """
    model = mechanism.model
    if model.nv == 0:
        return None
    data = kinematic_data(model)
    columns = [np.array(pin.computeJointJacobians(model, data, q)).reshape(6, -1) for q in mechanism.structure.samples]
    rotations = np.hstack([each[3:] for each in columns])
    translations = np.hstack([each[:3, np.linalg.norm(each[3:], axis=0) < _PARALLEL] for each in columns])
    rotations = rotations[:, np.linalg.norm(rotations, axis=0) > _PARALLEL]
    if rotations.size:
        normal = rotations[:, 0] / np.linalg.norm(rotations[:, 0])
        if np.abs(np.cross(rotations.T, normal)).max() > _PARALLEL:
            return None
    else:
        sides = np.linalg.svd(translations)[0]
        normal = sides[:, 2] * np.sign(sides[np.abs(sides[:, 2]).argmax(), 2])
    # a helical joint both rotates and translates
    along = np.concatenate([normal @ each[:3] for each in columns])
    if np.abs(along).max() > _PARALLEL * max(1.0, float(np.abs(translations).max(initial=0.0))):
        return None
    return np.asarray(normal)
