"""The motions that keep all loops closed, and the shortest correction of a gap, by Householder reflections.

The transposed Jacobian of the loops is factored, J^T P = H_1 ... H_r [L^T; 0], with rows of J taken in the order of
what they add (column pivoting; G. H. Golub and C. F. Van Loan, "Matrix computations", section 5.4.2): as many as the
generic rank. The last n - r columns of H_1 ... H_r span the free motions.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled

_ZERO = 1e-13  # a row adds nothing if less than this part of the longest is left of it


@compiled
def factor(f: Array, rows: int, n: int, rank: int, order: Array, left: Array, tau: Array, h: Array) -> float:
    """Factors f (rows, n) in place.

    Args:
        f: the matrix; becomes L, row after row, in its first columns.
        rows: of f.
        n: columns of f.
        rank: rows to be taken at most.
        order: (rows,) becomes which row stands where.
        left: (rows,) scratch.
        tau: (rank,) and
        h: (rank, n) become the reflections 1 - tau h h^T. Rows that add nothing have tau 0 and a 0 on the diagonal.

    Returns:
        the shortest of what the rows added, as a part of the longest: 0 where the rank is not reached.
    """
    for i in range(rows):
        order[i] = i
        s = 0.0
        for k in range(n):
            s += f[i, k] * f[i, k]
        left[i] = s
    first = 0.0
    shortest = 1.0
    for t in range(rank):
        p = t
        for i in range(t + 1, rows):
            if left[i] > left[p]:
                p = i
        if p != t:
            for k in range(n):
                f[t, k], f[p, k] = f[p, k], f[t, k]
            order[t], order[p] = order[p], order[t]
            left[p] = left[t]
        s = 0.0
        for k in range(t, n):
            s += f[t, k] * f[t, k]
        length = math.sqrt(s)
        if t == 0:
            first = length
        if length <= _ZERO * first or length == 0.0:
            for i in range(t, rank):
                tau[i] = 0.0
                f[i, i] = 0.0
            return 0.0
        shortest = min(shortest, length / first)
        diagonal = -length if f[t, t] > 0.0 else length
        for k in range(t, n):
            h[t, k] = f[t, k]
        h[t, t] -= diagonal
        tau[t] = 1.0 / (length * (length + abs(f[t, t])))
        f[t, t] = diagonal
        for i in range(t + 1, rows):
            dot = 0.0
            for k in range(t, n):
                dot += h[t, k] * f[i, k]
            dot *= tau[t]
            s = 0.0
            for k in range(t, n):
                f[i, k] -= dot * h[t, k]
            for k in range(t + 1, n):
                s += f[i, k] * f[i, k]
            left[i] = s
    return shortest


@compiled
def reflect(x: Array, n: int, rank: int, tau: Array, h: Array) -> None:
    """x (n,) becomes H_1 ... H_r x."""
    for t in range(rank - 1, -1, -1):
        if tau[t] != 0.0:
            dot = 0.0
            for k in range(t, n):
                dot += h[t, k] * x[k]
            dot *= tau[t]
            for k in range(t, n):
                x[k] -= dot * h[t, k]


@compiled
def free_motions(n: int, rank: int, tau: Array, h: Array, out: Array) -> None:
    """(n - rank, n) orthonormal rows that every factored row is orthogonal to."""
    for i in range(n - rank):
        for k in range(n):
            out[i, k] = 0.0
        out[i, rank + i] = 1.0
        reflect(out[i], n, rank, tau, h)


@compiled
def shortest_correction(
    f: Array, n: int, rank: int, order: Array, tau: Array, h: Array, residual: Array, out: Array
) -> None:
    """(n,) the shortest step that takes a residual (rows,) away to first order; rows that add nothing are left out."""
    for i in range(rank):
        if tau[i] == 0.0:
            out[i] = 0.0
            continue
        s = -residual[int(order[i])]
        for j in range(i):
            s -= f[i, j] * out[j]
        out[i] = s / f[i, i]
    for k in range(rank, n):
        out[k] = 0.0
    reflect(out, n, rank, tau, h)
