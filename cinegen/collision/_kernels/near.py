"""Pairs of bodies that are near each other, and how joints bring them nearer."""

from __future__ import annotations

from cinegen.jit.compiled import Array, Table, compiled, entry, matrix

DISTANCE, NORMAL, FIRST_POINT, SECOND_POINT, RESULT_WIDTH = 0, 1, 4, 7, 20
"""Where coal keeps what it found of a pair, counted in doubles from its distance; and from one pair to the next."""


@compiled
def speed_along(columns: Array, j: int, normal: Array, at: Array) -> float:
    """How fast the column j of a Jacobian (nv, 6) moves what is at a point (3,) along a normal (3,)."""
    x = columns[j, 0] + columns[j, 4] * at[2] - columns[j, 5] * at[1]
    y = columns[j, 1] + columns[j, 5] * at[0] - columns[j, 3] * at[2]
    z = columns[j, 2] + columns[j, 3] * at[1] - columns[j, 4] * at[0]
    return float(normal[0] * x + normal[1] * y + normal[2] * z)


@compiled
def in_world(place: Array, point: Array, found: Array) -> None:
    """A point (3,) of a joint that stands at a place (12,), in the world."""
    for i in range(3):
        found[i] = place[9 + i] + place[i] * point[0] + place[3 + i] * point[1] + place[6 + i] * point[2]


@compiled
def _row(columns: Array, first: Array, second: Array, normal: Array, one: Array, other: Array, row: Array) -> None:
    """How fast each column leads a point of the first body towards the second, and one of the second the other way."""
    for j in range(row.shape[0]):
        row[j] = 0.0
        if first[j] != 0.0:
            row[j] += speed_along(columns, j, normal, one)
        if second[j] != 0.0:
            row[j] -= speed_along(columns, j, normal, other)


@entry
def approach(
    results: int,
    pairs: Table,
    joints: Table,
    ends: Array,
    radii: Array,
    moves: Array,
    placements: int,
    jacobian: int,
    within: float,
    which: Table,
    room: Array,
    rows: Array,
    scratch: Array,
) -> int:
    """How each column of the Jacobian shortens the distances that are short.

    A pair adds a row for its nearest points, and one for each other end of a capsule, by how far that is from the plane
    that parts the two: the nearest point of a link along a wall leaps from one end to the other, its ends do not.

    Args:
        results: address of coal's results, `RESULT_WIDTH` doubles each.
        pairs: (2 pairs,) numbers of bodies.
        joints: (bodies,) that they move with.
        ends: (bodies, 6) centres of a capsule's ends, in the frame of its joint.
        radii: (bodies,) of capsules; below 0 for others.
        moves: (joints, nv) 1 where a column moves a joint.
        placements: address of the joints' placements, 12 doubles each.
        jacobian: address of Pinocchio's Jacobian, (nv, 6).
        within: m: what is further apart is not near.
        which: (most,) becomes the pair of each row; rows of a pair follow each other, nearest points first.
        room: (most,) becomes the distance of each row, m.
        rows: (most, nv) becomes by how much each column shortens it.
        scratch: (2, 3).

    Returns:
        how many rows there are.
    """
    most, nv = rows.shape
    total = pairs.shape[0] // 2
    result = matrix(results, total, RESULT_WIDTH)
    place, columns = matrix(placements, moves.shape[0], 12), matrix(jacobian, nv, 6)
    count = 0
    for p in range(total):
        if not result[p, DISTANCE] < within:
            continue
        if count == most:
            break
        normal = result[p, NORMAL : NORMAL + 3]
        one, other = result[p, FIRST_POINT : FIRST_POINT + 3], result[p, SECOND_POINT : SECOND_POINT + 3]
        first, second = pairs[2 * p], pairs[2 * p + 1]
        one_moves, other_moves = moves[joints[first]], moves[joints[second]]
        _row(columns, one_moves, other_moves, normal, one, other, rows[count])
        which[count], room[count] = p, result[p, DISTANCE]
        count += 1
        for side in range(2):
            body = second if side else first
            if radii[body] < 0.0:
                continue
            for end in range(2):
                if count == most:
                    break
                in_world(place[joints[body]], ends[body, 3 * end : 3 * end + 3], scratch[0])
                gap, off = -radii[body], 0.0
                for i in range(3):
                    towards = normal[i] if side == 0 else -normal[i]
                    met = one[i] if side else other[i]
                    gap += (met - scratch[0, i]) * towards
                    at = scratch[0, i] + radii[body] * towards
                    off += abs(at - (other[i] if side else one[i]))
                if off < 1e-9 or not gap < within:  # the nearest point itself
                    continue
                if side == 0:
                    _row(columns, one_moves, other_moves, normal, scratch[0], other, rows[count])
                else:
                    _row(columns, one_moves, other_moves, normal, one, scratch[0], rows[count])
                which[count], room[count] = p, gap
                count += 1
    return count
