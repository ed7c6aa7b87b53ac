"""Leaving configurations at which branches of closed configurations meet.

There the loops' Jacobian has a lower rank than elsewhere, and many of the velocities that it allows belong to no
branch: loops can't be closed after a step along them, however short. A stretched parallelogram is an example. After a
tiny step along one of the branches, the Jacobian allows the velocities of that branch alone.
"""

from __future__ import annotations

import numpy as np

from cinegen.arrays import Array
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.clusters import subsystems
from cinegen.model import Mechanism
from raff2urdf import closure

_SINGULAR = 3e-4  # smallest singular value of the loops, relative to the largest, that is so near to a branching
_STEPS = (1e-3, 3e-3, 1e-2)  # rad or lengths
_TRIES = 8  # for each length of a step


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
    found, moved = q.copy(), False
    for (own, at), rank in zip(subsystems(mechanism.structure.own_system()), mechanism.cluster_ranks, strict=True):
        if rank == 0:
            continue
        here = q[at]
        s, vt = np.linalg.svd(own.evaluate(here)[1])[1:]
        free = vt[np.count_nonzero(s > _SINGULAR * s[0]) :]
        if s[rank - 1] > _SINGULAR * s[0]:
            continue
        rng, clearest = np.random.default_rng(0), max(2.0 * float(s[rank - 1]), 1e-6 * float(s[0]))
        for size in np.repeat(_STEPS, _TRIES):
            step = np.asarray(rng.standard_normal(len(free))) @ free
            there, gap, smallest = _closed(own, own.integrate(here, step * (size / float(np.abs(step).max()))), rank)
            inside = (there >= lower[at]) & (there <= upper[at])
            near = float(np.abs(there - here).max()) <= 2.0 * size
            if gap <= closure.CLOSED and inside.all() and near and smallest > clearest:
                found[at], clearest, moved = there, smallest, True
    return found if moved else None


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
