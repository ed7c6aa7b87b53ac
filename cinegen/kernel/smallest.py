"""The smallest singular value alone, of a matrix whose columns are independent.

By Householder's reflections A = Q R, and R has the singular values of A; 1/sigma is the largest of R^-1, to which
inverse iteration comes, x <- (R^T R)^-1 x (G. H. Golub and C. F. Van Loan, "Matrix computations", section 8.2).
"""

from __future__ import annotations

import math

from cinegen.kernel.compiled import Array, compiled

_MOST = 100  # iterations
_SAME = 1e-12  # change of the value, as a part of it, in the last one


@compiled
def smallest_singular_value(a: Array, rows: int, n: int, x: Array, y: Array) -> float:
    """Of a (rows, n), rows >= n, which is lost; x and y (n,) are scratch. x is where it begins, and becomes the vector
    that belongs to it: given that of a matrix near by, it is there sooner. 0 where columns are dependent."""
    largest = 0.0
    for k in range(n):
        s = 0.0
        for i in range(k, rows):
            s += a[i, k] * a[i, k]
        length = math.sqrt(s)
        largest = max(largest, length)
        if not length > 1e-15 * largest:
            return 0.0
        diagonal = -length if a[k, k] > 0.0 else length
        a[k, k] -= diagonal
        tau = 1.0 / (length * abs(a[k, k]))
        for j in range(k + 1, n):
            s = 0.0
            for i in range(k, rows):
                s += a[i, k] * a[i, j]
            s *= tau
            for i in range(k, rows):
                a[i, j] -= s * a[i, k]
        a[k, k] = diagonal
    if not norm(x, n) > 0.0:
        for k in range(n):
            x[k] = 1.0 / math.sqrt(n)
    before = math.inf
    for _ in range(_MOST):
        for i in range(n):  # R^T y = x
            s = x[i]
            for k in range(i):
                s -= a[k, i] * y[k]
            y[i] = s / a[i, i]
        value = norm(y, n)  # of R^-T x: its inverse goes down to sigma
        for i in range(n - 1, -1, -1):  # R x = y
            s = y[i]
            for k in range(i + 1, n):
                s -= a[i, k] * x[k]
            x[i] = s / a[i, i]
        length = norm(x, n)
        if not 0.0 < length < math.inf:
            return 0.0
        for i in range(n):
            x[i] /= length
        if value >= before * (1.0 - _SAME) and value <= before * (1.0 + _SAME):
            break
        before = value
    return 1.0 / value


@compiled
def norm(x: Array, n: int) -> float:
    """Of x (n,)."""
    s = 0.0
    for i in range(n):
        s += x[i] * x[i]
    return math.sqrt(s)
