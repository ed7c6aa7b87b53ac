"""Redundancy: a secondary velocity in the null space of loops and tasks, as far as all bounds allow.

Lexicographic, as tasks are below loops: it moves no task (L. Sentis and O. Khatib,
"Synthesis of whole-body behaviors through hierarchical control of behavioral primitives", 2005; with bounds, O. Kanoun,
F. Lamiraux and P.-B. Wieber, "Kinematic control of redundant manipulators: generalizing the task-priority framework to
inequality task", 2011).
"""

from __future__ import annotations

import math

from cinegen.ik._kernels.bounds import keeps_bounds, nearest, reduce_barriers
from cinegen.ik._kernels.decomposition import find_axes, project_step, to_joints
from cinegen.ik._kernels.memory import BoundsMemory, SecondaryMemory
from cinegen.ik.thresholds import IDLE_SECONDARY, LEAST_SCALE, SCALE_GROWS, SPARE_SPEED
from cinegen.jit.compiled import compiled
from cinegen.jit.vectors import copy, inner


@compiled
def project_secondary(memory: SecondaryMemory) -> bool:
    """Project the wanted secondary step so that it neither opens a loop nor moves a task: `secondary_free`, and
    `secondary` as joints. Return False if it is negligible. If it reverses, half of it is used, so that it does not
    oscillate."""
    free, fresh, secondary = memory.secondary_free, memory.fresh, memory.secondary
    project_step(memory, memory.secondary_wanted, free, True)
    to_joints(memory, free, fresh)
    along, largest = 0.0, 0.0
    for j in range(memory.n):
        along += fresh[j] * secondary[j]
        largest = max(largest, abs(fresh[j]))
    scale = memory.secondary_scale
    scale = max(0.5 * scale, LEAST_SCALE) if along < 0.0 else min(SCALE_GROWS * scale, 1.0)
    memory.secondary_scale = scale
    left = scale * largest > IDLE_SECONDARY
    for j in range(memory.n):
        secondary[j] = scale * fresh[j] if left else 0.0
    for i in range(memory.mobility):
        free[i] *= scale
    return bool(left)


@compiled
def add_secondary(memory: SecondaryMemory, whole: bool) -> bool:
    """Add to `step` the part of the secondary step that keeps all bounds; it becomes `secondary`.

    Args:
        memory: its step is that of the tasks.
        whole: the step must not change; if it violates a bound, the null-space motion has to compensate.

    Returns:
        False if it can't at moderate speed; then nothing is added.
    """
    n, step, secondary, room = memory.n, memory.step, memory.secondary, memory.room
    for j in range(n):
        fastest = max(SPARE_SPEED * memory.longest_step[j], abs(step[j]))
        room[0, j] = max(memory.floor[j], -fastest) - step[j]
        room[1, j] = min(memory.ceiling[j], fastest) - step[j]
        if not whole:
            room[0, j], room[1, j] = min(room[0, j], 0.0), max(room[1, j], 0.0)
    for b in range(memory.barriers):
        room[0, n + b] = memory.floor[n + b]
        room[1, n + b] = memory.ceiling[n + b] - inner(memory.barrier_rows[b], step, n)
        if not whole:
            room[1, n + b] = max(room[1, n + b], 0.0)
    if not keeps_bounds(memory, secondary, room[0], room[1]) and not _bound_secondary(memory):
        if whole:
            return False
        secondary[:n] = 0.0
    for j in range(n):
        step[j] += secondary[j]
    return True


@compiled
def _bound_secondary(memory: SecondaryMemory) -> bool:
    """Set `secondary` to the nearest motion within `room`. Return False if there is none, or only one that is much
    faster than it and the last tick.

    With an orthonormal basis Q (n, width) of the motions that move neither loops nor tasks, s the secondary step and B
    the rows of the barriers, x minimises |Q x - s|^2 under room_0 <= [Q; B Q] x <= room_1 (`nearest`, from the start
    x = Q^T s); Q x is the result. Distances are those of the model's joints, dimensionless: the gradient of an
    objective is that of their motions, so that what bounds leave of it descends, too.
    """
    first, axes, room, x, basis = find_axes(memory), memory.axes, memory.room, memory.wanted_point, memory.normals
    width = memory.mobility - first
    if width <= 0:
        return False
    for i in range(width):
        to_joints(memory, axes[first + i], memory.fresh)
        write_orthonormal(memory, i)
        x[i] = 0.0
        for c in range(memory.n):
            x[i] += basis[c, i] * memory.secondary[c]
    reduce_barriers(memory, width)
    if not nearest(memory, room[0], room[1], room[2], width):
        return False
    fast, largest = 0.0, 0.0
    for j in range(memory.n):
        s = inner(basis[j], x, width)
        room[2, j] = s
        largest = max(largest, abs(s))
        fast = max(fast, abs(memory.secondary[j]), abs(memory.last[j]))
    if largest > 2.0 * fast:
        return False
    copy(room[2], memory.secondary, memory.n)
    return True


@compiled
def write_orthonormal(memory: BoundsMemory, i: int) -> None:
    """Write the part of `fresh` that is orthogonal to the columns of `normals` before the i-th, with length 1, into
    that column."""
    n, g, fresh = memory.n, memory.normals, memory.fresh
    for column in range(i):
        s = 0.0
        for c in range(n):
            s += g[c, column] * fresh[c]
        for c in range(n):
            fresh[c] -= s * g[c, column]
    size = math.sqrt(inner(fresh, fresh, n))
    for c in range(n):
        g[c, i] = fresh[c] / size
