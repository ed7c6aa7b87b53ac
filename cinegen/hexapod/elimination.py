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

import numpy as np
from numpy.polynomial import Polynomial

from cinegen.arrays import Array, Bools, Complex

SOLUTIONS = 16
PLANAR_DEGREE, SPATIAL_DEGREE = 2, 4
"""Degrees of the matrix polynomials, in tan^2(p34 / 2) and in tan(p34 / 2)."""

_ZERO = 1e-13  # least singular value of the leading matrix if the determinant vanishes identically
_HIGH, _LOW = np.array([[1, 2], [2, 2]]), np.array([[0, 0], [0, 1]])  # powers in the minors of Bezout's matrix
_ROW, _COLUMN = np.indices((4, 4))
_ODD = np.array([0, 1, 1, 0])  # powers of y in rows and columns, for base points in one plane


def eigen_directions(tangents: Array, planar: bool) -> tuple[Complex, Bools]:
    """Compute exp(i p34) of all solutions for m sets of leg lengths.

    Planar base points: 8 values, each for a pair of mirror images, whose other one has the inverse value. Else 16.
    Solutions at infinity have values near 0 or very large ones.

    Args:
        tangents: (m, 3, 3, 3) K, L, M by powers of the tangents of half of their two angles.
        planar: whether base points are in one plane.

    Returns:
        values (m, 8) or (m, 16), NaN where the eigenvalues did not converge; and (m,) whether the determinant vanishes
        identically, where values mean nothing.
    """
    rotations, mapped = _PLANAR if planar else _SPATIAL
    sets, degree = np.arange(len(tangents)), len(mapped[0]) - 1
    blocks = bezout(tangents)
    blocks[~np.isfinite(blocks).all(axis=(1, 2, 3))] = 0.0  # overflow counts as a determinant that vanishes
    if planar:  # coefficients by powers of y^2; power -1, like 5, is 0
        padded = np.concatenate([blocks, np.zeros_like(blocks[:, :1])], axis=1)
        powers = 2 * np.arange(degree + 1)[:, None, None] + _ODD[_ROW] - _ODD[_COLUMN]
        blocks = padded[:, powers, _ROW, _COLUMN]
    shape = len(tangents), len(mapped), degree + 1, 4, 4
    coefficients = (mapped.reshape(-1, degree + 1) @ blocks.reshape(-1, degree + 1, 16)).reshape(shape)
    least = np.linalg.svd(coefficients[:, :, degree], compute_uv=False)[..., -1]
    pole = least.argmax(axis=1)  # the one with the most regular leading matrix
    vanishes, chosen = least[sets, pole] <= _ZERO, coefficients[sets, pole]
    chosen[vanishes] = np.eye(4)
    rest = np.moveaxis(chosen[:, degree - 1 :: -1], 1, 2).reshape(-1, 4, 4 * degree)
    companions = np.tile(np.eye(4 * degree, k=-4), (len(tangents), 1, 1))
    companions[:, :4] = -np.linalg.solve(chosen[:, degree], rest)
    y, (c, s) = _eigenvalues(companions), rotations[:, pole, None]
    with np.errstate(all="ignore"):  # infinity, and what did not converge
        above, below = c * y - s, s * y + c
        if planar:
            above, below = np.sqrt(above), np.sqrt(below)
        return (below + 1j * above) / (below - 1j * above), vanishes


def bezout(tangents: Array) -> Array:
    """Return the coefficients (..., 5, 4, 4) of A by powers of y, from K, L, M (..., 3, 3, 3)."""
    first, second, third = np.moveaxis(tangents, -3, 0)
    of_x = _minors(np.swapaxes(first, -1, -2)[..., :, None, :], np.swapaxes(second, -1, -2)[..., None, :, :])
    of_z = _minors(np.moveaxis(of_x, -3, -1)[..., None, :, :, :, :], third[..., :, None, None, None, :])
    terms = np.moveaxis(of_z, (-2, -1), (-4, -2)).reshape(*of_z.shape[:-4], 4, 4)
    blocks = np.zeros((*terms.shape[:-4], SPATIAL_DEGREE + 1, 4, 4))
    for power in range(3):
        blocks[..., power : power + 3, :, :] += terms[..., power, :, :, :]
    return blocks


def _minors(first: Array, second: Array) -> Array:
    """Return Bezout's matrices (..., 2, 2) of quadratics (..., 3)."""
    return first[..., _HIGH] * second[..., _LOW] - first[..., _LOW] * second[..., _HIGH]


def _eigenvalues(matrices: Array) -> Complex:
    """Return the eigenvalues (m, n) of (m, n, n): NaN for a matrix where LAPACK does not converge, or not finite."""
    try:
        return np.linalg.eigvals(matrices).astype(complex)
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full(matrices.shape[:2], np.nan, dtype=complex)
        return np.concatenate([_eigenvalues(matrix[None]) for matrix in matrices])


def _poles(degree: int, first: float, step: float) -> tuple[Array, Array]:
    """Return cosines and sines (2, 4) of four maps x = (c y - s) / (s y + c), where y is infinite at x = c / s;
    and (4, degree + 1, degree + 1) the coefficients of y^n (rows) in (c y - s)^k (s y + c)^(degree - k)."""
    angles = first + step * np.arange(4)
    rotations, mapped = np.array([np.cos(angles), np.sin(angles)]), []
    for c, s in rotations.T:
        above, below = Polynomial([-s, c]), Polynomial([c, s])
        mapped.append(np.stack([(above**k * below ** (degree - k)).coef for k in range(degree + 1)], axis=1))
    return rotations, np.array(mapped)


_SPATIAL = _poles(SPATIAL_DEGREE, 0.2, 0.785)
_PLANAR = _poles(PLANAR_DEGREE, 1.76, 0.39)  # squares of real tangents are not negative
