"""Newton's method and path tracking for the equations of linkages (`equations.py`), compiled.

There are more equations than are independent, and may be more unknowns too (a rod may rotate about itself): least
squares by Householder reflections with column pivoting, cut off at the known rank (Golub and Van Loan, Matrix
Computations, 5.4).
"""

from __future__ import annotations

import math

import numpy as np

from cinegen.assembly._kernels.equations import go_to, write_equations
from cinegen.assembly._kernels.tables import (
    ARRIVED,
    COLUMN,
    INFINITE,
    IS_PRISMATIC,
    LOST,
    SINGULAR,
    Complex,
    LinkageScratch,
    LinkageTables,
    ParameterPath,
)
from cinegen.jit.compiled import Array, Table, compiled, entry
from cinegen.jit.vectors import add_multiple, copy, swap

_FAR = 6.0  # imaginary part of an angle (radians), logarithm of a length: beyond it a path ends at infinity
_SMALLEST = 1e-9  # step along a path
_MAX_STEPS = 3000
_CLOSE = 1e-6  # Newton's last step along a path: what is left then is of its square's size
_SINGULAR = 1e-8  # smallest pivot over the largest
_CLOSED = 1e-11  # residual
_ROUNDED = 1e-9  # ... which can't get smaller for rounding


@compiled
def solve(matrix: Complex, columns: int, right: Complex, rank: int, order: Table, step: Complex) -> float:
    """Write step (columns,) with sum(matrix[c] * step[c]) = right in least squares; both are overwritten.

    Householder reflections, columns pivoted; unknowns beyond the rank stay 0. Return the smallest over the largest
    pivot: 0 if the matrix is singular.

    Args:
        matrix: (., rows) the columns, one after the other, of which the first count.
        columns: number of unknowns.
        right: (rows,).
        rank: of the matrix.
        order: (columns,) scratch.
        step: the result.
    """
    rows = len(right)
    for j in range(columns):
        order[j] = j
        step[j] = 0.0
    largest = smallest = 0.0
    for j in range(rank):
        best, chosen = -1.0, j
        for c in range(j, columns):
            square = 0.0
            for i in range(j, rows):
                square += matrix[c, i].real ** 2 + matrix[c, i].imag ** 2
            if square > best:
                best, chosen = square, c
        if chosen != j:
            swap(matrix[j], matrix[chosen], rows)
            order[j], order[chosen] = order[chosen], order[j]
        smallest = math.sqrt(best)
        if j == 0:
            largest = smallest
        if not smallest > 1e-15 * largest:
            return 0.0
        pivot = matrix[j, j]
        size = abs(pivot)
        alpha = -smallest * (pivot / size if size > 0.0 else 1.0 + 0.0j)
        matrix[j, j] = pivot - alpha  # the reflection's vector is in the column now
        factor = 1.0 / (smallest * (smallest + size))  # 2 over its squared length
        for c in range(j + 1, columns):
            _reflect(matrix[j], matrix[c], j, factor)
        _reflect(matrix[j], right, j, factor)
        matrix[j, j] = alpha
    for j in range(rank - 1, -1, -1):
        value = right[j]
        for c in range(j + 1, rank):
            value -= matrix[c, j] * step[order[c]]
        step[order[j]] = value / matrix[j, j]
    return smallest / largest if largest > 0.0 else 0.0


@compiled
def _reflect(normal: Complex, column: Complex, first: int, factor: float) -> None:
    """Reflect a column at the plane normal to a vector, from a row on."""
    total = 0.0j
    for i in range(first, len(column)):
        total += normal[i].conjugate() * column[i]
    total *= factor
    add_multiple(-total, normal[first:], column[first:], len(column) - first)


@compiled
def _size(tables: LinkageTables, step: Complex, x: Complex) -> float:
    """Return the largest part of a step (k + 1,) from x: of angles in radians, of lengths and t relative to their own
    size."""
    last = len(x) - 1
    size: float = abs(step[last]) / (1.0 + abs(x[last]))
    for k in range(len(tables.joints)):
        column = tables.joints[k, COLUMN]
        if column < last:
            scale = 1.0 + abs(x[column]) if tables.joints[k, IS_PRISMATIC] == 1 else 1.0
            size = max(size, abs(step[column]) / scale)
    return size


@compiled
def _newton(
    tables: LinkageTables, algebraic: bool, max_steps: int, enough: float, x: Complex, scratch: LinkageScratch
) -> tuple[float, float]:
    """Apply Newton's method from x, in place, until a step is shorter than `enough`. Return the size of the first step,
    infinite if it does not converge, and the smallest pivot over the largest."""
    step, pivot = scratch.stages[5], 0.0
    first = before = np.inf
    for k in range(max_steps):
        write_equations(tables, x, algebraic, scratch)
        pivot = solve(scratch.matrix, len(x), scratch.residual, tables.rank, scratch.order, step)
        size = _size(tables, step, x)
        for i in range(len(x)):
            x[i] -= step[i]
        if k == 0:
            first = size
        if not size < 1e6 or pivot == 0.0:
            return np.inf, pivot
        if size < enough:
            return first, pivot
        if k > 0 and size > 0.5 * before:
            return (first if size < _ROUNDED else np.inf), pivot
        before = size
    return (first if before < 100.0 * enough else np.inf), pivot


