"""Memory of the loops' kernels, set up for a mechanism."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.errors import CinegenError
from cinegen.jit import pinocchio_calls
from cinegen.jit.foreign import frame_of
from cinegen.jit.pinocchio_calls import NativeTree
from cinegen.joints import axis
from cinegen.loops._kernels import kinematics, residual
from cinegen.loops._kernels.memory import NOWHERE, ClusterMemory, LoopMemory
from cinegen.loops.closed_loops import LARGE, ClosedLoops
from cinegen.loops.clusters import clusters
from cinegen.loops.screws import LoopScrews

_KINDS = {
    **dict.fromkeys(("RX", "RY", "RZ", "RevoluteUnaligned"), kinematics.REVOLUTE),
    **dict.fromkeys(("PX", "PY", "PZ", "PrismaticUnaligned"), kinematics.PRISMATIC),
    "Spherical": kinematics.SPHERICAL,
    "FreeFlyer": kinematics.FREE_FLYER,
}
"""Joints that the kernels can move themselves, by Pinocchio's names."""

_UNITS = {
    "Spherical": (0, 4), "FreeFlyer": (3, 4), "Planar": (2, 2),
    **dict.fromkeys(("RUBX", "RUBY", "RUBZ", "RevoluteUnboundedUnaligned"), (0, 2)),
}  # fmt: skip
"""First number and size of the unit vector in the q of a joint: a quaternion, or cosine and sine."""

Indices = NDArray[np.intp]
AnyMemory = TypeVar("AnyMemory", bound=LoopMemory)


def set_up(memory: AnyMemory, system: ClosedLoops, ranks: Sequence[int], fixed: int = 0) -> AnyMemory:
    """Fill the memory of a mechanism's kernels with its joints and loops.

    Args:
        memory: memory to fill.
        system: the mechanism's loops.
        ranks: generic rank of each cluster of them.
        fixed: 6 if a floating base is fixed, else 0.

    Raises:
        CinegenError: a joint is of a kind that only Pinocchio knows, and kernels can't call it.
    """
    model = system.model
    memory.resize(
        nq=model.nq, n=model.nv - fixed, fixed=fixed, nv=model.nv, joints=model.njoints, loops=len(system.loops),
        rows=system.rows, rank=sum(ranks), couplings=len(system.couplings), coupled=model.nq if system.couplings else 0,
        clusters=len(ranks), cut=sum(system.cut_dof), steps=sum(map(len, system.columns[: len(system.loops)])),
    )  # fmt: skip
    memory.length = system.length
    memory.scale[:] = system.scale[fixed:]
    memory.q_index[:] = -1
    memory.factored_at = NOWHERE
    memory.jacobian[:] = memory.cut_rates[:] = 0.0  # kernels write only what is not always zero
    memory.frames[0, :3] = np.eye(3)
    for j in range(1, model.njoints):
        _set_up_joint(memory, model, j, fixed)
    if memory.has_pinocchio:
        _set_up_pinocchio(memory, model)
    row = step = cut = 0
    memory.row_loop[:] = -1
    for i, (loop, anchor) in enumerate(zip(system.loops, system.anchors, strict=True)):
        joints, offsets, columns = anchor[::2], anchor[1::2], system.columns[i]
        memory.loop_kind[i], memory.loop_row[i], memory.loop_cut[i] = getattr(residual, loop.kind.name), row, cut
        memory.loop_joints[i], memory.loop_offsets[i] = joints, [frame_of(offset) for offset in offsets]
        sizes, columns = system.sizes[i][columns >= fixed], columns[columns >= fixed] - fixed
        end = step + len(columns)
        memory.loop_steps[i], memory.step_dof[step:end], memory.step_size[step:end] = (step, end), columns, sizes
        memory.row_loop[row : row + loop.rows] = i
        row, step, cut = row + loop.rows, end, cut + system.cut_dof[i]
    _set_up_couplings(memory, system)
    _set_up_clusters(memory, system, ranks)
    return memory


