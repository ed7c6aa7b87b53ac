"""Factorisations of small dense matrices: Householder QR with pivoting, Cholesky, and Gaussian elimination.

The QR factorisation J^T P = H_1 ... H_r [L^T; 0] pivots the rows of J (G. H. Golub and C. F. Van Loan, "Matrix
computations", section 5.4.2) and takes as many as its generic rank r. The last n - r columns of H_1 ... H_r span its
null space: for the Jacobian of loops, the motions that keep them closed.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, Table, compiled
from cinegen.jit.vectors import add_multiple, copy, inner, swap

_ZERO = 1e-13  # pivots below this fraction of the first are zero


@compiled
def factor(f: Array, rank: int, order: Table, left: Array, tau: Array, h: Array) -> float:
    """Factor f (rows, n) in place.

    Args:
        f: the matrix; becomes L, in its first columns.
        rank: largest number of pivots.
        order: (rows,) becomes the permutation of the rows.
        left: (rows,) becomes the squared remainder of each row without a pivot.
        tau: (rank,) and
        h: (rank, n) become the reflections 1 - tau h h^T. Where a pivot is zero, tau and the diagonal are 0.

    Returns:
        the smallest pivot as a fraction of the first; 0 if the rank is not reached.
    """
    rows, n = f.shape
    for i in range(rows):
        order[i] = i
        left[i] = inner(f[i], f[i], n)
    first = 0.0
    shortest = 1.0
    for t in range(rank):
        p = t
        for i in range(t + 1, rows):
            if left[i] > left[p]:
                p = i
        if p != t:
            swap(f[t], f[p], n)
            order[t], order[p] = order[p], order[t]
            left[p] = left[t]
        length = math.sqrt(inner(f[t, t:], f[t, t:], n - t))
        if t == 0:
            first = length
        if length <= _ZERO * first or length == 0.0:
            for i in range(t, rank):
                tau[i] = 0.0
                f[i, i] = 0.0
            return 0.0
        shortest = min(shortest, length / first)
        diagonal = -length if f[t, t] > 0.0 else length
        copy(f[t, t:], h[t, t:], n - t)
        h[t, t] -= diagonal
        tau[t] = 1.0 / (length * (length + abs(f[t, t])))
        f[t, t] = diagonal
        for i in range(t + 1, rows):
            _reflect(h[t, t:], tau[t], f[i, t:], n - t)
            left[i] = inner(f[i, t + 1 :], f[i, t + 1 :], n - t - 1)
    return shortest


@compiled
def _reflect(h: Array, tau: float, x: Array, n: int) -> None:
    """x -= tau h (h . x)."""
    add_multiple(-tau * inner(h, x, n), h, x, n)


@compiled
def reflect(x: Array, rank: int, tau: Array, h: Array) -> None:
    """Multiply x (n,) by H_1 ... H_r, in place."""
    n = x.shape[0]
    for t in range(rank - 1, -1, -1):
        if tau[t] != 0.0:
            _reflect(h[t, t:], tau[t], x[t:], n - t)


@compiled
def null_space(rank: int, tau: Array, h: Array, out: Array) -> None:
    """Write an orthonormal basis of the null space, the rows of out (n - rank, n)."""
    for i in range(len(out)):
        out[i] = 0.0
        out[i, rank + i] = 1.0
        reflect(out[i], rank, tau, h)


@compiled
def shortest_solution(f: Array, rank: int, order: Table, tau: Array, h: Array, right: Array, out: Array) -> None:
    """Write the shortest x (n,) with J x = right (rows,) on the rows with a nonzero pivot."""
    solve_rows(f, rank, order, tau, right, out)
    out[rank:] = 0.0
    reflect(out, rank, tau, h)


@compiled
def solve_rows(f: Array, rank: int, order: Table, tau: Array, right: Array, out: Array) -> None:
    """Solve L y = right (rows,) on the rows with a nonzero pivot; the first numbers of out become y (rank,)."""
    for i in range(rank):
        if tau[i] == 0.0:
            out[i] = 0.0
            continue
        out[i] = (right[order[i]] - inner(f[i], out, i)) / f[i, i]


@compiled
def damped_solution(
    f: Array, rank: int, order: Table, tau: Array, h: Array, right: Array, damping: float, normal: Array, out: Array
) -> None:
    """Write the minimiser of |J x - right|^2 + damping |x|^2 over all rows: (L^T L + damping) y = L^T right, x = Q y.

    Args:
        f, rank, order, tau, h: the factors; rows behind the rank are (rows, rank), too.
        right: (rows,).
        damping: not below 0.
        normal: (rank, rank) scratch.
        out: becomes x.
    """
    rows = f.shape[0]
    for i in range(rank):
        s = 0.0
        for k in range(i, rows):
            s += f[k, i] * right[order[k]]
        out[i] = s
        for j in range(i + 1):
            s = damping if i == j else 0.0
            for k in range(i, rows):
                s += f[k, i] * f[k, j]
            normal[i, j] = s
    cholesky(normal, rank, out)
    out[rank:] = 0.0
    reflect(out, rank, tau, h)


@compiled
def cholesky(a: Array, n: int, x: Array) -> None:
    """Solve a x = b in place: x (n,) is b; a (n, n) is positive definite, its lower half is given and overwritten."""
    for i in range(n):
        for k in range(i):
            a[i, k] = (a[i, k] - inner(a[i], a[k], k)) * a[k, k]
        a[i, i] = 1.0 / math.sqrt(max(a[i, i] - inner(a[i], a[i], i), 1e-300))
    for i in range(n):
        x[i] = (x[i] - inner(a[i], x, i)) * a[i, i]
    for i in range(n - 1, -1, -1):
        s = x[i]
        for j in range(i + 1, n):
            s -= a[j, i] * x[j]
        x[i] = s * a[i, i]


@compiled
def eliminate(a: Array, n: int, width: int) -> float:
    """Eliminate the first n columns of a (n, width), with partial pivoting.

    Returns:
        the sign of their determinant: 1, -1, or 0.
    """
    sign = 1.0
    for i in range(n):
        best = i
        for other in range(i + 1, n):
            if abs(a[other, i]) > abs(a[best, i]):
                best = other
        if best != i:
            sign = -sign
            swap(a[i, i:], a[best, i:], width - i)
        if a[i, i] == 0.0:
            return 0.0
        if a[i, i] < 0.0:
            sign = -sign
        for other in range(i + 1, n):
            add_multiple(-a[other, i] / a[i, i], a[i, i + 1 :], a[other, i + 1 :], width - i - 1)
    return sign
