"""Eigenvalues of small real matrices, and Gauss and Jordan's elimination.

Householder's Hessenberg form, then Francis's QR steps with two shifts (G. H. Golub and C. F. Van Loan, "Matrix
Computations", section 7.5), as in LAPACK. Measured for 8 and 16 rows, LAPACK through `numpy.linalg.eigvals` takes 1.7
times as long, and compiled code that allocates nothing can't call it.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled, entry

ROWS = 4
"""Rows of the coefficients of a matrix polynomial."""

_NEGLIGIBLE = 2.3e-16  # a subdiagonal number below this part of its neighbours is zero; more after each step
_MAX_STEPS = 40  # for each eigenvalue
_EXCEPTIONAL = 10  # steps after which the shifts are exceptional ones


@compiled
def reduce(a: Array, rows: int, columns: int) -> float:
    """Solve the first `rows` columns of a (rows, columns) against the others by Gauss and Jordan's elimination with row
    pivots, in place. Return the least pivot; if it is 0, nothing is solved."""
    least = 1e300
    for i in range(rows):
        best = i
        for k in range(i + 1, rows):
            if abs(a[k, i]) > abs(a[best, i]):
                best = k
        least = min(least, abs(a[best, i]))
        if not abs(a[best, i]) > 0.0:
            return 0.0
        if best != i:
            for j in range(i, columns):
                a[i, j], a[best, j] = a[best, j], a[i, j]
        inverse = 1.0 / a[i, i]
        for j in range(i, columns):
            a[i, j] *= inverse
        for k in range(rows):
            if k != i and a[k, i] != 0.0:
                part = a[k, i]
                for j in range(i, columns):
                    a[k, j] -= part * a[i, j]
    return least


@entry
def eigenvalues(a: Array, n: int, found: Array) -> bool:
    """Compute the eigenvalues of the first n rows and columns of a, which is overwritten.

    Args:
        a: with one row and column more than n at least, whose numbers are finite.
        n: size of the matrix.
        found: (2, .) their real and imaginary parts are written, in no order.

    Returns:
        whether the steps converged.
    """
    _to_hessenberg(a, n)
    high, steps = n - 1, 0
    while high >= 0:
        low = high
        while low > 0:
            near = abs(a[low - 1, low - 1]) + abs(a[low, low])
            if abs(a[low, low - 1]) <= _NEGLIGIBLE * (1 + steps) * near:  # rounding may keep multiple ones above
                a[low, low - 1] = 0.0
                break
            low -= 1
        if low == high:
            found[0, high], found[1, high] = a[high, high], 0.0
            high -= 1
            steps = 0
        elif low == high - 1:
            _write_pair(a, low, found)
            high -= 2
            steps = 0
        else:
            if not steps < _MAX_STEPS:
                return False
            steps += 1
            _francis_step(a, low, high, steps % _EXCEPTIONAL == 0)
    return True


@compiled
def _to_hessenberg(a: Array, n: int) -> None:
    """Transform a similarly, to zeros below the first subdiagonal."""
    for k in range(n - 2):
        s = 0.0
        for i in range(k + 2, n):
            s += a[i, k] * a[i, k]
        if s == 0.0:
            continue
        head = a[k + 1, k]
        length = math.sqrt(s + head * head)
        if head > 0.0:
            length = -length
        a[k + 1, k] = head - length  # column k holds the vector of the reflection until the end
        factor = 2.0 / (a[k + 1, k] * a[k + 1, k] + s)
        for j in range(k + 1, n):
            dot = 0.0
            for i in range(k + 1, n):
                dot += a[i, k] * a[i, j]
            dot *= factor
            for i in range(k + 1, n):
                a[i, j] -= dot * a[i, k]
        for j in range(n):
            dot = 0.0
            for i in range(k + 1, n):
                dot += a[i, k] * a[j, i]
            dot *= factor
            for i in range(k + 1, n):
                a[j, i] -= dot * a[i, k]
        a[k + 1, k] = length
        for i in range(k + 2, n):
            a[i, k] = 0.0


@compiled
def _write_pair(a: Array, i: int, found: Array) -> None:
    """Write the two eigenvalues of rows and columns i and i + 1."""
    half = 0.5 * (a[i, i] - a[i + 1, i + 1])
    square = half * half + a[i, i + 1] * a[i + 1, i]
    middle = 0.5 * (a[i, i] + a[i + 1, i + 1])
    root = math.sqrt(abs(square))
    if square < 0.0:
        found[0, i] = found[0, i + 1] = middle
        found[1, i], found[1, i + 1] = root, -root
        return
    found[1, i] = found[1, i + 1] = 0.0
    away = half + root if half >= 0.0 else half - root
    found[0, i] = a[i + 1, i + 1] + away
    found[0, i + 1] = a[i + 1, i + 1] if away == 0.0 else a[i + 1, i + 1] - a[i, i + 1] * a[i + 1, i] / away


@compiled
def _francis_step(a: Array, low: int, high: int, exceptional: bool) -> None:
    """Do one QR step with two shifts on rows and columns low ... high.

    Shifts are the eigenvalues of the last two rows if they are complex, else twice the one nearer to the last number.
    """
    first, second, w = a[high, high], a[high - 1, high - 1], a[high - 1, high] * a[high, high - 1]
    half = 0.5 * (second - first)
    square = half * half + w
    if exceptional:
        size = abs(a[high, high - 1]) + abs(a[high - 1, high - 2])
        first = second = first + 0.75 * size
        w = -0.4375 * size * size
    elif square >= 0.0:
        root = math.sqrt(square)
        first = second = first + (half - root if half >= 0.0 else half + root)
        w = 0.0
    r, s = first - a[low, low], second - a[low, low]  # differences first: eigenvalues may be close to each other
    x = (r * s - w) / a[low + 1, low] + a[low, low + 1]
    y = a[low + 1, low + 1] - a[low, low] - r - s
    z = a[low + 2, low + 1]
    for k in range(low, high):  # a reflection of three rows moves the bulge down; of the last two, with q = 0
        size = abs(x) + abs(y) + abs(z)
        if size > 0.0:
            x, y, z = x / size, y / size, z / size
            length = math.sqrt(x * x + y * y + z * z)
            if x > 0.0:
                length = -length
            p, q = y / (x - length), z / (x - length)
            factor = (length - x) / length  # 2 / v.v, with v = (1, p, q)
            if k > low:
                a[k, k - 1], a[k + 1, k - 1] = length * size, 0.0
                if k < high - 1:
                    a[k + 2, k - 1] = 0.0
            for j in range(k, high + 1):
                dot = factor * (a[k, j] + p * a[k + 1, j] + q * a[k + 2, j])
                a[k, j] -= dot
                a[k + 1, j] -= dot * p
                a[k + 2, j] -= dot * q
            for i in range(low, min(k + 4, high + 1)):
                dot = factor * (a[i, k] + p * a[i, k + 1] + q * a[i, k + 2])
                a[i, k] -= dot
                a[i, k + 1] -= dot * p
                a[i, k + 2] -= dot * q
        x, y = a[k + 1, k], a[k + 2, k]
        z = a[k + 3, k] if k < high - 2 else 0.0