def _set_up_clusters(memory: LoopMemory, system: ClosedLoops, ranks: Sequence[int]) -> None:
    memories = []
    for cluster, rank in zip(clusters(system), ranks, strict=True):
        members = [*cluster.loops, *(len(system.loops) + i for i in cluster.couplings)]
        columns = {i: system.columns[i][system.columns[i] >= memory.fixed] - memory.fixed for i in members}
        dof = np.unique(np.concatenate(list(columns.values())))
        cluster_memory = ClusterMemory(n=len(dof), rows=len(cluster.rows), rank=rank, mobility=max(len(dof) - rank, 0))
        if len(dof) <= LARGE:
            owner = np.repeat(np.arange(len(system.loops)), system.cut_dof)
            cut = np.flatnonzero(np.isin(owner, cluster.loops))
            if len(cut):
                cluster_memory.cut_first = int(cut[0])
            cluster_memory.resize(basis=cluster_memory.mobility, cut=int(cut[-1] + 1 - cut[0]) if len(cut) else 0)
            cluster_memory.dof[:], cluster_memory.row[:] = dof, cluster.rows
        else:
            _set_up_blocks(cluster_memory, columns, system.constraint_rows)
        memories.append(cluster_memory)
    memory.cluster_memories = memories
    memory.cluster_handles[:] = [cluster_memory.handle for cluster_memory in memories]
    busy = np.concatenate([system.held - memory.fixed, *(cluster_memory.dof for cluster_memory in memories)])
    idle = np.setdiff1d(np.arange(memory.n), busy)
    memory.resize(idle=len(idle))
    memory.idle_dof[:] = idle


def _set_up_blocks(cluster_memory: ClusterMemory, columns: Mapping[int, Indices], rows: Sequence[Indices]) -> None:
    """Order a large cluster so that loops that share joints are neighbours, and joints as they first occur."""
    members = _chained(columns)
    dof = np.array(list(dict.fromkeys(k for i in members for k in columns[i].tolist())), dtype=int)
    place = {k: j for j, k in enumerate(dof.tolist())}
    reached = [[place[k] for k in columns[i].tolist()] or [0] for i in members]
    heights = [len(rows[i]) for i in members]
    cluster_memory.resize(blocks=len(members), block_ends=len(members) + 1, kept=cluster_memory.rank)
    cluster_memory.dof[:], cluster_memory.row[:] = dof, np.concatenate([rows[i] for i in members])
    cluster_memory.block_row[:], cluster_memory.block_end[:] = (
        np.cumsum([0, *heights]),
        [max(places) + 1 for places in reached],
    )
    cluster_memory.row_first[:] = np.repeat([min(places) for places in reached], heights)


def _chained(columns: Mapping[int, Indices]) -> list[int]:
    """Return the keys so that those that share columns are near each other: breadth first, from one as far out as
    possible (E. Cuthill and J. McKee, "Reducing the bandwidth of sparse symmetric matrices", 1969)."""
    users: dict[int, list[int]] = {}
    for key, dof in columns.items():
        for k in dof.tolist():
            users.setdefault(k, []).append(key)

    def outwards(start: int) -> list[int]:
        reached, queue = {start}, [start]
        for key in queue:
            for other in [other for k in columns[key].tolist() for other in users[k]]:
                if other not in reached:
                    reached.add(other)
                    queue.append(other)
        return queue

    return outwards(outwards(next(iter(columns)))[-1])


def set_up_screws(memory: LoopMemory, screws: LoopScrews) -> None:
    """Prepare the kernels that compute the screw matrix of a memory that is set up.

    Args:
        memory: of the mechanism.
        screws: of the mechanism.
    """
    points = [(c, point) for c, of_cluster in enumerate(screws.points) for point in of_cluster]
    memory.resize(
        screwed=memory.loops, screw_rows=6 * memory.loops + memory.couplings,
        mixed=memory.couplings, screw_columns=memory.n + screws.cut, screw_clusters=len(screws.lengths),
        axis_points=len(points),
    )  # fmt: skip
    memory.screw_mix[:], memory.screw_cluster[:], memory.screw_length[:] = (
        screws.mix, screws.cluster_of, screws.lengths,
    )  # fmt: skip
    memory.coupling_mix[:] = screws.coupling_mix
    for a, (c, (joint, at, share)) in enumerate(points):
        memory.axis_cluster[a], memory.axis_joint[a], memory.axis_point[a], memory.axis_share[a] = c, joint, at, share


