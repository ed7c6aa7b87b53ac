"""Loops of a linkage in complex numbers: their equations, Newton's method and the tracking of paths, compiled.

Joint values may be complex: angles enter through sine and cosine, which are analytic, so that a solution can be led
around branch points and through all of its companions. The unknowns are the passive joints' values and one more, t: a
motor's value is A + B t, and a last row, the slice, says where on this line the solution lies,

    alpha . F(x) + beta t - gamma = 0                                                                              (1)

with F the linkage's features (points and directions of its bodies). With alpha = 0, beta = 1 and gamma = 0 it is t = 0:
motors are at A. A path leads A, B, alpha, beta, gamma from what they are to what they shall be, along straight lines.

Rows of a loop: difference of the ends' points (3; for a slide 2, across it) and of their axes (z: 3; all: 9). There
are more rows than are independent, and may be more unknowns too (a rod may turn about itself): least squares by
Householder reflections with column pivoting, cut off at the known rank (Golub and Van Loan, Matrix Computations, 5.4).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.jit.compiled import Array, Table, compiled, entry

Complex = NDArray[np.complex128]

# columns of the tables of joints, loops and features
PARENT, SLIDES, MOTOR, COLUMN = range(4)
FIRST, SECOND, KIND = range(3)
BODY, IS_DIRECTION = range(2)
RIGID, PRISMATIC, REVOLUTE, BALL = range(4)


class Tables(NamedTuple):
    """A linkage, without unit: lengths divided by the characteristic length. n joints, l loops, f features.

    Attributes:
        joints: (n, 4) parent body, whether it slides, number of its motor or -1, number of its unknown or -1.
        constants: (n, 15) placement in the parent (rotation row by row, translation), axis.
        above: (n + 1, n) whether a joint moves a body; body 0 is the base, body k + 1 is moved by joint k.
        loops: (l, 3) bodies of both ends, kind.
        anchors: (l, 2, 12) both ends in their bodies: three axes, then the point.
        wanted: (f, 2) of each feature the body, and whether it is a direction.
        local: (f, 3) the feature in its body's axes.
        rank: of all equations by all unknowns, the slice and t included.
    """

    joints: Table
    constants: Array
    above: Table
    loops: Table
    anchors: Array
    wanted: Table
    local: Array
    rank: int


class Path(NamedTuple):
    """What is led from its first value to its second.

    Attributes:
        lines: (2, motors, 2) A and B.
        slices: (2, 3 f + 2) alpha, beta, gamma.
        algebraic: whether A + B t is tan(theta / 2) of a turning motor, not theta.
        accuracy: error of a prediction that is aimed at (radians, characteristic lengths).
    """

    lines: Complex
    slices: Complex
    algebraic: bool
    accuracy: float


class Scratch(NamedTuple):
    """Memory that is written to; for k passive joints and so many rows."""

    line: Complex  # (motors, 2)
    slice: Complex  # (3 f + 2,)
    bodies: Complex  # (n + 1, 5, 3)
    found: Complex  # (f, 3)
    vectors: Complex  # (6, 3)
    matrix: Complex  # (rows, k + 1)
    motors: Complex  # (rows, motors)
    residual: Complex  # (rows,)
    order: Table  # (k + 1,)
    stages: Complex  # (6, k + 1)


# how a path ended
ARRIVED, SINGULAR, INFINITE, LOST = 1, 2, 3, 4

_FAR = 6.0  # imaginary part of an angle (radians), logarithm of a length: what ends beyond is at infinity
_SMALLEST = 1e-9  # step along a path
_MOST_STEPS = 3000
_CLOSE = 1e-6  # Newton's last step on the way: what is left then is of its square's size
_SINGULAR = 1e-8  # smallest pivot over the largest
_CLOSED = 1e-11  # residual
_ROUNDED = 1e-9  # ... and what can't get smaller for rounding


@compiled
def _turn(axis: Array, c: complex, s: complex, placement: Array, parent: Complex, out: Complex) -> None:
    """out (3, 3) = parent times the constant rotation placement (12,) times a rotation about axis."""
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
    """cos(theta / 2) squared, from tan(theta / 2)."""
    below = 1.0 + tangent * tangent
    return 1.0 / below if abs(below) > 1e-200 else 1e200 + 0.0j


@compiled
def _place(tables: Tables, x: Complex, algebraic: bool, scratch: Scratch) -> None:
    """Writes where all bodies and the features are, for x (k + 1,): the passive joints' values, and t."""
    joints, constants, line, bodies = tables.joints, tables.constants, scratch.line, scratch.bodies
    last = len(x) - 1
    bodies[0] = 0.0
    bodies[0, 0, 0] = bodies[0, 1, 1] = bodies[0, 2, 2] = 1.0
    for k in range(len(joints)):
        parent, here = bodies[joints[k, PARENT]], bodies[k + 1]
        motor = joints[k, MOTOR]
        value = line[motor, 0] + line[motor, 1] * x[last] if motor >= 0 else x[joints[k, COLUMN]]
        slides = joints[k, SLIDES] == 1
        if slides:
            c, s = 1.0 + 0.0j, 0.0j
        elif motor >= 0 and algebraic:
            half = _half(value)
            c, s = half * (1.0 - value * value), half * 2.0 * value
        else:
            c, s = np.cos(value), np.sin(value)
        _turn(constants[k, 12:15], c, s, constants[k, :9], parent[:3], here[:3])
        for i in range(3):
            here[3, i] = (
                parent[3, i]
                + parent[i, 0] * constants[k, 9]
                + parent[i, 1] * constants[k, 10]
                + parent[i, 2] * constants[k, 11]
            )
            here[4, i] = here[i, 0] * constants[k, 12] + here[i, 1] * constants[k, 13] + here[i, 2] * constants[k, 14]
        if slides:
            for i in range(3):
                here[3, i] += value * here[4, i]
    for f in range(len(tables.wanted)):
        body, direction = tables.wanted[f, BODY], tables.wanted[f, IS_DIRECTION] == 1
        _attach(bodies[body], tables.local[f], direction, scratch.found[f])


