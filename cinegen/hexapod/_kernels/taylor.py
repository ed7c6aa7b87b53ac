"""Paths of solutions, followed by Taylor series: quadratic equations in Study's coordinates whose coefficients change.

An unknown x = (c, d) is a pose up to a complex factor: 8 numbers, in the projective space P^7. The equations are linear
in 18 products of pairs of them (`_products`), and the coefficients are polynomials in the path's parameter: so the
derivatives of a path of any order follow from one factored matrix (`_series`), and the length of a step from the last
terms of the series (A. Jorba and M. Zou, "A software package for the numerical integration of ODEs by means of
high-order Taylor methods", 2005). Newton's method brings x back onto its path.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import boolean, complex128, float64, int64, typeof
from numpy.typing import NDArray

from cinegen.jit.compiled import Array, Table, compiled, entry, prepare, together
from cinegen.jit.vectors import add_multiple, copy, inner, swap

Complex = NDArray[np.complex128]

ORDER = 8
"""Order of the Taylor series."""

ARRIVED, NEAR, LOST = range(3)
"""States of a path: at the end of the parameter; near it, as steps became short; or neither."""

PRODUCTS = 18  # of pairs of unknowns: 10 of c with c, 6 of d with c (antisymmetric), <d, d> and <c, d>
LEGS = 16  # of them those that a leg's equation has coefficients for

_SHORTEST = 1e-13  # step
_CONTRACTION = 0.02  # of two Newton steps, or x may be moving to another path
_SURE = 1e-9  # a correction so small needs no proof
_HALVINGS = 8  # of a step, before the series is computed again


class TrackingScratch(NamedTuple):
    """Working memory of `follow` for one thread.

    Attributes:
        series: (ORDER + 1, 8) Taylor coefficients of x.
        products: (ORDER + 1, 18) of the products.
        coefficients: (3, 6, 16) Taylor coefficients of the equations' coefficients, at the path's parameter.
        at_end: (6, 16) the same at the end of the step.
        matrix: (8, 8) factors.
        rows: (8,) row permutation.
        x: (4, 8) vectors.
    """

    series: Complex
    products: Complex
    coefficients: Complex
    at_end: Complex
    matrix: Complex
    rows: Table
    x: Complex


def tracking_scratch() -> TrackingScratch:
    """Allocate working memory."""
    shapes = (ORDER + 1, 8), (ORDER + 1, PRODUCTS), (3, 6, LEGS), (6, LEGS), (8, 8), (4, 8)
    series, products, coefficients, at_end, matrix, x = (np.zeros(shape, dtype=complex) for shape in shapes)
    return TrackingScratch(series, products, coefficients, at_end, matrix, np.zeros(8, dtype=np.int64), x)


def prepare_tracking() -> None:
    """Compile these kernels, or load them from disk."""
    solutions, numbers, scratch = complex128[:, ::1], int64[::1], typeof(tracking_scratch())
    ends = complex128, complex128, solutions, numbers, numbers
    with together():
        prepare(follow, complex128[:, :, ::1], boolean, *ends, float64, float64, int64, scratch)
        prepare(polish, complex128[:, ::1], solutions, float64[::1], scratch)


@entry
def follow(
    family: Complex, quadratic: bool, begin: complex, end: complex, x: Complex, states: Table, steps: Table,
    tolerance: float, brink: float, max_steps: int, work: TrackingScratch,
) -> None:  # fmt: skip
    """Follow solutions while the parameter moves straight from `begin` to `end`.

    Args:
        family: (3, 6, 16) coefficients of the six legs' equations: a polynomial of degree 2 in the parameter.
        quadratic: whether more changes than the factor of <c, c>, linearly.
        begin: parameter.
        end: parameter.
        x: (n, 8) solutions at the beginning; replaced by the last points of their paths, of norm 1.
        states: (n,) ARRIVED, NEAR or LOST are written.
        steps: (n,) is increased by the number of steps.
        tolerance: of the prediction, in norms of x.
        brink: distance of the parameter from `end` within which a path that has not arrived is NEAR.
        max_steps: of a path.
        work: scratch.
    """
    span = end - begin
    for path in range(x.shape[0]):
        states[path] = LOST
        part = 0.0
        while steps[path] < max_steps:
            steps[path] += 1
            _series(family, begin, span, part, x[path], quadratic, work)
            onward = _step(family, begin, span, part, x[path], tolerance, work)
            if onward == part:
                break
            part = onward
            if part == 1.0:
                states[path] = ARRIVED
                break
            if (1.0 - part) * abs(span) <= brink:
                states[path] = NEAR
                break


@entry
def polish(coefficients: Complex, x: Complex, change: Array, work: TrackingScratch) -> None:
    """Apply Newton's method to fixed equations, until a step is no shorter than the one before.

    Args:
        coefficients: (6, 16) of the six legs' equations.
        x: (n, 8) approximate solutions; replaced.
        change: (n,) length of the last step, where |x| = 1: an estimate of the error of x.
        work: scratch.
    """
    dx = work.x[0]
    for path in range(x.shape[0]):
        y = x[path]
        change[path] = math.inf
        for _ in range(12):
            _normalise(y)
            _jacobian(coefficients, y, y, work)
            if not _factor(work.matrix, work.rows):
                break
            _correction(coefficients, y, dx, work)
            size = _norm(dx)
            if not size < change[path]:
                break
            change[path] = size
            for i in range(8):
                y[i] += dx[i]
        _normalise(y)


# --- along a path ---------------------------------------------------------------------------------------------------


@compiled
def _series(
    family: Complex, begin: complex, span: complex, part: float, x: Complex, quadratic: bool, work: TrackingScratch
) -> None:
    """Write the Taylor coefficients of x by the part of the path behind it; each is orthogonal to x, whose length is
    free."""
    series, products, a = work.series, work.products, work.coefficients
    parameter = begin + part * span
    for e in range(6):
        for m in range(LEGS):
            first, second = family[1, e, m], family[2, e, m]
            a[0, e, m] = family[0, e, m] + parameter * (first + parameter * second)
            a[1, e, m] = span * (first + 2.0 * parameter * second)
            a[2, e, m] = span * span * second
    copy(x, series[0], 8)
    products[:] = 0.0
    _products(x, x, 1.0, products[0])
    _jacobian(a[0], x, x, work)
    if not _factor(work.matrix, work.rows):
        for k in range(1, ORDER + 1):
            for i in range(8):
                series[k, i] = math.inf
        return
    right = work.x[3]
    for k in range(1, ORDER + 1):
        sums = products[k]
        for i in range(1, (k + 1) // 2):
            _products(series[i], series[k - i], 2.0, sums)
        if k % 2 == 0:
            _products(series[k // 2], series[k // 2], 1.0, sums)
        for e in range(6):
            s = inner(a[0, e], sums, LEGS)
            before = products[k - 1]
            if not quadratic:  # only lengths change, thus only the factor of <c, c>
                s += a[1, e, 0] * (before[0] + before[1] + before[2] + before[3])
            else:
                s += inner(a[1, e], before, LEGS)
                if k > 1:
                    s += inner(a[2, e], products[k - 2], LEGS)
            right[e] = -0.5 * s
        right[0] -= 0.5 * sums[16]
        right[6] = -0.5 * sums[17]
        right[7] = 0.0
        _solve(work.matrix, work.rows, right, series[k])
        _products(x, series[k], 2.0, sums)


@compiled
def _step(
    family: Complex, begin: complex, span: complex, part: float, x: Complex, tolerance: float, work: TrackingScratch
) -> float:
    """Take a step along the series; return the part of the path behind x then, `part` if no step succeeds."""
    series, at_end, y, dx, more = work.series, work.at_end, work.x[0], work.x[1], work.x[2]
    h: float = min(
        (tolerance / _norm(series[ORDER])) ** (1.0 / ORDER),
        (tolerance / _norm(series[ORDER - 1])) ** (1.0 / (ORDER - 1)),
    )
    for _ in range(_HALVINGS):
        if not h > _SHORTEST * (1.0 - part):
            return part
        onward = part + h
        if onward >= 1.0 - 1e-14:
            onward, h = 1.0, 1.0 - part
        copy(series[ORDER], y, 8)
        for k in range(ORDER - 1, -1, -1):
            for i in range(8):
                y[i] = y[i] * h + series[k, i]
        parameter = begin + onward * span
        for e in range(6):
            for m in range(LEGS):
                at_end[e, m] = family[0, e, m] + parameter * (family[1, e, m] + parameter * family[2, e, m])
        _jacobian(at_end, y, x, work)
        if _factor(work.matrix, work.rows):
            _correction(at_end, y, dx, work)
            for i in range(8):
                y[i] += dx[i]
            _correction(at_end, y, more, work)
            first, second = _norm(dx), _norm(more)
            if first < _SURE or (first <= 0.1 and second <= min(_CONTRACTION * first, 1e-6)):
                for i in range(8):
                    x[i] = y[i] + more[i]
                _normalise(x)
                return onward
        h *= 0.5
    return part


# --- the equations --------------------------------------------------------------------------------------------------


@compiled
def _products(x: Complex, y: Complex, factor: float, out: Complex) -> None:
    """Add the products of x and y, times a factor; with x = y an equation's left side is linear in them."""
    a0, a1, a2, a3 = factor * x[0], factor * x[1], factor * x[2], factor * x[3]
    e0, e1, e2, e3 = factor * x[4], factor * x[5], factor * x[6], factor * x[7]
    b0, b1, b2, b3 = y[0], y[1], y[2], y[3]
    f0, f1, f2, f3 = y[4], y[5], y[6], y[7]
    out[0] += a0 * b0
    out[1] += a1 * b1
    out[2] += a2 * b2
    out[3] += a3 * b3
    out[4] += a0 * b1 + a1 * b0
    out[5] += a0 * b2 + a2 * b0
    out[6] += a0 * b3 + a3 * b0
    out[7] += a1 * b2 + a2 * b1
    out[8] += a1 * b3 + a3 * b1
    out[9] += a2 * b3 + a3 * b2
    out[10] += e0 * b1 - e1 * b0 + f0 * a1 - f1 * a0
    out[11] += e0 * b2 - e2 * b0 + f0 * a2 - f2 * a0
    out[12] += e0 * b3 - e3 * b0 + f0 * a3 - f3 * a0
    out[13] += e1 * b2 - e2 * b1 + f1 * a2 - f2 * a1
    out[14] += e1 * b3 - e3 * b1 + f1 * a3 - f3 * a1
    out[15] += e2 * b3 - e3 * b2 + f2 * a3 - f3 * a2
    out[16] += e0 * f0 + e1 * f1 + e2 * f2 + e3 * f3
    out[17] += 0.5 * (a0 * f0 + a1 * f1 + a2 * f2 + a3 * f3 + b0 * e0 + b1 * e1 + b2 * e2 + b3 * e3)


