"""Loops of a linkage in complex numbers: their equations, compiled.

Joint values may be complex: angles enter through sine and cosine, which are analytic, so that a solution can be
continued around branch points and through all of its companions. The unknowns are the values of the passive joints and
one more, t: a locked joint's value is A + B t, and a last equation, the slice, selects a point of this line,

    alpha . F(x) + beta t - gamma = 0                                                                              (1)

with F the linkage's features (points and directions of its bodies). With alpha = 0, beta = 1 and gamma = 0 it is t = 0:
locked joints are at A. A path changes A, B, alpha, beta, gamma along straight lines.

Equations of the loops are differences of vectors attached to two bodies (points, axes), and products of an axis with
such a difference, for prismatic joints.
"""

from __future__ import annotations

import numpy as np

from cinegen.assembly._kernels.tables import (
    BODY,
    COLUMN,
    IS_DIRECTION,
    IS_PRISMATIC,
    PARENT,
    Complex,
    LinkageScratch,
    LinkageTables,
    ParameterPath,
    Vector,
)
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.vectors import add_multiple, copy


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
        parent, out, column = bodies[joints[k, PARENT]], bodies[k + 1], joints[k, COLUMN]
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
        _rotate(constants[k, 12:15], c, s, constants[k, :9], parent[:3], out[:3])
        for i in range(3):
            x0, x1, x2 = constants[k, 9], constants[k, 10], constants[k, 11]
            out[3, i] = parent[3, i] + parent[i, 0] * x0 + parent[i, 1] * x1 + parent[i, 2] * x2
            out[4, i] = out[i, 0] * constants[k, 12] + out[i, 1] * constants[k, 13] + out[i, 2] * constants[k, 14]
        if prismatic:
            add_multiple(value, out[4], out[3], 3)
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
def write_equations(tables: LinkageTables, x: Complex, algebraic: bool, scratch: LinkageScratch) -> None:
    """Write the residual of all loops and of the slice, and its derivatives, at x and at the line and the slice in
    scratch."""
    _place(tables, x, algebraic, scratch)
    joints, at, matrix, residual, cut = tables.joints, scratch.vectors, scratch.matrix, scratch.residual, scratch.slice
    row, last = 0, len(x) - 1
    matrix[:] = 0.0
    for d in range(len(tables.differences)):
        first, second = tables.differences[d, 0], tables.differences[d, 1]
        for i in range(3):
            residual[row + i] = at[first, i] - at[second, i]
        _add(tables, scratch, first, (1.0 + 0.0j, 1.0 + 0.0j, 1.0 + 0.0j), row, 1)
        _add(tables, scratch, second, (-1.0 + 0.0j, -1.0 + 0.0j, -1.0 + 0.0j), row, 1)
        row += 3
    for p in range(len(tables.products)):
        axis, first, second = tables.products[p, 0], tables.products[p, 1], tables.products[p, 2]
        normal = (at[axis, 0], at[axis, 1], at[axis, 2])
        gap = (at[first, 0] - at[second, 0], at[first, 1] - at[second, 1], at[first, 2] - at[second, 2])
        residual[row] = normal[0] * gap[0] + normal[1] * gap[1] + normal[2] * gap[2]
        _add(tables, scratch, axis, gap, row, 0)
        _add(tables, scratch, first, normal, row, 0)
        _add(tables, scratch, second, (-normal[0], -normal[1], -normal[2]), row, 0)
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
def go_to(path: ParameterPath, s: float, scratch: LinkageScratch) -> None:
    """Write the line and the slice at a parameter of the path."""
    for k in range(scratch.line.shape[0]):
        for i in range(2):
            scratch.line[k, i] = path.lines[0, k, i] + s * (path.lines[1, k, i] - path.lines[0, k, i])
    for i in range(len(scratch.slice)):
        scratch.slice[i] = path.slices[0, i] + s * (path.slices[1, i] - path.slices[0, i])


@entry
def write_features(
    tables: LinkageTables, path: ParameterPath, solutions: Complex, out: Complex, scratch: LinkageScratch
) -> None:
    """Write the features (count, f, 3) of many solutions at the path's beginning."""
    go_to(path, 0.0, scratch)
    for k in range(len(solutions)):
        _place(tables, solutions[k], path.algebraic, scratch)
        for f in range(tables.features):
            copy(scratch.vectors[f], out[k, f], 3)


@entry
def evaluate(tables: LinkageTables, path: ParameterPath, x: Complex, scratch: LinkageScratch) -> None:
    """Write residual and derivatives at the beginning of a path to scratch."""
    go_to(path, 0.0, scratch)
    write_equations(tables, x, path.algebraic, scratch)
