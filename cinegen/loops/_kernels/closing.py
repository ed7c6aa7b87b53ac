"""All loops at once: their gap, their rows and factors, and the correction that closes them."""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, Table, compiled, matrix, vector
from cinegen.jit.null_space import factor, shortest_correction
from cinegen.jit.svd import decompose
from cinegen.loops._kernels import memory as m
from cinegen.loops._kernels.loops import loop_equations
from cinegen.loops.thresholds import HEALTHY


@compiled
def loop_rows(t: Table, wanted: bool) -> float:
    """Residual of all loops where Pinocchio was evaluated last, and their rows if wanted; returns the largest."""
    n, offset, nv = t[m.N], t[m.OFFSET], t[m.NV]
    table = matrix(t[m.LOOP_TABLE], t[m.LOOPS], m.LOOP_WIDTH)
    columns = matrix(t[m.COLUMNS] + 48 * offset, n, 6)
    scale = vector(t[m.SCALE] + 8 * offset, n)
    length = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.LENGTH]
    c = vector(t[m.C], t[m.ROWS])
    for i in range(t[m.LOOPS]):
        row, rows = int(table[i, m.FIRST_ROW]), int(table[i, m.LOOP_ROWS])
        loop_equations(
            int(table[i, m.KIND]),
            vector(t[m.PLACEMENTS] + 96 * int(table[i, m.FIRST]), 12),
            table[i, m.FIRST_LOCAL : m.FIRST_LOCAL + 12],
            vector(t[m.PLACEMENTS] + 96 * int(table[i, m.SECOND]), 12),
            table[i, m.SECOND_LOCAL : m.SECOND_LOCAL + 12],
            length,
            columns,
            vector(t[m.SIGNS] + 8 * (i * nv + offset), n),
            scale,
            n,
            wanted,
            c[row : row + rows],
            matrix(t[m.JC] + 8 * row * n, rows, n),
            matrix(t[m.W], 16, 3),
        )
    largest = 0.0
    for i in range(t[m.ROWS]):
        if not abs(c[i]) <= largest:  # so that what is no number is large
            largest = abs(c[i])
    return largest


@compiled
def factor_loops(t: Table, holding: bool) -> None:
    """Factors the loops' rows, without the joints that are held."""
    n, rows, rank = t[m.N], t[m.ROWS], t[m.RANK]
    jc, f = matrix(t[m.JC], rows, n), matrix(t[m.F], rows, n)
    held = vector(t[m.HELD], n)
    for i in range(rows):
        for k in range(n):
            f[i, k] = 0.0 if holding and held[k] != 0.0 else jc[i, k]
    order, left, tau = vector(t[m.ORDER], rows), vector(t[m.LEFT], rows), vector(t[m.TAU], n)
    h = matrix(t[m.H], rank, n)
    t[m.SINGULAR] = 0
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    if factor(f, rows, n, rank, order, left, tau, h) >= HEALTHY:
        if not holding:
            settings[m.LOOP_SIGMA] = 1.0
        return
    # near a type 2 singularity, or with joints held: singular vectors
    t[m.SINGULAR] = 1
    u, b, square = matrix(t[m.LOOP_U], rows, rows), matrix(t[m.LOOP_B], rows, n), vector(t[m.LOOP_SQUARE], rows)
    for i in range(rows):
        for k in range(n):
            f[i, k] = 0.0 if holding and held[k] != 0.0 else jc[i, k]
    decompose(f, rows, n, u, b, square, False)
    if not holding:
        settings[m.LOOP_SIGMA] = math.sqrt(square[rank - 1])
        for i in range(rank):
            s = 1.0 / math.sqrt(square[i]) if square[i] > 1e-30 * square[0] else 0.0
            for k in range(n):
                f[i, k] = s * b[i, k]
        factor(f, rank, n, rank, order, left, tau, h)


@compiled
def loop_correction(t: Table, damping: float, out: Array) -> None:
    """(n,) the shortest step that closes the loops, from the factors: Newton's, or near a singularity Levenberg's and
    Marquardt's with some damping."""
    n, rows, rank = t[m.N], t[m.ROWS], t[m.RANK]
    c = vector(t[m.C], rows)
    if t[m.SINGULAR] == 0:
        f, h = matrix(t[m.F], rows, n), matrix(t[m.H], rank, n)
        shortest_correction(f, n, rank, vector(t[m.ORDER], rows), vector(t[m.TAU], n), h, c, out)
        return
    u, b, square = matrix(t[m.LOOP_U], rows, rows), matrix(t[m.LOOP_B], rows, n), vector(t[m.LOOP_SQUARE], rows)
    for k in range(n):
        out[k] = 0.0
    for i in range(rows):
        if square[i] <= 1e-20 * square[0]:
            break
        s = 0.0
        for j in range(rows):
            s += u[i, j] * c[j]
        s /= square[i] + damping
        for k in range(n):
            out[k] -= s * b[i, k]


@compiled
def squared_gap(t: Table) -> float:
    """c^T c of the residual c: with it as damping, Levenberg's and Marquardt's steps go on to converge quadratically
    where rows depend on each other (N. Yamashita and M. Fukushima, 2001; see `raff2urdf.closure.close`)."""
    c = vector(t[m.C], t[m.ROWS])
    squared = 0.0
    for i in range(t[m.ROWS]):
        squared += c[i] * c[i]
    return squared


@compiled
def move(t: Table, step: Array) -> None:
    """Moves `trial` by a step (n,) without unit: here where joints are numbers, where not by `delta` from `before`."""
    n, offset = t[m.N], t[m.OFFSET]
    trial, before = vector(t[m.TRIAL], t[m.NQ]), vector(t[m.BEFORE], t[m.NQ])
    at, delta = vector(t[m.AT] + 8 * offset, n), vector(t[m.DELTA] + 8 * offset, n)
    scale = vector(t[m.SCALE] + 8 * offset, n)
    for i in range(t[m.NQ]):
        before[i] = trial[i]
    for k in range(n):
        delta[k] = step[k] * scale[k]
        if at[k] >= 0.0:
            trial[int(at[k])] += delta[k]
