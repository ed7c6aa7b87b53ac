"""Merlet's elimination: from the three distances of a platform triangle to its angles p34, as an eigenvalue problem.

A distance equation is linear in 1, cos p, sin p of either of its two angles: K contains p12 and p34, L p12 and p56, M
p34 and p56 (`TSSM.circles`, equations 20-22 of J-P. Merlet, "Symbolic computation for the determination of the minimal
direct kinematics polynomial and the singular configurations of parallel manipulators"). Eliminating p12 and p56 leaves
a 4x4 matrix, polynomial in one unknown, whose determinant vanishes at every solution. The determinant is never expanded
(its coefficients would hold the roots to 1e-9 at best): the eigenvalues of the matrix polynomial are computed.

Base points in one plane (equations 23-26): K and L are linear in sin p12 and cos p12, a sin p12 + b cos p12 + g = 0,

    a = K11 sin p34    b = K21 cos p34 + K22     g = K32 cos p34 + K33
    a' = L11 sin p56   b' = L21 cos p56 + L22    g' = L32 cos p56 + L33

and sin^2 + cos^2 = 1 gives (b g' - g b')^2 + (g a' - a g')^2 = (a b' - b a')^2, equation 23. It contains sin p34 and
sin p56 as squares or as their product, for which M is substituted: two quadratics in cos p56, equations 25 and 26,
whose coefficients are quadratics in cos p34. Their Sylvester matrix is a quadratic matrix polynomial in cos p34 with 8
eigenvalues, each for a solution and its mirror image.

Base points anywhere: with x, y, z the tangents of half of p12, p34, p56 the distances are K(x, y), L(x, z), M(y, z),
of degree 2 in each. Bezout's matrix of K and L in x, (2, 2), is a quadratic in z; its Bezout matrix with M, by blocks,

    A = [B1 m0 - B0 m1   B2 m0 - B0 m2]      Bj = [k1 l0j - k0 l1j   k2 l0j - k0 l2j]
        [B2 m0 - B0 m2   B2 m1 - B1 m2]           [k2 l0j - k0 l2j   k2 l1j - k1 l2j]

is of degree 4 in y: ki and mj are quadratics in y, lij numbers. Three such equations have 16 solutions (Bezout's number
in three projective lines), so none of the 16 eigenvalues is extraneous.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.hexapod._kernels.eigenvalues import ROWS, companion, eigenvalues, reduce
from cinegen.jit.compiled import Array, compiled

SOLUTIONS = 16
PLANAR_DEGREE, SPATIAL_DEGREE = 2, 4
"""Degrees of the matrix polynomials, in cos p34 and in tan(p34 / 2)."""

# coefficients of a distance equation: of 1, cos and sin of the first angle, of the second, and of their products
ONE, C1, S1, C2, S2, CC, CS, SC, SS, EQUATION_WIDTH = range(10)

_POLES = 4  # values that may be mapped to infinity: the one with the most regular leading matrix is taken


class EliminationScratch(NamedTuple):
    """Working memory for one set of leg lengths."""

    quadratics: Array
    blocks: Array
    wide: Array
    matrix: Array
    eigenvalues: Array
    choice: NDArray[np.complex128]
    newton: NDArray[np.complex128]


def elimination_scratch() -> EliminationScratch:
    """Allocate working memory for `roots.find_roots`."""
    padded, degrees = SOLUTIONS + 1, SPATIAL_DEGREE + 1
    shapes = (6, 3), (degrees, ROWS, ROWS), (ROWS, ROWS * degrees), (padded, padded), (2, SOLUTIONS)
    quadratics, blocks, wide, matrix, found = (np.zeros(shape) for shape in shapes)
    choice, newton = (np.empty(shape, dtype=complex) for shape in ((5, 3), (6, 3)))
    return EliminationScratch(quadratics, blocks, wide, matrix, found, choice, newton)


@compiled
def eigen_directions(
    equations: Array, planar: bool, quadratics: Array, blocks: Array, wide: Array, matrix: Array, found: Array
) -> float:
    """Write exp(i p34) of all solutions to `scratch.eigenvalues` (2, 16), as real and imaginary parts.

    Planar base points: 8 values, each for a pair of mirror images, whose other one has the inverse value. Else 16.
    Solutions at infinity have values near 0 or very large ones.

    Returns:
        how far the determinant is from vanishing identically: the least pivot of the best leading matrix; negative if
        the eigenvalues did not converge.
    """
    degree = PLANAR_DEGREE if planar else SPATIAL_DEGREE
    if planar:
        write_quadratics(equations, quadratics)
    best, regular = 0, -1.0
    for trial in range(_POLES + 1):
        pole = trial if trial < _POLES else best
        if planar:
            _write_sylvester(quadratics, pole, blocks)
        else:
            write_bezout(equations, _offset(pole), quadratics, blocks)
        if trial < _POLES:
            for i in range(ROWS):
                for j in range(ROWS):
                    wide[i, j] = blocks[degree, i, j]
            least = reduce(wide, ROWS, ROWS)
            if least > regular:
                best, regular = pole, least
    if regular == 0.0:
        return 0.0
    companion(blocks, degree, wide, matrix)
    if not eigenvalues(matrix, ROWS * degree, found):
        return -1.0
    c, s = _pole(best)
    back = complex(math.cos(_offset(best)), math.sin(_offset(best)))
    for i in range(ROWS * degree):
        y = complex(found[0, i], found[1, i])
        below = s * y + c if planar else 1.0 - 1j * y
        above = c * y - s if planar else back * (1.0 + 1j * y)
        w = above / below if below != 0.0 else complex(1e300)
        if planar:  # w is cos p34
            root = np.sqrt(w - 1.0) * np.sqrt(w + 1.0)
            w = complex(w + root if (root * w.conjugate()).real >= 0.0 else w - root)
        found[0, i], found[1, i] = w.real, w.imag
    return regular


@compiled
def _pole(number: int) -> tuple[float, float]:
    """Return (c, s) of x = (c y - s) / (s y + c), where y is infinite at x = c / s, outside the range of cosines."""
    x = 1.37 if number == 0 else (-1.61 if number == 1 else (2.83 if number == 2 else -3.71))
    s = 1.0 / math.sqrt(1.0 + x * x)
    return x * s, s


@compiled
def _offset(number: int) -> float:
    """Return the angle that p34 is measured from: p34 = offset + pi is mapped to infinity."""
    return 0.41 + 1.57 * number


# --- base points in one plane -----------------------------------------------------------------------------------------


@compiled
def write_quadratics(equations: Array, quadratics: Array) -> None:
    """Write I1, I2, I3 of equation 25 and H1, H2, H3 of equation 26: (6, 3), the coefficients of 1, x, x^2 with
    x = cos p34. Each equation is divided by its largest coefficient."""
    K, L, M = equations[0], equations[1], equations[2]
    k11, l11, m11 = K[SS], L[SS], M[SS]
    l21, l22, l32, l33 = L[CC], L[C1], L[C2], L[ONE]
    ratio = k11 * l11 / m11
    # linear in x, as pairs (of 1, of x)
    b0, b1, g0, g1 = K[C1], K[CC], K[ONE], K[C2]
    u0, u1, v0, v1 = M[C2], M[CC], M[ONE], M[C1]  # sin p34 sin p56 = -(u cos p56 + v) / M11
    high0, high1 = b0 * l32 - g0 * l21, b1 * l32 - g1 * l21  # b g' - g b' = high cos p56 + low
    low0, low1 = b0 * l33 - g0 * l22, b1 * l33 - g1 * l22
    s0, s1 = b0 * l21 - g0 * l32, b1 * l21 - g1 * l32  # b b' - g g' = s cos p56 + t
    t0, t1 = b0 * l22 - g0 * l33, b1 * l22 - g1 * l33
    for power in range(3):
        sine = 1.0 if power == 0 else (0.0 if power == 1 else -1.0)  # sin^2 p34 = 1 - x^2
        square = k11 * k11 * sine
        gap = l11 * l11 * (_product(g0, g1, g0, g1, power) - _product(b0, b1, b0, b1, power))
        i1 = _product(high0, high1, high0, high1, power) - gap + square * (l32 * l32 - l21 * l21)
        i2 = _product(high0, high1, low0, low1, power) + square * (l32 * l33 - l21 * l22)
        i3 = _product(low0, low1, low0, low1, power) + gap + square * (l33 * l33 - l22 * l22)
        mixed = _product(u0, u1, t0, t1, power) + _product(v0, v1, s0, s1, power)
        quadratics[0, power] = i1 - 2.0 * ratio * _product(u0, u1, s0, s1, power)
        quadratics[1, power] = 2.0 * (i2 - ratio * mixed)
        quadratics[2, power] = i3 - 2.0 * ratio * _product(v0, v1, t0, t1, power)
        quadratics[3, power] = _product(u0, u1, u0, u1, power) + m11 * m11 * sine
        quadratics[4, power] = 2.0 * _product(u0, u1, v0, v1, power)
        quadratics[5, power] = _product(v0, v1, v0, v1, power) - m11 * m11 * sine
    for first in (0, 3):
        largest = 0.0
        for i in range(first, first + 3):
            for power in range(3):
                largest = max(largest, abs(quadratics[i, power]))
        for i in range(first, first + 3):
            for power in range(3):
                quadratics[i, power] /= largest


@compiled
def _product(p0: float, p1: float, q0: float, q1: float, power: int) -> float:
    """Return the coefficient of x^power in (p0 + p1 x) (q0 + q1 x)."""
    if power == 0:
        return p0 * q0
    return p0 * q1 + p1 * q0 if power == 1 else p1 * q1


@compiled
def _write_sylvester(quadratics: Array, pole: int, blocks: Array) -> None:
    """Write the Sylvester matrix of equations 25 and 26, (3, 4, 4), by powers of y, where x = (c y - s) / (s y + c)."""
    c, s = _pole(pole)
    for power in range(PLANAR_DEGREE + 1):
        zeroth, first, second = c * c, -c * s, s * s
        if power == 1:
            zeroth, first, second = 2.0 * c * s, c * c - s * s, -2.0 * c * s
        elif power == 2:
            zeroth, first, second = s * s, c * s, c * c
        for i in range(ROWS):
            for j in range(ROWS):
                blocks[power, i, j] = 0.0
        for i in range(3):
            p = quadratics[i, 0] * zeroth + quadratics[i, 1] * first + quadratics[i, 2] * second
            q = quadratics[3 + i, 0] * zeroth + quadratics[3 + i, 1] * first + quadratics[3 + i, 2] * second
            blocks[power, 0, i] = blocks[power, 1, i + 1] = p
            blocks[power, 2, i] = blocks[power, 3, i + 1] = q


# --- base points anywhere ---------------------------------------------------------------------------------------------


@compiled
def write_bezout(equations: Array, offset: float, quadratics: Array, blocks: Array) -> None:
    """Write the coefficients (5, 4, 4) of A by powers of y = tan((p34 - offset) / 2).

    quadratics: (6, 3) scratch.
    """
    c, s = math.cos(offset), math.sin(offset)
    for k in range(2):  # K and M are q0 + q1 cos + q2 sin of the angle to eliminate, each linear in 1, cos, sin p34
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
        for p in range(3):  # ... and by the tangent of half of the eliminated angle
            one, x, y = quadratics[3 * k, p], quadratics[3 * k + 1, p], quadratics[3 * k + 2, p]
            quadratics[3 * k, p], quadratics[3 * k + 1, p], quadratics[3 * k + 2, p] = one + x, 2.0 * y, one - x
    for i in range(ROWS):
        for j in range(ROWS):
            for power in range(SPATIAL_DEGREE + 1):
                blocks[power, i, j] = 0.0
    L = equations[1]
    for i in range(ROWS):  # A and its blocks are symmetric
        for j in range(i, ROWS):
            high, low = (2, 0) if i // 2 != j // 2 else (i // 2 + 1, i // 2)
            left, right = (2, 0) if i % 2 != j % 2 else (i % 2 + 1, i % 2)
            a, b = _coefficient(L, right, high), _coefficient(L, left, high)
            d, e = _coefficient(L, right, low), _coefficient(L, left, low)
            for p in range(3):
                one = quadratics[left, p] * a - quadratics[right, p] * b
                two = quadratics[left, p] * d - quadratics[right, p] * e
                for q in range(3):
                    blocks[p + q, i, j] += one * quadratics[3 + low, q] - two * quadratics[3 + high, q]
            for power in range(SPATIAL_DEGREE + 1):
                blocks[power, j, i] = blocks[power, i, j]


@compiled
def _coefficient(L: Array, i: int, j: int) -> float:
    """Return the coefficient of x^i z^j in L, with x and z the tangents of half of p12 and p56."""
    if i == 1 and j == 1:
        return float(4.0 * L[SS])
    sign, other = 1.0 - i, 1.0 - j  # of cosines
    if i == 1:
        return float(2.0 * (L[S1] + other * L[SC]))
    if j == 1:
        return float(2.0 * (L[S2] + sign * L[CS]))
    return float(L[ONE] + sign * L[C1] + other * L[C2] + sign * other * L[CC])
