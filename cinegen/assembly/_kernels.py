"""Loops of a linkage in complex numbers: their equations, Newton's method and path tracking, compiled.

Joint values may be complex: angles enter through sine and cosine, which are analytic, so that a solution can be
continued around branch points and through all of its companions. The unknowns are the values of the passive joints and
one more, t: a locked joint's value is A + B t, and a last equation, the slice, selects a point of this line,

    alpha . F(x) + beta t - gamma = 0                                                                              (1)

with F the linkage's features (points and directions of its bodies). With alpha = 0, beta = 1 and gamma = 0 it is t = 0:
locked joints are at A. A path changes A, B, alpha, beta, gamma along straight lines.

Equations of the loops are differences of vectors attached to two bodies (points, axes), and products of an axis with
such a difference, for prismatic joints. There are more equations than are independent, and may be more unknowns too (a
rod may rotate about itself): least squares by Householder reflections with column pivoting, cut off at the known rank
(Golub and Van Loan, Matrix Computations, 5.4).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.jit.compiled import Array, Table, compiled, entry
from cinegen.jit.vectors import add_multiple, copy, swap

Complex = NDArray[np.complex128]
Vector = tuple[complex, complex, complex]

PARENT, IS_PRISMATIC, COLUMN = range(3)
"""Columns of `LinkageTables.joints`."""

BODY, IS_DIRECTION = range(2)
"""Columns of `LinkageTables.vectors`."""

ARRIVED, SINGULAR, INFINITE, LOST = 1, 2, 3, 4
"""How a path ends."""

_FAR = 6.0  # imaginary part of an angle (radians), logarithm of a length: beyond it a path ends at infinity
_SMALLEST = 1e-9  # step along a path
_MAX_STEPS = 3000
_CLOSE = 1e-6  # Newton's last step along a path: what is left then is of its square's size
_SINGULAR = 1e-8  # smallest pivot over the largest
_CLOSED = 1e-11  # residual
_ROUNDED = 1e-9  # ... which can't get smaller for rounding


class LinkageTables(NamedTuple):
    """A linkage, dimensionless: lengths are divided by the characteristic length. n joints, c attached vectors.

    Attributes:
        joints: (n, 3) parent body, whether it is prismatic, column: that of a passive joint among the k unknowns, or
            k + 1 plus the number of a locked joint.
        constants: (n, 15) placement in the parent (rotation row by row, translation), axis.
        above: (n + 1, n) whether a joint moves a body; body 0 is the base, body i + 1 is moved by joint i.
        vectors: (c, 2) body, and whether the vector is a direction (else a point); the features first.
        local: (c, 3) the vectors in their bodies' axes.
        differences: (d, 2) vectors that coincide: 3 equations each.
        products: (p, 3) a direction, and two points whose difference is normal to it: 1 equation each.
        features: number of features.
        rank: of all equations by all unknowns, the slice and t included.
    """

    joints: Table
    constants: Array
    above: Table
    vectors: Table
    local: Array
    differences: Table
    products: Table
    features: int
    rank: int


class ParameterPath(NamedTuple):
    """Parameters that change from a first value to a second.

    Attributes:
        lines: (2, locked, 2) A and B.
        slices: (2, 3 f + 2) alpha, beta, gamma.
        algebraic: whether A + B t is tan(theta / 2) of a locked revolute joint, not theta.
        accuracy: target error of a prediction (radians, characteristic lengths).
    """

    lines: Complex
    slices: Complex
    algebraic: bool
    accuracy: float


class LinkageScratch(NamedTuple):
    """Working memory for one thread, k passive joints.

    Attributes:
        line: (locked, 2).
        slice: (3 f + 2,).
        bodies: (n + 1, 5, 3) rotation, position, joint axis.
        vectors: (c, 3).
        matrix: (k + 1 + locked, rows) derivatives by the passive joints, t, and the locked joints' A + B t.
        residual: (rows,).
        order: (k + 1,).
        stages: (6, k + 1).
    """

    line: Complex
    slice: Complex
    bodies: Complex
    vectors: Complex
    matrix: Complex
    residual: Complex
    order: Table
    stages: Complex


# --- equations --------------------------------------------------------------------------------------------------------


@compiled
def _rotate(axis: Array, c: complex, s: complex, placement: Array, parent: Complex, out: Complex) -> None:
    """Write out (3, 3) = parent times the constant rotation placement (12,) times a rotation about axis."""
    for i in range(3):
        for j in range(3):
            out[i, j] = parent[i, 0] * placement[j] + parent[i, 1] * placement[3 + j] + parent[i, 2] * placement[6 + j]
    x, y, z = axis[0], axis[1], axis[2]
    v = 1.0 - c
    for i in range(3):
        a, b, d = out[i, 0], out[i, 1], out[i, 2]
        out[i, 0] = a * (c + x * x * v) + b * (x * y * v + z * s) + d * (x * z * v - y * s)
        out[i, 1] = a * (x * y * v - z * s) + b * (c + y * y * v) + d * (y * z * v + x * s)
        out[i, 2] = a * (x * z * v + y * s) + b * (y * z * v - x * s) + d * (c + z * z * v)


@compiled
def _half(tangent: complex) -> complex:
    """Return cos(theta / 2) squared, from tan(theta / 2)."""
    below = 1.0 + tangent * tangent
    return 1.0 / below if abs(below) > 1e-200 else 1e200 + 0.0j


@compiled
def _place(tables: LinkageTables, x: Complex, algebraic: bool, scratch: LinkageScratch) -> None:
    """Write the placements of all bodies and the attached vectors, for x (k + 1,)."""
    joints, constants, line, bodies = tables.joints, tables.constants, scratch.line, scratch.bodies
    last = len(x) - 1
    bodies[0] = 0.0
    bodies[0, 0, 0] = bodies[0, 1, 1] = bodies[0, 2, 2] = 1.0
    for k in range(len(joints)):
        parent, here, column = bodies[joints[k, PARENT]], bodies[k + 1], joints[k, COLUMN]
        locked = column - last - 1
        value = line[locked, 0] + line[locked, 1] * x[last] if locked >= 0 else x[column]
        prismatic = joints[k, IS_PRISMATIC] == 1
        if prismatic:
            c, s = 1.0 + 0.0j, 0.0j
        elif locked >= 0 and algebraic:
            half = _half(value)
            c, s = half * (1.0 - value * value), half * 2.0 * value
        else:
            c, s = np.cos(value), np.sin(value)
        _rotate(constants[k, 12:15], c, s, constants[k, :9], parent[:3], here[:3])
        for i in range(3):
            x0, x1, x2 = constants[k, 9], constants[k, 10], constants[k, 11]
            here[3, i] = parent[3, i] + parent[i, 0] * x0 + parent[i, 1] * x1 + parent[i, 2] * x2
            here[4, i] = here[i, 0] * constants[k, 12] + here[i, 1] * constants[k, 13] + here[i, 2] * constants[k, 14]
        if prismatic:
            add_multiple(value, here[4], here[3], 3)
    for v in range(len(tables.vectors)):
        body, local = bodies[tables.vectors[v, BODY]], tables.local[v]
        for i in range(3):
            vector = body[i, 0] * local[0] + body[i, 1] * local[1] + body[i, 2] * local[2]
            scratch.vectors[v, i] = vector if tables.vectors[v, IS_DIRECTION] == 1 else vector + body[3, i]


@compiled
def _rate(body: Complex, prismatic: bool, at: Complex, direction: bool) -> Vector:
    """Return the velocity of an attached vector when the joint of a body moves."""
    axis, origin = body[4], body[3]
    if prismatic:
        return (0.0j, 0.0j, 0.0j) if direction else (axis[0], axis[1], axis[2])
    a, b, d = at[0], at[1], at[2]
    if not direction:
        a, b, d = a - origin[0], b - origin[1], d - origin[2]
    return axis[1] * d - axis[2] * b, axis[2] * a - axis[0] * d, axis[0] * b - axis[1] * a


@compiled
def _add(tables: LinkageTables, scratch: LinkageScratch, v: int, weight: Vector, row: int, stride: int) -> None:
    """Add the derivatives of an attached vector's components, times weights, to rows `row`, `row` + `stride`, ..."""
    joints, above = tables.joints, tables.above[tables.vectors[v, BODY]]
    for k in range(len(joints)):
        if above[k]:
            prismatic, direction = joints[k, IS_PRISMATIC] == 1, tables.vectors[v, IS_DIRECTION] == 1
            rate, column = _rate(scratch.bodies[k + 1], prismatic, scratch.vectors[v], direction), joints[k, COLUMN]
            for i in range(3):
                scratch.matrix[column, row + i * stride] += weight[i] * rate[i]


