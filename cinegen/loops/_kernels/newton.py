"""Closing loops by Gauss-Newton steps from nearby, as `raff2urdf.closure.close` does: the same steps, but for rounding.

Its damped step on the singular value decomposition is (J^T J + mu 1) d = -J^T c on the rows that count. With J's rows
in the order of what they add, J = L Q^T by Householder reflections, that is d = Q y with (L^T L + mu 1) y = -L^T c: no
iteration is needed. That holds where the rank is clear. Where it is not, or where a step is too long or does not bring
the ends nearer, nothing is done here: `closure.close` begins again from where this began.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import TABLE, Array, Table, compiled, entry, matrix, prepare, vector
from cinegen.jit.null_space import factor, reflect
from cinegen.loops._kernels import memory as m
from cinegen.loops._kernels.closing import loop_rows, move, squared_gap
from raff2urdf.closure import CLOSED, ROUNDING, STEP_CAP

FOUND, ONWARD, UNCLEAR = range(3)

_MOST = 12  # evaluations
_CLEAR = 1e-3  # part of the first row that each of the others adds at least, or the rank is not clear
_ADDS_NOTHING = 1e-10  # part of the longest row: what is left of one that depends on others


@entry
def newton(t: Table) -> int:
    """Goes on from Pinocchio's Jacobians at `trial`; at first `corrections` is 0 and the joints that stay are `held`.

    Returns:
        FOUND: closed, at `q`. ONWARD: wants Pinocchio's Jacobians at the new `trial`, that is at `before` moved by
        `delta`. UNCLEAR.
    """
    q, trial = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ])
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    gap = loop_rows(t, False)
    squared = squared_gap(t)
    enough = False
    if t[m.CORRECTIONS] == 0:
        for i in range(t[m.NQ]):
            if not math.isfinite(trial[i]):
                return UNCLEAR
        settings[m.DAMPING] = 1.0
    else:
        if not squared < settings[m.SQUARED]:
            return FOUND if settings[m.GAP] <= CLOSED else UNCLEAR
        enough = gap <= 0.1 * CLOSED and gap > 0.25 * settings[m.GAP]
        settings[m.DAMPING] = max(0.1 * settings[m.DAMPING], 1e-4)
    settings[m.SQUARED], settings[m.GAP] = squared, gap
    for i in range(t[m.NQ]):
        q[i] = trial[i]
    if gap <= ROUNDING or enough:
        return FOUND
    if t[m.CORRECTIONS] == _MOST or not gap < math.inf:
        return UNCLEAR
    if not _step(t, settings[m.DAMPING] * squared):
        return UNCLEAR
    move(t, vector(t[m.STEP], t[m.N]))
    t[m.CORRECTIONS] += 1
    return ONWARD


@compiled
def _step(t: Table, damping: float) -> bool:
    """The damped `step` (n,) from the residual; False where the rank is not clear or the step is too long."""
    n, rows = t[m.N], t[m.ROWS]
    held, step = vector(t[m.HELD], n), vector(t[m.STEP], n)
    free = 0
    for k in range(n):
        if held[k] == 0.0:
            free += 1
    rank = min(t[m.RANK], free)
    if rank == 0:
        return False
    loop_rows(t, True)
    jc, f, c = matrix(t[m.JC], rows, n), matrix(t[m.F], rows, n), vector(t[m.C], rows)
    for i in range(rows):
        for k in range(n):
            f[i, k] = 0.0 if held[k] != 0.0 else jc[i, k]
    order, left, tau = vector(t[m.ORDER], rows), vector(t[m.LEFT], rows), vector(t[m.TAU], n)
    h = matrix(t[m.H], rank, n)
    if not factor(f, rows, n, rank, order, left, tau, h) >= _CLEAR:
        return False
    for i in range(rank, rows):
        if left[i] > _ADDS_NOTHING * _ADDS_NOTHING * f[0, 0] * f[0, 0]:
            return False
    if not _least_squares(f, rows, rank, order, c, damping, matrix(t[m.LOOP_U], rank, rank), step):
        return False
    for k in range(rank, n):
        step[k] = 0.0
    reflect(step, n, rank, tau, h)
    longest = 0.0
    for k in range(n):
        if held[k] != 0.0:
            step[k] = 0.0
        longest = max(longest, abs(step[k]))
    return bool(longest <= STEP_CAP)


@compiled
def _least_squares(
    low: Array, rows: int, rank: int, order: Array, c: Array, damping: float, g: Array, out: Array
) -> bool:
    """(rank,) the least of |low y + c|^2 + damping |y|^2, by Cholesky's factors of the normal equations.

    Args:
        low: (rows, rank) lower triangle and the rows below.
        rows: of it.
        rank: its columns.
        order: (rows,) which of c belongs to each row.
        c: (rows,).
        damping: not below 0.
        g: (rank, rank) scratch.
        out: becomes y.
    """
    for i in range(rank):
        s = 0.0
        for k in range(i, rows):
            s -= low[k, i] * c[int(order[k])]
        out[i] = s
        for j in range(i + 1):
            s = damping if i == j else 0.0
            for k in range(i, rows):
                s += low[k, i] * low[k, j]
            for k in range(j):
                s -= g[i, k] * g[j, k]
            if i == j:
                if not s > 0.0:
                    return False
                g[i, i] = math.sqrt(s)
            else:
                g[i, j] = s / g[j, j]
    for i in range(rank):
        for k in range(i):
            out[i] -= g[i, k] * out[k]
        out[i] /= g[i, i]
    for i in range(rank - 1, -1, -1):
        for k in range(i + 1, rank):
            out[i] -= g[k, i] * out[k]
        out[i] /= g[i, i]
    return True


def prepare_newton() -> None:
    """Compiles it, or loads it from disk."""
    prepare(newton, TABLE)
