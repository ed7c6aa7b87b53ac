"""Weighted least motion: where tasks and loops leave freedom, joints of large weight move less.

The weights act in what tasks and loops leave, and only there: as a metric of the loops' null space they would change
singular values and with them damping and statuses. With the step s of the tasks and a basis Z of the remaining motions,
z is the least of sum w_j (s + Z z)_j^2 (Y. Nakamura, H. Hanafusa and T. Yoshikawa, "Task-priority based redundancy
control of robot manipulators", 1987, with a weighted norm as the second task).
"""

from __future__ import annotations

import math

from cinegen.ik._kernels.decomposition import damping, direction, is_lost, to_joints
from cinegen.ik._kernels.memory import DirectionsMemory, WeightsMemory
from cinegen.ik.thresholds import FULL
from cinegen.jit.compiled import compiled
from cinegen.jit.factor import factor, null_space
from cinegen.jit.svd import decompose
from cinegen.jit.vectors import add_multiple, inner


@compiled
def weigh(memory: WeightsMemory) -> None:
    """Add to `step` and `free_step` the motion that neither loops nor tasks notice and that makes the weighted step
    shortest, as far as no joint becomes so fast that the tasks would have to be slower."""
    n, step, fresh = memory.n, memory.step, memory.fresh
    if memory.active_rows == 0 or not find_least_motion(memory, _find_remaining(memory)):
        return
    excess, part = FULL, 1.0
    for j in range(n):
        excess = max(excess, abs(step[j]) / memory.longest_step[j])
    for j in range(n):
        most = excess * memory.longest_step[j]
        if abs(step[j] + fresh[j]) > most:
            part = min(part, max(most - (step[j] if fresh[j] > 0.0 else -step[j]), 0.0) / abs(fresh[j]))
    for j in range(n):
        step[j] += part * fresh[j]
    add_multiple(part, memory.coordinates, memory.free_step, memory.mobility)


@compiled
def find_least_motion(memory: WeightsMemory, first: int) -> bool:
    """Set `fresh`, and `coordinates` in the null space, to the motion along `axes[first:]` that makes the weighted
    `step` shortest. Return False if there are no such axes.

    Directions in which weighted joints hardly move are damped as the tasks' are.
    """
    n, k, root, step, fresh = memory.n, memory.mobility, memory.root_weight, memory.step, memory.fresh
    rows, left, right, square = (
        memory.weighted_rows, memory.weighted_left, memory.weighted_right, memory.weighted_square,
    )  # fmt: skip
    width = k - first
    if width <= 0:
        return False
    for i in range(width):
        to_joints(memory, memory.axes[first + i], fresh)
        for j in range(n):
            rows[i, j] = root[j] * fresh[j]
    decompose(rows, width, n, left, right, square, False)
    y = memory.coordinates
    y[:k] = 0.0
    for a in range(width):
        along, size = 0.0, square[a] + damping(square[a], 1.0, 0.0, memory.damping_threshold)
        for j in range(n):
            along += right[a, j] * root[j] * step[j]
        for i in range(width):
            add_multiple(-along / size * left[a, i], memory.axes[first + i], y, k)
    to_joints(memory, y, fresh)
    return True


@compiled
def _find_remaining(memory: DirectionsMemory) -> int:
    """Set the last of `axes` to an orthonormal basis of the null space that tasks leave, in the basis of the loops'.
    Return the index of its first."""
    p, k, f, known = memory.active_rows, memory.mobility, memory.active_normals[0], 0
    for i in range(min(memory.task_rank, p, k)):
        if is_lost(memory, i):
            continue
        for j in range(k):
            f[known, j] = direction(memory, i, j)
        s = 1.0 / math.sqrt(inner(f[known], f[known], k))
        for j in range(k):
            f[known, j] *= s
        known += 1
    if known < k:
        tau, reflectors = memory.active[1], memory.active_normals[1]
        factor(f[:known], known, memory.axis_order, memory.active[0], tau, reflectors)
        null_space(known, tau, reflectors, memory.axes[known:])
    return known
