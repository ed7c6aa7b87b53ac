"""Kinematics by Pinocchio, called from the kernels, of models with joints that the kernels cannot move.

Files bring revolute, prismatic and free joints only, which the kernels move themselves, as they do spherical ones. A
model that a program builds may have any joint of Pinocchio: planar, helical, universal, composite ...
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.jit.callback import CALLBACK
from cinegen.jit.foreign import frame_of, numbers_at
from cinegen.joints import kinematic_data
from cinegen.loops._kernels.kinematics import EVALUATE, INTEGRATE
from cinegen.loops._kernels.memory import LoopMemory


def kinematics_callback(memory: LoopMemory, model: pin.Model) -> Any:
    """Return a `CALLBACK` that evaluates a model for the kernels, as `cinegen.loops._kernels.kinematics` does.

    Args:
        memory: of the kernels, with its sizes set.
        model: the tree.
    """
    data, fixed, frames, screws = kinematic_data(model), memory.fixed, memory.frames, memory.screws

    def call(operation: int, first: int, second: int, third: int) -> None:
        q = numbers_at(first, (model.nq,))
        if operation == EVALUATE:
            pin.computeJointJacobians(model, data, q)
            frames[:] = [frame_of(placement) for placement in data.oMi]
            screws[:] = data.J[:, fixed:].T
        elif operation == INTEGRATE:
            step, end = np.zeros(model.nv), q.copy()
            step[fixed:] = numbers_at(second, (model.nv - fixed,))
            moved = np.asarray(pin.integrate(model, q, step))
            for joint in model.joints:
                if joint.idx_v >= 0 and step[joint.idx_v : joint.idx_v + joint.nv].any():  # the others stay bit by bit
                    where = slice(joint.idx_q, joint.idx_q + joint.nq)
                    end[where] = moved[where]
            numbers_at(third, (model.nq,))[:] = end
        else:
            to = numbers_at(second, (model.nq,))
            numbers_at(third, (model.nv - fixed,))[:] = np.asarray(pin.difference(model, q, to))[fixed:]

    return CALLBACK(call)
