"""Eigenvalues of a small real matrix: Householder's Hessenberg form, then Francis's QR steps with two shifts.

G. H. Golub and C. F. Van Loan, "Matrix Computations", section 7.5. LAPACK does the same; a call of it costs more than
its work for a matrix of 8 rows, and compiled code that allocates nothing can't make that call.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled, entry

_NOTHING = 2.3e-16  # a subdiagonal number below this part of its neighbours is zero
_PATIENCE = 40  # steps for each eigenvalue
_STUBBORN = 10  # steps after which the shifts are exceptional ones


@entry
def eigenvalues(a: Array, n: int, found: Array) -> bool:
    """Of the first n rows and columns of a, which is lost.

    Args:
        a: (., .) the matrix.
        n: its size.
        found: (2, .) becomes their real and imaginary parts, in no order.

    Returns:
        whether the steps converged.
    """
    _to_hessenberg(a, n)
    high, steps = n - 1, 0
    while high >= 0:
        low = high
        while low > 0:
            near = abs(a[low - 1, low - 1]) + abs(a[low, low])
            if abs(a[low, low - 1]) <= _NOTHING * near:
                a[low, low - 1] = 0.0
                break
            low -= 1
        if low == high:
            found[0, high], found[1, high] = a[high, high], 0.0
            high -= 1
            steps = 0
        elif low == high - 1:
            _of_two(a, low, found)
            high -= 2
            steps = 0
        else:
            if not steps < _PATIENCE:
                return False
            steps += 1
            _francis_step(a, low, high, steps % _STUBBORN == 0)
    return True


@compiled
def _to_hessenberg(a: Array, n: int) -> None:
    """Similar to what it was, and zero below the first subdiagonal."""
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
        v0 = head - length  # the vector of the reflection: v0 above column k, which keeps the rest of it till the end
        factor = 2.0 / (v0 * v0 + s)
        for j in range(k + 1, n):
            dot = v0 * a[k + 1, j]
            for i in range(k + 2, n):
                dot += a[i, k] * a[i, j]
            dot *= factor
            a[k + 1, j] -= dot * v0
            for i in range(k + 2, n):
                a[i, j] -= dot * a[i, k]
        for j in range(n):
            dot = v0 * a[j, k + 1]
            for i in range(k + 2, n):
                dot += a[i, k] * a[j, i]
            dot *= factor
            a[j, k + 1] -= dot * v0
            for i in range(k + 2, n):
                a[j, i] -= dot * a[i, k]
        a[k + 1, k] = length
        for i in range(k + 2, n):
            a[i, k] = 0.0


@compiled
def _of_two(a: Array, i: int, found: Array) -> None:
    """The two eigenvalues of rows and columns i and i + 1."""
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
    """One step of QR with two shifts on rows and columns low ... high.

    Shifts are the eigenvalues of the last two rows if they are complex, else twice the one nearer to the last number.
    """
    half = 0.5 * (a[high - 1, high - 1] - a[high, high])
    square = half * half + a[high - 1, high] * a[high, high - 1]
    total = a[high - 1, high - 1] + a[high, high]
    product = a[high - 1, high - 1] * a[high, high] - a[high - 1, high] * a[high, high - 1]
    if exceptional:
        size = abs(a[high, high - 1]) + abs(a[high - 1, high - 2])
        shift = a[high, high] + 0.75 * size
        total, product = 2.0 * shift, shift * shift + 0.4375 * size * size
    elif square >= 0.0:
        root = math.sqrt(square)
        shift = a[high, high] + (half - root if half >= 0.0 else half + root)
        total, product = 2.0 * shift, shift * shift
    x = a[low, low] * a[low, low] + a[low, low + 1] * a[low + 1, low] - total * a[low, low] + product
    y = a[low + 1, low] * (a[low, low] + a[low + 1, low + 1] - total)
    z = a[low + 1, low] * a[low + 2, low + 1]
    for k in range(low, high):  # a reflection of three rows, of two at the end, pushes the bulge down
        three = k < high - 1
        if not three:
            z = 0.0
        size = abs(x) + abs(y) + abs(z)
        if size > 0.0:
            x, y, z = x / size, y / size, z / size
            length = math.sqrt(x * x + y * y + z * z)
            if x > 0.0:
                length = -length
            v0 = x - length
            p, q = y / v0, z / v0
            factor = -v0 / length  # 2 / v.v, with v = (1, p, q)
            if k > low:
                a[k, k - 1] = length * size
                a[k + 1, k - 1] = 0.0
                if three:
                    a[k + 2, k - 1] = 0.0
            if three:
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
            else:
                for j in range(k, high + 1):
                    dot = factor * (a[k, j] + p * a[k + 1, j])
                    a[k, j] -= dot
                    a[k + 1, j] -= dot * p
                for i in range(low, high + 1):
                    dot = factor * (a[i, k] + p * a[i, k + 1])
                    a[i, k] -= dot
                    a[i, k + 1] -= dot * p
        if three:
            x, y = a[k + 1, k], a[k + 2, k]
            z = a[k + 3, k] if k < high - 2 else 0.0
