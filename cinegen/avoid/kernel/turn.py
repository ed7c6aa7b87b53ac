"""How links turn around what is in their way."""

from __future__ import annotations

import math

from cinegen.avoid.kernel.near import DISTANCE, FIRST_POINT, NORMAL, RESULT_WIDTH, SECOND_POINT
from cinegen.kernel.compiled import Array, Table, compiled, entry, matrix

AWAKE, AXIS, STATE_WIDTH = 0, 1, 4
"""Of a vortex: whether it turns, and about which axis (3)."""

_LEAST = 1e-4  # of the mean square that joints move a point by, along a direction: less can't be asked of them


@compiled
def _moved(columns: Array, moves: Array, j: int, at: Array, found: Array) -> bool:
    """How the column j moves a point (3,) of a joint; False where it does not."""
    if moves[j] == 0.0:
        found[0] = found[1] = found[2] = 0.0
        return False
    found[0] = columns[j, 0] + columns[j, 4] * at[2] - columns[j, 5] * at[1]
    found[1] = columns[j, 1] + columns[j, 5] * at[0] - columns[j, 3] * at[2]
    found[2] = columns[j, 2] + columns[j, 3] * at[1] - columns[j, 4] * at[0]
    return True


@entry
def turn(
    results: int,
    pairs: Table,
    joints: Table,
    moves: Array,
    jacobian: int,
    motion: Array,
    vortices: Table,
    states: Array,
    reach: float,
    stop: float,
    strength: float,
    asks: Table,
    found: Array,
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
        vortices: (pairs,) number of the vortex that each belongs to.
        states: (vortices, 4) whether it turns, and its axis; one that nothing is led into any more rests.
        reach: m: where fields begin.
        stop: m: where links are stopped.
        strength: of vortices, by the attraction at the same point.
        asks: (vortices,) becomes the nearest pair that is led into what a resting vortex surrounds, else -1.
        found: (nv,) becomes the motion with all vortices.
        scratch: (3, 3).
    """
    nv, total = motion.shape[0], pairs.shape[0] // 2
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
        square = 0.0
        for j in range(nv):
            if _moved(columns, first, j, one, c):
                square += c[0] * c[0] + c[1] * c[1] + c[2] * c[2]
                for i in range(3):
                    a[i] += c[i] * motion[j]
            if _moved(columns, second, j, other, c):
                for i in range(3):
                    a[i] -= c[i] * motion[j]
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
        along = _LEAST * square / 3.0
        for j in range(nv):
            s = 0.0
            if _moved(columns, first, j, one, c):
                s += (c[0] * t[0] + c[1] * t[1] + c[2] * t[2]) / length
            if _moved(columns, second, j, other, c):
                s -= (c[0] * t[0] + c[1] * t[1] + c[2] * t[2]) / length
            along += s * s
        if not along > 0.0:
            continue
        for j in range(nv):
            s = 0.0
            if _moved(columns, first, j, one, c):
                s += (c[0] * t[0] + c[1] * t[1] + c[2] * t[2]) / length
            if _moved(columns, second, j, other, c):
                s -= (c[0] * t[0] + c[1] * t[1] + c[2] * t[2]) / length
            found[j] += s * asked / along
    for g in range(asks.shape[0]):  # what was not needed rests
        states[g, AWAKE] = 1.0 if states[g, AWAKE] == 2.0 else 0.0
