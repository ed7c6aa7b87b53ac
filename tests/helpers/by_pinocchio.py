"""URDFs as Pinocchio's own reader has them."""

import math
from collections.abc import Mapping

import numpy as np
import pinocchio as pin


def configuration(model: pin.Model, values: Mapping[str, float]) -> np.ndarray:
    """Return q (nq,) at values of joints (rad, m); a joint that may turn for ever has its cosine and sine there."""
    q = pin.neutral(model)
    for name, value in values.items():
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (math.cos(value), math.sin(value))
    return q


def placements_of(text: str, values: Mapping[str, float]) -> dict[str, np.ndarray]:
    """Return the world placements (4, 4) of all bodies of a URDF at values of its joints (rad, m)."""
    model = pin.buildModelFromXML(text)
    data = model.createData()
    pin.framesForwardKinematics(model, data, configuration(model, values))
    bodies = ((i, frame) for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY)
    return {frame.name: data.oMf[i].homogeneous for i, frame in bodies}