@compiled
def _jacobian(a: Complex, x: Complex, patch: Complex, work: TrackingScratch) -> None:
    """Write half the derivatives of the seven equations at x, and below them the conjugate of `patch`.

    In the order of `_products`, the equations are, for e < 6, a_e0 c0^2 + .. + 2 a_e4 c0 c1 + .. + 2 a_e,10 (d0 c1 -
    d1 c0) + .. = 0, the first one with <d, d>; and <c, d> = 0 (see `cinegen.hexapod.study`). The last row keeps dx
    orthogonal to `patch`, since x counts up to a factor.

    Args:
        a: (6, 16) coefficients of the six legs' equations.
        x: (8,) Study's coordinates (c, d).
        patch: (8,).
        work: `matrix` (8, 8) is written.
    """
    c0, c1, c2, c3, d0, d1, d2, d3 = x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]
    j = work.matrix
    for e in range(6):
        r = a[e]
        j[e, 0] = r[0] * c0 + r[4] * c1 + r[5] * c2 + r[6] * c3 - r[10] * d1 - r[11] * d2 - r[12] * d3
        j[e, 1] = r[4] * c0 + r[1] * c1 + r[7] * c2 + r[8] * c3 + r[10] * d0 - r[13] * d2 - r[14] * d3
        j[e, 2] = r[5] * c0 + r[7] * c1 + r[2] * c2 + r[9] * c3 + r[11] * d0 + r[13] * d1 - r[15] * d3
        j[e, 3] = r[6] * c0 + r[8] * c1 + r[9] * c2 + r[3] * c3 + r[12] * d0 + r[14] * d1 + r[15] * d2
        j[e, 4] = r[10] * c1 + r[11] * c2 + r[12] * c3
        j[e, 5] = r[13] * c2 + r[14] * c3 - r[10] * c0
        j[e, 6] = r[15] * c3 - r[11] * c0 - r[13] * c1
        j[e, 7] = -r[12] * c0 - r[14] * c1 - r[15] * c2
    for i in range(4):
        j[0, 4 + i] += x[4 + i]
        j[6, i] = 0.5 * x[4 + i]
        j[6, 4 + i] = 0.5 * x[i]
    for i in range(8):
        j[7, i] = patch[i].conjugate()