@compiled
def _attach(body: Complex, local: Array, direction: bool, out: Complex) -> None:
    """A point or a direction of a body in the base's axes."""
    for i in range(3):
        out[i] = body[i, 0] * local[0] + body[i, 1] * local[1] + body[i, 2] * local[2]
        if not direction:
            out[i] += body[3, i]


@compiled
def _moves(bodies: Complex, joints: Table, k: int, at: Complex, direction: bool, out: Complex) -> None:
    """Velocity of a point, or of a direction, when joint k moves."""
    axis, origin = bodies[k + 1, 4], bodies[k + 1, 3]
    if joints[k, SLIDES] == 1:
        for i in range(3):
            out[i] = 0.0 if direction else axis[i]
        return
    if direction:
        a, b, d = at[0], at[1], at[2]
    else:
        a, b, d = at[0] - origin[0], at[1] - origin[1], at[2] - origin[2]
    out[0] = axis[1] * d - axis[2] * b
    out[1] = axis[2] * a - axis[0] * d
    out[2] = axis[0] * b - axis[1] * a


@compiled
def _equations(tables: Tables, x: Complex, algebraic: bool, scratch: Scratch) -> None:
    """Writes the residual of all loops and of the slice, its derivative by the unknowns (matrix) and by the motors'
    A + B t (motors), at x and at the line and the slice in scratch."""
    _place(tables, x, algebraic, scratch)
    joints, above, loops, anchors = tables.joints, tables.above, tables.loops, tables.anchors
    wanted, slice_, bodies, found, vectors = (
        tables.wanted,
        scratch.slice,
        scratch.bodies,
        scratch.found,
        scratch.vectors,
    )
    matrix, motors, residual = scratch.matrix, scratch.motors, scratch.residual
    matrix[:] = 0.0
    motors[:] = 0.0
    row, last = 0, len(x) - 1
    one, two, vel, there, axis, across = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4], vectors[5]
    for at in range(len(loops)):
        first, second, kind = loops[at, FIRST], loops[at, SECOND], loops[at, KIND]
        _attach(bodies[first], anchors[at, 0, 9:12], False, one)
        _attach(bodies[second], anchors[at, 1, 9:12], False, two)
        if kind == PRISMATIC:
            for part in range(2):  # (two - one) . axis
                _attach(bodies[first], anchors[at, 0, 3 * part : 3 * part + 3], True, axis)
                residual[row] = 0.0
                for i in range(3):
                    residual[row] += (two[i] - one[i]) * axis[i]
                for k in range(len(joints)):
                    total = 0.0j
                    if above[second, k]:
                        _moves(bodies, joints, k, two, False, vel)
                        for i in range(3):
                            total += vel[i] * axis[i]
                    if above[first, k]:
                        _moves(bodies, joints, k, one, False, vel)
                        _moves(bodies, joints, k, axis, True, across)
                        for i in range(3):
                            total += (two[i] - one[i]) * across[i] - vel[i] * axis[i]
                    _put(joints, k, total, row, matrix, motors)
                row += 1
        else:
            row = _difference(tables, first, second, one, two, False, row, scratch)
        axes = 0 if kind == BALL else (1 if kind == REVOLUTE else 3)
        for part in range(3 - axes, 3):
            _attach(bodies[first], anchors[at, 0, 3 * part : 3 * part + 3], True, axis)
            _attach(bodies[second], anchors[at, 1, 3 * part : 3 * part + 3], True, there)
            row = _difference(tables, first, second, axis, there, True, row, scratch)
    count = len(wanted)
    residual[row] = slice_[3 * count] * x[last] - slice_[3 * count + 1]
    for f in range(count):
        for i in range(3):
            residual[row] += slice_[3 * f + i] * found[f, i]
        if slice_[3 * f] == 0.0 and slice_[3 * f + 1] == 0.0:
            continue
        for k in range(len(joints)):
            if above[wanted[f, BODY], k]:
                _moves(bodies, joints, k, found[f], wanted[f, IS_DIRECTION] == 1, vel)
                total = 0.0j
                for i in range(3):
                    total += slice_[3 * f + i] * vel[i]
                _put(joints, k, total, row, matrix, motors)
    _along_the_line(joints, x[last], scratch.line, algebraic, row + 1, matrix, motors)
    matrix[row, last] += slice_[3 * count]


