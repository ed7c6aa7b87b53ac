"""Branches of closed configurations: whether the actuated joints pass a toggle, and leaving points where branches meet.

For given actuated joints the loops have several closed configurations. Two of them meet at a type 2 singularity, where
the determinant of the passive joints' Jacobian of the loops is 0; its sign is another on either side of it (C.
Gosselin and J. Angeles, "Singularity analysis of closed-loop kinematic chains", IEEE Trans. Robotics and Automation 6,
1990). Rows of loops may be dependent: the signs of two configurations are compared by the singular vectors of both.

Where branches meet the loops' Jacobian has a lower rank than elsewhere, and many of the velocities that it allows
belong to no branch: loops can't be closed after a step along them, however short. A stretched parallelogram is an
example. After a tiny step along one of the branches, the Jacobian allows the velocities of that branch alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.clusters import clusters, subsystems
from cinegen.model import Mechanism
from raff2urdf import closure

_SINGULAR = 3e-4  # smallest singular value of the loops, relative to the largest, that is so near to a branching
_STEPS = (1e-3, 3e-3, 1e-2)  # rad or lengths
_TRIES = 8  # for each length of a step


class _Block(NamedTuple):
    """The equations of a cluster of loops, the columns of its passive joints, and their generic rank."""

    rows: Indices
    columns: Indices
    rank: int


def passes_toggle(mechanism: Mechanism, q: Array, q_next: Array) -> bool:
    """Return whether the sign of a determinant is another at a configuration than at one a tick before.

    Args:
        mechanism: with locked joints, if there are any.
        q: (nq,) closed.
        q_next: (nq,) closed, near q.
    """
    blocks = mechanism.structure.derived(_blocks)
    if not blocks:
        return False
    before, after = (mechanism.structure.system.evaluate(x)[1] for x in (q, q_next))
    return any(_turned(before[np.ix_(*block[:2])], after[np.ix_(*block[:2])], block.rank) for block in blocks)


def _blocks(mechanism: Mechanism) -> list[_Block]:
    blocks, samples = list[_Block](), [mechanism.structure.system.evaluate(q)[1] for q in mechanism.structure.samples]
    for cluster in clusters(mechanism.structure.system):
        columns = np.intersect1d(cluster.columns, mechanism.structure.passive_columns)
        most = max(closure.rank(jacobian[np.ix_(cluster.rows, columns)]) for jacobian in samples)
        if most:
            blocks.append(_Block(cluster.rows, columns, most))
    return blocks


def _turned(before: Array, after: Array, count: int) -> bool:
    """Return whether the determinants of two near matrices, on the spaces of as many singular vectors, have different
    signs."""
    (u, _, vt), (v, _, wt) = (np.linalg.svd(matrix, full_matrices=False) for matrix in (before, after))
    left, right = u[:, :count].T @ v[:, :count], vt[:count] @ wt[:count].T
    return bool(np.linalg.slogdet(left)[0] * np.linalg.slogdet(right)[0] < 0.0)


def regular_neighbour(mechanism: Mechanism, q: Array, lower: Array, upper: Array) -> Array | None:
    """Return a closed configuration (nq,) next to a singular one, where the loops have their generic rank and are
    further from a singularity; None if q is regular, or there is no such configuration.

    Of several, that whose smallest singular value is largest is returned: the branch that departs most clearly.

    Args:
        mechanism: with loops.
        q: (nq,) closed.
        lower: (nq,) least values, at most q.
        upper: (nq,) greatest values, at least q.
    """
    neighbour, is_moved = q.copy(), False
    for (system, at), rank in zip(subsystems(mechanism.structure.own_system()), mechanism.cluster_ranks, strict=True):
        if rank == 0:
            continue
        before = q[at]
        s, vt = np.linalg.svd(system.evaluate(before)[1])[1:]
        free = vt[np.count_nonzero(s > _SINGULAR * s[0]) :]
        if s[rank - 1] > _SINGULAR * s[0]:
            continue
        rng, clearest = np.random.default_rng(0), max(2.0 * float(s[rank - 1]), 1e-6 * float(s[0]))
        for size in np.repeat(_STEPS, _TRIES):
            step = np.asarray(rng.standard_normal(len(free))) @ free
            guess = system.integrate(before, step * (size / float(np.abs(step).max())))
            after, gap, smallest = _closed(system, guess, rank)
            inside = (after >= lower[at]) & (after <= upper[at])
            near = float(np.abs(after - before).max()) <= 2.0 * size
            if gap <= closure.CLOSED and inside.all() and near and smallest > clearest:
                neighbour[at], clearest, is_moved = after, smallest, True
    return neighbour if is_moved else None


def _closed(system: ClosedLoops, q: Array, rank: int) -> tuple[Array, float, float]:
    """Close loops from q (nq,) by Newton steps on as many equations as are independent in general; return the
    configuration, the remaining gap, and the smallest of their singular values. Next to where branches meet, the other
    equations seem to be independent, too, and falsify the steps."""
    for _ in range(12):
        c, jacobian = system.evaluate(q)
        u, s, vt = np.linalg.svd(jacobian)
        if np.abs(c).max() <= 0.1 * closure.CLOSED:
            break
        step = -vt[:rank].T @ ((u[:, :rank].T @ c) / np.maximum(s[:rank], 1e-9 * s[0]))
        q = system.integrate(q, step * min(1.0, _STEPS[-1] / float(np.abs(step).max())))
    return q, float(np.abs(c).max()), float(s[rank - 1])
