"""How links turn around what is in their way."""

from __future__ import annotations

import math

from cinegen.collision._kernels.near import DISTANCE, FIRST_POINT, NORMAL, RESULT_WIDTH, SECOND_POINT
from cinegen.jit.compiled import Array, Table, compiled, entry, matrix

AWAKE, AXIS, STATE_WIDTH = 0, 1, 4
"""Of a vortex: whether it turns, and about which axis (3)."""

_LEAST = 1e-4  # of the mean square by which free motions move a point: where it can't go, none is asked to take it


@compiled
def _led(columns: Array, first: Array, second: Array, j: int, one: Array, other: Array, found: Array) -> None:
    """How the column j moves a point (3,) of the first joint, seen from a point of the second."""
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
def _freely(
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
    """How free motions move a point of the first joint, seen from the second: by (3, motions), without unit of motion.
    Of joints that no loop ties, each is free.

    Returns:
        the mean square along a direction.
    """
    nv, k = scale.shape[0], free.shape[0]
    for i in range(3):
        for f in range(k):
            by[i, f] = 0.0
    for j in range(nv):
        _led(columns, first, second, j, one, other, c)
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
def turn(
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
    asks: Table,
    found: Array,
    by: Array,
    scratch: Array,
) -> None:
    """Adds to a motion what vortices make of it (De Medio and Oriolo, equation 6).

    For each pair nearer than `reach`, a is how the motion moves the nearest point L of the first body, seen from the
    second, and n the normal out of the second. Where n . a < 0 the link is led into the obstacle: then the vortex of
    axis w moves L along w x n by strength |a| (-n . a / |a|) m(d), with m 1 at the distance where links are stopped and
    0 at the reach. The joints do the least that does that.

    Args:
        results: address of coal's results.
        pairs: (2 pairs,) numbers of bodies.
        joints: (bodies,) that they move with.
        moves: (joints, nv) 1 where a column moves a joint.
        jacobian: address of the Jacobian, (nv, 6).
        motion: (nv,) of the attraction, rad and m.
        scale: (nv,) rad or m that a motion without unit is.
        free: (motions, nv) orthonormal motions without unit that keep loops closed; none where there are no loops.
        vortices: (pairs,) number of the vortex that each belongs to.
        states: (vortices, 4) whether it turns, and its axis; one that nothing is led into any more rests.
        reach: m: where fields begin.
        stop: m: where links are stopped.
        strength: of vortices, by the attraction at the same point.
        asks: (vortices,) becomes the nearest pair that is led into what a resting vortex surrounds, else -1.
        found: (nv,) becomes the motion with all vortices.
        by: (3, nv) scratch.
        scratch: (3, 3).
    """
    nv, total, k = motion.shape[0], pairs.shape[0] // 2, free.shape[0]
    result, columns = matrix(results, total, RESULT_WIDTH), matrix(jacobian, nv, 6)
    a, t, c = scratch[0], scratch[1], scratch[2]
    for g in range(asks.shape[0]):
        asks[g] = -1
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
                _led(columns, first, second, j, one, other, c)
                for i in range(3):
                    a[i] += c[i] * motion[j]
        size = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        into = a[0] * normal[0] + a[1] * normal[1] + a[2] * normal[2]
        if not into > 1e-9 * size or size < 1e-12:
            continue
        g = vortices[p]
        if states[g, AWAKE] == 0.0:
            if asks[g] < 0 or d < result[asks[g], DISTANCE]:
                asks[g] = p
            continue
        states[g, AWAKE] = 2.0  # it is needed
        x, y, z = states[g, AXIS], states[g, AXIS + 1], states[g, AXIS + 2]
        t[0] = z * normal[1] - y * normal[2]
        t[1] = x * normal[2] - z * normal[0]
        t[2] = y * normal[0] - x * normal[1]
        length = math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
        if length < 1e-6:
            continue
        near = max(d, stop)
        modulus = (1.0 / near - 1.0 / reach) / (1.0 / stop - 1.0 / reach)
        asked = strength * into * modulus
        along = _LEAST * _freely(columns, first, second, one, other, scale, free, by, c)
        count = k if k > 0 else nv
        for f in range(count):
            s = (by[0, f] * t[0] + by[1, f] * t[1] + by[2, f] * t[2]) / length
            along += s * s
        if not along > 0.0:
            continue
        for f in range(count):
            s = (by[0, f] * t[0] + by[1, f] * t[1] + by[2, f] * t[2]) / length * asked / along
            if k == 0:
                found[f] += s * scale[f]
            else:
                for j in range(nv):
                    found[j] += s * free[f, j] * scale[j]
    for g in range(asks.shape[0]):  # what was not needed rests
        states[g, AWAKE] = 1.0 if states[g, AWAKE] == 2.0 else 0.0
