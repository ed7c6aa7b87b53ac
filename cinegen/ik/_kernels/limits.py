"""Limits of position, velocity and acceleration, and barriers, as bounds of a tick's step."""

from __future__ import annotations

import math

import numpy as np

from cinegen.ik._kernels.bounds import TOUCH, keeps_bounds, nearest, reduce_barriers
from cinegen.ik._kernels.decomposition import find_axes, project_step, to_joints
from cinegen.ik._kernels.levels import add_levels
from cinegen.ik._kernels.memory import (
    LIMITING_DOF,
    SPEED_SCALE,
    BoundsMemory,
    RecordMemory,
    SecondaryMemory,
    SolverMemory,
)
from cinegen.ik._kernels.secondary import add_secondary
from cinegen.ik.thresholds import FULL
from cinegen.jit.compiled import compiled, inlined
from cinegen.jit.vectors import inner
from cinegen.loops._kernels.memory import ClusterMemory, cluster_at

_SPARE = 0.02  # of an acceleration limit, where closing loops adds to steps
_PLANNED = 0.9  # of an acceleration limit, with which joints of loops plan to brake: loops curve their path meanwhile
_EASED = 6  # number of times that barriers are relaxed if they contradict each other


@compiled
def keep_limits(memory: SolverMemory, ticks_left: float) -> None:
    """Project and scale `step` so that positions, velocities and accelerations stay within their limits; the secondary
    step is added as far as it respects them.

    Args:
        memory: `free_step` is the same step in the null space.
        ticks_left: number of such steps to the targets, if the robot is to stop there; else infinite.
    """
    step = memory.step
    _slow_down(memory, ticks_left)
    _bound_positions(memory)
    for b in range(memory.barriers):
        memory.floor[memory.n + b], memory.ceiling[memory.n + b] = -math.inf, memory.barrier_room[b]
    if memory.has_acceleration_limits != 0:
        _bound_accelerations(memory)
    if must_go_back(memory):
        _bound_by_speed(memory)
    has_secondary = memory.has_secondary != 0
    if memory.parts > 0:
        if not keeps_bounds(memory, step, memory.floor, memory.ceiling):
            _bend(memory)
        add_levels(memory)
        return
    if has_secondary and add_secondary(memory, True):
        return
    if not keeps_bounds(memory, step, memory.floor, memory.ceiling):
        _bend(memory)
    if has_secondary:
        add_secondary(memory, False)


@inlined
def _slow_down(memory: RecordMemory, ticks_left: float) -> None:
    """Scale `step` to the velocity limits, and so that ever shorter ones can follow it up to the targets."""
    n, step, longest, excess, limiting = memory.n, memory.step, memory.longest_step, 0.0, -1
    for j in range(n):
        part = abs(step[j]) / longest[j]
        if part > excess:
            excess, limiting = part, j
    scale = FULL / excess if excess > FULL else 1.0
    if memory.has_acceleration_limits != 0 and ticks_left < math.inf:
        for j in range(n):
            size, limit = abs(step[j]), memory.longest_change[j]
            if limit < math.inf and _stopping(ticks_left * size, limit) < scale * size:
                scale, limiting = _stopping(ticks_left * size, limit) / size, j
    if scale < 1.0:
        memory.report[SPEED_SCALE], memory.report[LIMITING_DOF] = scale, limiting
        for j in range(n):
            step[j] *= scale
        for i in range(memory.mobility):
            memory.free_step[i] *= scale


@compiled
def must_go_back(memory: BoundsMemory) -> bool:
    """Return whether a barrier does not allow the mechanism to stay."""
    back = False
    for b in range(memory.barriers):
        back = back or memory.barrier_room[b] < 0.0
    return back


@compiled
def _bound_positions(memory: BoundsMemory) -> None:
    """Set the bounds of the position limits: no step leads further beyond them."""
    for j in range(memory.n):
        at, scale = memory.q_index[j], memory.scale[j]
        memory.floor[j], memory.ceiling[j] = -math.inf, math.inf
        if at >= 0:
            memory.floor[j] = min(0.0, memory.lower[j] - memory.q[at]) / scale
            memory.ceiling[j] = max(0.0, memory.upper[j] - memory.q[at]) / scale


@compiled
def _bound_speeds(memory: BoundsMemory) -> None:
    """Narrow the bounds to the velocity limits."""
    for j in range(memory.n):
        memory.floor[j] = max(memory.floor[j], -FULL * memory.longest_step[j])
        memory.ceiling[j] = min(memory.ceiling[j], FULL * memory.longest_step[j])


