"""Jacobians in which a ball joint is one joint, however it is written.

A ball joint may be written as three joints that turn about axes through one point. Where two of these axes fall
together (gimbal lock) they lose a freedom that the ball has: no singularity of the mechanism, only of how its joints
are counted. Their three columns are linear in their axes, L a1, L a2, L a3 with the same L, for what lies between them
carries nothing else; here L's own columns stand in their place: turns about the world's x, y and z.
"""

from __future__ import annotations

import weakref
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.assembly.linkage import Linkage, ModesError
from cinegen.model import Mechanism
from raff2urdf.residual import loop_residual

Array = NDArray[np.float64]


class Counted(NamedTuple):
    """Jacobians at a configuration, without unit (lengths divided by the characteristic length).

    Attributes:
        loops: (rows, nv) of all loops.
        node: (6, nv) of a node in the world's axes at its own origin, linear above angular.
        joints: (nv, nv) the joints' own velocities, by those that the columns above belong to.
    """

    loops: Array
    node: Array
    joints: Array


_KNOWN: weakref.WeakKeyDictionary[Mechanism, tuple[tuple[str, ...], ...]] = weakref.WeakKeyDictionary()


def balls(mechanism: Mechanism) -> tuple[tuple[str, ...], ...]:
    """The joints, by threes, that are written for a ball joint each."""
    if mechanism not in _KNOWN:
        try:
            linkage = Linkage(mechanism)
        except ModesError:
            _KNOWN[mechanism] = ()
        else:
            # A tree's joint is carried by the body that it moves; one that is cut is carried by another's.
            threes = [
                sorted(joint.carrier - 1 for joint in c.joints) for c in linkage.bodies.centres if len(c.joints) == 3
            ]
            names = linkage.joint_names
            _KNOWN[mechanism] = tuple(tuple(names[k] for k in ks) for ks in threes if len(set(ks)) == 3 and ks[0] >= 0)
    return _KNOWN[mechanism]


def counted(mechanism: Mechanism, q: Array, node: str) -> Counted:
    """The Jacobians at q (nq,), loops closed."""
    model, written = mechanism.model, balls(mechanism)
    placement = mechanism.placement(q, node)
    local = mechanism.jacobian(q, node) * mechanism.scale
    of_node = np.vstack([placement.rotation @ local[:3] / mechanism.length, placement.rotation @ local[3:]])
    loops, joints = counted_loops(mechanism, q), np.eye(model.nv)
    end = model.frames[mechanism.frame_id(node)].parentJoint
    for names in written:
        columns, last, axes, centre = _ball(mechanism, names)
        moves = last in model.supports[end]
        for column, turn in zip(columns, np.eye(3), strict=True):
            linear = np.cross(turn, placement.translation - centre) / mechanism.length
            of_node[:, column] = np.concatenate([linear, turn]) if moves else 0.0
        joints[np.ix_(columns, columns)] = np.linalg.pinv(axes, rcond=1e-9)
    return Counted(loops, of_node, joints)


def counted_loops(mechanism: Mechanism, q: Array) -> Array:
    """(rows, nv) of all loops at q (nq,), without unit."""
    written = balls(mechanism)  # before the loops are evaluated: the first time it evaluates them elsewhere
    loops = mechanism.system.evaluate(q)[1]
    for names in written:
        columns, last, _, centre = _ball(mechanism, names)
        turns = [pin.Motion(np.cross(centre, turn), turn) for turn in np.eye(3)]
        loops[:, columns] = _opened(mechanism, last, turns)
    return loops


def _ball(mechanism: Mechanism, names: tuple[str, ...]) -> tuple[list[int], int, Array, Array]:
    """Of a ball joint, where the loops were evaluated last: its columns, the joint that carries what it moves, its axes
    (3, 3) by columns, and its centre (3,), in the world."""
    data = mechanism.system.data
    columns = [mechanism.v_index(name) for name in names]
    numbers = [mechanism.model.getJointId(name) for name in names]
    axes = np.column_stack([data.J[3:, column] for column in columns])
    return columns, numbers[-1], axes, _centre(data.oMi, numbers, axes)


def _centre(placements: pin.StdVec_SE3, joints: list[int], axes: Array) -> Array:
    """(3,) where the axes meet: the middle one is never along the others."""
    across = np.eye(3) - axes.T[:, :, None] * axes.T[:, None, :]
    points = np.array([placements[joint].translation for joint in joints])
    right = (across @ points[:, :, None]).reshape(-1)
    return np.asarray(np.linalg.lstsq(across.reshape(-1, 3), right, rcond=None)[0])


def _opened(mechanism: Mechanism, joint: int, turns: list[pin.Motion]) -> Array:
    """(rows, len(turns)) how loops open, without unit, when what a joint carries moves by some twists."""
    model, system = mechanism.model, mechanism.system
    columns = []
    for loop, (first, first_place, second, second_place) in zip(mechanism.loops, system.anchors, strict=True):
        one, two = (system.data.oMi[j] * at for j, at in ((first, first_place), (second, second_place)))
        sign = int(joint in model.supports[second]) - int(joint in model.supports[first])
        _, derivative = loop_residual(loop.kind, one.actInv(two).homogeneous, mechanism.length)
        columns.append(sign * derivative @ np.column_stack([one.actInv(turn).vector for turn in turns]))
    return np.vstack(columns)
