"""Levels below the first: each does what it can in the freedom that those above leave, and disturbs none of them.

With the motions V of the loops and a basis Z of what the levels above leave of them, level k, with rows A and the
error r that is left of it, takes the step V Z z that minimises

    |B z - r|^2 + sum_i damping_i (w_i . z)^2,    B = A V Z = U S W^T,

within all bounds of the whole step; then Z becomes Z W without the first columns, as many as the level's generic rank
(O. Kanoun, F. Lamiraux and P.-B. Wieber, "Kinematic control of redundant manipulators: generalizing the task-priority
framework to inequality task", 2011; A. Escande, N. Mansard and P.-B. Wieber, "Hierarchical quadratic programming",
2014). A damped direction belongs to its level still: lower levels would move it fast otherwise. What is left of it
damps all levels below (`carry`): otherwise they move on while the mechanism is stretched.

Levels disturb those above to second order. So all but the last are corrected with the loops, to what their steps
promise.
"""

from __future__ import annotations

import math

from cinegen.ik._kernels.bounds import keeps_bounds, nearest, reduce_barriers
from cinegen.ik._kernels.decomposition import damping, find_axes, find_emphasis, size_of, to_free, to_joints, unweighted
from cinegen.ik._kernels.memory import BASIS, SVD, BoundsMemory, DirectionsMemory, LevelsMemory, SolverMemory, task_at
from cinegen.ik._kernels.secondary import write_orthonormal
from cinegen.ik._kernels.tasks import tasks_left
from cinegen.ik._kernels.weights import find_least_motion
from cinegen.ik.thresholds import (
    AT_LIMIT,
    BARRED,
    LEAST_SCALE,
    NOISE,
    REST,
    RESTING,
    SPARE_SPEED,
)
from cinegen.jit.compiled import Array, compiled
from cinegen.jit.factor import factor, null_space
from cinegen.jit.svd import decompose
from cinegen.jit.vectors import add_multiple, copy, inner

_LOST = 1e-12  # directions of singular values below this fraction of the largest are undetermined
_GROWS = 1.1  # of a step scale, from tick to tick
_CARRIED = 100.0  # damping of lower levels by what is left of a damped direction, as a multiple of it


@compiled
def add_levels(memory: SolverMemory) -> None:
    """Add to `step`, that of the first level, what lower levels do within its bounds, and then the objectives, and what
    weights of joints ask for. They are the secondary step, which is shortened first."""
    has_objective, secondary, still = memory.has_secondary != 0, memory.secondary, memory.level_still
    still[:] = 1.0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        if task.is_active != 0 and task.is_still == 0:
            still[task.level] = 0.0
    memory.first_free = first_left(memory)
    memory.carry = _first_carry(memory)
    _scale_first(memory)
    copy(memory.step, secondary, memory.n)
    memory.level_stopped[: memory.n] = 0.0
    for level in range(1, memory.levels):
        memory.level_cost[level] = tasks_left(memory, level)
        _add_level(memory, level)
    memory.level_part[memory.levels, : memory.n] = 0.0
    if memory.weighted != 0 and find_least_motion(memory, memory.first_free):
        for j in range(memory.n):
            wanted = memory.secondary_wanted[j] if has_objective else 0.0
            memory.secondary_wanted[j] = wanted + memory.fresh[j]
        has_objective = True
    if has_objective:
        _add_objective(memory)
    memory.guarded_levels = memory.levels if has_objective else memory.levels - 1
    memory.has_secondary = 0
    for j in range(memory.n):
        secondary[j] = memory.step[j] - secondary[j]
        if secondary[j] != 0.0:
            memory.has_secondary = 1


@compiled
def first_left(memory: DirectionsMemory) -> int:
    """Fill `axes` with what the first level leaves; return the index of the first of these."""
    p, k = memory.active_rows, memory.mobility
    if memory.found_by != BASIS:
        return max(find_axes(memory), min(memory.task_rank, p, k))
    if p < k:
        f, tau, reflectors = memory.active_normals[0], memory.active[1], memory.active_normals[1]
        for i in range(p):
            copy(memory.reduced[i], f[i], k)
        factor(f[:p], p, memory.axis_order, memory.active[0], tau, reflectors)
        null_space(p, tau, reflectors, memory.axes[p:k])
    return p