@compiled
def _put(joints: Table, k: int, value: complex, row: int, matrix: Complex, motors: Complex) -> None:
    if joints[k, MOTOR] >= 0:
        motors[row, joints[k, MOTOR]] += value
    else:
        matrix[row, joints[k, COLUMN]] += value


@compiled
def _difference(
    tables: Tables, first: int, second: int, one: Complex, two: Complex, direction: bool, row: int, scratch: Scratch
) -> int:
    """Three rows: what belongs to the second body less what belongs to the first. The next row's number."""
    joints, above, vel = tables.joints, tables.above, scratch.vectors[2]
    for i in range(3):
        scratch.residual[row + i] = two[i] - one[i]
    for k in range(len(joints)):
        if above[second, k]:
            _moves(scratch.bodies, joints, k, two, direction, vel)
            for i in range(3):
                _put(joints, k, vel[i], row + i, scratch.matrix, scratch.motors)
        if above[first, k]:
            _moves(scratch.bodies, joints, k, one, direction, vel)
            for i in range(3):
                _put(joints, k, -vel[i], row + i, scratch.matrix, scratch.motors)
    return row + 3


@compiled
def _along_the_line(
    joints: Table, t: complex, line: Complex, algebraic: bool, rows: int, matrix: Complex, motors: Complex
) -> None:
    """Columns of the motors become derivatives by A + B t, and that of t what they are together."""
    last = matrix.shape[1] - 1
    for k in range(len(joints)):
        motor = joints[k, MOTOR]
        if motor < 0:
            continue
        if algebraic and joints[k, SLIDES] == 0:
            value = line[motor, 0] + line[motor, 1] * t
            for row in range(rows):
                motors[row, motor] *= 2.0 * _half(value)
        for row in range(rows):
            matrix[row, last] += motors[row, motor] * line[motor, 1]