@compiled
def _equations(tables: LinkageTables, x: Complex, algebraic: bool, scratch: LinkageScratch) -> None:
    """Write the residual of all loops and of the slice, and its derivatives, at x and at the line and the slice in
    scratch."""
    _place(tables, x, algebraic, scratch)
    joints, at, matrix, residual, cut = tables.joints, scratch.vectors, scratch.matrix, scratch.residual, scratch.slice
    row, last = 0, len(x) - 1
    matrix[:] = 0.0
    for d in range(len(tables.differences)):
        one, two = tables.differences[d, 0], tables.differences[d, 1]
        for i in range(3):
            residual[row + i] = at[one, i] - at[two, i]
        _add(tables, scratch, one, (1.0 + 0.0j, 1.0 + 0.0j, 1.0 + 0.0j), row, 1)
        _add(tables, scratch, two, (-1.0 + 0.0j, -1.0 + 0.0j, -1.0 + 0.0j), row, 1)
        row += 3
    for p in range(len(tables.products)):
        axis, one, two = tables.products[p, 0], tables.products[p, 1], tables.products[p, 2]
        normal = (at[axis, 0], at[axis, 1], at[axis, 2])
        gap = (at[one, 0] - at[two, 0], at[one, 1] - at[two, 1], at[one, 2] - at[two, 2])
        residual[row] = normal[0] * gap[0] + normal[1] * gap[1] + normal[2] * gap[2]
        _add(tables, scratch, axis, gap, row, 0)
        _add(tables, scratch, one, normal, row, 0)
        _add(tables, scratch, two, (-normal[0], -normal[1], -normal[2]), row, 0)
        row += 1
    count = 3 * tables.features
    residual[row] = cut[count] * x[last] - cut[count + 1]
    for f in range(tables.features):
        weight = (cut[3 * f], cut[3 * f + 1], cut[3 * f + 2])
        if weight[0] != 0.0 or weight[1] != 0.0:
            residual[row] += weight[0] * at[f, 0] + weight[1] * at[f, 1] + weight[2] * at[f, 2]
            _add(tables, scratch, f, weight, row, 0)
    for k in range(len(joints)):  # derivatives by locked joints become those by A + B t, and contribute to that by t
        column = joints[k, COLUMN]
        locked = column - last - 1
        if locked >= 0:
            a, b = scratch.line[locked, 0], scratch.line[locked, 1]
            scale = 2.0 * _half(a + b * x[last]) if algebraic and joints[k, IS_PRISMATIC] == 0 else 1.0 + 0.0j
            for i in range(row + 1):
                matrix[column, i] *= scale
                matrix[last, i] += matrix[column, i] * b
    matrix[last, row] += cut[count]


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


