"""Motions that keep all loops closed: a basis of the null space of their Jacobian, in plain numpy.

The kernels compute the same in each tick, and are tested against this; it serves where speed does not matter.
"""

from __future__ import annotations

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.loops.closed_loops import ClosedLoops, linked

_LARGE = 100  # columns of a Jacobian that is decomposed block by block


def motions_of(system: ClosedLoops, q: Array, rank: int) -> Array:
    """Return a basis (nv, nv - rank) of the motions that keep all loops closed at q (nq,), orthonormal together with
    the motions of the joints that were cut: so lengths, and singular values of what moves, do not depend on which.

    Args:
        system: the loops; its data is that at q afterwards.
        q: (nq,).
        rank: generic rank of the loops.
    """
    loops = system.evaluate(q)[1]
    return orthonormal(free_motions(loops, rank, system.held)[0], system.cut_rates())


def orthonormal(motions: Array, cut_rates: Array) -> Array:
    """Return a basis of the same motions (nv, k), orthonormal together with those of the joints that were cut.

    Args:
        motions: orthonormal basis.
        cut_rates: (., nv) of `ClosedLoops.cut_rates`.
    """
    if not len(cut_rates):
        return motions
    cut = cut_rates @ motions
    factor = np.linalg.cholesky(np.eye(motions.shape[1]) + cut.T @ cut)
    return np.asarray(np.linalg.solve(factor, motions.T).T)


def free_motions(loops: Array, rank: int, held: Indices | None = None) -> tuple[Array, Array]:
    """Return an orthonormal basis of the motions that keep all loops closed, (nv, nv - rank), and the singular values
    of their rows.

    The width is the generic mobility: near a type 2 singularity, where the loops lose a rank, it stays the same. It is
    less by the number of locked columns, `held`.
    """
    if held is not None and len(held):
        free = np.delete(np.arange(loops.shape[1]), held)
        basis, sigma = free_motions(loops[:, free], rank)
        wide = np.zeros((loops.shape[1], basis.shape[1]))
        wide[free] = basis
        return wide, sigma
    if rank == 0:
        return np.eye(loops.shape[1]), np.zeros(0)
    if loops.shape[1] <= _LARGE:
        _, sigma, vt = np.linalg.svd(loops, full_matrices=True)
        return vt[rank:].T, sigma[:rank]
    blocks = [(columns, *np.linalg.svd(loops[rows][:, columns])[1:]) for rows, columns in _blocks(loops)]
    sigma = np.concatenate([values for _, values, _ in blocks])
    largest = np.argsort(-sigma, kind="stable")[:rank]
    owner = np.repeat(np.arange(len(blocks)), [len(values) for _, values, _ in blocks])
    ranks = np.bincount(owner[largest], minlength=len(blocks))
    motions = [np.delete(np.eye(loops.shape[1]), np.concatenate([columns for columns, _, _ in blocks]), axis=0)]
    for (columns, _, vt), part_rank in zip(blocks, ranks, strict=True):
        motions.append(np.zeros((len(vt) - part_rank, loops.shape[1])))
        motions[-1][:, columns] = vt[part_rank:]
    return np.vstack(motions).T, sigma[largest]


def _blocks(matrix: Array) -> list[tuple[list[int], Indices]]:
    """Return the blocks of a matrix, by their rows and columns: it is zero outside them."""
    return linked([np.flatnonzero(row) for row in matrix])
