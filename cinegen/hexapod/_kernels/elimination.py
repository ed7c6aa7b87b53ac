"""Merlet's elimination: from the three distances of a platform triangle to its angles p34, as an eigenvalue problem.

A distance is u.Q v with u = (1, cos, sin) of one of its two angles and v of the other: K contains p12 and p34, L p12
and p56, M p34 and p56 (`TSSM.circles`, equations 20-22 of J-P. Merlet, "Symbolic computation for the determination of
the minimal direct kinematics polynomial and the singular configurations of parallel manipulators"). Eliminating p12 and
p56 leaves a 4x4 matrix, polynomial in one unknown, whose determinant vanishes at every solution. The determinant is
never expanded (its coefficients would hold the roots to 1e-9 at best): the eigenvalues of the matrix polynomial are
computed.

With x, y, z the tangents of half of p12, p34, p56 the distances are K(x, y), L(x, z), M(y, z), of degree 2 in each.
Bezout's matrix of K and L in x, (2, 2), is a quadratic in z; its Bezout matrix with M, by blocks,

    A = [B1 m0 - B0 m1   B2 m0 - B0 m2]      Bj = [k1 l0j - k0 l1j   k2 l0j - k0 l2j]
        [B2 m0 - B0 m2   B2 m1 - B1 m2]           [k2 l0j - k0 l2j   k2 l1j - k1 l2j]

is of degree 4 in y: ki and mj are quadratics in y, lij numbers. Three such equations have 16 solutions (Bezout's number
in three projective lines), so none of the 16 eigenvalues is extraneous.

With base points in one plane a solution and its mirror image have the same y^2. Then the second and third row and
column of A are odd in y where others are even: with these columns times y, and these rows through y, A is a quadratic
in y^2 with 8 eigenvalues, each for a solution and its mirror image.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.hexapod._kernels.eigenvalues import ROWS, eigenvalues, reduce
from cinegen.jit.compiled import Array, compiled

SOLUTIONS = 16
PLANAR_DEGREE, SPATIAL_DEGREE = 2, 4
"""Degrees of the matrix polynomials, in tan^2(p34 / 2) and in tan(p34 / 2)."""

_POLES = 4  # values that may be mapped to infinity: the one with the most regular leading matrix is taken


class EliminationScratch(NamedTuple):
    """Working memory for one set of leg lengths."""

    blocks: Array
    powers: Array
    wide: Array
    matrix: Array
    eigenvalues: Array
    choice: NDArray[np.complex128]
    newton: NDArray[np.complex128]


def elimination_scratch() -> EliminationScratch:
    """Allocate working memory for `roots.find_roots`."""
    padded, degrees = SOLUTIONS + 1, SPATIAL_DEGREE + 1
    shapes = (degrees, ROWS, ROWS), (degrees, degrees), (ROWS, ROWS * degrees), (padded, padded), (2, SOLUTIONS)
    choice, newton = (np.empty(shape, dtype=complex) for shape in ((5, 3), (6, 3)))
    blocks, powers, wide, matrix, found = (np.zeros(shape) for shape in shapes)
    return EliminationScratch(blocks, powers, wide, matrix, found, choice, newton)


@compiled
def eigen_directions(
    tangents: Array, planar: bool, blocks: Array, powers: Array, wide: Array, matrix: Array, found: Array
) -> float:
    """Write exp(i p34) of all solutions to found (2, 16), as real and imaginary parts.

    Planar base points: 8 values, each for a pair of mirror images, whose other one has the inverse value. Else 16.
    Solutions at infinity have values near 0 or very large ones.

    Args:
        tangents: (3, 3, 3) K, L, M by powers of the tangents of half of their two angles.
        planar: whether base points are in one plane.
        blocks: and the following: see `EliminationScratch`.

    Returns:
        how far the determinant is from vanishing identically: the least pivot of the best leading matrix; negative if
        the eigenvalues did not converge.
    """
    degree = PLANAR_DEGREE if planar else SPATIAL_DEGREE
    write_bezout(tangents, blocks)
    if planar:
        _fold(blocks)
    # x = (c y - s) / (s y + c), where y is infinite at x = c / s; squares of real tangents are not negative
    c, s, regular = 0.0, 0.0, -1.0
    for trial in range(_POLES):
        angle = 1.76 + 0.39 * trial if planar else 0.2 + 0.785 * trial
        d, t = math.cos(angle), math.sin(angle)
        for k in range(degree + 1):
            powers[degree, k] = d**k * t ** (degree - k)
        _write_coefficient(blocks, powers[degree], degree, 0, wide)
        least = reduce(wide, ROWS, ROWS)
        if least > regular:
            c, s, regular = d, t, least
    if regular == 0.0:
        return 0.0
    _write_powers(c, s, degree, powers)
    for power in range(degree + 1):
        _write_coefficient(blocks, powers[power], degree, ROWS * (degree - power), wide)
    _write_companion(wide, degree, matrix)
    if not eigenvalues(matrix, ROWS * degree, found):
        return -1.0
    for i in range(ROWS * degree):
        y = complex(found[0, i], found[1, i])
        above, below = c * y - s, s * y + c
        if planar:
            above, below = complex(np.sqrt(above)), complex(np.sqrt(below))
        w = (below + 1j * above) / (below - 1j * above) if below != 1j * above else complex(1e300)
        found[0, i], found[1, i] = w.real, w.imag
    return regular


@compiled
def write_bezout(tangents: Array, blocks: Array) -> None:
    """Write the coefficients (5, 4, 4) of A by powers of y."""
    K, L, M = tangents[0], tangents[1], tangents[2]
    blocks[:] = 0.0
    for i in range(ROWS):
        for j in range(ROWS):
            high, low = (2, 0) if i // 2 != j // 2 else (i // 2 + 1, i // 2)
            left, right = (2, 0) if i % 2 != j % 2 else (i % 2 + 1, i % 2)
            for p in range(3):
                one = K[left, p] * L[right, high] - K[right, p] * L[left, high]
                two = K[left, p] * L[right, low] - K[right, p] * L[left, low]
                for q in range(3):
                    blocks[p + q, i, j] += one * M[q, low] - two * M[q, high]


@compiled
def _fold(blocks: Array) -> None:
    """Replace the coefficients by powers of y by those by powers of y^2, for base points in one plane."""
    for i in range(ROWS):
        for j in range(ROWS):
            shift = (j == 1 or j == 2) - (i == 1 or i == 2)
            for power in range(PLANAR_DEGREE + 1):
                n = 2 * power - shift
                blocks[power, i, j] = blocks[n, i, j] if 0 <= n <= SPATIAL_DEGREE else 0.0


@compiled
def _write_powers(c: float, s: float, degree: int, powers: Array) -> None:
    """Write powers[n, k], the coefficient of y^n in (c y - s)^k (s y + c)^(degree - k)."""
    powers[:] = 0.0
    for k in range(degree + 1):
        powers[0, k] = 1.0
        for n in range(degree):
            a, b = (c, -s) if n < k else (s, c)
            for p in range(n + 1, 0, -1):
                powers[p, k] = b * powers[p, k] + a * powers[p - 1, k]
            powers[0, k] *= b


@compiled
def _write_coefficient(blocks: Array, weights: Array, degree: int, column: int, wide: Array) -> None:
    """Write the weighted sum of all blocks to columns of wide (4, .), from `column` on."""
    for i in range(ROWS):
        for j in range(ROWS):
            total = 0.0
            for k in range(degree + 1):
                total += weights[k] * blocks[k, i, j]
            wide[i, column + j] = total


@compiled
def _write_companion(wide: Array, degree: int, matrix: Array) -> None:
    """Write the block companion matrix of coefficients in wide, the highest first; its eigenvalues are the roots of the
    determinant."""
    size = ROWS * degree
    reduce(wide, ROWS, ROWS + size)
    for i in range(size):
        for j in range(size):
            matrix[i, j] = -wide[i, ROWS + j] if i < ROWS else (1.0 if j == i - ROWS else 0.0)
