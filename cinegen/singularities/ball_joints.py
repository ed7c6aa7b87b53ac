"""Jacobians in which a ball joint counts as one joint, however it is written.

A ball joint may be written as three revolute joints with axes through one point. Where two of these axes coincide
(gimbal lock) they lose a DoF that the ball has: no singularity of the mechanism, only of how its joints are written.
Their three columns are linear in their axes, L a1, L a2, L a3 with the same L, as what lies between them carries
nothing else; here they are replaced by L's own columns: rotations about the world's x, y and z.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.assembly.errors import FreeMotionError, ModesError
from cinegen.assembly.linkage import Linkage
from cinegen.joints import common_point
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.model import Mechanism


class CountedLoops(ClosedLoops):
    """The loops of a mechanism, with a Jacobian in which a ball joint counts as one joint.

    Args:
        mechanism: that has them.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        super().__init__(mechanism.model, mechanism.loops, mechanism.length, mechanism.couplings)
        self._mechanism = mechanism

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Return the residual (rows,) at q (nq,), and its derivative (rows, nv) by the counted velocities."""
        if self.model.nv == 0:
            return super().evaluate(q)
        _count(self._mechanism, self.data, q)
        return self.evaluate_placed(q)


class CountedJacobians(NamedTuple):
    """Jacobians at a configuration, dimensionless (lengths divided by the characteristic length).

    Attributes:
        loops: (rows, nv) of all loops.
        passive: the passive joints' columns in the screw matrix of all loops (`Structure.passive_matrix`).
        cut_rates: velocities of the joints that were cut (`ClosedLoops.cut_rates`).
        node: (6, nv) of a node in the world's axes at its own origin, linear above angular.
        joints: (nv, nv) the joints' own velocities, by those that the columns above belong to.
    """

    loops: Array
    passive: Array
    cut_rates: Array
    node: Array
    joints: Array


def balls(mechanism: Mechanism) -> tuple[tuple[str, ...], ...]:
    """Return the joints, by threes, that are written for a ball joint each."""
    return mechanism.structure.derived(_balls)


def _balls(mechanism: Mechanism) -> tuple[tuple[str, ...], ...]:
    linkage = linkage_of(mechanism.successive)
    if linkage is None:
        return ()
    # a joint of the tree is fixed in the body that it moves; a cut one in another's
    threes = [sorted(j.carrier - 1 for j in centre.joints) for centre in linkage.bodies.centres]
    names = linkage.joint_names
    groups = [tuple(names[k] for k in ks) for ks in threes if len(ks) == len(set(ks)) == 3 and ks[0] >= 0]
    return tuple(joints for joints in groups if joints[0] in mechanism.joints)  # others are spherical joints


def linkage_of(mechanism: Mechanism) -> Linkage | None:
    """Return the linkage of a mechanism, free to move with all actuated joints locked or not; None without one."""
    try:
        return Linkage(mechanism)
    except FreeMotionError:
        return None if mechanism.couplings else Linkage(mechanism, as_built=True)
    except ModesError:
        return None


def counted(mechanism: Mechanism, q: Array, node: str) -> CountedJacobians:
    """Return the Jacobians at q (nq,), loops closed."""
    model, frame = mechanism.model, mechanism.frame_id(node)
    if model.nv == 0:  # Pinocchio would crash
        nothing = np.zeros((0, 0))
        return CountedJacobians(nothing, nothing, nothing, np.zeros((6, 0)), nothing)
    written, joints = _count(mechanism, mechanism.structure.system.data, q), np.eye(model.nv)
    for columns, axes in written:
        joints[np.ix_(columns, columns)] = np.linalg.pinv(axes, rcond=1e-9)
    data, aligned = mechanism.structure.system.data, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    pin.updateFramePlacement(model, data, frame)
    of_node = pin.getFrameJacobian(model, data, frame, aligned).reshape(6, -1) * mechanism.scale
    of_node[:3] /= mechanism.length
    system = mechanism.structure.system
    loops = system.evaluate_placed(q)[1]
    return CountedJacobians(
        loops, mechanism.structure.screws.passive_matrix(system, loops), system.cut_rates(), of_node, joints
    )


def counted_passive(mechanism: Mechanism, q: Array) -> Array:
    """Return the passive joints' columns in the screw matrix at q (nq,), see `Structure.passive_matrix`."""
    system = mechanism.structure.system
    _count(mechanism, system.data, q)
    return mechanism.structure.screws.passive_matrix(system, system.evaluate_placed(q)[1])


def _count(mechanism: Mechanism, data: pin.Data, q: Array) -> list[tuple[list[int], Array]]:
    """Compute Pinocchio's placements and joint Jacobians at q (nq,), those of ball joints replaced; return of each ball
    joint the columns, and the axes (3, 3) by columns."""
    written, model, replaced = balls(mechanism), mechanism.model, []
    pin.computeJointJacobians(model, data, q)
    for names in written:
        columns = [mechanism.v_index(name) for name in names]
        axes = np.array(data.J[3:, columns])
        meeting = common_point(np.array([data.oMi[model.getJointId(name)].translation for name in names]), axes.T)
        assert meeting is not None  # the middle axis is never along the others
        for column, axis in zip(columns, np.eye(3), strict=True):
            data.J[:, column] = np.concatenate([np.cross(meeting[0], axis), axis])
        replaced.append((columns, axes))
    return replaced
