"""Limits of position, velocity and acceleration as bounds of a tick's step."""

from __future__ import annotations

import math

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.bounds import TOUCH
from cinegen.ik._kernels.directions import all_axes
from cinegen.ik._kernels.redundancy import add_wish
from cinegen.ik._kernels.resolve import bounded, within
from cinegen.ik.thresholds import FULL
from cinegen.jit.compiled import Array, Table, compiled, matrices, matrix, vector

_EASED = 6  # times that barriers ask less back of a step than they did, where they contradict each other


@compiled
def keep_bounds(t: Table, step: Array, y: Array, pull_rank: int, room: float) -> None:
    """Bends and shortens the step so that positions, velocities and accelerations stay within their limits; what
    redundancy would like is added as far as it keeps them.

    Args:
        t: the table.
        step: (n,) becomes what is left of it.
        y: (k,) the same in the free motions.
        pull_rank: the pulls' generic rank.
        room: the way to the targets, in such steps, if the robot is to stop there; else infinite.
    """
    n, offset, k = t[m.N], t[m.OFFSET], t[m.K]
    record = vector(t[m.RECORD], m.R_HEAD)
    longest = vector(t[m.LONGEST] + 8 * offset, n)
    total = n + t[m.BARRIERS]
    floor, ceiling = vector(t[m.FLOOR], total), vector(t[m.CEILING], total)
    rows = matrix(t[m.BARRIER_ROWS], t[m.BARRIERS], n)
    excess, slowest = 0.0, -1
    for j in range(n):
        part = abs(step[j]) / longest[j]
        if part > excess:
            excess, slowest = part, j
    _positions(t, floor, ceiling)
    _barriers(t, floor, ceiling)
    pace = FULL / excess if excess > FULL else 1.0
    if t[m.ACCELERATED] != 0 and room < math.inf:
        limit = vector(t[m.ACCELERATION] + 8 * offset, n)
        for j in range(n):
            way = abs(step[j])
            if limit[j] < math.inf and _stopping(room * way, limit[j]) < pace * way:
                pace, slowest = _stopping(room * way, limit[j]) / way, j
    if pace < 1.0:  # slower, in the same direction
        record[m.R_PACE], record[m.R_SLOWEST] = pace, slowest
        for j in range(n):
            step[j] *= pace
        for i in range(k):
            y[i] *= pace
    if t[m.ACCELERATED] != 0:
        _accelerations(t, floor, ceiling)
    if must_go_back(t):
        _as_fast_as_can_be(t, floor, ceiling, rows)
    wishing = t[m.WISHING] != 0
    if wishing and add_wish(t, step, pull_rank, True):
        return
    if not within(step, floor, ceiling, rows, n):
        _bend(t, step, y, pull_rank)
    if wishing:
        add_wish(t, step, pull_rank, False)


@compiled
def _positions(t: Table, floor: Array, ceiling: Array) -> None:
    """The bounds (n,) of a step that limits of position give: none leads further beyond."""
    n, offset = t[m.N], t[m.OFFSET]
    q, at = vector(t[m.Q], t[m.NQ]), vector(t[m.AT] + 8 * offset, n)
    scale = vector(t[m.SCALE] + 8 * offset, n)
    low, high = vector(t[m.LOW] + 8 * offset, n), vector(t[m.HIGH] + 8 * offset, n)
    for j in range(n):
        if at[j] < 0.0:
            floor[j], ceiling[j] = -math.inf, math.inf
        else:
            here = q[int(at[j])]
            floor[j] = min(0.0, low[j] - here) / scale[j]
            ceiling[j] = max(0.0, high[j] - here) / scale[j]


@compiled
def _barriers(t: Table, floor: Array, ceiling: Array) -> None:
    """The bounds behind the first n (barriers,) of what barriers see of a step."""
    n, room = t[m.N], vector(t[m.BARRIER_ROOM], t[m.BARRIERS])
    for b in range(t[m.BARRIERS]):
        floor[n + b], ceiling[n + b] = -math.inf, room[b]


@compiled
def must_go_back(t: Table) -> bool:
    """Whether a barrier does not allow the mechanism to stay."""
    room = vector(t[m.BARRIER_ROOM], t[m.BARRIERS])
    back = False
    for b in range(t[m.BARRIERS]):
        back = back or room[b] < 0.0
    return back


@compiled
def _as_fast_as_can_be(t: Table, floor: Array, ceiling: Array, rows: Array) -> None:
    """Where the mechanism has to go back, it need not go faster than its joints can: then it could not go at all."""
    n, longest = t[m.N], vector(t[m.LONGEST] + 8 * t[m.OFFSET], t[m.N])
    for b in range(t[m.BARRIERS]):
        if not ceiling[n + b] < 0.0:
            continue
        s = 0.0
        for j in range(n):
            if rows[b, j] > 0.0:
                s += rows[b, j] * max(floor[j], -FULL * longest[j])
            elif rows[b, j] < 0.0:
                s += rows[b, j] * min(ceiling[j], FULL * longest[j])
        ceiling[n + b] = max(ceiling[n + b], min(FULL * s, 0.0))


@compiled
def _speeds(t: Table, floor: Array, ceiling: Array) -> None:
    """Narrows the bounds (n,) to what limits of velocity allow."""
    longest = vector(t[m.LONGEST] + 8 * t[m.OFFSET], t[m.N])
    for j in range(t[m.N]):
        floor[j] = max(floor[j], -FULL * longest[j])
        ceiling[j] = min(ceiling[j], FULL * longest[j])


