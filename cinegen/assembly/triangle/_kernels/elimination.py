"""Gauss and Jordan's elimination with row pivots, for a few unknowns."""

from __future__ import annotations

from cinegen.jit.compiled import Array, compiled


@compiled
def reduce(a: Array, rows: int, columns: int) -> float:
    """Solves the first `rows` columns of a (rows, columns) against the others, in place; returns the least pivot.

    Where that is 0, nothing is solved.
    """
    least = 1e300
    for i in range(rows):
        best = i
        for k in range(i + 1, rows):
            if abs(a[k, i]) > abs(a[best, i]):
                best = k
        least = min(least, abs(a[best, i]))
        if not abs(a[best, i]) > 0.0:
            return 0.0
        if best != i:
            for j in range(i, columns):
                a[i, j], a[best, j] = a[best, j], a[i, j]
        inverse = 1.0 / a[i, i]
        for j in range(i, columns):
            a[i, j] *= inverse
        for k in range(rows):
            if k != i and a[k, i] != 0.0:
                part = a[k, i]
                for j in range(i, columns):
                    a[k, j] -= part * a[i, j]
    return least
