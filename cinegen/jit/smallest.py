"""The smallest singular value of a matrix with independent columns.

Householder reflections from both sides make A bidiagonal (G. H. Golub and C. F. Van Loan, "Matrix computations",
section 5.4). The squared singular values of B are the zeros of det(B^T B - s), all real. Laguerre's method converges
from 0 to the smallest monotonically and cubically (B. N. Parlett, "Laguerre's method applied to the matrix eigenvalue
problem", 1964). The determinant is a product of pivots, which the differential stationary qd transformation computes
without cancellation (B. N. Parlett, "The new qd algorithms", 1995).
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled
from cinegen.jit.vectors import add_multiple, inner

_MOST = 60  # iterations; 3 to 6 are usual
_SAME = 1e-13  # relative change of the square at which iterations end


@compiled
def smallest_singular_value(a: Array, rows: int, n: int, x: Array, y: Array) -> float:
    """Return the smallest singular value of a (rows, n), rows >= n, which is overwritten; 0 if columns are dependent.

    x and y (n,) are scratch.
    """
    if not _bidiagonalise(a, rows, n, x, y):
        return 0.0
    for k in range(n):
        x[k] *= x[k]
        y[k] *= y[k]
    return math.sqrt(_smallest_zero(x, y, n))


@compiled
def _bidiagonalise(a: Array, rows: int, n: int, d: Array, e: Array) -> bool:
    """Compute the bidiagonal form of a (rows, n), which is overwritten: diagonal d (n,), superdiagonal e (n,), whose
    last number is 0. Return False if columns are dependent."""
    largest = 0.0
    for k in range(n):
        s = 0.0
        for i in range(k, rows):
            s += a[i, k] * a[i, k]
        length = math.sqrt(s)
        largest = max(largest, length)
        if not length > 1e-15 * largest:
            return False
        d[k] = -length if a[k, k] > 0.0 else length
        a[k, k] -= d[k]
        tau = 1.0 / (length * abs(a[k, k]))
        e[k + 1 : n] = 0.0  # the rest of e is scratch meanwhile
        for i in range(k, rows):
            add_multiple(a[i, k], a[i, k + 1 :], e[k + 1 :], n - k - 1)
        for i in range(k, rows):
            add_multiple(-tau * a[i, k], e[k + 1 :], a[i, k + 1 :], n - k - 1)
        e[k] = a[k, k + 1] if k == n - 2 else 0.0
        if k >= n - 2:
            continue
        row = a[k, k + 1 :]
        length = math.sqrt(inner(row, row, n - k - 1))
        if not length > 0.0:
            continue
        e[k] = -length if a[k, k + 1] > 0.0 else length
        a[k, k + 1] -= e[k]
        tau = 1.0 / (length * abs(a[k, k + 1]))
        for i in range(k + 1, rows):
            add_multiple(-tau * inner(a[i, k + 1 :], row, n - k - 1), row, a[i, k + 1 :], n - k - 1)
    return True


@compiled
def _smallest_zero(q: Array, e: Array, n: int) -> float:
    """Return the smallest zero of det(B^T B - s); B has the squares q (n,) on its diagonal and e (n,) beside it."""
    s = 0.0
    for _ in range(_MOST):
        first, second = 0.0, 0.0  # sums of 1 / (zero - s) and of their squares
        t, dt, ddt = -s, -1.0, 0.0  # difference of a pivot from q, and its derivatives
        for k in range(n):
            pivot = q[k] + t
            if not pivot > 0.0:  # s is the zero, up to rounding
                return s
            inverse = 1.0 / pivot
            u, v = dt * inverse, ddt * inverse
            first -= u
            second += u * u - v
            part = e[k] * inverse
            t = t * part - s
            part *= q[k] * inverse
            ddt = part * (ddt - 2.0 * dt * u)
            dt = part * dt - 1.0
        step = n / (first + math.sqrt(max(0.0, (n - 1) * (n * second - first * first))))
        s += step
        if not step > _SAME * s:
            break
    return s
