"""Bounds of the change of distances along a motion."""

from __future__ import annotations

import math

from cinegen.collision._kernels.memory import ClearanceMemory
from cinegen.collision._kernels.near import in_world
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.foreign import DISTANCE, NORMAL
from cinegen.jit.se3 import combine, cross, dot


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
def _place(memory: ClearanceMemory) -> None:
    """Write the boxes of all bodies in the world."""
    for body in range(memory.bodies):
        frame = memory.frames[memory.joint[body]]
        for row in range(3):
            combine(memory.box[body, row], frame, memory.placed[body, row])
        in_world(frame, memory.box[body, 3], memory.placed[body, 3])


@compiled
def _sweep_bodies(memory: ClearanceMemory) -> None:
    """Write bounds of the motion of all bodies in the world along `motion`."""
    for body in range(memory.bodies):
        joint, radius = memory.joint[body], memory.ball[body]
        # moving half-spaces are refused elsewhere
        is_fixed = joint == 0 or radius == math.inf
        memory.swept[body] = 0.0 if is_fixed else _swept(memory, joint, 0, memory.placed[body, 3], radius)


@compiled
def _change(memory: ClearanceMemory, pair: int) -> float:
    """Return a bound of the change of a pair's distance along `motion`, m: the sum of the paths of both bodies."""
    first, second = memory.pair[pair, 0], memory.pair[pair, 1]
    joint, other = memory.joint[first], memory.joint[second]
    if joint == 0 or other == 0:
        return float(memory.swept[first] + memory.swept[second])
    bound = _swept(memory, joint, other, memory.placed[first, 3], memory.ball[first])
    return bound + _swept(memory, other, joint, memory.placed[second, 3], memory.ball[second])


@entry
def sweep(memory: ClearanceMemory) -> None:
    """Compute for each pair its present distance, `before`, and a bound of its change along `motion`, `bounds`."""
    _place(memory)
    _sweep_bodies(memory)
    for p in range(memory.pairs):
        memory.before[p] = memory.results[p, DISTANCE]
        memory.bounds[p] = _change(memory, p)


@compiled
def _from_box(memory: ClearanceMemory, body: int, other: int) -> float:
    """Return a lower bound of the distance between two bodies, from the bounding sphere of the first and the bounding
    box of the second."""
    centre, placed, outside = memory.placed[body, 3], memory.placed[other], 0.0
    for i in range(3):
        along = 0.0
        for k in range(3):
            along += placed[i, k] * (centre[k] - placed[3, k])
        beyond = max(abs(along) - memory.box[other, 4, i], 0.0)
        outside += beyond * beyond
    return float(math.sqrt(outside) - memory.ball[body])


@compiled
def _see(memory: ClearanceMemory, pair: int, box: Array) -> float:
    """Write the box (4, 3) of the smaller body of a pair in that of the other; return the radius of its sphere."""
    inner, outer = memory.pair[pair, 0], memory.pair[pair, 1]
    if memory.ball[inner] > memory.ball[outer]:
        inner, outer = outer, inner
    frame, other = memory.placed[inner], memory.placed[outer]
    for i in range(3):
        for k in range(3):
            box[i, k] = dot(frame[i], other[k])
        box[3, i] = 0.0
        for k in range(3):
            box[3, i] += (frame[3, k] - other[3, k]) * other[i, k]
    return float(memory.ball[inner])


@compiled
def _from_known(memory: ClearanceMemory, pair: int) -> float:
    """Return a lower bound of a pair's distance: the last one measured, less the largest displacement of a point of the
    smaller body since then, as seen from the other."""
    now, then = memory.vectors, memory.seen[pair]
    radius, turned, moved = _see(memory, pair, now), 0.0, 0.0
    for k in range(3):
        for i in range(3):
            turned += (now[i, k] - then[i, k]) ** 2
        moved += (now[3, k] - then[3, k]) ** 2
    # a rotation by an angle moves points of a unit sphere by 2 sin(angle / 2) at most: see its Frobenius norm
    return float(memory.known[pair] - math.sqrt(moved) - radius * math.sqrt(0.5 * turned))