def null_space(memory: LoopMemory) -> NDArray[np.float64]:
    """Return a basis of motions that keep all loops closed, dimensionless: (mobility, n + cut), orthonormal together
    with those of the joints that were cut, the last columns, which are 0 for large clusters. First those of the
    clusters, then the joints that are in none."""
    parts: list[NDArray[np.float64]] = []
    for cluster in memory.cluster_memories:
        basis = cluster.null_space if not cluster.blocks else np.eye(cluster.n)[cluster.rank :]
        for t in range(cluster.kept - 1, -1, -1):
            at = slice(t, cluster.kept_reach[t])
            h = cluster.kept_reflectors[t, at]
            basis[:, at] -= cluster.kept_tau[t] * np.outer(basis[:, at] @ h, h)
        parts.append(np.zeros((cluster.mobility, memory.n + memory.cut)))
        parts[-1][:, cluster.dof] = basis
        cut = slice(cluster.cut_first, cluster.cut_first + cluster.cut)
        parts[-1][:, memory.n :][:, cut] = basis @ memory.cut_rates[cluster.dof, cut]
    return np.vstack([*parts, np.eye(memory.n + memory.cut)[memory.idle_dof]])


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


def other_joints(model: pin.Model) -> dict[str, str]:
    """Return the joints that the kernels can't move themselves, and their kinds, by Pinocchio's names."""
    kinds = {model.names[j]: _kind_of(model.joints[j]) for j in range(1, model.njoints)}
    return {name: kind for name, kind in kinds.items() if kind not in _KINDS}


def _kind_of(joint: Any) -> str:
    return str(joint.shortname().removeprefix("JointModel"))


def _set_up_pinocchio(memory: LoopMemory, model: pin.Model) -> None:
    """Let the kernels call Pinocchio, if they can."""
    native, others = pinocchio_calls.native(), other_joints(model)
    if native.reason:
        for name, kind in others.items():
            raise CinegenError(
                f"joint '{name}' is of the kind {kind}, which kernels leave to Pinocchio, but they can't call this "
                f"build of it: {native.reason}"
            )
        return
    memory.tree = tree = NativeTree(model)
    memory.point_at("joint_offset", tree.offsets)
    memory.point_at("frames", tree.frames)
    memory.point_at("screws", tree.screws[memory.fixed :])
    memory.model_address, memory.data_address = tree.model_address, tree.data_address
    memory.evaluate_address, memory.integrate_address = native.evaluate, native.integrate
    memory.difference_address = native.difference
    units, left_to_pinocchio = list[tuple[int, ...]](), list[tuple[int, ...]]()
    for joint in list(model.joints)[1:]:
        if (kind := _kind_of(joint)) in _UNITS:
            at, size = _UNITS[kind]
            units.append((joint.idx_q + at, size))
        if kind not in _KINDS:
            left_to_pinocchio.append((joint.idx_q, joint.nq, joint.idx_v - memory.fixed, joint.nv))
    memory.resize(units=len(units), others=len(left_to_pinocchio))
    memory.unit[:], memory.other[:] = np.reshape(units, (-1, 2)), np.reshape(left_to_pinocchio, (-1, 4))


def _set_up_joint(memory: LoopMemory, model: pin.Model, j: int, fixed: int) -> None:
    joint = model.joints[j]
    memory.joint_parent[j], memory.joint_offset[j] = model.parents[j], frame_of(model.jointPlacements[j])
    memory.joint_q[j], memory.joint_dof[j] = joint.idx_q, joint.idx_v - fixed
    if joint.nq == joint.nv == 1:
        memory.q_index[joint.idx_v - fixed] = joint.idx_q
    memory.joint_kind[j] = kind = _KINDS.get(_kind_of(joint), kinematics.OTHER)
    if kind in (kinematics.REVOLUTE, kinematics.PRISMATIC):
        memory.joint_axis[j] = axis(joint)


def actuate(memory: LoopMemory, columns: Sequence[int]) -> None:
    """Declare the joints that follow `goal`, by their columns in the model's Jacobian; they are locked."""
    memory.resize(actuated=len(columns))
    memory.actuated_dof[:] = np.array(columns, dtype=int) - memory.fixed
    memory.locked[memory.actuated_dof] = 1.0
