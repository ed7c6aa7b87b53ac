"""The smallest singular value alone, of a matrix whose columns are independent.

By Householder's reflections from both sides A becomes bidiagonal (G. H. Golub and C. F. Van Loan, "Matrix
computations", section 5.4). The squares of B's singular values are the zeros of det(B^T B - s), which all are real:
from 0 Laguerre's method goes up to the smallest, three times as many digits right with each step, and never beyond
(B. N. Parlett, "Laguerre's method applied to the matrix eigenvalue problem", 1964). The determinant is a product of
pivots, which the differential stationary qd transformation gives without loss by subtraction (B. N. Parlett, "The new
qd algorithms", 1995).
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled

_MOST = 60  # iterations; 3 to 6 are usual
_SAME = 1e-13  # change of the square, as a part of it, in the last one


@compiled
def smallest_singular_value(a: Array, rows: int, n: int, x: Array, y: Array) -> float:
    """Of a (rows, n), rows >= n, which is lost; x and y (n,) are scratch. 0 where columns are dependent."""
    if not _bidiagonalise(a, rows, n, x, y):
        return 0.0
    for k in range(n):
        x[k] *= x[k]
        y[k] *= y[k]
    return math.sqrt(_smallest_zero(x, y, n))


@compiled
def _bidiagonalise(a: Array, rows: int, n: int, d: Array, e: Array) -> bool:
    """Of a (rows, n), which is lost: diagonal d (n,) and what is right of it, e (n,), whose last is 0; False where
    columns are dependent."""
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
        for j in range(k + 1, n):  # what e will hold further on serves meanwhile
            e[j] = 0.0
        for i in range(k, rows):
            part = a[i, k]
            for j in range(k + 1, n):
                e[j] += part * a[i, j]
        for i in range(k, rows):
            part = tau * a[i, k]
            for j in range(k + 1, n):
                a[i, j] -= part * e[j]
        e[k] = a[k, k + 1] if k == n - 2 else 0.0
        if k >= n - 2:
            continue
        s = 0.0
        for j in range(k + 1, n):
            s += a[k, j] * a[k, j]
        length = math.sqrt(s)
        if not length > 0.0:
            continue
        e[k] = -length if a[k, k + 1] > 0.0 else length
        a[k, k + 1] -= e[k]
        tau = 1.0 / (length * abs(a[k, k + 1]))
        for i in range(k + 1, rows):
            s = 0.0
            for j in range(k + 1, n):
                s += a[i, j] * a[k, j]
            s *= tau
            for j in range(k + 1, n):
                a[i, j] -= s * a[k, j]
    return True


@compiled
def _smallest_zero(q: Array, e: Array, n: int) -> float:
    """Of det(B^T B - s), where B has the squares q (n,) on its diagonal and e (n,) right of it."""
    s = 0.0
    for _ in range(_MOST):
        first, second = 0.0, 0.0  # sums of 1 / (zero - s) and of their squares
        t, dt, ddt = -s, -1.0, 0.0  # what a pivot is more than q, and its derivatives
        for k in range(n):
            pivot = q[k] + t
            if not pivot > 0.0:  # s is the zero, but for rounding
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
