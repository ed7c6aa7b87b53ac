"""Branches of closed configurations: whether the actuated joints of a mechanism with loops pass a toggle.

For given actuated joints the loops have several closed configurations. Two of them meet at a type 2 singularity, where
the determinant of the passive joints' Jacobian of the loops is 0; its sign is another on either side of it (C.
Gosselin and J. Angeles, "Singularity analysis of closed-loop kinematic chains", IEEE Trans. Robotics and Automation 6,
1990). Rows of loops may be dependent: the signs of two configurations are compared by the singular vectors of both.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.loops.clusters import clusters
from cinegen.model import Mechanism
from raff2urdf.closure import rank


class _Block(NamedTuple):
    """The equations of a cluster of loops, the columns of its passive joints, and their generic rank."""

    rows: Indices
    columns: Indices
    rank: int


def passes_toggle(mechanism: Mechanism, q: Array, there: Array) -> bool:
    """Return whether the sign of a determinant is another at a configuration than at one a tick before.

    Args:
        mechanism: with locked joints, if there are any.
        q: (nq,) closed.
        there: (nq,) closed, near q.
    """
    blocks = mechanism.structure.derived(_blocks)
    if not blocks:
        return False
    here, after = (mechanism.structure.system.evaluate(x)[1] for x in (q, there))
    return any(_turned(here[np.ix_(*one[:2])], after[np.ix_(*one[:2])], one.rank) for one in blocks)


def _blocks(mechanism: Mechanism) -> list[_Block]:
    found, samples = list[_Block](), [mechanism.structure.system.evaluate(q)[1] for q in mechanism.structure.samples]
    for cluster in clusters(mechanism.structure.system):
        columns = np.intersect1d(cluster.columns, mechanism.structure.passive_columns)
        most = max(rank(jacobian[np.ix_(cluster.rows, columns)]) for jacobian in samples)
        if most:
            found.append(_Block(cluster.rows, columns, most))
    return found


def _turned(before: Array, after: Array, count: int) -> bool:
    """Return whether the determinants of two near matrices, on the spaces of as many singular vectors, have different
    signs."""
    (u, _, vt), (v, _, wt) = (np.linalg.svd(matrix, full_matrices=False) for matrix in (before, after))
    left, right = u[:, :count].T @ v[:, :count], vt[:count] @ wt[:count].T
    return bool(np.linalg.slogdet(left)[0] * np.linalg.slogdet(right)[0] < 0.0)