@compiled
def _first_carry(memory: DirectionsMemory) -> float:
    """Return the damping that the first level leaves to those below: |wanted| times the largest `_damped_part` of its
    singular values."""
    p, carry = memory.active_rows, 0.0
    if memory.found_by == SVD:
        error = size_of(memory.wanted, memory.row_weights, p)
        for i in range(min(memory.task_rank, p, memory.mobility)):
            carry = max(carry, _damped_part(unweighted(memory, i), memory.damping_threshold) * error)
    return carry


@compiled
def _damped_part(square: float, threshold: float) -> float:
    """Return what a singular value adds to the damping of the levels below, as a multiple of the error."""
    ratio = min(square / (threshold * threshold), 1.0)
    return _CARRIED * (1.0 - ratio) * (1.0 - ratio)


@compiled
def _scale_first(memory: LevelsMemory) -> None:
    """Scale the first level's step if it turns back."""
    part = memory.level_part[0]
    for j in range(memory.n):
        part[j] = memory.step[j] - memory.braking[j]
    back = False
    for b in range(memory.barriers):  # they do not allow the mechanism to stay
        back = back or memory.barrier_room[b] < 0.0
    if not back:
        _scale_turn(memory, 0)
    for j in range(memory.n):
        memory.step[j] = memory.braking[j] + part[j]


@compiled
def _scale_turn(memory: LevelsMemory, level: int) -> None:
    """Scale a level's part of the step so that it does not oscillate about targets at rest: half the last scale if it
    is opposite to the last part, within 60 degrees."""
    part, last = memory.level_part[level], memory.level_last[level]
    along, square, last_square = inner(part, last, memory.n), inner(part, part, memory.n), inner(last, last, memory.n)
    scale = memory.level_scale[level]
    if memory.level_still[level] != 0.0 and along < 0.0 and along * along > 0.25 * square * last_square:
        scale = max(0.5 * scale, LEAST_SCALE)
    else:
        scale = min((_GROWS if level > 0 else 2.0) * scale, 1.0)
    memory.level_scale[level] = scale
    for j in range(memory.n):
        part[j] *= scale


@compiled
def _add_level(memory: LevelsMemory, level: int) -> None:
    """Add a level's part to the step."""
    part, first, start = memory.level_part[level], memory.first_free, memory.level_end[level - 1]
    rows, width, n = memory.level_end[level] - start, memory.mobility - memory.first_free, memory.n
    part[:n] = 0.0
    memory.level_limit[level], memory.level_sigma[level], memory.level_kept[level] = -1, math.inf, 0
    memory.level_freedom[level] = width
    if rows == 0 or width <= 0:
        return
    rank = min(memory.level_rank[level], rows, width)
    decompose_level(memory, level, first)
    left, total = memory.level_error, 0.0
    for i in range(rows):
        left[i] = memory.wanted[start + i] - inner(memory.task_jacobian[start + i], memory.step, n)
        total += left[i] * left[i]
    size, unweighted_size = math.sqrt(total), size_of(left, memory.row_weights[start:], rows)
    if rank > 0 and total > 0.0 and memory.level_cost[level] > NOISE:
        _solve(memory, level, first, rank, unweighted_size)
        won = 0.0
        for i in range(rows):
            won += left[i] * inner(memory.task_jacobian[start + i], part, n)
        if won <= REST * memory.gain * size and won < 0.5 * total:  # at rest; not if this tick can finish it
            part[:n] = 0.0
        _scale_turn(memory, level)
    for i in range(rank):
        square = memory.level_squares[i] / memory.level_emphasis[i]
        memory.carry = max(memory.carry, _damped_part(square, memory.damping_threshold) * unweighted_size)
        memory.level_sigma[level] = math.sqrt(square)
    for j in range(n):
        memory.step[j] += part[j]
    memory.first_free = first + rank


