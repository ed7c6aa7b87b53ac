"""The vortex field of links among obstacles, compiled; `cinegen.planning.vortex_field` is its plain form."""

from __future__ import annotations

import math

from cinegen.collision._kernels.near import DISTANCE, FIRST_POINT, NORMAL, RESULT_WIDTH, SECOND_POINT
from cinegen.jit.compiled import Array, Table, compiled, entry, matrix

ACTIVE, AXIS, STATE_WIDTH = 0, 1, 4
"""State of a vortex: whether it is active, and its axis (3)."""

_LEAST = 1e-4  # damping, relative to the mean square by which free motions move a point: bounds the joint motion where
# the point can hardly move


@compiled
def _point_velocity(
    columns: Array, first: Array, second: Array, j: int, one: Array, other: Array, found: Array
) -> None:
    """Write the velocity (3,) by column j of a point on the first joint relative to a point on the second."""
    for i in range(3):
        found[i] = 0.0
    for side in range(2):
        if (second[j] if side else first[j]) == 0.0:
            continue
        at, sign = (other, -1.0) if side else (one, 1.0)
        found[0] += sign * (columns[j, 0] + columns[j, 4] * at[2] - columns[j, 5] * at[1])
        found[1] += sign * (columns[j, 1] + columns[j, 5] * at[0] - columns[j, 3] * at[2])
        found[2] += sign * (columns[j, 2] + columns[j, 3] * at[1] - columns[j, 4] * at[0])


@compiled
def _free_jacobian(
    columns: Array,
    first: Array,
    second: Array,
    one: Array,
    other: Array,
    scale: Array,
    free: Array,
    by: Array,
    c: Array,
) -> float:
    """Write the Jacobian `by` (3, motions) of a point on the first joint relative to the second, by dimensionless free
    motions; without loops each joint is free.

    Returns:
        the mean square of the point's motion along a direction.
    """
    nv, k = scale.shape[0], free.shape[0]
    for i in range(3):
        for f in range(k):
            by[i, f] = 0.0
    for j in range(nv):
        _point_velocity(columns, first, second, j, one, other, c)
        for i in range(3):
            if k == 0:
                by[i, j] = scale[j] * c[i]
            else:
                for f in range(k):
                    by[i, f] += free[f, j] * scale[j] * c[i]
    square = 0.0
    for i in range(3):
        for f in range(k if k > 0 else nv):
            square += by[i, f] * by[i, f]
    return square / 3.0


@entry
def deflect(
    results: int,
    pairs: Table,
    joints: Table,
    moves: Array,
    jacobian: int,
    motion: Array,
    scale: Array,
    free: Array,
    vortices: Table,
    states: Array,
    reach: float,
    stop: float,
    strength: float,
    candidates: Table,
    found: Array,
    by: Array,
    scratch: Array,
) -> None:
    """Add the vortices to a motion (De Medio and Oriolo, equation 6).

    For each pair nearer than `reach`, a is how the motion moves the nearest point L of the first body relative to the
    second, and n the outward normal of the second. Where n . a < 0 the link moves toward the obstacle: the vortex of
    axis w then moves L along w x n by strength |a| (-n . a / |a|) m(d), with m 1 at the stop distance and 0 at the
    reach. The joints make the smallest motion that does so (damped).

    Args:
        results: address of coal's results.
        pairs: (2 pairs,) indices of bodies.
        joints: (bodies,) joint of each body.
        moves: (joints, nv) 1 where a column moves a joint.
        jacobian: address of the Jacobian, (nv, 6).
        motion: (nv,) undeflected motion, rad and m.
        scale: (nv,) rad or m of a dimensionless unit of motion.
        free: (motions, nv) orthonormal dimensionless motions that keep loops closed; empty without loops.
        vortices: (pairs,) index of the vortex of each pair.
        states: (vortices, 4) whether each is active, and its axis; a vortex that no link moves toward is deactivated.
        reach: distance at which vortices start to act, m.
        stop: distance at which links are stopped, m.
        strength: strength relative to the attraction at the same point.
        candidates: (vortices,) becomes the nearest pair that moves toward the obstacle of an inactive vortex, else -1.
        found: (nv,) becomes the motion with all vortices.
        by: (3, nv) scratch.
        scratch: (3, 3).
    """
    nv, total, k = motion.shape[0], pairs.shape[0] // 2, free.shape[0]
    result, columns = matrix(results, total, RESULT_WIDTH), matrix(jacobian, nv, 6)
    a, t, c = scratch[0], scratch[1], scratch[2]
    for g in range(candidates.shape[0]):
        candidates[g] = -1
    for j in range(nv):
        found[j] = motion[j]
    for p in range(total):
        d = result[p, DISTANCE]
        if not d < reach:
            continue
        normal = result[p, NORMAL : NORMAL + 3]  # from the first to the second: -n
        one, other = result[p, FIRST_POINT : FIRST_POINT + 3], result[p, SECOND_POINT : SECOND_POINT + 3]
        first, second = moves[joints[pairs[2 * p]]], moves[joints[pairs[2 * p + 1]]]
        a[0] = a[1] = a[2] = 0.0
        for j in range(nv):
            if motion[j] != 0.0:
                _point_velocity(columns, first, second, j, one, other, c)
                for i in range(3):
                    a[i] += c[i] * motion[j]
        size = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        into = a[0] * normal[0] + a[1] * normal[1] + a[2] * normal[2]
        if not into > 1e-9 * size or size < 1e-12:
            continue
        g = vortices[p]
        if states[g, ACTIVE] == 0.0:
            if candidates[g] < 0 or d < result[candidates[g], DISTANCE]:
                candidates[g] = p
            continue
        states[g, ACTIVE] = 2.0  # still needed
        x, y, z = states[g, AXIS], states[g, AXIS + 1], states[g, AXIS + 2]
        t[0] = z * normal[1] - y * normal[2]
        t[1] = x * normal[2] - z * normal[0]
        t[2] = y * normal[0] - x * normal[1]
        length = math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
        if length < 1e-6:
            continue
        near = max(d, stop)
        modulus = (1.0 / near - 1.0 / reach) / (1.0 / stop - 1.0 / reach)
        target = strength * into * modulus
        along = _LEAST * _free_jacobian(columns, first, second, one, other, scale, free, by, c)
        count = k if k > 0 else nv
        for f in range(count):
            s = (by[0, f] * t[0] + by[1, f] * t[1] + by[2, f] * t[2]) / length
            along += s * s
        if not along > 0.0:
            continue
        for f in range(count):
            s = (by[0, f] * t[0] + by[1, f] * t[1] + by[2, f] * t[2]) / length * target / along
            if k == 0:
                found[f] += s * scale[f]
            else:
                for j in range(nv):
                    found[j] += s * free[f, j] * scale[j]
    for g in range(candidates.shape[0]):  # what was not needed is deactivated
        states[g, ACTIVE] = 1.0 if states[g, ACTIVE] == 2.0 else 0.0