@compiled
def _bend(t: Table, step: Array, y: Array, pull_rank: int) -> None:
    """The step that does most for the pulls within all bounds."""
    n, offset, k = t[m.N], t[m.OFFSET], t[m.K]
    record = vector(t[m.RECORD], m.R_HEAD)
    q, at = vector(t[m.Q], t[m.NQ]), vector(t[m.AT] + 8 * offset, n)
    scale = vector(t[m.SCALE] + 8 * offset, n)
    low, high = vector(t[m.LOW] + 8 * offset, n), vector(t[m.HIGH] + 8 * offset, n)
    total = n + t[m.BARRIERS]
    floor, ceiling, rows = (
        vector(t[m.FLOOR], total),
        vector(t[m.CEILING], total),
        matrix(t[m.BARRIER_ROWS], t[m.BARRIERS], n),
    )
    accelerated = t[m.ACCELERATED] != 0
    _speeds(t, floor, ceiling)
    all_axes(t, pull_rank)
    motions, looped = matrix(t[m.MOTIONS], k, n), t[m.RANK] > 0
    axes, size, x = matrix(t[m.AXES], k, k), vector(t[m.SIZE], k), vector(t[m.X], k)
    held = vector(t[m.STOPPED], total)
    g, work = matrix(t[m.G], total, k), matrices(t[m.WORK], 3, k, k)
    scratch = matrix(t[m.SCRATCH], 6, k)
    found = bounded(y, motions, looped, axes, size, floor, ceiling, rows, n, k, x, g, held, work, scratch, step)
    if not found and must_go_back(t):  # not all at once: as much as can be, or nothing at all
        for eased in range(_EASED):
            for b in range(n, total):
                if ceiling[b] < 0.0:
                    ceiling[b] = 0.25 * ceiling[b] if eased < _EASED - 1 else 0.0
            found = bounded(y, motions, looped, axes, size, floor, ceiling, rows, n, k, x, g, held, work, scratch, step)
            if found:
                break
    if not found:
        if accelerated:  # positions and velocities count more; within these, as near to braking as can be
            braking = vector(t[m.BRAKING], n)
            for i in range(k):
                s = 0.0 if looped else braking[i]
                if looped:
                    for j in range(n):
                        s += motions[i, j] * braking[j]
                y[i] = s
            _positions(t, floor, ceiling)
            _speeds(t, floor, ceiling)
            found = bounded(y, motions, looped, axes, size, floor, ceiling, rows, n, k, x, g, held, work, scratch, step)
        if not found:
            for j in range(n):
                step[j] = 0.0
    part = 1.0  # of the step that is within all bounds, to rounding
    for j in range(n):
        if step[j] > ceiling[j] + TOUCH and ceiling[j] >= 0.0:
            part = min(part, ceiling[j] / step[j])
        elif step[j] < floor[j] - TOUCH and floor[j] <= 0.0:
            part = min(part, floor[j] / step[j])
        if held[j] != 0.0 and not _at_position_limit(held[j], q, at[j], step[j], low[j], high[j], scale[j]):
            held[j] = 0.0  # a velocity's or an acceleration's limit
            record[m.R_SLOWEST] = j
    for b in range(t[m.BARRIERS]):
        s, most = 0.0, ceiling[n + b]
        for j in range(n):
            s += rows[b, j] * step[j]
        if s > most + TOUCH and most >= 0.0:
            part = min(part, most / s)
    if part < 1.0:
        for j in range(n):
            step[j] *= part


@compiled
def _at_position_limit(side: float, q: Array, at: float, step: float, low: float, high: float, scale: float) -> bool:
    """Whether a joint that its bound holds back stands on a position limit after the step, or beyond it before."""
    if at < 0.0:
        return False
    here = q[int(at)]
    there = here + step * scale
    if side > 0.0:
        return bool(here >= high or there >= high - 1e-9 * scale)
    return bool(here <= low or there <= low + 1e-9 * scale)


@compiled
def _accelerations(t: Table, floor: Array, ceiling: Array) -> None:
    """Narrows the bounds to what accelerations allow: of the next step, and so that a joint can still stop before its
    position limit. Where loops tie joints together, braking in the direction of the motion always stays possible.

    What closing the loops added to the last step, it will add to this one, too (`drift`)."""
    n, looped = t[m.N], t[m.RANK] > 0
    last, limit = vector(t[m.LAST], n), vector(t[m.ACCELERATION] + 8 * t[m.OFFSET], n)
    drift, braking = vector(t[m.DRIFT], n), vector(t[m.BRAKING], n)
    goes_on = 0.0  # part of the last step
    for j in range(n):
        if abs(last[j]) > limit[j]:
            goes_on = max(goes_on, 1.0 - FULL * limit[j] / abs(last[j]))
    for j in range(n):
        if looped:
            braking[j] = goes_on * last[j] - drift[j]
        else:
            least = max(0.0, abs(last[j]) - FULL * limit[j])
            braking[j] = least if last[j] > 0.0 else -least
        if limit[j] == math.inf:
            continue
        most = FULL * limit[j]
        down, up = last[j] - most - drift[j], last[j] + most - drift[j]
        up = min(up, _stopping(ceiling[j], most))
        down = max(down, -_stopping(-floor[j], most))
        allowed = braking[j] if looped else up
        floor[j] = max(floor[j], min(down, allowed, up))
        ceiling[j] = min(ceiling[j], max(up, allowed, down))


@compiled
def _stopping(room: float, limit: float) -> float:
    """The longest step s that leaves room to stop: s + (s - a) + (s - 2 a) + ... as long as these are above 0."""
    if room == math.inf:
        return math.inf
    more = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * room / limit) - 1.0))  # steps after this one
    return (room + 0.5 * limit * more * (more + 1.0)) / (more + 1.0)
