"""QR factorisation of a large matrix whose rows come in blocks, each of which reaches over few columns.

Such is the Jacobian of loops that share joints with their neighbours. J^T P = H_1 ... H_r [L^T; 0] as in
`cinegen.jit.factor`, but pivots are taken block after block, so that a reflection reaches no further than the rows
before it. For a row of n blocks, cost grows with n^2 at most, and with n where the blocks leave no motion over.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, Table, compiled
from cinegen.jit.factor import solve_rows
from cinegen.jit.vectors import add_multiple, copy, inner, swap

_CLEAR = 2e-2  # sine between a row and the pivots before it; pivots below are taken after all blocks
_NOTHING = 1e-12  # rows shorter than this fraction of the longest are zero
_LEAST = 1e-7  # sine below which a row is no pivot


@compiled
def factor_blocks(
    f: Array, rank: int, block_row: Table, block_end: Table, first: Table, order: Table, left: Array, size: Array,
    applied: Table, filled: Table, tau: Array, h: Array, reach: Table,
) -> float:  # fmt: skip
    """Factor f (rows, n) in place.

    Args:
        f: the matrix; becomes L, in its first columns.
        rank: largest number of pivots.
        block_row: (blocks + 1,) the first row of each block, and the number of rows.
        block_end: (blocks,) the column behind the last that a block reaches.
        first: (rows,) the first column that a row reaches.
        order: (rows,) becomes the permutation of the rows.
        left: (rows,) becomes the squared remainder of each row without a pivot.
        size: (rows,) scratch: squared lengths.
        applied: (rows,) scratch: reflections applied to a row.
        filled: (rows, 2) becomes the first column of each row of f that may not be zero, and the column behind the
            last.
        tau: (rank,) and
        h: (rank, n) become the reflections 1 - tau h h^T. Where a pivot is zero, tau and the diagonal are 0.
        reach: (rank,) becomes the column behind the last that a reflection changes.

    Returns:
        the smallest sine between a pivot's row and the pivots before it; 0 if the rank is not reached.
    """
    longest, shortest, t, end = 0.0, 1.0, 0, 0
    for b in range(len(block_end)):
        for i in range(block_row[b], block_row[b + 1]):
            order[i] = i
            size[i] = inner(f[i, first[i] :], f[i, first[i] :], block_end[b] - first[i])
            longest = max(longest, size[i])
    nothing = _NOTHING * _NOTHING * longest
    for b in range(len(block_end)):
        start, stop = block_row[b], block_row[b + 1]
        end = max(end, block_end[b])
        _reflect_block(f, start, stop, t, end, first, left, filled, tau, h, reach)
        while t < rank:
            p = _longest(left, order, max(t, start), stop, start)
            if p < 0 or left[p] <= nothing or left[p] <= _CLEAR * _CLEAR * size[order[p]]:
                break
            shortest = min(shortest, math.sqrt(left[p] / size[order[p]]))
            _take(f, t, p, end, order, left, filled, tau, h, reach)
            for i in range(max(t + 1, start), stop):
                if order[i] >= start:
                    _apply(f[i], t, t + 1, tau, h, reach)
                    left[i] = inner(f[i, t + 1 :], f[i, t + 1 :], end - t - 1)
            t += 1
        for i in range(start, stop):
            if order[i] >= start:
                applied[order[i]] = t
    return _take_rest(f, rank, t, nothing, shortest, order, left, size, applied, filled, tau, h, reach)


@compiled
def _reflect_block(
    f: Array, start: int, stop: int, t: int, end: int, first: Table, left: Array, filled: Table, tau: Array, h: Array,
    reach: Table,
) -> None:  # fmt: skip
    """Apply the first t reflections to the rows of a block, as far as these reach; `end` is the column behind the last
    that they reach then."""
    for i in range(start, stop):
        u = t
        while u > 0 and reach[u - 1] > first[i]:
            u -= 1
        _apply(f[i], u, t, tau, h, reach)
        left[i] = inner(f[i, t:], f[i, t:], max(end - t, 0))
        filled[i, 0], filled[i, 1] = min(first[i], u), end


@compiled
def _longest(left: Array, order: Table, begin: int, end: int, start: int) -> int:
    """Return the row, from `begin` on and before `end`, with the largest remainder; -1 if all are of blocks before that
    whose first row was `start`."""
    p = -1
    for i in range(begin, end):
        if order[i] >= start and (p < 0 or left[i] > left[p]):
            p = i
    return p


@compiled
def _take_rest(
    f: Array, rank: int, t: int, nothing: float, shortest: float, order: Table, left: Array, size: Array,
    applied: Table, filled: Table, tau: Array, h: Array, reach: Table,
) -> float:  # fmt: skip
    """Take pivots t to `rank` among all rows that are left, as `factor` does. Return what `factor_blocks` does, where
    `shortest` is the smallest sine so far."""
    rows, n = f.shape
    if t < rank:
        for i in range(t, rows):
            if left[i] > nothing:
                filled[i, 0], filled[i, 1] = 0, n
                _apply(f[i], applied[order[i]], t, tau, h, reach)
                left[i] = inner(f[i, t:], f[i, t:], n - t)
    while t < rank:
        p = _longest(left, order, t, rows, 0)
        if left[p] <= nothing or left[p] <= _LEAST * _LEAST * size[order[p]]:
            for i in range(t, rank):
                tau[i], reach[i], f[i, i] = 0.0, i, 0.0
            return 0.0
        shortest = min(shortest, math.sqrt(left[p] / size[order[p]]))
        _take(f, t, p, n, order, left, filled, tau, h, reach)
        for i in range(t + 1, rows):
            if left[i] > nothing:
                _apply(f[i], t, t + 1, tau, h, reach)
                left[i] = inner(f[i, t + 1 :], f[i, t + 1 :], n - t - 1)
        t += 1
    return shortest


@compiled
def _take(
    f: Array, t: int, p: int, end: int, order: Table, left: Array, filled: Table, tau: Array, h: Array, reach: Table
) -> None:
    """Make row p pivot t: swap them, and make the reflection that leaves it nothing behind column t."""
    if p != t:
        swap(f[t], f[p], f.shape[1])
        order[t], order[p] = order[p], order[t]
        left[t], left[p] = left[p], left[t]
        swap(filled[t], filled[p], 2)
    length = math.sqrt(inner(f[t, t:], f[t, t:], end - t))
    diagonal = -length if f[t, t] > 0.0 else length
    copy(f[t, t:], h[t, t:], end - t)
    h[t, t] -= diagonal
    tau[t], reach[t] = 1.0 / (length * (length + abs(f[t, t]))), end
    f[t, t] = diagonal


@compiled
def _apply(x: Array, begin: int, end: int, tau: Array, h: Array, reach: Table) -> None:
    """Multiply x (n,) by the reflections from `begin` on, and before `end`, in this order."""
    for t in range(begin, end):
        if tau[t] != 0.0:
            width = reach[t] - t
            add_multiple(-tau[t] * inner(h[t, t:], x[t:], width), h[t, t:], x[t:], width)


@compiled
def to_motions(x: Array, rank: int, tau: Array, h: Array, reach: Table) -> None:
    """Multiply x (n,) by H_r ... H_1, in place: behind the rank it is x in the null space's basis."""
    _apply(x, 0, rank, tau, h, reach)


@compiled
def from_motions(x: Array, rank: int, tau: Array, h: Array, reach: Table) -> None:
    """Multiply x (n,) by H_1 ... H_r, in place: the inverse of `to_motions`."""
    for t in range(rank - 1, -1, -1):
        if tau[t] != 0.0:
            width = reach[t] - t
            add_multiple(-tau[t] * inner(h[t, t:], x[t:], width), h[t, t:], x[t:], width)


@compiled
def newton_step(
    f: Array, rank: int, order: Table, tau: Array, h: Array, reach: Table, right: Array, damping: float, out: Array
) -> None:
    """Write the shortest x (n,) with J x = right (rows,) on the rows with a nonzero pivot, shortened by a damping that
    is compared with the smallest squared pivot."""
    solve_rows(f, rank, order, tau, right, out)
    least = math.inf
    for t in range(rank):
        if tau[t] != 0.0:
            least = min(least, f[t, t] * f[t, t])
    for t in range(rank):
        out[t] *= 1.0 / (1.0 + damping / least)
    out[rank:] = 0.0
    from_motions(out, rank, tau, h, reach)
