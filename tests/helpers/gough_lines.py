"""The lines of the legs of `robots/gough.raff`, by Pinocchio's placements of their joints."""

import numpy as np
import pinocchio as pin


def lines_of(gough, q):
    """Return the legs' unit forces (6, 6) as force and moment about the platform's origin."""
    data = gough.model.createData()
    pin.forwardKinematics(gough.model, data, q)
    starts = [data.oMi[gough.model.getJointId(f"joint{k}")].translation for k in (1, 7, 10, 13, 16, 19)]
    ends = [data.oMi[gough.model.getJointId("joint4")].translation]
    ends += [(data.oMi[anchor[0]] * anchor[1]).translation for anchor in gough.structure.system.anchors]
    centre = gough.placement(q, gough.end).translation
    units = [(b - a) / np.linalg.norm(b - a) for a, b in zip(starts, ends, strict=True)]
    return np.array([np.concatenate([u, np.cross(a - centre, u)]) for a, u in zip(starts, units, strict=True)])
