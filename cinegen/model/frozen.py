"""Joints that nothing can move from home, because limits block every motion that keeps loops and couplings closed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cinegen.arrays import Array
from cinegen.joints import scalar_joints
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.clusters import subsystems
from cinegen.model.limits import JointLimits
from cinegen.tolerances import AT_LIMIT
from raff2urdf import closure

_MOVES = 1e-6  # rad or characteristic lengths: a joint that moves by less, where others move by 1, does not move


def locked(limits: Mapping[str, JointLimits]) -> list[str]:
    """Return the joints whose limits are one value."""
    return [joint for joint, bounds in limits.items() if bounds.upper - bounds.lower <= AT_LIMIT]


def blocking(system: ClosedLoops, q: Array, lower: Array, upper: Array) -> list[list[str]]:
    """Return, for each cluster of loops and couplings in which nothing can move, the joints at limits that block it: an
    irreducible set, without whose limits something could.

    With the motions N y that keep the cluster closed to first order, and the rows S of the joints at limits, signed so
    that they must not fall, that is so where S N y >= 0 holds for y = 0 alone.

    Args:
        system: the loops and couplings.
        q: (nq,) closed.
        lower: (nq,) least values; -inf where there is none.
        upper: (nq,) greatest values; inf likewise.
    """
    blocked = []
    for cluster, at in subsystems(system):
        values, jacobian = q[at], cluster.evaluate(q[at])[1]
        motions = np.linalg.svd(jacobian)[2][closure.rank(jacobian) :].T
        names = {int(joint.idx_v): name for name, joint in zip(cluster.model.names, cluster.model.joints, strict=True)}
        rows, joints = [np.zeros((0, motions.shape[1]))], []
        for i, column in zip(*map(np.ndarray.tolist, scalar_joints(cluster.model)), strict=True):
            least, greatest = lower[at][i] + AT_LIMIT, upper[at][i] - AT_LIMIT
            for is_there, sign in ((values[i] <= least, 1.0), (values[i] >= greatest, -1.0)):
                if is_there and np.abs(motions[column]).max(initial=0.0) > _MOVES:
                    rows.append(sign * motions[column : column + 1])
                    joints.append(names[column])
        signed = np.vstack(rows)
        if motions.shape[1] == 0 or not _is_blocked(signed):
            continue
        kept = list(range(len(joints)))
        for row in range(len(joints)):
            others = [k for k in kept if k != row]
            kept = others if _is_blocked(signed[others]) else kept
        blocked.append(list(dict.fromkeys(joints[row] for row in kept)))
    return blocked


def _is_blocked(signed: Array) -> bool:
    """Return whether no y but 0 has signed @ y >= 0."""
    if len(signed) <= signed.shape[1] or closure.rank(signed) < signed.shape[1]:
        return False
    from scipy.optimize import linprog  # takes long, and is hardly ever needed

    ends = np.repeat([0.0, 1.0], len(signed))
    best = linprog(-signed.sum(axis=0), np.vstack([-signed, signed]), ends, bounds=(None, None))
    return bool(best.status == 0 and -best.fun < _MOVES)