@compiled
def solve(matrix: Complex, right: Complex, rank: int, order: Table, step: Complex) -> float:
    """step (k,) with matrix (rows, k) step = right in least squares; both are overwritten.

    Householder reflections, columns pivoted; what lies beyond the rank stays 0. Returns the smallest over the largest
    pivot: 0 where the matrix is singular.
    """
    rows, columns = matrix.shape
    for j in range(columns):
        order[j] = j
        step[j] = 0.0
    largest = smallest = 0.0
    for j in range(rank):
        best, chosen = -1.0, j
        for c in range(j, columns):
            square = 0.0
            for i in range(j, rows):
                square += matrix[i, c].real ** 2 + matrix[i, c].imag ** 2
            if square > best:
                best, chosen = square, c
        if chosen != j:
            for i in range(rows):
                matrix[i, j], matrix[i, chosen] = matrix[i, chosen], matrix[i, j]
            order[j], order[chosen] = order[chosen], order[j]
        norm = math.sqrt(best)
        if j == 0:
            largest = norm
        smallest = norm
        if not norm > 1e-15 * largest:
            return 0.0
        pivot = matrix[j, j]
        size = abs(pivot)
        alpha = -norm * (pivot / size if size > 0.0 else 1.0 + 0.0j)
        matrix[j, j] = pivot - alpha  # the reflection's vector stands in the column now
        square = 2.0 * norm * (norm + size)  # its squared length
        for c in range(j + 1, columns):
            total = 0.0j
            for i in range(j, rows):
                total += matrix[i, j].conjugate() * matrix[i, c]
            total *= 2.0 / square
            for i in range(j, rows):
                matrix[i, c] -= total * matrix[i, j]
        total = 0.0j
        for i in range(j, rows):
            total += matrix[i, j].conjugate() * right[i]
        total *= 2.0 / square
        for i in range(j, rows):
            right[i] -= total * matrix[i, j]
        matrix[j, j] = alpha
    for j in range(rank - 1, -1, -1):
        value = right[j]
        for c in range(j + 1, rank):
            value -= matrix[j, c] * step[order[c]]
        step[order[j]] = value / matrix[j, j]
    return smallest / largest if largest > 0.0 else 0.0


@compiled
def _size(joints: Table, step: Complex, x: Complex) -> float:
    """The largest part of a step (k + 1,) from x: of angles in radians, of lengths and of t against their own size."""
    last = len(x) - 1
    size: float = abs(step[last]) / (1.0 + abs(x[last]))
    for k in range(len(joints)):
        column = joints[k, COLUMN]
        if column >= 0:
            size = max(size, abs(step[column]) / (1.0 + abs(x[column]) if joints[k, SLIDES] == 1 else 1.0))
    return size


@compiled
def _newton(tables: Tables, algebraic: bool, most: int, enough: float, x: Complex, scratch: Scratch) -> float:
    """Newton's method from x, in place, until a step is shorter than `enough`. Size of the first step, or infinity
    where it does not converge; the smallest pivot over the largest is left in residual[0]."""
    step = scratch.stages[5]
    first = before = np.inf
    for k in range(most):
        _equations(tables, x, algebraic, scratch)
        pivot = solve(scratch.matrix, scratch.residual, tables.rank, scratch.order, step)
        size = _size(tables.joints, step, x)
        for i in range(len(x)):
            x[i] -= step[i]
        scratch.residual[0] = pivot
        if k == 0:
            first = size
        if not size < 1e6 or pivot == 0.0:
            return np.inf
        if size < enough:
            return first
        if k > 0 and size > 0.5 * before:
            return first if size < _ROUNDED else np.inf
        before = size
    return first if before < 100.0 * enough else np.inf


@compiled
def _go_to(path: Path, s: float, scratch: Scratch) -> None:
    """The line and the slice at a place of the path."""
    for k in range(scratch.line.shape[0]):
        for i in range(2):
            scratch.line[k, i] = path.lines[0, k, i] + s * (path.lines[1, k, i] - path.lines[0, k, i])
    for i in range(len(scratch.slice)):
        scratch.slice[i] = path.slices[0, i] + s * (path.slices[1, i] - path.slices[0, i])


@compiled
def _tangent(tables: Tables, path: Path, s: float, x: Complex, scratch: Scratch, out: Complex) -> None:
    """out = dx/ds at x and s."""
    _go_to(path, s, scratch)
    _equations(tables, x, path.algebraic, scratch)
    residual, found = scratch.residual, scratch.found
    row, t, count = len(residual) - 1, x[len(x) - 1], len(found)
    for i in range(row + 1):
        residual[i] = 0.0
        for k in range(scratch.line.shape[0]):
            a, b = path.lines[1, k, 0] - path.lines[0, k, 0], path.lines[1, k, 1] - path.lines[0, k, 1]
            residual[i] -= scratch.motors[i, k] * (a + b * t)
    for f in range(count):
        for i in range(3):
            residual[row] -= (path.slices[1, 3 * f + i] - path.slices[0, 3 * f + i]) * found[f, i]
    residual[row] -= (path.slices[1, 3 * count] - path.slices[0, 3 * count]) * t
    residual[row] += path.slices[1, 3 * count + 1] - path.slices[0, 3 * count + 1]
    solve(scratch.matrix, residual, tables.rank, scratch.order, out)