@compiled
def _support(memory: ClearanceMemory, body: int, seen_from: int, normal: Array) -> float:
    """Return an upper bound of how far a body extends along a normal (3,) anywhere on a motion by `motion` at most.

    To first order, each corner moves along the normal by what the straight part of the motion contributes, and by the
    sum of what joints contribute to the remainder. Second derivatives of the position of a point by two joints are at
    most the rotation by the one times the velocity by the other.
    """
    joint, frame, radius = memory.joint[body], memory.placed[body], memory.ball[body]
    count, turned, sideways, tilts = 0, 0.0, memory.vectors[2], memory.tilts
    for i in range(4):
        tilts[0, i] = 0.0
    if joint != 0:
        for j in range(memory.nv):
            if memory.moved_by[joint, j] == 0.0 or memory.moved_by[seen_from, j] != 0.0 or memory.motion[j] == 0.0:
                continue
            screw, tilt, straight = memory.screws[j], tilts[count + 1], memory.straight[j]
            size = abs(memory.motion[j]) - abs(straight)
            cross(normal, screw[3:6], sideways)
            along = dot(normal, screw[0:3]) + dot(sideways, frame[3])
            for i in range(3):
                tilt[i] = dot(sideways, frame[i])
                tilts[0, i] += straight * tilt[i]
                tilt[i] *= size
            tilts[0, 3] += straight * along
            tilt[3] = size * along
            turned += abs(memory.motion[j]) * math.sqrt(dot(screw[3:6], screw[3:6]))
            count += size > 0.0
    x, y, z = dot(normal, frame[0]), dot(normal, frame[1]), dot(normal, frame[2])
    most = -math.inf
    for k in range(memory.hull[body, 0], memory.hull[body, 1]):
        corner = memory.corner[k]
        height = x * corner[0] + y * corner[1] + z * corner[2]
        for j in range(count + 1):
            tilt = tilts[j]
            height += abs(tilt[0] * corner[0] + tilt[1] * corner[1] + tilt[2] * corner[2] + tilt[3])
        most = max(most, height)
    if turned > 0.0:
        most += turned * _swept(memory, joint, seen_from, frame[3], radius)
    return float(most + dot(normal, frame[3]) + memory.rounding[body])


@compiled
def _from_plane(memory: ClearanceMemory, pair: int) -> float:
    """Return a lower bound of the distance of a pair anywhere on a motion by `motion` at most: between two planes
    perpendicular to its `normal`, one before each body."""
    first, second = memory.pair[pair, 0], memory.pair[pair, 1]
    normal, local = memory.vectors[0], memory.normal[pair]
    if memory.hull[first, 1] == memory.hull[first, 0] or memory.hull[second, 1] == memory.hull[second, 0]:
        return -math.inf
    combine(local, memory.placed[first], normal)
    if not dot(normal, normal) > 0.5:  # none is known
        return -math.inf
    extent = _support(memory, first, memory.joint[second], normal)
    for i in range(3):
        normal[i] = -normal[i]
    extent += _support(memory, second, memory.joint[first], normal)
    return -extent / math.sqrt(dot(normal, normal))


@compiled
def _keep_normal(memory: ClearanceMemory, pair: int, normal: Array) -> None:
    """Write the normal (3,) of a pair, given in the world, in the box of its first body."""
    frame = memory.placed[memory.pair[pair, 0]]
    for i in range(3):
        memory.normal[pair, i] = dot(normal, frame[i])


@entry
def remember(memory: ClearanceMemory) -> None:
    """Take the present configuration as that in which all pairs have their `known` distances, and their normals."""
    _place(memory)
    for p in range(memory.pairs):
        _see(memory, p, memory.seen[p])
        _keep_normal(memory, p, memory.results[p, NORMAL : NORMAL + 3])


@entry
def separate(memory: ClearanceMemory, pair: int) -> float:
    """Take the present configuration as that in which a pair has its `known` distance, and normal.

    Args:
        memory: `normal` is that of the pair in the world, and becomes that in the box of the first body.
        pair: its index.

    Returns:
        lower bound of its distance along `motion`, from that normal, m.
    """
    _see(memory, pair, memory.seen[pair])
    normal = memory.vectors[0]
    for i in range(3):
        normal[i] = memory.normal[pair, i]
    _keep_normal(memory, pair, normal)
    return _from_plane(memory, pair)


@entry
def advance(memory: ClearanceMemory, count: int) -> int:
    """Drop from the first `asked` pairs those that keep a distance along `motion`, as their bounding volumes show, or
    their last measurements.

    A pair with a distance of at least `lower` now, which changes by `change` at most, keeps the distance `needed` if
    lower - change >= needed. `lower` is the best of three bounds: from the last measurement, and from the sphere of the
    one body and the box of the other, and vice versa. If it is too small, two planes between the bodies are tried:
    that bound holds during all of the motion.

    Args:
        memory: `asked` are the pairs, `needed` the distances, m; of those that remain, `bounds` are bounds of their
            change, and `lower` bounds of their distances now, m.
        count: number of pairs asked about.

    Returns:
        number of pairs that remain, the first of `asked`.
    """
    _place(memory)
    _sweep_bodies(memory)
    remaining = 0
    for k in range(count):
        p = memory.asked[k]
        first, second, needed = memory.pair[p, 0], memory.pair[p, 1], memory.needed[p]
        change, lower = _change(memory, p), _from_known(memory, p)
        if lower - change >= needed:
            continue
        lower = max(lower, _from_box(memory, first, second), _from_box(memory, second, first))
        if lower - change >= needed or _from_plane(memory, p) >= needed:
            continue
        memory.bounds[p], memory.lower[p], memory.asked[remaining] = change, lower, p
        remaining += 1
    return remaining
