"""Equations 23-26: base points in one plane, p12 and p56 eliminated.

Equations 20 and 21 are linear in sin p12 and cos p12: a sin p12 + b cos p12 + g = 0 with

    a = K11 sin p34    b = K21 cos p34 + K22     g = K32 cos p34 + K33
    a' = L11 sin p56   b' = L21 cos p56 + L22    g' = L32 cos p56 + L33

and sin^2 + cos^2 = 1 makes of them (b g' - g b')^2 + (g a' - a g')^2 = (a b' - b a')^2, equation 23. It holds sin p34
and sin p56 as their squares or as their product, which equation 22 gives without division but by M11: two quadratics
in cos p56, equations 25 and 26, whose factors are quadratics in cos p34. Their Sylvester matrix, a quadratic of
matrices in cos p34, is singular where they have a common root: its determinant has degree 8.

The determinant is never expanded: its coefficients would hold the roots only to 1e-9 or worse.
"""

from __future__ import annotations

import math

from cinegen.assembly.triangle._kernels.circles import C1, C2, CC, ONE, SS
from cinegen.assembly.triangle._kernels.companion import ROWS, companion
from cinegen.assembly.triangle._kernels.eigenvalues import eigenvalues
from cinegen.assembly.triangle._kernels.elimination import reduce
from cinegen.jit.compiled import Array, compiled, entry

DEGREE = 2  # of the Sylvester matrix in cos p34
ROOTS = 8
_POLES = 4  # which are tried, and the best taken


@entry
def write_quadratics(equations: Array, quadratics: Array) -> None:
    """I1, I2, I3 of equation 25 and H1, H2, H3 of equation 26, each (3,) the factors of 1, x, x^2 with x = cos p34.

    quadratics: (6, 3); each equation is divided by its largest factor.
    """
    K, L, M = equations[0], equations[1], equations[2]
    k11, l11, m11 = K[SS], L[SS], M[SS]
    l21, l22, l32, l33 = L[CC], L[C1], L[C2], L[ONE]
    turn = k11 * l11 / m11
    # linear in x, as pairs (of 1, of x)
    b0, b1, g0, g1 = K[C1], K[CC], K[ONE], K[C2]
    u0, u1, v0, v1 = M[C2], M[CC], M[ONE], M[C1]  # sin p34 sin p56 = -(u cos p56 + v) / M11
    high0, high1 = b0 * l32 - g0 * l21, b1 * l32 - g1 * l21  # b g' - g b' = high cos p56 + low
    low0, low1 = b0 * l33 - g0 * l22, b1 * l33 - g1 * l22
    s0, s1 = b0 * l21 - g0 * l32, b1 * l21 - g1 * l32  # b b' - g g' = s cos p56 + t
    t0, t1 = b0 * l22 - g0 * l33, b1 * l22 - g1 * l33
    for power in range(3):
        square = k11 * k11 * (1.0 if power == 0 else (0.0 if power == 1 else -1.0))  # of a
        gap = _product(g0, g1, g0, g1, power) - _product(b0, b1, b0, b1, power)
        gap *= l11 * l11
        quadratics[0, power] = (
            _product(high0, high1, high0, high1, power)
            - gap
            + square * (l32 * l32 - l21 * l21)
            - 2.0 * turn * _product(u0, u1, s0, s1, power)
        )
        quadratics[1, power] = 2.0 * (
            _product(high0, high1, low0, low1, power)
            + square * (l32 * l33 - l21 * l22)
            - turn * (_product(u0, u1, t0, t1, power) + _product(v0, v1, s0, s1, power))
        )
        quadratics[2, power] = (
            _product(low0, low1, low0, low1, power)
            + gap
            + square * (l33 * l33 - l22 * l22)
            - 2.0 * turn * _product(v0, v1, t0, t1, power)
        )
        square = m11 * m11 * (1.0 if power == 0 else (0.0 if power == 1 else -1.0))
        quadratics[3, power] = _product(u0, u1, u0, u1, power) + square
        quadratics[4, power] = 2.0 * _product(u0, u1, v0, v1, power)
        quadratics[5, power] = _product(v0, v1, v0, v1, power) - square
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
    """The factor of x^power in (p0 + p1 x) (q0 + q1 x)."""
    if power == 0:
        return p0 * q0
    return p0 * q1 + p1 * q0 if power == 1 else p1 * q1


@compiled
def cosines(equations: Array, quadratics: Array, blocks: Array, work: Array, matrix: Array, found: Array) -> float:
    """The eight cos p34 (2, ROOTS): real and imaginary parts; infinite ones are large.

    Returns:
        how far the polynomial is from being zero everywhere (the least pivot at the best of some places); negative
        where the eigenvalues did not converge.
    """
    write_quadratics(equations, quadratics)
    # x = (c y - s) / (s y + c): infinity becomes finite, and a place x = c / s which is no root goes to infinity
    best, regular = 0, -1.0
    for pole in range(_POLES):
        c, s = _direction(pole)
        _write_blocks(quadratics, c * c, c * s, s * s, work)
        least = reduce(work, ROWS, ROWS)
        if least > regular:
            best, regular = pole, least
    c, s = _direction(best)
    _write_blocks(quadratics, c * c, c * s, s * s, blocks[2])
    _write_blocks(quadratics, -2.0 * c * s, c * c - s * s, 2.0 * c * s, blocks[1])
    _write_blocks(quadratics, s * s, -c * s, c * c, blocks[0])
    if regular == 0.0:
        return 0.0
    companion(blocks, DEGREE, work, matrix)
    if not eigenvalues(matrix, ROOTS, found):
        return -1.0
    for i in range(ROOTS):
        y = complex(found[0, i], found[1, i])
        below = s * y + c
        x = (c * y - s) / below if below != 0.0 else complex(1e300)
        found[0, i], found[1, i] = x.real, x.imag
    return regular


@compiled
def _direction(pole: int) -> tuple[float, float]:
    """(c, s) with c / s outside of where cosines are."""
    x = 1.37 if pole == 0 else (-1.61 if pole == 1 else (2.83 if pole == 2 else -3.71))
    s = 1.0 / math.sqrt(1.0 + x * x)
    return x * s, s


@compiled
def _write_blocks(quadratics: Array, second: float, first: float, none: float, out: Array) -> None:
    """The Sylvester matrix with x^2, x and 1 replaced by these."""
    for i in range(ROWS):
        for j in range(ROWS):
            out[i, j] = 0.0
    for i in range(3):
        p = quadratics[i, 0] * none + quadratics[i, 1] * first + quadratics[i, 2] * second
        q = quadratics[3 + i, 0] * none + quadratics[3 + i, 1] * first + quadratics[3 + i, 2] * second
        out[0, i] = out[1, i + 1] = p
        out[2, i] = out[3, i + 1] = q