# --- Newton's method and tracking -------------------------------------------------------------------------------------


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
        _equations(tables, x, algebraic, scratch)
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
def _go_to(path: ParameterPath, s: float, scratch: LinkageScratch) -> None:
    """Write the line and the slice at a parameter of the path."""
    for k in range(scratch.line.shape[0]):
        for i in range(2):
            scratch.line[k, i] = path.lines[0, k, i] + s * (path.lines[1, k, i] - path.lines[0, k, i])
    for i in range(len(scratch.slice)):
        scratch.slice[i] = path.slices[0, i] + s * (path.slices[1, i] - path.slices[0, i])


@compiled
def _tangent(
    tables: LinkageTables, path: ParameterPath, s: float, x: Complex, scratch: LinkageScratch, out: Complex
) -> None:
    """Write out = dx/ds at x and s."""
    _go_to(path, s, scratch)
    _equations(tables, x, path.algebraic, scratch)
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
    slope, other, total, there = stages[0], stages[1], stages[2], stages[3]
    s, h, n, steps, fresh = 0.0, 0.05, len(x), 0, False
    while s < 1.0:
        steps += 1
        if not fresh:
            _tangent(tables, path, s, x, scratch, slope)
            fresh = True
        h = min(h, 1.0 - s)
        for i in range(n):
            total[i] = slope[i]
            there[i] = x[i] + 0.5 * h * slope[i]
        for stage in range(3):
            _tangent(tables, path, s + (h if stage == 2 else 0.5 * h), there, scratch, other)
            for i in range(n):
                total[i] += other[i] * (1.0 if stage == 2 else 2.0)
                there[i] = x[i] + (h if stage == 1 else 0.5 * h) * other[i]
        for i in range(n):
            total[i] *= h / 6.0
            there[i] = x[i] + total[i]
        error, pivot, reached = np.inf, 0.0, 1.0 if h >= 1.0 - s else s + h
        if _size(tables, total, x) < 1.0:
            enough = _CLOSE if reached < 1.0 else 1e-2 * _ROUNDED
            error, pivot = _newton(tables, path.algebraic, 5, enough, there, scratch)
        better = min(max(0.9 * (path.accuracy / max(error, 1e-14)) ** 0.2, 0.3), 2.0) if error < 1e3 else 0.3
        if error <= 10.0 * path.accuracy:
            s = reached
            copy(there, x, n)
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
        _go_to(path, 0.0, scratch)
        for _ in range(60):
            _equations(tables, x, path.algebraic, scratch)
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


@entry
def write_features(
    tables: LinkageTables, path: ParameterPath, solutions: Complex, out: Complex, scratch: LinkageScratch
) -> None:
    """Write the features (count, f, 3) of many solutions at the path's beginning."""
    _go_to(path, 0.0, scratch)
    for k in range(len(solutions)):
        _place(tables, solutions[k], path.algebraic, scratch)
        for f in range(tables.features):
            copy(scratch.vectors[f], out[k, f], 3)


@entry
def evaluate(tables: LinkageTables, path: ParameterPath, x: Complex, scratch: LinkageScratch) -> None:
    """Write residual and derivatives at the beginning of a path to scratch."""
    _go_to(path, 0.0, scratch)
    _equations(tables, x, path.algebraic, scratch)