@compiled
def _is_far(joints: Table, x: Complex) -> bool:
    """Whether a solution is on its way to infinity."""
    far = math.log(1.0 + abs(x[len(x) - 1]))
    for k in range(len(joints)):
        column = joints[k, COLUMN]
        if column >= 0:
            value = x[column]
            far = max(far, math.log(1.0 + abs(value)) if joints[k, SLIDES] == 1 else abs(value.imag))
    return far > _FAR


@compiled
def _track(tables: Tables, path: Path, x: Complex, scratch: Scratch, record: Array) -> int:
    """Leads one solution x along the whole path, in place: how that ended. Runge and Kutta's fourth order, and Newton's
    method after each step, whose first correction is the error that the next step's length is chosen by."""
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
        error, reached = np.inf, 1.0 if h >= 1.0 - s else s + h
        if _size(tables.joints, total, x) < 1.0:
            error = _newton(tables, path.algebraic, 5, _CLOSE if reached < 1.0 else 1e-2 * _ROUNDED, there, scratch)
        better = min(max(0.9 * (path.accuracy / max(error, 1e-14)) ** 0.2, 0.3), 2.0) if error < 1e3 else 0.3
        if error <= 10.0 * path.accuracy:
            s = reached
            for i in range(n):
                x[i] = there[i]
            record[0] = scratch.residual[0].real
            fresh = False
        else:
            better = min(better, 0.5)
        h *= better
        record[1] = steps
        if s < 1.0 and (h < _SMALLEST * (1.0 - s) + 1e-14 or steps > _MOST_STEPS or 1.0 - s < _SMALLEST):
            return INFINITE if _is_far(tables.joints, x) else (SINGULAR if s > 0.99 else LOST)
    return ARRIVED


@entry
def track(tables: Tables, path: Path, solutions: Complex, ends: Table, records: Array, scratch: Scratch) -> None:
    """Leads many solutions (count, k + 1) along a path, in place; writes how each ended (count,), and records (count,
    2): the smallest pivot at the end over the largest, and the number of steps."""
    for k in range(len(solutions)):
        ends[k] = _track(tables, path, solutions[k], scratch, records[k])


@entry
def settle(tables: Tables, path: Path, solutions: Complex, ends: Table, scratch: Scratch) -> None:
    """Newton's method at the beginning of a path from many guesses (count, k + 1), in place, its steps capped. `ends`
    is ARRIVED where it converged, SINGULAR where it did to a singular solution, else LOST."""
    step = scratch.stages[5]
    for k in range(len(solutions)):
        x = solutions[k]
        ends[k] = LOST
        _go_to(path, 0.0, scratch)
        for _ in range(60):
            _equations(tables, x, path.algebraic, scratch)
            gap = size = 0.0
            for i in range(len(scratch.residual)):
                gap = max(gap, abs(scratch.residual[i]))
            pivot = solve(scratch.matrix, scratch.residual, tables.rank, scratch.order, step)
            for i in range(len(x)):
                size = max(size, abs(step[i]))
            if pivot == 0.0 or not size < 1e9:
                break
            cap = min(1.0, 0.7 / max(size, 1e-300))
            for i in range(len(x)):
                x[i] -= cap * step[i]
            if size < 1e-11:
                if gap < _CLOSED:
                    ends[k] = ARRIVED if pivot > _SINGULAR else SINGULAR
                break


@entry
def measure(tables: Tables, path: Path, solutions: Complex, out: Complex, scratch: Scratch) -> None:
    """Writes the features (count, f, 3) of many solutions at the path's beginning."""
    _go_to(path, 0.0, scratch)
    for k in range(len(solutions)):
        _place(tables, solutions[k], path.algebraic, scratch)
        for f in range(len(scratch.found)):
            for i in range(3):
                out[k, f, i] = scratch.found[f, i]


@entry
def residuals(tables: Tables, path: Path, x: Complex, scratch: Scratch) -> None:
    """Residual and derivatives at the beginning of a path: they stand in scratch then."""
    _go_to(path, 0.0, scratch)
    _equations(tables, x, path.algebraic, scratch)
