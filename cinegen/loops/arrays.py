"""Memory of the loops' kernels, set up for a mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.jit.callback import address_of
from cinegen.jit.foreign import frame_of
from cinegen.joints import axis
from cinegen.loops._kernels import kinematics, residual
from cinegen.loops._kernels.memory import NOWHERE, ClusterMemory, LoopMemory
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.clusters import clusters
from cinegen.loops.pinocchio_joints import kinematics_callback

_KINDS = {
    **dict.fromkeys(("RX", "RY", "RZ", "RevoluteUnaligned"), kinematics.REVOLUTE),
    **dict.fromkeys(("PX", "PY", "PZ", "PrismaticUnaligned"), kinematics.PRISMATIC),
    "Spherical": kinematics.SPHERICAL,
    "FreeFlyer": kinematics.FREE_FLYER,
}
"""Joints that the kernels move, by Pinocchio's names."""

AnyMemory = TypeVar("AnyMemory", bound=LoopMemory)


def set_up(memory: AnyMemory, system: ClosedLoops, ranks: Sequence[int], fixed: int = 0) -> AnyMemory:
    """Fill the memory of a mechanism's kernels with its joints and loops.

    Args:
        memory: memory to fill.
        system: the mechanism's loops.
        ranks: generic rank of each cluster of them.
        fixed: 6 if a floating base is fixed, else 0.
    """
    model = system.model
    memory.resize(
        nq=model.nq, n=model.nv - fixed, fixed=fixed, joints=model.njoints, loops=len(system.loops), rows=system.rows,
        rank=sum(ranks), couplings=len(system.couplings), coupled=model.nq if system.couplings else 0,
        clusters=len(ranks), steps=sum(map(len, system.columns[: len(system.loops)])),
    )  # fmt: skip
    memory.length = system.length
    memory.scale[:] = system.scale[fixed:]
    memory.q_index[:] = -1
    memory.factored_at = NOWHERE
    memory.frames[0, :3] = np.eye(3)
    if not all([_set_up_joint(memory, model, j, fixed) for j in range(1, model.njoints)]):
        memory.callback = kinematics_callback(memory, model)
        memory.callback_address = address_of(memory.callback)
    row = step = 0
    for i, (loop, anchor) in enumerate(zip(system.loops, system.anchors, strict=True)):
        joints, offsets, columns = anchor[::2], anchor[1::2], system.columns[i]
        memory.loop_kind[i], memory.loop_row[i] = getattr(residual, loop.kind.name), row
        memory.loop_joints[i], memory.loop_offsets[i] = joints, [frame_of(offset) for offset in offsets]
        sizes, columns = system.sizes[i][columns >= fixed], columns[columns >= fixed] - fixed
        end = step + len(columns)
        memory.loop_steps[i], memory.step_dof[step:end], memory.step_size[step:end] = (step, end), columns, sizes
        row, step = row + loop.rows, end
    _set_up_couplings(memory, system)
    _set_up_clusters(memory, system, ranks)
    return memory


def _set_up_clusters(memory: LoopMemory, system: ClosedLoops, ranks: Sequence[int]) -> None:
    found = []
    for cluster, rank in zip(clusters(system), ranks, strict=True):
        dof = cluster.columns[cluster.columns >= memory.fixed] - memory.fixed
        one = ClusterMemory(n=len(dof), rows=len(cluster.rows), rank=rank, mobility=max(len(dof) - rank, 0))
        one.dof[:], one.row[:] = dof, cluster.rows
        found.append(one)
    memory.cluster_memories = found
    memory.cluster_handles[:] = [one.handle for one in found]
    idle = np.setdiff1d(np.arange(memory.n), np.concatenate([np.zeros(0, int), *(one.dof for one in found)]))
    memory.resize(idle=len(idle))
    memory.idle_dof[:] = idle


def null_space(memory: LoopMemory) -> NDArray[np.float64]:
    """Return the null space of all loops, a basis of motions that keep them closed: (mobility, n), dimensionless. First
    those of the clusters, then the joints that are in none."""
    found: list[NDArray[np.float64]] = []
    for one in memory.cluster_memories:
        found.append(np.zeros((one.mobility, memory.n)))
        found[-1][:, one.dof] = one.null_space
    return np.vstack([*found, np.eye(memory.n)[memory.idle_dof]])


def _set_up_couplings(memory: LoopMemory, system: ClosedLoops) -> None:
    model = system.model
    terms = [
        (i, model.joints[model.getJointId(joint)].idx_v - memory.fixed, np.array(coefficients) / size)
        for i, (coupling, size) in enumerate(zip(system.couplings, system.coupling_sizes, strict=True))
        for joint, coefficients in coupling.terms.items()
    ]
    memory.resize(coupling_terms=len(terms), coupling_degree=max((len(c) for _, _, c in terms), default=0))
    memory.term_coefficients[:] = 0.0
    for t, (i, dof, coefficients) in enumerate(terms):
        memory.term_coupling[t], memory.term_dof[t] = i, dof
        memory.term_coefficients[t, : len(coefficients)] = coefficients
    for i, (coupling, size) in enumerate(zip(system.couplings, system.coupling_sizes, strict=True)):
        memory.coupling_constant[i] = coupling.constant / size


def _set_up_joint(memory: LoopMemory, model: pin.Model, j: int, fixed: int) -> bool:
    """Return whether the kernels can move that joint."""
    joint = model.joints[j]
    memory.joint_parent[j], memory.joint_offset[j] = model.parents[j], frame_of(model.jointPlacements[j])
    memory.joint_q[j], memory.joint_dof[j] = joint.idx_q, joint.idx_v - fixed
    if joint.nq == joint.nv == 1:
        memory.q_index[joint.idx_v - fixed] = joint.idx_q
    kind = _KINDS.get(joint.shortname().removeprefix("JointModel"))
    if kind is None:
        return False
    memory.joint_kind[j] = kind
    if kind in (kinematics.REVOLUTE, kinematics.PRISMATIC):
        memory.joint_axis[j] = axis(joint)
    return True


def actuate(memory: LoopMemory, columns: Sequence[int]) -> None:
    """Declare the joints that follow `goal`, by their columns in the model's Jacobian; they are locked."""
    memory.resize(actuated=len(columns))
    memory.actuated_dof[:] = np.array(columns, dtype=int) - memory.fixed
    memory.locked[memory.actuated_dof] = 1.0
