"""What a step of a walk will be more than to first order, foreseen from the steps before, compiled.

Where motors go on by as much as before, as they do along the lines of a grid, joints bend as before: what the loops
added to the last two steps goes on like a straight line. Of a step h that foresees all but some h^4.
"""

from __future__ import annotations

from cinegen.jit.compiled import Array, Table, compiled, matrix, vector
from cinegen.loops._kernels import memory as m

_ALIKE = 1e-6  # part of a step by which motors may differ from the one before


@compiled
def bend(t: Table, step: Array) -> None:
    """Adds to a step (n,), the whole way to first order, what is foreseen."""
    n = t[m.N]
    bends = matrix(t[m.BENDS], 3, n)
    _count_alike(t)
    for k in range(n):
        now = 0.0
        if t[m.ALIKE] == 1:
            now = bends[1, k]
        elif t[m.ALIKE] == 2:
            now = 2.0 * bends[1, k] - bends[2, k]
        bends[0, k] = now
        step[k] += now


@compiled
def bend_on(t: Table, step: Array) -> None:
    """Notes what loops have added to this step (n,)."""
    bends = matrix(t[m.BENDS], 3, t[m.N])
    for k in range(t[m.N]):
        bends[0, k] += step[k]


@compiled
def keep_bend(t: Table) -> None:
    """Once the step is done, all the way: for the next."""
    n, count = t[m.N], t[m.MOTORS]
    bends = matrix(t[m.BENDS], 3, n)
    for k in range(n):
        bends[2, k], bends[1, k] = bends[1, k], bends[0, k]
    columns, before, way = vector(t[m.MOTOR_COLUMNS], count), vector(t[m.WAY_BEFORE], count), vector(t[m.WAY], n)
    for motor in range(count):
        before[motor] = way[int(columns[motor]) - t[m.OFFSET]]
    t[m.ALIKE] = min(t[m.ALIKE] + 1, 2)


@compiled
def _count_alike(t: Table) -> None:
    """Forgets the steps before, unless motors did there what they are to do now."""
    count = t[m.MOTORS]
    columns, before, way = vector(t[m.MOTOR_COLUMNS], count), vector(t[m.WAY_BEFORE], count), vector(t[m.WAY], t[m.N])
    change, size = 0.0, 0.0
    for motor in range(count):
        now = way[int(columns[motor]) - t[m.OFFSET]]
        size = max(size, abs(now))
        change = max(change, abs(now - before[motor]))
    if change > _ALIKE * size:
        t[m.ALIKE] = 0