@compiled
def decompose_level(memory: LevelsMemory, level: int, first: int) -> None:
    """Decompose a level's rows in the freedom `axes[first:]`, whose basis becomes that of its singular vectors; fill
    `level_squares`, largest first, and the directions in which the level is corrected."""
    start, k = memory.level_end[level - 1], memory.mobility
    rows, width = memory.level_end[level] - start, k - first
    lesser, b, y = min(rows, width), memory.level_reduced, memory.coordinates
    for i in range(rows):
        to_free(memory, memory.task_jacobian[start + i], y)
        for c in range(width):
            s = inner(memory.axes[first + c], y, k)
            if rows <= width:
                b[i, c] = s
            else:
                b[c, i] = s
    u, v, squares = memory.level_left, memory.level_right, memory.level_squares
    decompose(b, lesser, max(rows, width), u, v, squares, False)
    if rows <= width:
        find_emphasis(memory.row_weights[start:], rows, u, squares, lesser, True, memory.level_emphasis)
    else:
        find_emphasis(memory.row_weights[start:], rows, v, squares, lesser, False, memory.level_emphasis)
    known, w = 0, memory.level_axes  # right singular vectors, completed
    for i in range(lesser):
        if rows > width:
            copy(u[i], w[i], width)
            known += 1
        elif squares[i] > _LOST * _LOST * squares[0]:
            s = 1.0 / math.sqrt(squares[i])
            for c in range(width):
                w[i, c] = s * v[i, c]
            known += 1
    if known < width:
        _complete(memory, known, width)
    _keep_directions(memory, level, first, known)
    _turn_axes(memory, first, width)


@compiled
def _complete(memory: LevelsMemory, known: int, width: int) -> None:
    """Complete the orthonormal rows of `level_axes` (width, width) to a basis."""
    w, f, tau, reflectors = memory.level_axes, memory.active_normals[0], memory.active[1], memory.active_normals[1]
    for i in range(known):
        copy(w[i], f[i], width)
    factor(f[:known, :width], known, memory.axis_order, memory.active[0], tau, reflectors[:, :width])
    for i in range(known, width):
        w[i] = 0.0
    null_space(known, tau, reflectors[:, :width], w[known:width, :width])


@compiled
def _turn_axes(memory: LevelsMemory, first: int, width: int) -> None:
    """Replace `axes[first:]` by their combinations with the rows of `level_axes`."""
    w, axes, y = memory.level_axes, memory.axes, memory.active[0]
    for j in range(memory.mobility):
        for i in range(width):
            y[i] = axes[first + i, j]
        for i in range(width):
            axes[first + i, j] = inner(w[i], y, width)


@compiled
def _keep_directions(memory: LevelsMemory, level: int, first: int, known: int) -> None:
    """Keep the directions in which the level is corrected: those that are not damped."""
    start, k = memory.level_end[level - 1], memory.mobility
    rows, width = memory.level_end[level] - start, k - first
    u, v, squares, kept = memory.level_left, memory.level_right, memory.level_squares, 0
    least = memory.damping_threshold * memory.damping_threshold
    for i in range(min(memory.level_rank[level], known, rows, width)):
        if squares[i] < least * memory.level_emphasis[i]:
            continue
        s = 1.0 / math.sqrt(squares[i])
        for r in range(rows):
            memory.level_in[level, kept, r] = u[i, r] if rows <= width else s * v[i, r]
        y = memory.coordinates
        y[:k] = 0.0
        for c in range(width):
            add_multiple(s * memory.level_axes[i, c], memory.axes[first + c], y, k)
        to_joints(memory, y, memory.level_out[level, kept])
        kept += 1
    memory.level_kept[level] = kept


@compiled
def _solve(memory: LevelsMemory, level: int, first: int, rank: int, size: float) -> None:
    """Set a level's part to the minimiser within the bounds, for `level_error` of this size without its weights."""
    start, n, g, x = memory.level_end[level - 1], memory.n, memory.normals, memory.wanted_point
    rows, width = memory.level_end[level] - start, memory.mobility - first
    u, v, threshold, part = memory.level_left, memory.level_right, memory.damping_threshold, memory.level_part[level]
    for i in range(width):
        square = memory.level_squares[i] if i < min(rows, width) else 0.0
        h = square + damping(square, memory.level_emphasis[i], size, threshold) if i < rank else RESTING
        h = math.sqrt(h + memory.carry)
        x[i] = 0.0
        if i < min(rows, width):
            along = inner(u[i], memory.level_error, rows) if rows <= width else inner(v[i], memory.level_error, rows)
            x[i] = (math.sqrt(square) * along if rows <= width else along) / h
        to_joints(memory, memory.axes[first + i], memory.fresh)
        for c in range(n):
            g[c, i] = memory.fresh[c] / h
    memory.level_limit[level] = _bound(memory, part, width)


