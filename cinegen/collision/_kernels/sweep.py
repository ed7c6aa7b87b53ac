"""Bounds of the change of distances along a motion."""

from __future__ import annotations

import math

from cinegen.collision._kernels.memory import ClearanceMemory
from cinegen.collision._kernels.near import in_world
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.foreign import DISTANCE


@compiled
def _swept(memory: ClearanceMemory, joint: int, seen_from: int, centre: Array, radius: float) -> float:
    """Return a bound of the path of any point of a sphere during `motion`, relative to the body of another joint.

    Joints are added from the last to the first. Those behind a joint have moved a point by `way` at most, so the joint
    moves no point faster than it moves the farthest point of the sphere, enlarged by `way`.

    Args:
        memory: `screws` are those at the start of the motion.
        joint: joint that carries the sphere.
        seen_from: the other joint: columns that move both do not count.
        centre: (3,) centre of the sphere, in the world.
        radius: its radius, m.
    """
    way, moved_by, motion = 0.0, memory.moved_by, memory.motion
    for k in range(memory.nv):
        j = memory.nv - 1 - k  # columns are behind those that carry their joint
        if moved_by[joint, j] == 0.0 or moved_by[seen_from, j] != 0.0 or motion[j] == 0.0:
            continue
        screw = memory.screws[j]
        a, b, c = screw[3], screw[4], screw[5]
        x = screw[0] + b * centre[2] - c * centre[1]
        y = screw[1] + c * centre[0] - a * centre[2]
        z = screw[2] + a * centre[1] - b * centre[0]
        rotation = math.sqrt(a * a + b * b + c * c)
        way += abs(motion[j]) * (math.sqrt(x * x + y * y + z * z) + rotation * (radius + way))
    return way


@compiled
def _change(memory: ClearanceMemory, pair: int) -> float:
    """Return a bound of the change of a pair's distance along `motion`."""
    bound, centre = 0.0, memory.vectors[0]
    for side in range(2):
        body, other = memory.pair[pair, side], memory.pair[pair, 1 - side]
        joint, radius = memory.joint[body], memory.ball[body, 3]
        if joint == 0 or radius == math.inf:  # fixed; moving half-spaces are refused elsewhere
            continue
        in_world(memory.frames[joint], memory.ball[body, 0:3], centre)
        bound += _swept(memory, joint, memory.joint[other], centre, radius)
    return bound


@entry
def sweep(memory: ClearanceMemory) -> None:
    """Compute for each pair its present distance, `before`, and a bound of its change along `motion`, `bounds`."""
    for p in range(memory.pairs):
        memory.before[p] = memory.results[p, DISTANCE]
        memory.bounds[p] = _change(memory, p)


@compiled
def _from_box(memory: ClearanceMemory, body: int, other: int) -> float:
    """Return a lower bound of the distance between two bodies, from the bounding sphere of the first and the bounding
    box of the second."""
    centre, local = memory.vectors[0], memory.vectors[1]
    frame, box = memory.frames[memory.joint[other]], memory.box[other]
    in_world(memory.frames[memory.joint[body]], memory.ball[body, 0:3], centre)
    for i in range(3):
        local[i] = -box[3, i]
        for k in range(3):
            local[i] += frame[i, k] * (centre[k] - frame[3, k])
    outside = 0.0
    for i in range(3):
        along = box[i, 0] * local[0] + box[i, 1] * local[1] + box[i, 2] * local[2]
        beyond = max(abs(along) - box[4, i], 0.0)
        outside += beyond * beyond
    return float(math.sqrt(outside) - memory.ball[body, 3])


@entry
def advance(memory: ClearanceMemory, count: int, safety: float) -> int:
    """Drop from the first `asked` pairs those whose bounding volumes show that they keep a distance along `motion`.

    Args:
        memory: `asked` are the pairs; of those that remain, `bounds` are bounds of their change.
        count: number of pairs asked about.
        safety: the distance, m.

    Returns:
        number of pairs that remain, the first of `asked`.
    """
    left = 0
    for k in range(count):
        p = memory.asked[k]
        change = _change(memory, p)
        first, second = memory.pair[p, 0], memory.pair[p, 1]
        if _from_box(memory, first, second) - change >= safety or _from_box(memory, second, first) - change >= safety:
            continue
        memory.bounds[p], memory.asked[left] = change, p
        left += 1
    return left
