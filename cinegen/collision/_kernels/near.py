"""Pairs of bodies that are near each other, and the Jacobians of their distances."""

from __future__ import annotations

from cinegen.collision._kernels.memory import ClearanceMemory
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.foreign import DISTANCE, FIRST_POINT, NORMAL, SECOND_POINT
from cinegen.jit.se3 import combine


@compiled
def speed_along(screw: Array, normal: Array, at: Array) -> float:
    """Return the speed along a normal (3,) of the point (3,) that a screw (6,) moves."""
    x = screw[0] + screw[4] * at[2] - screw[5] * at[1]
    y = screw[1] + screw[5] * at[0] - screw[3] * at[2]
    z = screw[2] + screw[3] * at[1] - screw[4] * at[0]
    return float(normal[0] * x + normal[1] * y + normal[2] * z)


@compiled
def in_world(frame: Array, point: Array, out: Array) -> None:
    """Write the position in the world of a point (3,) in a joint's frame."""
    combine(point, frame, out)
    for i in range(3):
        out[i] += frame[3, i]


@compiled
def _write_row(
    memory: ClearanceMemory, row: int, pair: int, distance: float, normal: Array, point: Array, other: Array
) -> None:
    """Write a distance, and the rate at which each column shortens it: a point of the first body moves towards the
    second, one of the second towards the first."""
    first, second = memory.joint[memory.pair[pair, 0]], memory.joint[memory.pair[pair, 1]]
    memory.which[row], memory.room[row] = pair, distance
    for j in range(memory.nv):
        memory.rows[row, j] = 0.0
        if memory.moved_by[first, j] != 0.0:
            memory.rows[row, j] += speed_along(memory.screws[j], normal, point)
        if memory.moved_by[second, j] != 0.0:
            memory.rows[row, j] -= speed_along(memory.screws[j], normal, other)


@entry
def approach(memory: ClearanceMemory, within: float) -> int:
    """Compute the rates at which each column of the Jacobian shortens the distances below a bound.

    A pair adds a row for its nearest points, and one for each other end of a capsule, by how far that is from the plane
    that separates the two: the nearest point of a link along a wall jumps from one end to the other, its ends do not.
    A capsule around an exact shape counts as much further away as the exact shape is.

    Args:
        memory: `which`, `room` and `rows` are the results.
        within: the bound, m.

    Returns:
        number of rows.
    """
    count, centre = 0, memory.vectors[0]
    for p in range(memory.pairs):
        result = memory.results[p]
        if not result[DISTANCE] < within:
            continue
        if count == memory.most:
            break
        normal = result[NORMAL : NORMAL + 3]
        point, other = result[FIRST_POINT : FIRST_POINT + 3], result[SECOND_POINT : SECOND_POINT + 3]
        _write_row(memory, count, p, result[DISTANCE], normal, point, other)
        count += 1
        for side in range(2):
            body = memory.pair[p, side]
            radius = memory.radius[body]
            if radius < 0.0:
                continue
            for end in range(2):
                if count == memory.most:
                    break
                in_world(memory.frames[memory.joint[body]], memory.ends[body, end], centre)
                gap, off = memory.excess[p] - radius, 0.0
                for i in range(3):
                    towards = normal[i] if side == 0 else -normal[i]
                    met = point[i] if side else other[i]
                    gap += (met - centre[i]) * towards
                    at = centre[i] + radius * towards
                    off += abs(at - (other[i] if side else point[i]))
                if off < 1e-9 or not gap < within:  # the nearest point itself
                    continue
                if side == 0:
                    _write_row(memory, count, p, gap, normal, centre, other)
                else:
                    _write_row(memory, count, p, gap, normal, point, centre)
                count += 1
    return count
