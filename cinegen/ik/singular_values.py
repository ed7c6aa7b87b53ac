"""Singularities: the DoF that the tasks lose (type 1) and the DoF that the actuated joints do not control (type 2).

C. Gosselin and J. Angeles, "Singularity analysis of closed-loop kinematic chains", IEEE Trans. Robotics and
Automation 6, 1990. Type 1: the Jacobian of the tasks in the loops' null space loses rank. Type 2: the columns of the
passive joints in the loops' Jacobian lose rank, and the mechanism can move while its actuated joints are locked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.ik.equations import equations, units
from cinegen.ik.task import FrameTask
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.motions import motions_of
from cinegen.model import Mechanism

_EVER = 1e-6  # relative singular value below which no configuration moves the tasks along a direction


@dataclass(frozen=True, eq=False, repr=False)
class LostDoF:
    """Direction that the tasks follow worst; the DoF is lost where `sigma` is 0.

    A joint step `joints` moves the nodes of the tasks by `sigma` times `twists` in their constrained directions.

    Attributes:
        sigma: smallest singular value, dimensionless.
        joints: (nv,) joint direction, rad and m: a unit vector, together with the motions of the joints that were cut,
            once lengths are divided by the characteristic length.
        twists: (tasks, 6) Cartesian direction: for each task, in the order in which they were added, the twist of its
            node in world axes, linear (m) above angular (rad). All tasks together are a unit vector once lengths are
            divided by the characteristic length and each task is multiplied by its weight over the largest. 0 for a
            task that was left out.
        values: all singular values, largest first, the last `sigma`: several small ones are as many DoF.
    """

    sigma: float
    joints: Array
    twists: Array
    values: Array

    def __repr__(self) -> str:
        return f"<LostDoF: smallest singular value {self.sigma:.3g}, tasks: {len(self.twists)}>"


@dataclass(frozen=True, eq=False, repr=False)
class UncontrolledDoF:
    """Motion that the actuated joints control least; it is uncontrolled where `sigma` is 0.

    Attributes:
        sigma: smallest singular value of the passive joints, dimensionless: how fast the motion would open the loops.
        joints: (nv,) the motion, rad and m: a unit vector, together with the motions of the joints that were cut, once
            lengths are divided by the characteristic length; 0 for actuated joints.
        values: all singular values, largest first, the last `sigma`: several small ones are as many DoF.
    """

    sigma: float
    joints: Array
    values: Array

    def __repr__(self) -> str:
        return f"<UncontrolledDoF: smallest singular value {self.sigma:.3g}>"


def lost(
    mechanism: Mechanism,
    q: Array,
    tasks: Sequence[tuple[FrameTask, Array]],
    rank: int,
    system: ClosedLoops | None = None,
) -> LostDoF | None:
    """Return the weakest direction of some tasks; None if no configuration can move them.

    Args:
        mechanism: mechanism of the tasks.
        q: (nq,) configuration with closed loops.
        tasks: valid tasks, each with its axes in the world (3, 3).
        rank: generic rank of all tasks together.
        system: the mechanism's loops, if not its own: `joints` is then in the columns of its Jacobian.
    """
    if rank == 0:
        return None
    system = mechanism.structure.system if system is None else system
    ever = _ever(mechanism, system, q, tasks)
    rows, motions = _on_free_motions(mechanism, system, q, tasks)
    rank = min(rank, *ever.shape)  # less where a target's rotation was set to what is none
    if rank == 0:
        return None
    u, sigma, wt = np.linalg.svd(ever.T @ rows @ motions, full_matrices=False)
    joints = motions @ wt[rank - 1]
    sign = _sign(joints)
    twists = sign * _twists(mechanism, system, tasks, ever @ u[:, rank - 1])
    return LostDoF(float(sigma[rank - 1]), sign * joints * mechanism.scale, twists, sigma[:rank])


def passive_singular_values(mechanism: Mechanism, q: Array) -> Array:
    """Return the singular values of the passive joints' columns in the loops' screw matrix at q (nq,), dimensionless,
    largest first, as many as their generic rank. The mechanism is at a type 2 singularity where the last is 0.

    The joints that were cut are passive, too (`cinegen.loops.screws`).
    """
    if mechanism.structure.passive_rank == 0:
        return np.zeros(0)
    sigma = np.linalg.svd(mechanism.structure.passive_matrix(q), compute_uv=False)
    return np.asarray(sigma[: mechanism.structure.passive_rank + mechanism.structure.screws.cut])


def gained(mechanism: Mechanism, q: Array, system: ClosedLoops | None = None) -> UncontrolledDoF | None:
    """Return the motion that the actuated joints control least at q (nq,); None without passive joints in loops.

    With `system`, the motion is in the columns of its Jacobian, see `lost`.
    """
    rank = mechanism.structure.passive_rank
    if rank == 0:
        return None
    columns = mechanism.structure.passive_columns
    _, sigma, vt = np.linalg.svd(mechanism.structure.passive_matrix(q, system), full_matrices=False)
    last, joints = rank + mechanism.structure.screws.cut - 1, np.zeros(mechanism.model.nv)
    joints[columns] = vt[last, : len(columns)]
    return UncontrolledDoF(float(sigma[last]), _sign(joints) * joints * mechanism.scale, sigma[: last + 1])


def _on_free_motions(
    mechanism: Mechanism, system: ClosedLoops, q: Array, tasks: Sequence[tuple[FrameTask, Array]]
) -> tuple[Array, Array]:
    """Return the rows of all tasks (rows, n) and a basis of the loops' null space (n, k), at q."""
    motions = motions_of(system, q, mechanism.loop_rank)
    return equations(mechanism, system, tasks)[1], motions


def _ever(mechanism: Mechanism, system: ClosedLoops, q: Array, tasks: Sequence[tuple[FrameTask, Array]]) -> Array:
    """Return an orthonormal basis (rows, .) of the directions in which the tasks can move in any configuration. The
    direction out of the plane of a planar mechanism always has a singular value of 0: it is not a lost DoF."""
    images = []
    for sample in (*mechanism.structure.samples, q):
        rows, motions = _on_free_motions(mechanism, system, sample, tasks)
        images.append(rows @ motions)
    together = np.hstack(images)
    if not np.isfinite(together).all():
        return np.zeros((len(together), 0))
    u, sigma, _ = np.linalg.svd(together, full_matrices=False)
    return np.asarray(u[:, sigma > _EVER * sigma[0]])


def _twists(mechanism: Mechanism, system: ClosedLoops, tasks: Sequence[tuple[FrameTask, Array]], along: Array) -> Array:
    """Return the shortest twists (tasks, 6) of the tasks' frames, in world axes, whose rows are `along` (rows,)."""
    heaviest = max(task.heaviest for task, _ in tasks)
    twists, row = np.zeros((len(tasks), 6)), 0
    for twist, (task, axes) in zip(twists, tasks, strict=True):
        placement = pin.updateFramePlacement(mechanism.model, system.data, task.frame) * task.offset
        seen = task.equations(placement, np.eye(6), axes)[1]  # (rows, 6) of the node's twist in its own axes
        part = along[row : row + task.rows] / units(task, mechanism.length) * (heaviest / task.row_weights)
        local = np.linalg.pinv(seen) @ part
        twist[:3], twist[3:] = placement.rotation @ local[:3], placement.rotation @ local[3:]
        row += task.rows
    return twists


def _sign(joints: Array) -> float:
    """Return the sign that makes the largest component positive: singular vectors are determined up to sign."""
    return -1.0 if joints[np.argmax(np.abs(joints))] < 0.0 else 1.0