@compiled
def _bound_by_speed(memory: BoundsMemory) -> None:
    """Relax barriers that push the mechanism back to what velocity limits allow: otherwise no step would exist."""
    for b in range(memory.barriers):
        at = memory.n + b
        if not memory.ceiling[at] < 0.0:
            continue
        s = 0.0
        for j in range(memory.n):
            row, longest = memory.barrier_rows[b, j], FULL * memory.longest_step[j]
            if row > 0.0:
                s += row * max(memory.floor[j], -longest)
            elif row < 0.0:
                s += row * min(memory.ceiling[j], longest)
        memory.ceiling[at] = max(memory.ceiling[at], min(FULL * s, 0.0))


@compiled
def _find_bounded(memory: SecondaryMemory) -> bool:
    """Set `step` to the one within its bounds that is nearest to `free_step`, in the metric of `axes` and `size`.
    Return whether there is one: the bounds may contradict each other."""
    k, g, x, axes, size = memory.mobility, memory.normals, memory.wanted_point, memory.axes, memory.size
    for i in range(k):
        x[i] = size[i] * inner(axes[i], memory.free_step, k)
        to_joints(memory, axes[i], memory.fresh)
        for c in range(memory.n):
            g[c, i] = memory.fresh[c] / size[i]
    reduce_barriers(memory, k)
    if not nearest(memory, memory.floor, memory.ceiling, memory.stopped, k):
        return False
    for c in range(memory.n):
        memory.step[c] = inner(g[c], x, k)
    return True


@compiled
def _bend(memory: SolverMemory) -> None:
    """Set `step` to the one that does most for the tasks within all bounds."""
    _bound_speeds(memory)
    find_axes(memory)
    done = _find_bounded(memory)
    if not done and must_go_back(memory):
        done = _ease_barriers(memory)
    if not done and memory.has_acceleration_limits != 0:
        done = _find_braking(memory)
    if not done:
        _brake(memory)
    for j in range(memory.n):
        if memory.stopped[j] != 0.0 and not _is_at_position_limit(memory, j):
            memory.stopped[j] = 0.0  # a velocity's or an acceleration's limit
            memory.report[LIMITING_DOF] = j
    _shorten(memory)


@compiled
def _ease_barriers(memory: SecondaryMemory) -> bool:
    """Set `step` as `_find_bounded` does, with barriers that push the mechanism back not all at once: as much as can
    be, or nothing at all. Return whether there is one."""
    ceiling = memory.ceiling
    for eased in range(_EASED):
        for b in range(memory.n, memory.n + memory.barriers):
            if ceiling[b] < 0.0:
                ceiling[b] = 0.25 * ceiling[b] if eased < _EASED - 1 else 0.0
        if _find_bounded(memory):
            return True
    return False


@compiled
def _find_braking(memory: SecondaryMemory) -> bool:
    """Set `step` to the one that is as near to braking as can be: limits of positions and velocities count more than
    those of accelerations. Return whether there is one."""
    n, ceiling = memory.n, memory.ceiling
    project_step(memory, memory.braking, memory.free_step, False)
    _bound_positions(memory)
    _bound_speeds(memory)
    for b in range(memory.barriers):  # a barrier asks for no more than braking does
        ceiling[n + b] = max(ceiling[n + b], inner(memory.barrier_rows[b], memory.braking, n))
    return _find_bounded(memory)


@compiled
def _brake(memory: BoundsMemory) -> None:
    """Set `step` to braking, or to nothing without limits of accelerations; joints that no loop moves keep their
    bounds."""
    step = memory.step
    for j in range(memory.n):
        step[j] = memory.braking[j] if memory.has_acceleration_limits != 0 else 0.0
    for i in range(memory.idle):
        j = memory.idle_dof[i]
        step[j] = min(max(step[j], memory.floor[j]), memory.ceiling[j])


@compiled
def _shorten(memory: BoundsMemory) -> None:
    """Scale `step` to the part of it that is within all bounds, to rounding, of those that allow to stay."""
    n, step, floor, ceiling, part = memory.n, memory.step, memory.floor, memory.ceiling, 1.0
    for j in range(n):
        if step[j] > ceiling[j] + TOUCH and ceiling[j] >= 0.0:
            part = min(part, ceiling[j] / step[j])
        elif step[j] < floor[j] - TOUCH and floor[j] <= 0.0:
            part = min(part, floor[j] / step[j])
    for b in range(memory.barriers):
        s, most = inner(memory.barrier_rows[b], step, n), ceiling[n + b]
        if s > most + TOUCH and most >= 0.0:
            part = min(part, most / s)
    if part < 1.0:
        for j in range(n):
            step[j] *= part