@compiled
def _bound(memory: LevelsMemory, part: Array, width: int) -> int:
    """Set a part of the step to `normals` times the point nearest to `wanted_point` (width,) that keeps all bounds.
    Return the status of what restricts it: AT_LIMIT, BARRED, or -1."""
    n, g, x, room, limit = memory.n, memory.normals, memory.wanted_point, memory.room, -1
    for c in range(n):
        part[c] = inner(g[c], x, width)
    _find_room(memory, room)
    if keeps_bounds(memory, part, room[0], room[1]):
        return -1
    reduce_barriers(memory, width)
    if not nearest(memory, room[0], room[1], room[2], width):
        part[:n] = 0.0
        return AT_LIMIT
    for c in range(n):
        part[c] = inner(g[c], x, width)
        at = memory.q_index[c]
        if room[2, c] != 0.0 and at >= 0:
            value, touch = memory.q[at] + (memory.step[c] + part[c]) * memory.scale[c], 1e-9 * memory.scale[c]
            if value >= memory.upper[c] - touch or value <= memory.lower[c] + touch:
                memory.level_stopped[c], limit = room[2, c], AT_LIMIT
    for b in range(memory.barriers):
        if room[2, n + b] != 0.0:
            memory.stopped[n + b], limit = room[2, n + b], BARRED
    return limit


@compiled
def _find_room(memory: BoundsMemory, room: Array) -> None:
    """Set `room[0]` and `room[1]` to what the bounds leave beyond the step. Velocity limits are bounds here: the step
    of the levels above is not scaled for the sake of this one."""
    n, step = memory.n, memory.step
    for j in range(n):
        fastest = max(SPARE_SPEED * memory.longest_step[j], abs(step[j]))
        room[0, j] = min(max(memory.floor[j], -fastest) - step[j], 0.0)
        room[1, j] = max(min(memory.ceiling[j], fastest) - step[j], 0.0)
    for b in range(memory.barriers):
        room[0, n + b] = memory.floor[n + b]
        room[1, n + b] = max(memory.ceiling[n + b] - inner(memory.barrier_rows[b], step, n), 0.0)


@compiled
def _add_objective(memory: LevelsMemory) -> None:
    """Add to the step the part of the objectives' motion that no level uses, nearest to it as the joints move."""
    n, width, g, x, fresh = (
        memory.n,
        memory.mobility - memory.first_free,
        memory.normals,
        memory.wanted_point,
        memory.fresh,
    )
    part = memory.level_part[memory.levels]
    if width <= 0:
        return
    for i in range(width):
        to_joints(memory, memory.axes[memory.first_free + i], fresh)
        write_orthonormal(memory, i)
        x[i] = 0.0
        for j in range(n):
            x[i] += g[j, i] * memory.secondary_wanted[j]
    _bound(memory, part, width)
    _scale_turn(memory, memory.levels)
    for j in range(n):
        memory.step[j] += part[j]


@compiled
def promise(memory: LevelsMemory) -> None:
    """Set what the attempted step promises to lower levels, and what all levels are corrected to.

    With the gradient g of a level's cost, its rows' motion u by the levels above and o by its own part, the cost
    becomes `level_cost` - g . u + |u|^2 / 2 without the part, and is less by (g - u) . o - |o|^2 / 2 with it.
    """
    for level in range(memory.levels):
        start, others, gained = memory.level_end[level - 1] if level > 0 else 0, 0.0, 0.0
        for i in range(start, memory.level_end[level]):
            row, wanted = memory.task_jacobian[i], memory.wanted[i] / memory.gain
            memory.aimed[i] = inner(row, memory.attempted, memory.n)
            if level > 0:
                part = inner(row, memory.level_part[level], memory.n)
                above = memory.aimed[i] - part
                others += (wanted - 0.5 * above) * above
                gained += (wanted - above - 0.5 * part) * part
        memory.level_rest[level], memory.level_promised[level] = memory.level_cost[level] - others, gained
