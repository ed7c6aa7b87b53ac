"""How far a motion can bring two bodies nearer: a bound that holds all along it."""

from __future__ import annotations

import math

from cinegen.collision._kernels.near import DISTANCE, RESULT_WIDTH, in_world
from cinegen.jit.compiled import Array, Table, compiled, entry, matrix


@compiled
def _swept(columns: Array, moves: Array, others: Array, motion: Array, centre: Array, radius: float) -> float:
    """Of all points of a ball, the longest way that they go while the joints do a motion (nv,), seen from what other
    joints carry.

    From the last joint to the first: a joint swings what those behind it have moved by `way` at most, so it moves
    nothing faster than its own column moves the ball's farthest point, and that `way` further out.

    Args:
        columns: (nv, 6) the Jacobian where the motion begins.
        moves: (nv,) 1 where a column moves the ball.
        others: (nv,) 1 where it moves what the ball is seen from: with it, both move as one.
        motion: (nv,) rad and m.
        centre: (3,) of the ball, in the world.
        radius: its radius, m.
    """
    way = 0.0
    for k in range(motion.shape[0]):
        j = motion.shape[0] - 1 - k  # a column stands behind those that carry its joint
        if moves[j] == 0.0 or others[j] != 0.0 or motion[j] == 0.0:
            continue
        a, b, c = columns[j, 3], columns[j, 4], columns[j, 5]
        x = columns[j, 0] + b * centre[2] - c * centre[1]
        y = columns[j, 1] + c * centre[0] - a * centre[2]
        z = columns[j, 2] + a * centre[1] - b * centre[0]
        turn = math.sqrt(a * a + b * b + c * c)
        way += abs(motion[j]) * (math.sqrt(x * x + y * y + z * z) + turn * (radius + way))
    return way


@entry
def sweep(
    results: int,
    pairs: Table,
    joints: Table,
    balls: Array,
    moves: Array,
    placements: int,
    jacobian: int,
    motion: Array,
    before: Array,
    ways: Array,
    scratch: Array,
) -> None:
    """For each pair its distance now, and by how much a motion from here can shorten it.

    Args:
        results: address of coal's results here.
        pairs: (2 pairs,) numbers of bodies.
        joints: (bodies,) that they move with.
        balls: (bodies, 4) centre in the joint's frame and radius of a ball that holds the body.
        moves: (joints, nv) 1 where a column moves a joint.
        placements: address of the joints' placements here.
        jacobian: address of the Jacobian here.
        motion: (nv,) rad and m.
        before: (pairs,) becomes the distances, m.
        ways: (pairs,) becomes the bounds, m.
        scratch: (2, 3).
    """
    total = pairs.shape[0] // 2
    result = matrix(results, total, RESULT_WIDTH)
    place, columns = matrix(placements, moves.shape[0], 12), matrix(jacobian, moves.shape[1], 6)
    for p in range(total):
        before[p] = result[p, DISTANCE]
        ways[p] = 0.0
        for side in range(2):
            body, other = pairs[2 * p + side], pairs[2 * p + 1 - side]
            joint = joints[body]
            if joint == 0 or balls[body, 3] == math.inf:  # what is fixed; a half-space that moves is refused elsewhere
                continue
            in_world(place[joint], balls[body, 0:3], scratch[0])
            ways[p] += _swept(columns, moves[joint], moves[joints[other]], motion, scratch[0], balls[body, 3])