@compiled
def _correction(a: Complex, x: Complex, dx: Complex, work: TrackingScratch) -> None:
    """Write Newton's step, with the present factors."""
    sums = work.products[ORDER]
    sums[:] = 0.0
    _products(x, x, -0.5, sums)
    right = work.x[3]
    for e in range(6):
        right[e] = inner(a[e], sums, LEGS)
    right[0] += sums[16]
    right[6] = sums[17]
    right[7] = 0.0
    _solve(work.matrix, work.rows, right, dx)


# --- eight linear equations -----------------------------------------------------------------------------------------


@compiled
def _factor(a: Complex, rows: Table) -> bool:
    """Factor a by Gauss' elimination with the largest pivot of a column, in place; the diagonal holds reciprocals."""
    for i in range(8):
        best, size = i, abs(a[i, i].real) + abs(a[i, i].imag)
        for other in range(i + 1, 8):
            its = abs(a[other, i].real) + abs(a[other, i].imag)
            if its > size:
                best, size = other, its
        if not size > 0.0:
            return False
        rows[i] = best
        if best != i:
            swap(a[i], a[best], 8)
        pivot = a[i, i]
        inverse = pivot.conjugate() * (1.0 / (pivot.real * pivot.real + pivot.imag * pivot.imag))
        a[i, i] = inverse
        for other in range(i + 1, 8):
            part = a[other, i] * inverse
            a[other, i] = part
            add_multiple(-part, a[i, i + 1 :], a[other, i + 1 :], 7 - i)
    return True


@compiled
def _solve(a: Complex, rows: Table, right: Complex, out: Complex) -> None:
    copy(right, out, 8)
    for i in range(8):
        other = rows[i]
        if other != i:
            out[i], out[other] = out[other], out[i]
    for i in range(8):
        out[i] -= inner(a[i], out, i)
    for i in range(7, -1, -1):
        out[i] = (out[i] - inner(a[i, i + 1 :], out[i + 1 :], 7 - i)) * a[i, i]


@compiled
def _norm(x: Complex) -> float:
    s = 0.0
    for i in range(8):
        s += x[i].real * x[i].real + x[i].imag * x[i].imag
    return math.sqrt(s)


@compiled
def _normalise(x: Complex) -> None:
    inverse = 1.0 / _norm(x)
    for i in range(8):
        x[i] *= inverse
