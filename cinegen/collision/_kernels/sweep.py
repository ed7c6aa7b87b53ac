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


@entry
def sweep(memory: ClearanceMemory) -> None:
    """Compute for each pair its present distance, `before`, and a bound of its change along `motion`, `bounds`."""
    centre = memory.vectors[0]
    for p in range(memory.pairs):
        memory.before[p] = memory.results[p, DISTANCE]
        memory.bounds[p] = 0.0
        for side in range(2):
            body, other = memory.pair[p, side], memory.pair[p, 1 - side]
            joint, radius = memory.joint[body], memory.ball[body, 3]
            if joint == 0 or radius == math.inf:  # fixed; moving half-spaces are refused elsewhere
                continue
            in_world(memory.frames[joint], memory.ball[body, 0:3], centre)
            memory.bounds[p] += _swept(memory, joint, memory.joint[other], centre, radius)
