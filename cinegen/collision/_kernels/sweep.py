"""How far a motion can bring two bodies nearer: a bound that holds all along it."""

from __future__ import annotations

import math

from cinegen.collision._kernels.memory import ClearanceMemory
from cinegen.collision._kernels.near import in_world
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.foreign import DISTANCE


@compiled
def _swept(memory: ClearanceMemory, joint: int, seen_from: int, centre: Array, radius: float) -> float:
    """Of all points of a ball, the longest path during `motion`, seen from what another joint carries.

    From the last joint to the first: a joint swings what those behind it have moved by `way` at most, so it moves
    nothing faster than its own column moves the ball's farthest point, and that `way` further out.

    Args:
        memory: `screws` are those where the motion begins.
        joint: that carries the ball.
        seen_from: the other one: what moves both moves them as one.
        centre: (3,) of the ball, in the world.
        radius: its radius, m.
    """
    way, moved_by, motion = 0.0, memory.moved_by, memory.motion
    for k in range(memory.nv):
        j = memory.nv - 1 - k  # a column stands behind those that carry its joint
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
    """Compute for each pair its distance now, `before`, and by how much `motion` from here can shorten it, `bounds`."""
    centre = memory.vectors[0]
    for p in range(memory.pairs):
        memory.before[p] = memory.results[p, DISTANCE]
        memory.bounds[p] = 0.0
        for side in range(2):
            body, other = memory.pair[p, side], memory.pair[p, 1 - side]
            joint, radius = memory.joint[body], memory.ball[body, 3]
            if joint == 0 or radius == math.inf:  # what is fixed; a half-space that moves is refused elsewhere
                continue
            in_world(memory.frames[joint], memory.ball[body, 0:3], centre)
            memory.bounds[p] += _swept(memory, joint, memory.joint[other], centre, radius)
