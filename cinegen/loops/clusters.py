"""Clusters: loops and couplings that share joints, directly or through others. Each can be closed by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from cinegen.arrays import Indices
from cinegen.loops.closed_loops import ClosedLoops, linked


@dataclass(frozen=True, slots=True)
class LoopCluster:
    """Loops and couplings that share joints.

    Attributes:
        loops: their indices.
        couplings: their indices.
        rows: indices of their equations.
        columns: indices of the velocities that change them.
    """

    loops: tuple[int, ...]
    couplings: tuple[int, ...]
    rows: Indices
    columns: Indices


def clusters(system: ClosedLoops) -> list[LoopCluster]:
    """Return the clusters of a mechanism, in the order of their first equations; no equation and no column is in
    two."""
    count = len(system.loops)
    return [
        LoopCluster(
            tuple(i for i in members if i < count),
            tuple(i - count for i in members if i >= count),
            np.concatenate([system.constraint_rows[i] for i in members]),
            columns,
        )
        for members, columns in linked(system.columns)
    ]


def subsystems(system: ClosedLoops) -> list[tuple[ClosedLoops, Indices]]:
    """Return each cluster as a mechanism of its own joints, and the indices of its numbers in q; a single cluster is
    the mechanism itself, with all its joints. All other joints are at zero, which changes no loop; locked ones are part
    of the links that carry them."""
    groups = clusters(system)
    if len(groups) == 1 and not len(system.held):
        return [(system, np.arange(system.model.nq))]
    pin.forwardKinematics(system.model, system.data, system.rest)
    return [_subsystem(system, cluster) for cluster in groups]


def _subsystem(system: ClosedLoops, cluster: LoopCluster) -> tuple[ClosedLoops, Indices]:
    """Return a cluster as a mechanism of its own joints, and the indices of their numbers in q. Joints between them are
    fixed at zero: the system's data has the placements there."""
    model, placements, part = system.model, system.data.oMi, pin.Model()
    joints = np.unique(np.repeat(np.arange(model.njoints), model.nvs)[cluster.columns]).tolist()
    index_in_part = {0: 0}  # of the cluster's joints, by their index in the whole model

    def carrier(joint: int) -> tuple[int, pin.SE3]:
        """Return the index in the part of the nearest of its joints from a joint to the base, and the placement of the
        joint on it."""
        nearest = joint
        while nearest not in index_in_part:
            nearest = model.parents[nearest]
        if nearest == joint:
            return index_in_part[joint], pin.SE3.Identity()
        return index_in_part[nearest], placements[nearest].actInv(placements[joint])

    for joint in joints:
        parent, placement = carrier(model.parents[joint])
        placement = placement * model.jointPlacements[joint]
        of, at = model.joints[joint], slice(model.idx_qs[joint], model.idx_qs[joint] + model.nqs[joint])
        most, low, high = np.full(of.nv, np.inf), model.lowerPositionLimit[at], model.upperPositionLimit[at]
        index_in_part[joint] = part.addJoint(parent, of, placement, model.names[joint], most, most, low, high)
    loops = [system.loops[i] for i in cluster.loops]
    for node in {node for loop in loops for node in (loop.first, loop.second)}:
        frame = model.frames[model.getFrameId(node, pin.FrameType.BODY)]
        parent, placement = carrier(frame.parentJoint)
        part.addFrame(pin.Frame(node, parent, 0, placement * frame.placement, pin.FrameType.BODY))
    indices_in_q = [np.arange(model.idx_qs[j], model.idx_qs[j] + model.nqs[j]) for j in joints]
    couplings = [system.couplings[i] for i in cluster.couplings]
    return ClosedLoops(part, loops, system.length, couplings), np.concatenate([np.zeros(0, np.intp), *indices_in_q])
