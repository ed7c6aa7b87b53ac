"""Point-to-point inverse kinematics, compiled: one start, iterated until it is there or leads nowhere.

Loops and pulls are one system of equations r(q) = 0 here (the extended Jacobian), and joint limits a box. Levenberg's
and Marquardt's step, d = J^T (J J^T + mu |r|^2 1)^-1 r, has a damping that vanishes with the residual: convergence is
quadratic at the end, also where rows depend on each other (N. Yamashita and M. Fukushima, "On the rate of convergence
of the Levenberg-Marquardt method", 2001). A joint that stands on a limit and is driven against it is left out of J.
"""

from __future__ import annotations

import math

from numba import types

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.aims import aim_at, holding
from cinegen.jit.compiled import TABLE, Array, Table, compiled, entry, matrix, prepare, vector
from cinegen.loops._kernels.closing import loop_rows

FOUND, ONWARD, STUCK = range(3)

# the first numbers of the scratch: the squared residual, the damping, iterations, those without progress, the largest
# residual of pulls and of loops, what counts as reached, whether this is a new start, iterations at most
COST, MU, COUNT, STALLED, PULLS_LEFT, LOOPS_LEFT, GOAL, FRESH, MOST, HEAD = range(10)

_LONGEST = 0.8  # rad or lengths of one joint in an iteration
SOFT = 0.03  # the first mu
_SMALLEST, _LARGEST = 1e-6, 1e7  # of mu
_FLOOR = 1e-13  # of the damping, as a part of J J^T's trace: rows may depend on each other
_SLOW = 0.95  # part of the squared residual that is left after an iteration without progress
_PATIENCE = 5  # of these in a row
_ROUNDING = 1e-12  # rad or lengths


def scratch_size(rows: int, n: int) -> int:
    """Numbers that `seek` needs."""
    return HEAD + rows * n + rows * rows + 2 * rows + n


@entry
def seek(t: Table, s_address: int) -> int:
    """Goes on from Pinocchio's Jacobians at `trial`.

    Args:
        t: the solver's table. `q` becomes the best so far.
        s_address: of the scratch.

    Returns:
        FOUND; STUCK; or ONWARD: wants Pinocchio's Jacobians at the new `trial`, that is at `before` moved by `delta`.
    """
    n, rows = t[m.N], t[m.ROWS]
    head = vector(s_address, HEAD)
    if head[FRESH] != 0.0:
        holding(t)
    aim_at(t)
    p = t[m.P]
    size = p + rows
    jacobian = matrix(s_address + 8 * HEAD, size, n)
    square = matrix(s_address + 8 * (HEAD + size * n), size, size)
    residual = vector(s_address + 8 * (HEAD + size * n + size * size), size)
    e, c = vector(t[m.E_WHOLE], p), vector(t[m.C], rows)
    if t[m.LOOPS] > 0:
        loop_rows(t, True)
    cost, pulls, loops = 0.0, 0.0, 0.0
    for i in range(p):
        cost += e[i] * e[i]
        pulls = max(pulls, abs(e[i]))
    for i in range(rows):
        cost += c[i] * c[i]
        loops = max(loops, abs(c[i]))
    head[COUNT] += 1.0
    reached = head[FRESH] == 0.0 and max(head[PULLS_LEFT], head[LOOPS_LEFT]) <= head[GOAL]
    if head[FRESH] != 0.0 or cost < head[COST]:
        before = math.inf if head[FRESH] != 0.0 else head[COST]
        head[FRESH] = 0.0
        head[COST], head[PULLS_LEFT], head[LOOPS_LEFT] = cost, pulls, loops
        q, trial = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ])
        for i in range(t[m.NQ]):
            q[i] = trial[i]
        if max(pulls, loops) <= _ROUNDING or (reached and cost > 0.01 * before):
            return FOUND
        head[STALLED] = head[STALLED] + 1.0 if cost > _SLOW * before else 0.0
        head[MU] = max(_SMALLEST, head[MU] * (0.2 if cost < 0.5 * before else 0.7))
        jp, jc = matrix(t[m.JP], p, n), matrix(t[m.JC], rows, n)
        for i in range(p):
            residual[i] = e[i]
            for j in range(n):
                jacobian[i, j] = jp[i, j]
        for i in range(rows):
            residual[p + i] = -c[i]
            for j in range(n):
                jacobian[p + i, j] = jc[i, j]
    else:
        if reached:
            return FOUND
        head[MU] *= 6.0
        head[STALLED] += 0.5
    if head[COUNT] > head[MOST] or head[STALLED] >= _PATIENCE or head[MU] > _LARGEST or not head[COST] < 1e30:
        return STUCK
    spare = s_address + 8 * (HEAD + size * n + size * size + size)
    if not _step(t, head, jacobian, residual, square, vector(spare, size), vector(spare + 8 * size, n), size, n):
        return FOUND if max(head[PULLS_LEFT], head[LOOPS_LEFT]) <= head[GOAL] else STUCK
    return ONWARD


