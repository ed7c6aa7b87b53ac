"""Forward dynamics of closed mechanisms by Pinocchio's constraintDynamics."""

import numpy as np
import pinocchio as pin

from raff2urdf.raff.document import LoopKind


def constraints_of(mechanism):
    """Pinocchio's constraints: a rigid loop is one, a ball one point, a revolute joint two points on its axis."""
    constraints, system, length = pin.StdVec_RigidConstraintModel(), mechanism.structure.system, mechanism.length
    for loop, (first, on_first, second, on_second) in zip(system.loops, system.anchors, strict=True):
        kind = pin.ContactType.CONTACT_6D if loop.kind is LoopKind.RIGID else pin.ContactType.CONTACT_3D
        for z in (0.0, length) if loop.kind is LoopKind.REVOLUTE else (0.0,):
            along = pin.SE3(np.eye(3), np.array([0.0, 0.0, z]))
            ends = (first, on_first * along, second, on_second * along)
            constraints.append(pin.RigidConstraintModel(kind, mechanism.model, *ends, pin.ReferenceFrame.LOCAL))
    return constraints


def constraint_dynamics(mechanism, gravity=(0.0, 0.0, -9.81)):
    """Return a function of q, v and the torques of the actuated joints: the accelerations (nv,) of all joints."""
    assert {loop.kind for loop in mechanism.loops} <= {LoopKind.RIGID, LoopKind.REVOLUTE, LoopKind.BALL}
    model, models, datas = pin.Model(mechanism.model), constraints_of(mechanism), pin.StdVec_RigidConstraintData()
    model.gravity.linear = np.array(gravity)
    data, columns = model.createData(), [mechanism.v_index(joint) for joint in mechanism.actuated]
    for constraint in models:
        datas.append(constraint.createData())
    pin.initConstraintDynamics(model, data, models, datas)
    settings = pin.ProximalSettings(1e-14, 1e-8, 100)

    def accelerate(q, v, torques):
        effort = np.zeros(model.nv)
        effort[columns] = torques
        return np.array(pin.constraintDynamics(model, data, q, v, effort, models, datas, settings))

    return accelerate
