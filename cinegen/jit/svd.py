"""Singular values by one-sided Jacobi rotations, starting from the singular vectors of an earlier matrix.

Between two ticks a Jacobian changes little, so the singular vectors of the last one nearly diagonalise it: one or two
sweeps of rotations complete the decomposition (A. A. Maciejewski and C. A. Klein, "The singular value decomposition:
computation and applications to robotics", International Journal of Robotics Research 8, 1989). The rotations are
Hestenes's; the start affects the result only by rounding.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled, inlined
from cinegen.jit.vectors import add_multiple, copy, inner, swap

_ORTHOGONAL = 1e-15  # cosine between two rows that count as orthogonal
_LAST = 1e-6  # largest rotation in the last sweep: the square of it remains
_LAST_OF_VALUES = 1e-4  # if only values are computed: their errors are quadratic in the rotations
_NOTHING = 1e-15  # rows shorter than this fraction of the longest are zero
_WARM_SWEEPS = 6  # from a guess, before a cold start
COLD_SWEEPS = 30


@compiled
def orthogonalise(b: Array, u: Array, n: int, width: int, vectors: int, square: Array, sweeps: int) -> int:
    """Rotate the first n rows of b (., width) until they are orthogonal, and those of u (., vectors) with them.

    Args:
        b: u m, for some matrix m (n, width); becomes the product of the new u with m.
        u: orthogonal.
        n: rows.
        width: columns.
        vectors: columns of u: n, or 0 if u is not needed.
        square: (n,) becomes the squared length of each row of b.
        sweeps: largest number of sweeps.

    Returns:
        number of sweeps; -1 if they were too few.
    """
    last = _LAST if vectors > 0 else _LAST_OF_VALUES
    for sweep in range(sweeps):
        longest = 0.0
        for i in range(n):
            square[i] = inner(b[i], b[i], width)
            if not square[i] < math.inf:  # NaN or overflow: no result, and no guess for later
                return -1
            longest = max(longest, square[i])
        nothing = _NOTHING * _NOTHING * longest
        largest = 0.0  # rotation
        players = n + n % 2
        for turn in range(players - 1):
            for pair in range(players // 2):
                i, j = _opponents(turn, pair, players)
                if j >= n:
                    continue
                dot = _product(b[i], b[j], width)
                p, q = square[i], square[j]
                if dot * dot <= _ORTHOGONAL * _ORTHOGONAL * p * q or min(p, q) <= nothing:
                    continue
                tangent, c = _rotation(p, q, dot)
                s = c * tangent
                largest = max(largest, abs(tangent))
                _rotate(b[i], b[j], width, c, s)
                _rotate(u[i], u[j], vectors, c, s)
                square[i], square[j] = max(0.0, p - tangent * dot), max(0.0, q + tangent * dot)
        if largest < last:
            return sweep + 1
    return -1


@inlined
def _opponents(turn: int, pair: int, players: int) -> tuple[int, int]:
    """Return who meet in a round of a tournament, by the circle method: no row meets two others in one round, so that
    rotations may overlap.

    Args:
        turn: the round, of players - 1.
        pair: of players / 2.
        players: an even number.
    """
    if pair == 0:
        return turn, players - 1
    i, j = turn + pair, turn - pair
    if i >= players - 1:
        i -= players - 1
    if j < 0:
        j += players - 1
    return min(i, j), max(i, j)


@inlined
def _product(x: Array, y: Array, n: int) -> float:
    """Return the product of two rows, as two sums at a time: none waits for the other."""
    even, odd = 0.0, 0.0
    for k in range(0, n - 1, 2):
        even += x[k] * y[k]
        odd += x[k + 1] * y[k + 1]
    if n % 2 == 1:
        even += x[n - 1] * y[n - 1]
    return even + odd


@inlined
def _rotation(p: float, q: float, dot: float) -> tuple[float, float]:
    """Return tangent and cosine of the rotation, of 45 degrees at most, after which two rows of squared lengths p and q
    and of product `dot` are orthogonal: t^2 + 2 zeta t - 1 = 0 with zeta = (q - p) / (2 dot)."""
    if abs(dot) < 1e-3 * abs(q - p):  # a small rotation, to rounding, without a root
        t = dot / (q - p)
        t2 = t * t
        tangent = t * (1.0 - t2 * (1.0 - t2 * (2.0 - 5.0 * t2)))
        t2 = tangent * tangent
        return tangent, 1.0 - t2 * (0.5 - t2 * (0.375 - t2 * 0.3125))
    zeta = (q - p) / (2.0 * dot)
    tangent = 1.0 / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
    if zeta < 0.0:
        tangent = -tangent
    return tangent, 1.0 / math.sqrt(1.0 + tangent * tangent)


@inlined
def _rotate(x: Array, y: Array, n: int, c: float, s: float) -> None:
    """Rotate two rows: x, y = c x - s y, s x + c y."""
    for k in range(n):
        a, b = x[k], y[k]
        x[k], y[k] = c * a - s * b, s * a + c * b


@compiled
def decompose(m: Array, n: int, width: int, u: Array, b: Array, square: Array, warm: bool) -> int:
    """Compute the singular values of m: b = u m has orthogonal rows, the longest first, of squared lengths `square`.

    With s_i the length of row i, u_i is a left singular vector (a row of u) and b_i / s_i the right one.

    Args:
        m: (n, width).
        n: rows.
        width: columns.
        u: (n, n), orthogonal; the start if `warm`.
        b: (n, width), result.
        square: (n,), result.
        warm: u is a guess.

    Returns:
        number of sweeps.
    """
    used = 0
    if warm:
        for i in range(n):
            for k in range(width):
                s = 0.0
                for j in range(n):
                    s += u[i, j] * m[j, k]
                b[i, k] = s
        used = orthogonalise(b, u, n, width, n, square, _WARM_SWEEPS)
    if not warm or used < 0:
        for i in range(n):
            for j in range(n):
                u[i, j] = 1.0 if i == j else 0.0
            copy(m[i], b[i], width)
        used = max(used, 0) + orthogonalise(b, u, n, width, n, square, COLD_SWEEPS)
    for i in range(1, n):  # nearly sorted already
        j = i
        while j > 0 and square[j] > square[j - 1]:
            square[j], square[j - 1] = square[j - 1], square[j]
            swap(b[j], b[j - 1], width)
            swap(u[j], u[j - 1], n)
            j -= 1
    return used


@compiled
def straighten(u: Array, n: int) -> None:
    """Orthonormalise u (n, n), orthogonal up to rounding, by Gram-Schmidt."""
    for i in range(n):
        for j in range(i):
            add_multiple(-inner(u[i], u[j], n), u[j], u[i], n)
        s = 1.0 / math.sqrt(inner(u[i], u[i], n))
        for k in range(n):
            u[i, k] *= s