@compiled
def _step(
    t: Table, head: Array, jacobian: Array, residual: Array, square: Array, z: Array, free: Array, size: int, n: int
) -> bool:
    """Sets `trial` one step away from q. False where every joint that would help stands on a limit."""
    offset = t[m.OFFSET]
    q, trial, before = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ]), vector(t[m.BEFORE], t[m.NQ])
    at, delta = vector(t[m.AT] + 8 * offset, n), vector(t[m.DELTA] + 8 * offset, n)
    low, high = vector(t[m.LOW] + 8 * offset, n), vector(t[m.HIGH] + 8 * offset, n)
    scale, d = vector(t[m.SCALE] + 8 * offset, n), vector(t[m.STEP], n)
    for j in range(n):
        s = 0.0
        for i in range(size):
            s += jacobian[i, j] * residual[i]
        free[j] = 0.0 if _blocked(q, at[j], s, low[j], high[j]) else 1.0
    for _ in range(4):
        trace = 0.0
        for i in range(size):
            for k in range(i + 1):
                s = 0.0
                for j in range(n):
                    s += jacobian[i, j] * free[j] * jacobian[k, j]
                square[i, k] = s
            trace += square[i, i]
        if not trace > 0.0:
            return False
        damping = head[MU] * head[COST] + _FLOOR * trace
        for i in range(size):
            square[i, i] += damping
        _solve(square, residual, z, size)
        again = False
        for j in range(n):
            s = 0.0
            for i in range(size):
                s += jacobian[i, j] * z[i]
            d[j] = s * free[j]
            if free[j] != 0.0 and _blocked(q, at[j], s, low[j], high[j]):
                free[j] = 0.0
                again = True
        if not again:
            break
    longest = 0.0
    for j in range(n):
        d[j] *= free[j]
        longest = max(longest, abs(d[j]))
    cut = min(1.0, _LONGEST / max(longest, 1e-300))
    for i in range(t[m.NQ]):
        trial[i] = q[i]
        before[i] = q[i]
    for j in range(n):
        delta[j] = cut * d[j] * scale[j]
        if at[j] >= 0.0:
            i = int(at[j])
            trial[i] = min(max(q[i] + delta[j], low[j]), high[j])
    return longest > 0.0


@compiled
def _blocked(q: Array, at: float, way: float, low: float, high: float) -> bool:
    """Whether a joint stands on a limit that it would go beyond."""
    if at < 0.0:
        return False
    here = q[int(at)]
    return bool((here >= high and way > 0.0) or (here <= low and way < 0.0))


@compiled
def _solve(a: Array, b: Array, x: Array, n: int) -> None:
    """x = a^-1 b for a positive definite a, whose lower half is given and lost (Cholesky)."""
    for i in range(n):
        for k in range(i):
            s = a[i, k]
            for j in range(k):
                s -= a[i, j] * a[k, j]
            a[i, k] = s * a[k, k]
        s = a[i, i]
        for j in range(i):
            s -= a[i, j] * a[i, j]
        a[i, i] = 1.0 / math.sqrt(max(s, 1e-300))
    for i in range(n):
        s = b[i]
        for j in range(i):
            s -= a[i, j] * x[j]
        x[i] = s * a[i, i]
    for i in range(n - 1, -1, -1):
        s = x[i]
        for j in range(i + 1, n):
            s -= a[j, i] * x[j]
        x[i] = s * a[i, i]


@entry
def nearest_start(features: Array, goal: Array, used: Array) -> int:
    """Index of the row of features (count, width) that is nearest to goal (width,) and not used yet; -1 if none is."""
    best, nearest = -1, math.inf
    for i in range(features.shape[0]):
        if used[i] == 0.0:
            s = 0.0
            for k in range(features.shape[1]):
                s += (features[i, k] - goal[k]) * (features[i, k] - goal[k])
            if s < nearest:
                best, nearest = i, s
    return best


def prepare_seek() -> None:
    """Compiles these kernels, or loads them from disk."""
    prepare(seek, TABLE, types.int64)
    prepare(nearest_start, types.float64[:, ::1], types.float64[::1], types.float64[::1])