@compiled
def _tangent(
    tables: LinkageTables, path: ParameterPath, s: float, x: Complex, scratch: LinkageScratch, out: Complex
) -> None:
    """Write out = dx/ds at x and s."""
    go_to(path, s, scratch)
    write_equations(tables, x, path.algebraic, scratch)
    residual, columns, count = scratch.residual, len(x), 3 * tables.features
    row, t = len(residual) - 1, x[columns - 1]
    for i in range(row + 1):
        residual[i] = 0.0
        for k in range(len(scratch.line)):
            a, b = path.lines[1, k, 0] - path.lines[0, k, 0], path.lines[1, k, 1] - path.lines[0, k, 1]
            residual[i] -= scratch.matrix[columns + k, i] * (a + b * t)
    for f in range(tables.features):
        for i in range(3):
            residual[row] -= (path.slices[1, 3 * f + i] - path.slices[0, 3 * f + i]) * scratch.vectors[f, i]
    residual[row] -= (path.slices[1, count] - path.slices[0, count]) * t
    residual[row] += path.slices[1, count + 1] - path.slices[0, count + 1]
    solve(scratch.matrix, columns, residual, tables.rank, scratch.order, out)


@compiled
def _is_far(tables: LinkageTables, x: Complex) -> bool:
    """Return whether a solution diverges to infinity."""
    last = len(x) - 1
    far = math.log(1.0 + abs(x[last]))
    for k in range(len(tables.joints)):
        column = tables.joints[k, COLUMN]
        if column < last:
            prismatic = tables.joints[k, IS_PRISMATIC] == 1
            far = max(far, math.log(1.0 + abs(x[column])) if prismatic else abs(x[column].imag))
    return far > _FAR


@compiled
def _track(tables: LinkageTables, path: ParameterPath, x: Complex, scratch: LinkageScratch, record: Array) -> int:
    """Continue one solution x along the whole path, in place; return how that ends.

    Runge and Kutta's fourth order, then Newton's method, whose first correction is the error by which the next step's
    length is chosen.
    """
    stages = scratch.stages
    slope, other, total, point = stages[0], stages[1], stages[2], stages[3]
    s, h, n, steps, fresh = 0.0, 0.05, len(x), 0, False
    while s < 1.0:
        steps += 1
        if not fresh:
            _tangent(tables, path, s, x, scratch, slope)
            fresh = True
        h = min(h, 1.0 - s)
        for i in range(n):
            total[i] = slope[i]
            point[i] = x[i] + 0.5 * h * slope[i]
        for stage in range(3):
            _tangent(tables, path, s + (h if stage == 2 else 0.5 * h), point, scratch, other)
            for i in range(n):
                total[i] += other[i] * (1.0 if stage == 2 else 2.0)
                point[i] = x[i] + (h if stage == 1 else 0.5 * h) * other[i]
        for i in range(n):
            total[i] *= h / 6.0
            point[i] = x[i] + total[i]
        error, pivot, reached = np.inf, 0.0, 1.0 if h >= 1.0 - s else s + h
        if _size(tables, total, x) < 1.0:
            enough = _CLOSE if reached < 1.0 else 1e-2 * _ROUNDED
            error, pivot = _newton(tables, path.algebraic, 5, enough, point, scratch)
        better = min(max(0.9 * (path.accuracy / max(error, 1e-14)) ** 0.2, 0.3), 2.0) if error < 1e3 else 0.3
        if error <= 10.0 * path.accuracy:
            s = reached
            copy(point, x, n)
            record[0] = pivot
            fresh = False
        else:
            better = min(better, 0.5)
        h *= better
        record[1] = steps
        if s < 1.0 and (h < _SMALLEST * (1.0 - s) + 1e-14 or steps > _MAX_STEPS or 1.0 - s < _SMALLEST):
            return INFINITE if _is_far(tables, x) else (SINGULAR if s > 0.99 else LOST)
    return ARRIVED


@entry
def track(
    tables: LinkageTables, path: ParameterPath, solutions: Complex, ends: Table, records: Array,
    scratch: LinkageScratch,
) -> None:  # fmt: skip
    """Continue many solutions (count, k + 1) along a path, in place; write how each ends (count,), and records (count,
    2): the smallest pivot at the end over the largest, and the number of steps."""
    for k in range(len(solutions)):
        ends[k] = _track(tables, path, solutions[k], scratch, records[k])


@entry
def solve_from(
    tables: LinkageTables, path: ParameterPath, solutions: Complex, ends: Table, scratch: LinkageScratch
) -> None:
    """Apply Newton's method at the beginning of a path to many guesses (count, k + 1), in place, with limited steps.

    ends: ARRIVED if it converges, SINGULAR if it does to a singular solution, else LOST.
    """
    step = scratch.stages[5]
    for k in range(len(solutions)):
        x = solutions[k]
        ends[k] = LOST
        settled = False
        go_to(path, 0.0, scratch)
        for _ in range(60):
            write_equations(tables, x, path.algebraic, scratch)
            gap = size = 0.0
            for i in range(len(scratch.residual)):
                gap = max(gap, abs(scratch.residual[i]))
            pivot = solve(scratch.matrix, len(x), scratch.residual, tables.rank, scratch.order, step)
            if gap < _CLOSED and not pivot > _SINGULAR:  # a step would be as long as rounding makes it
                ends[k] = SINGULAR
                break
            for i in range(len(x)):
                size = max(size, abs(step[i]))
            if pivot == 0.0 or not size < 1e9:
                break
            part = min(1.0, 0.7 / max(size, 1e-300))
            add_multiple(-part, step, x, len(x))
            if size < 1e-11:
                if gap < _CLOSED:
                    ends[k] = ARRIVED
                if gap < _CLOSED or settled:  # the gap is that before the step
                    break
                settled = True
