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
from numpy.typing import NDArray

from cinegen.assembly.linkage import Linkage, ModesError
from cinegen.model import Mechanism
from raff2urdf.residual import loop_residual

Array = NDArray[np.float64]


class CountedJacobians(NamedTuple):
    """Jacobians at a configuration, dimensionless (lengths divided by the characteristic length).

    Attributes:
        loops: (rows, nv) of all loops.
        node: (6, nv) of a node in the world's axes at its own origin, linear above angular.
        joints: (nv, nv) the joints' own velocities, by those that the columns above belong to.
    """

    loops: Array
    node: Array
    joints: Array


def balls(mechanism: Mechanism) -> tuple[tuple[str, ...], ...]:
    """Return the joints, by threes, that are written for a ball joint each."""
    return mechanism.derived(_balls)


def _balls(mechanism: Mechanism) -> tuple[tuple[str, ...], ...]:
    try:
        linkage = Linkage(mechanism)
    except ModesError:
        return ()
    # a joint of the tree is fixed in the body that it moves; a cut one in another's
    threes = [sorted(j.carrier - 1 for j in centre.joints) for centre in linkage.bodies.centres]
    names = linkage.joint_names
    return tuple(tuple(names[k] for k in ks) for ks in threes if len(ks) == len(set(ks)) == 3 and ks[0] >= 0)


def counted(mechanism: Mechanism, q: Array, node: str) -> CountedJacobians:
    """Return the Jacobians at q (nq,), loops closed."""
    model, written = mechanism.model, balls(mechanism)
    placement = mechanism.placement(q, node)
    local = mechanism.jacobian(q, node) * mechanism.scale
    of_node = np.vstack([placement.rotation @ local[:3] / mechanism.length, placement.rotation @ local[3:]])
    loops, joints = counted_loops(mechanism, q), np.eye(model.nv)
    end = model.frames[mechanism.frame_id(node)].parentJoint
    for names in written:
        columns, last, axes, centre = _ball(mechanism, names)
        moves = last in model.supports[end]
        for column, axis in zip(columns, np.eye(3), strict=True):
            linear = np.cross(axis, placement.translation - centre) / mechanism.length
            of_node[:, column] = np.concatenate([linear, axis]) if moves else 0.0
        joints[np.ix_(columns, columns)] = np.linalg.pinv(axes, rcond=1e-9)
    return CountedJacobians(loops, of_node, joints)


def counted_loops(mechanism: Mechanism, q: Array) -> Array:
    """Return the Jacobian (rows, nv) of all loops at q (nq,), dimensionless."""
    written = balls(mechanism)  # before the loops are evaluated: the first time it evaluates them elsewhere
    loops = mechanism.system.evaluate(q)[1]
    for names in written:
        columns, last, _, centre = _ball(mechanism, names)
        rotations = [pin.Motion(np.cross(centre, axis), axis) for axis in np.eye(3)]
        loops[:, columns] = _loop_rates(mechanism, last, rotations)
    return loops


def _ball(mechanism: Mechanism, names: tuple[str, ...]) -> tuple[list[int], int, Array, Array]:
    """Return, where the loops were evaluated last, a ball joint's columns, the joint that carries what it moves, its
    axes (3, 3) by columns, and its centre (3,), in the world."""
    data = mechanism.system.data
    columns = [mechanism.v_index(name) for name in names]
    numbers = [mechanism.model.getJointId(name) for name in names]
    axes = np.column_stack([data.J[3:, column] for column in columns])
    # the middle axis is never along the others, so that their point is determined
    across = np.eye(3) - axes.T[:, :, None] * axes.T[:, None, :]
    points = np.array([data.oMi[joint].translation for joint in numbers])
    right = (across @ points[:, :, None]).reshape(-1)
    centre = np.asarray(np.linalg.lstsq(across.reshape(-1, 3), right, rcond=None)[0])
    return columns, numbers[-1], axes, centre


def _loop_rates(mechanism: Mechanism, joint: int, twists: list[pin.Motion]) -> Array:
    """Return the derivatives (rows, len(twists)) of the loops, dimensionless, when what a joint carries moves with some
    twists."""
    model, system = mechanism.model, mechanism.system
    columns = []
    for loop, (first, first_placement, second, second_placement) in zip(mechanism.loops, system.anchors, strict=True):
        one, two = system.data.oMi[first] * first_placement, system.data.oMi[second] * second_placement
        sign = int(joint in model.supports[second]) - int(joint in model.supports[first])
        _, derivative = loop_residual(loop.kind, one.actInv(two).homogeneous, mechanism.length)
        columns.append(sign * derivative @ np.column_stack([one.actInv(twist).vector for twist in twists]))
    return np.vstack(columns)
