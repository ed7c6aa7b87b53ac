"""Base points anywhere: p12 and p56 eliminated in half-angle tangents.

With x, y, z the tangents of half of p12, p34, p56, and denominators cleared, the distances are K(x, y), L(x, z) and
M(y, z), of degree 2 in each. For a given y, K is a quadratic in x and M one in z. Bezout's matrix of K and L in x,
(2, 2), is singular where these have a common root; it is a quadratic in z, whose Bezout matrix with M, block by block,
(4, 4), is singular where a root of M makes it so:

    A = [B1 m0 - B0 m1   B2 m0 - B0 m2]      Bj = [k1 l0j - k0 l1j   k2 l0j - k0 l2j]
        [B2 m0 - B0 m2   B2 m1 - B1 m2]           [k2 l0j - k0 l2j   k2 l1j - k1 l2j]

Here ki and mj are quadratics in y, lij numbers: A is of degree 4 in y and its determinant of degree 16. Three such
equations have 16 solutions (Bezout's number in three projective lines), so none that is found here is extraneous.
"""

from __future__ import annotations

import math

from cinegen.assembly.triangle._kernels.circles import C1, C2, CC, CS, ONE, S1, S2, SC, SS
from cinegen.assembly.triangle._kernels.companion import ROWS, companion
from cinegen.assembly.triangle._kernels.eigenvalues import eigenvalues
from cinegen.assembly.triangle._kernels.elimination import reduce
from cinegen.jit.compiled import Array, compiled, entry

DEGREE = 4  # of the matrix in tan(p34 / 2)
ROOTS = 16
_POLES = 4  # which are tried, and the best taken


@compiled
def directions(equations: Array, quadratics: Array, blocks: Array, wide: Array, matrix: Array, found: Array) -> float:
    """The sixteen exp(i p34) (2, ROOTS): real and imaginary parts; those of solutions at infinity are 0 or large.

    Args:
        equations: (3, EQUATION_WIDTH) of the distances.
        quadratics: (6, 3) scratch.
        blocks: (DEGREE + 1, ROWS, ROWS) scratch.
        wide: (ROWS, ROWS (DEGREE + 1)) scratch.
        matrix: (ROOTS, ROOTS) scratch.
        found: the result.

    Returns:
        how far the polynomial is from being zero everywhere (the least pivot at the best of some places); negative
        where the eigenvalues did not converge.
    """
    best, regular = 0.0, -1.0
    for pole in range(_POLES + 1):  # p34 is counted from another direction, so that no solution is near y = infinity
        offset = 0.41 + 1.57 * pole if pole < _POLES else best
        write_matrices(equations, offset, quadratics, blocks)
        if pole == _POLES:
            break
        for i in range(ROWS):
            for j in range(ROWS):
                wide[i, j] = blocks[DEGREE, i, j]
        least = reduce(wide, ROWS, ROWS)
        if least > regular:
            best, regular = offset, least
    if regular == 0.0:
        return 0.0
    companion(blocks, DEGREE, wide, matrix)
    if not eigenvalues(matrix, ROOTS, found):
        return -1.0
    back = complex(math.cos(best), math.sin(best))
    for i in range(ROOTS):
        y = complex(found[0, i], found[1, i])
        below = 1.0 - 1j * y
        w = back * (1.0 + 1j * y) / below if below != 0.0 else complex(1e300)
        found[0, i], found[1, i] = w.real, w.imag
    return regular


@entry
def write_matrices(equations: Array, offset: float, quadratics: Array, blocks: Array) -> None:
    """The factors (DEGREE + 1, ROWS, ROWS) of 1, y, ... in A, with y = tan((p34 - offset) / 2)."""
    c, s = math.cos(offset), math.sin(offset)
    for k in range(2):  # K and M are q0 + q1 cos + q2 sin of the angle that goes, each with factors of 1, cos, sin p34
        q = equations[2 * k]
        for row in range(3):
            if k == 0:
                one = q[ONE] if row == 0 else (q[C1] if row == 1 else q[S1])
                x = q[C2] if row == 0 else (q[CC] if row == 1 else q[SC])
                y = q[S2] if row == 0 else (q[CS] if row == 1 else q[SS])
            else:
                one = q[ONE] if row == 0 else (q[C2] if row == 1 else q[S2])
                x = q[C1] if row == 0 else (q[CC] if row == 1 else q[CS])
                y = q[S1] if row == 0 else (q[SC] if row == 1 else q[SS])
            x, y = x * c + y * s, y * c - x * s
            out = quadratics[3 * k + row]
            out[0], out[1], out[2] = one + x, 2.0 * y, one - x
        for p in range(3):  # ... and of its half's tangent
            one, x, y = quadratics[3 * k, p], quadratics[3 * k + 1, p], quadratics[3 * k + 2, p]
            quadratics[3 * k, p], quadratics[3 * k + 1, p], quadratics[3 * k + 2, p] = one + x, 2.0 * y, one - x
    for i in range(ROWS):
        for j in range(ROWS):
            for power in range(DEGREE + 1):
                blocks[power, i, j] = 0.0
    for i in range(ROWS):  # A and its blocks are symmetric
        for j in range(i, ROWS):
            high, low = _orders(i // 2, j // 2)
            left, right = _orders(i % 2, j % 2)
            a, b = _third(equations[1], right, high), _third(equations[1], left, high)
            d, e = _third(equations[1], right, low), _third(equations[1], left, low)
            for p in range(3):
                one = quadratics[left, p] * a - quadratics[right, p] * b
                two = quadratics[left, p] * d - quadratics[right, p] * e
                for q in range(3):
                    blocks[p + q, i, j] += one * quadratics[3 + low, q] - two * quadratics[3 + high, q]
            for power in range(DEGREE + 1):
                blocks[power, j, i] = blocks[power, i, j]


@compiled
def _orders(i: int, j: int) -> tuple[int, int]:
    """Which powers meet in entry i, j of Bezout's matrix of two quadratics."""
    if i != j:
        return 2, 0
    return i + 1, i


@compiled
def _third(L: Array, i: int, j: int) -> float:
    """The factor of x^i z^j in L."""
    if i == 1 and j == 1:
        return float(4.0 * L[SS])
    sign, other = 1.0 - i, 1.0 - j  # of cosines
    if i == 1:
        return float(2.0 * (L[S1] + other * L[SC]))
    if j == 1:
        return float(2.0 * (L[S2] + sign * L[CS]))
    return float(L[ONE] + sign * L[C1] + other * L[C2] + sign * other * L[CC])
