"""Facts about joints of a Pinocchio model: axes, indices, the columns of a Jacobian that they move; its data."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, Indices

_TRANSLATIONS = {"FreeFlyer": 3, "Planar": 2, "Translation": 3, "PrismaticUnaligned": 1, "PX": 1, "PY": 1, "PZ": 1}
"""Number of translational velocities, which come first, by Pinocchio's name for a type of joint."""


_PARALLEL = 1e-4  # rad: lines at a smaller angle
_LARGE = 100  # degrees of freedom for which Pinocchio's whole data takes 54 MB


def translations(joint: Any) -> int:
    """Return how many of the velocities of a joint are translations; they come first."""
    return _TRANSLATIONS.get(joint.shortname().removeprefix("JointModel"), 0)


def axis(joint: Any) -> Array:
    """Return the unit axis (3,), in its own frame, of a revolute or prismatic joint."""
    data = joint.createData()
    joint.calc(data, np.zeros(joint.idx_q + joint.nq))
    motion = np.asarray(data.S).ravel()
    return np.array(motion[:3] if translations(joint) else motion[3:])


def common_point(points: Array, axes: Array) -> tuple[Array, float] | None:
    """Return the point (3,) nearest to lines through points (n, 3) along unit axes (n, 3), and its largest distance
    from one of them along a coordinate; None if they are parallel."""
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]  # (I - a a^T) (c - p) = 0 for all lines
    matrix, right = across.reshape(-1, 3), (across @ points[:, :, None]).ravel()
    point, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=_PARALLEL)
    return (np.asarray(point, dtype=float), float(np.abs(matrix @ point - right).max())) if rank == 3 else None


def step_scale(model: pin.Model, length: float) -> Array:
    """Return (nv,) the size of one dimensionless step: `length` (m) for translations, 1 rad for rotations."""
    scale = np.ones(model.nv)
    for joint in model.joints:
        scale[joint.idx_v : joint.idx_v + translations(joint)] = length
    return scale


def supporting_columns(model: pin.Model, joint: int) -> Array:
    """Return (nv,) 1 for each column of a Jacobian that moves the body behind a joint (by its index), else 0."""
    supports = np.zeros(model.njoints)
    supports[list(model.supports[joint])] = 1.0
    return np.repeat(supports, list(model.nvs))


def scalar_joints(model: pin.Model) -> tuple[Indices, Indices]:
    """Return where in q and in v the joints are whose configuration is one number, which adds to its velocity."""
    pairs = [(j.idx_q, j.idx_v) for j in model.joints if j.nq == 1 and j.nv == 1 and j.idx_v >= 0]
    indices, columns = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    return indices, columns


def joint_data(model: pin.Model) -> pin.Data:
    """Return Pinocchio's data of a model for placements and Jacobians of joints, and nothing else."""
    data = pin.Data()
    data.joints.extend([joint.createData() for joint in model.joints])
    for placements in (data.oMi, data.liMi):
        placements.extend([pin.SE3.Identity()] * model.njoints)
    data.J = np.zeros((6, model.nv))
    return data


def kinematic_data(model: pin.Model) -> pin.Data:
    """Return Pinocchio's data of a model, for placements and Jacobians of joints and frames.

    `model.createData()` also has tensors of second derivatives, 54 nv^3 bytes. For a large model, the data returned has
    what kinematics needs and nothing else: functions for dynamics must not be called with it.
    """
    if model.nv <= _LARGE:
        return model.createData()
    data, last = joint_data(model), [-1] * model.njoints  # last: column of each joint
    data.iMf.extend([pin.SE3.Identity()] * model.njoints)
    data.oMf.extend([pin.SE3.Identity()] * model.nframes)
    supporting: list[int] = []  # for each column the one before it on the way to the base
    for j in range(1, model.njoints):
        joint = model.joints[j]
        supporting += [last[model.parents[j]], *range(joint.idx_v, joint.idx_v + joint.nv)][: joint.nv]
        last[j] = len(supporting) - 1 if joint.nv else last[model.parents[j]]
    data.parents_fromRow.extend(supporting)
    data.non_mimic_parents_fromRow.extend(supporting)
    data.mimic_parents_fromRow.extend([-1] * model.nv)
    data.idx_vExtended_to_idx_v_fromRow.extend(range(model.nv))
    return data