@compiled
def _is_at_position_limit(memory: BoundsMemory, j: int) -> bool:
    """Return whether a joint with an active bound is at a position limit after the step, or was beyond it before."""
    if memory.q_index[j] < 0:
        return False
    value, scale = memory.q[memory.q_index[j]], memory.scale[j]
    after = value + memory.step[j] * scale
    if memory.stopped[j] > 0.0:
        return bool(value >= memory.upper[j] or after >= memory.upper[j] - 1e-9 * scale)
    return bool(value <= memory.lower[j] or after <= memory.lower[j] + 1e-9 * scale)


@compiled
def _bound_accelerations(memory: BoundsMemory) -> None:
    """Narrow the bounds to what accelerations allow: of the next step, and so that a joint can still stop before its
    position limit. Joints that loops and couplings tie together brake together, in the direction of their motion, which
    always stays possible; all others brake alone."""
    for i in range(memory.idle):
        _bound_alone(memory, memory.idle_dof[i])
    for c in range(memory.clusters):
        _bound_cluster(memory, cluster_at(memory.cluster_handles[c]))


@compiled
def _bound_alone(memory: BoundsMemory, j: int) -> None:
    """Narrow the bounds of a joint that no loop moves."""
    floor, ceiling, last, most = memory.floor, memory.ceiling, memory.last[j], FULL * memory.longest_change[j]
    least = max(0.0, abs(last) - most)
    memory.braking[j] = least if last > 0.0 else -least
    if most == math.inf:
        return
    down, up = last - most - memory.drift[j], last + most - memory.drift[j]
    up = min(up, _stopping(ceiling[j], most))
    down = max(down, -_stopping(-floor[j], most))
    floor[j], ceiling[j] = max(floor[j], min(down, up)), min(ceiling[j], max(up, down))


@compiled
def _bound_cluster(memory: BoundsMemory, cluster: ClusterMemory) -> None:
    """Narrow the bounds of the joints of a cluster. All brake for as long as the one that takes longest: after a step
    s that is followed by n - 1 ever shorter ones, a joint moves by s (n + 1) / 2, and its limit must be as far. Where
    a limit is nearer, n is less: no joint may be so fast that it takes longer.

    What closing the loops added to the last step, it will add to this one, too (`drift`)."""
    last, drift, braking, dof = memory.last, memory.drift, memory.braking, cluster.dof
    floor, ceiling, usable, ticks = memory.floor, memory.ceiling, 1.0 - _SPARE, 0.0
    for i in range(cluster.n):
        ticks = max(ticks, abs(last[dof[i]]) / (_PLANNED * memory.longest_change[dof[i]]))
    change = usable / _PLANNED  # of `ticks`, in this tick: at most
    left, goes_on = ticks + change, 1.0 - change / max(ticks, change)
    for i in range(cluster.n):
        j = dof[i]
        braking[j] = goes_on * last[j] - drift[j]
        room = ceiling[j] if braking[j] > 0.0 else -floor[j]
        if abs(braking[j]) * (left + 1.0) > 2.0 * room:
            left = 2.0 * room / abs(braking[j]) - 1.0
    left = max(left, ticks - change, 1.0)
    for i in range(cluster.n):
        j = dof[i]
        limit = memory.longest_change[j]
        down = max(2.0 * floor[j] / (left + 1.0), last[j] - usable * limit - drift[j], -left * _PLANNED * limit)
        up = min(2.0 * ceiling[j] / (left + 1.0), last[j] + usable * limit - drift[j], left * _PLANNED * limit)
        floor[j] = max(floor[j], min(down, braking[j], up))
        ceiling[j] = min(ceiling[j], max(up, braking[j], down))


@compiled
def _stopping(room: float, limit: float) -> float:
    """Return the longest step s after which a joint can stop: s + (s - a) + (s - 2 a) + ..., terms above 0 only."""
    if room == math.inf:
        return math.inf
    more = np.floor(0.5 * (math.sqrt(1.0 + 8.0 * room / limit) - 1.0))  # steps after this one: a float, however many
    return float((room + 0.5 * limit * more * (more + 1.0)) / (more + 1.0))
