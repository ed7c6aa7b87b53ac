"""Matrices of balls."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nextafter
from typing import Any

from flint import arb, arb_mat


class CertificateError(Exception):
    """A claim that is not confirmed; `box` is the number of the box that it is about, if it is about one."""

    box: int | None = None


def absolute(m: arb_mat) -> arb_mat:
    """Return absolute values."""
    return arb_mat(m.nrows(), m.ncols(), [abs(x) for x in m.entries()])


def added_sizes(matrices: Sequence[arb_mat]) -> arb_mat:
    """Return the sums of absolute values of matrices: products with [-1, 1] have these as radii, which add up."""
    return radii(added([m * arb(0, 1) for m in matrices]))


def radii(m: arb_mat) -> arb_mat:
    """Return the radii."""
    return arb_mat(m.nrows(), m.ncols(), [x.rad() for x in m.entries()])


def row_sums(m: arb_mat) -> arb_mat:
    """Return the sums of absolute values of rows."""
    return absolute(m) * arb_mat(m.ncols(), 1, [1] * m.ncols())


def pick(rows: Sequence[Sequence[arb]], at: Sequence[int], columns: Sequence[int]) -> arb_mat:
    """Return some rows and columns."""
    return arb_mat(len(at), len(columns), [rows[i][j] for i in at for j in columns])


def column(values: Sequence[Any]) -> arb_mat:
    """Return a matrix of one column."""
    return arb_mat(len(values), 1, list(values))


def identity(n: int) -> arb_mat:
    """Return the identity."""
    return arb_mat(n, n, [int(i % (n + 1) == 0) for i in range(n * n)])


def doubles(m: arb_mat) -> arb_mat:
    """Return the matrix rounded to doubles, which processes can exchange."""
    return arb_mat(m.nrows(), m.ncols(), [float(x) for x in m.entries()])


def inverse(m: arb_mat) -> arb_mat:
    """Return an approximation of the inverse, of doubles."""
    try:
        return doubles(m.mid().inv())
    except ZeroDivisionError:
        raise CertificateError("a matrix is singular") from None


def upper(m: arb_mat) -> arb_mat:
    """Return doubles that are no less."""
    return arb_mat(m.nrows(), m.ncols(), [nextafter(float(x.upper()), inf) for x in m.entries()])


def added(matrices: Sequence[arb_mat]) -> arb_mat:
    """Return the sum of matrices."""
    return sum(matrices[1:], matrices[0])


def norms(parts: Sequence[arb_mat], squarings: int = 3) -> tuple[arb, arb]:
    """Return the largest singular value of matrices one above the other, from below and above: |M|^2 is at most the
    largest sum of a row of |(M^T M)^(2^k)|, to the power 2^-k; one of its columns is near the direction."""
    power = gram = added([m.transpose() * m for m in parts])
    if not any(gram[i, i] != 0 for i in range(gram.nrows())):
        return arb(0), arb(0)
    for _ in range(squarings):
        power = power * power
    sums = [x.upper() for x in row_sums(power).entries()]
    t = power.mid() * column([int(x == max(sums)) for x in sums])
    size = (t.transpose() * t)[0, 0]
    low = ((t.transpose() * gram * t)[0, 0] / size).lower() if size > 0 else arb(0)
    return low.sqrt().lower() if low > 0 else arb(0), max(sums).root(2 ** (squarings + 1)).upper()


def frobenius(parts: Sequence[arb_mat]) -> arb:
    """Return the Frobenius norm of matrices one above the other, from above."""
    row = arb_mat([[x for m in parts for x in m.entries()]])
    return (row * row.transpose())[0, 0].upper().sqrt()
