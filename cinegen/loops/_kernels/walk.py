"""Following motors on one branch, compiled: they are led straight to where they should be, and all loops follow.

Each step sets out along the way that all joints take to first order, closes the loops again with the motors held, and
counts only if that added little to the step: else it would lead into another assembly mode, and half of it is tried
(predictor and corrector; E. L. Allgower and K. Georg, "Introduction to numerical continuation methods", 2003).
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import TABLE, Array, Table, compiled, entry, matrix, prepare, vector
from cinegen.loops._kernels import memory as m
from cinegen.loops._kernels.bend import bend, bend_on, keep_bend
from cinegen.loops._kernels.closing import factor_loops, loop_correction, loop_rows, move, squared_gap
from cinegen.loops.thresholds import CLOSURE

ARRIVED, ONWARD, LOST = range(3)

_MOST_HALVED = 6
_FAR = 1e6  # rad or lengths: no joint goes there
_MOST = 12  # iterations that closing the loops may take
_LONGEST = 0.6  # rad or lengths of one joint in an iteration


@entry
def walk(t: Table) -> int:
    """Goes on from Pinocchio's Jacobians at `trial`; where nothing is begun that is q, closed, and the way to `goal`
    begins.

    Returns:
        ARRIVED: at `q`. ONWARD: wants Pinocchio's Jacobians at the new `trial`, that is at `before` moved by `delta`.
        LOST: the motors get no further than to `q`.
    """
    if t[m.BEGUN] == 0:
        return ONWARD if set_out(t) else LOST
    return go_on(t)


@compiled
def set_out(t: Table) -> bool:
    """Moves `trial` from q one step towards the goal; False where no step makes sense."""
    t[m.BEGUN] = 1
    t[m.HALVED] = 0
    _foresee(t)
    return _lead(t)


@compiled
def go_on(t: Table) -> int:
    """As `walk`, once it is begun."""
    if _improve(t):
        return ONWARD
    if _is_near(t) and _is_same_side(t):
        q, trial = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ])
        for i in range(t[m.NQ]):
            q[i] = trial[i]
        if t[m.CORRECTIONS] == 0:
            t[m.FACTORED] = 0  # the factors are not of here
        if t[m.WHOLE] != 0:
            t[m.BEGUN] = 0
            keep_bend(t)
            return ARRIVED
        t[m.HALVED] = max(t[m.HALVED] - 1, 0)
        t[m.ALIKE] = 0
        _foresee(t)
    else:
        t[m.HALVED] += 1
        t[m.ALIKE] = 0
        t[m.FACTORED] = 0
    if t[m.HALVED] <= _MOST_HALVED and _lead(t):
        return ONWARD
    t[m.BEGUN] = 0
    return LOST


@compiled
def _foresee(t: Table) -> None:
    """The `way` (n,) to the goal, to first order: what motors do to the loops, the other joints make good."""
    n, rows, count = t[m.N], t[m.ROWS], t[m.MOTORS]
    offset = t[m.OFFSET]
    columns, places = vector(t[m.MOTOR_COLUMNS], count), vector(t[m.MOTOR_PLACES], count)
    q, goal, way = vector(t[m.Q], t[m.NQ]), vector(t[m.GOAL], count), vector(t[m.WAY], n)
    scale = vector(t[m.SCALE] + 8 * offset, n)
    fresh = t[m.FACTORED] == 0
    if fresh:  # else near by, which will do
        _factor(t)
    jc, c = matrix(t[m.JC], rows, n), vector(t[m.C], rows)
    before = matrix(t[m.JC_BEFORE], rows, n)
    for i in range(rows):
        c[i] = 0.0
        for k in range(n):
            before[i, k] = jc[i, k]
    if fresh:
        vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.SIDE] = _side(t)
    for motor in range(count):
        k = int(columns[motor]) - offset
        d = (goal[motor] - q[int(places[motor])]) / scale[k]
        for i in range(rows):
            c[i] += jc[i, k] * d
    if t[m.RANK] > 0:
        loop_correction(t, 0.0, way)
    held = vector(t[m.HELD], n)
    for k in range(n):
        if held[k] != 0.0 or t[m.RANK] == 0:
            way[k] = 0.0
    for motor in range(count):
        k = int(columns[motor]) - offset
        way[k] = (goal[motor] - q[int(places[motor])]) / scale[k]


@compiled
def _factor(t: Table) -> None:
    """Factors the loops without the motors, where Pinocchio was evaluated last."""
    loop_rows(t, True)
    factor_loops(t, True)
    t[m.FACTORED] = 1


@compiled
def _lead(t: Table) -> bool:
    """Moves `trial` from q along the way, all of it or a stride; False where that makes no sense."""
    n, count = t[m.N], t[m.MOTORS]
    q, trial, way = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ]), vector(t[m.WAY], n)
    places, goal, step = vector(t[m.MOTOR_PLACES], count), vector(t[m.GOAL], count), vector(t[m.STEP], n)
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    furthest = 0.0
    for k in range(n):
        if not abs(way[k]) <= furthest:  # so that what is no number is far
            furthest = abs(way[k])
    if not furthest < _FAR:
        return False
    part = min(1.0, settings[m.STRIDE] * 0.5 ** t[m.HALVED] / max(furthest, 1e-300))
    t[m.WHOLE] = 1 if part == 1.0 else 0
    settings[m.PART] = part
    for k in range(n):
        step[k] = part * way[k]
    if t[m.WHOLE] != 0:
        bend(t, step)
    for i in range(t[m.NQ]):
        trial[i] = q[i]
    move(t, step)
    for motor in range(count):
        i = int(places[motor])
        trial[i] = goal[motor] if part == 1.0 else q[i] + part * (goal[motor] - q[i])
    t[m.CORRECTIONS] = 0
    settings[m.SHARP] = math.inf  # the factors are those of q, and not good enough
    return True


@compiled
def _is_near(t: Table) -> bool:
    """Whether `trial` is closed, and not much further than was foreseen: else it is another branch."""
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    if not settings[m.CLOSED] <= CLOSURE:
        return False
    n, offset = t[m.N], t[m.OFFSET]
    q, trial, way = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ]), vector(t[m.WAY], n)
    at, scale = vector(t[m.AT] + 8 * offset, n), vector(t[m.SCALE] + 8 * offset, n)
    astray, size = 0.0, 0.0
    for k in range(n):
        foreseen = settings[m.PART] * way[k]
        size = max(size, abs(foreseen))
        if at[k] >= 0.0:
            i = int(at[k])
            astray = max(astray, abs((trial[i] - q[i]) / scale[k] - foreseen))
    return bool(astray <= settings[m.ASTRAY] * size + CLOSURE)


@compiled
def _is_same_side(t: Table) -> bool:
    """Whether the loops' Jacobian J by the joints that follow has kept the sign of its determinant since q.

    Between two branches it is 0, so that they lie on different sides, near as they may come to each other.
    """
    if t[m.CORRECTIONS] == 0:  # nothing has bent
        return True
    return bool(_side(t) * vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.SIDE] >= 0.0)


@compiled
def _side(t: Table) -> float:
    """The sign of that determinant, 1 or -1; 0 where the motors don't say it all. Where rows are more than joints, the
    sign of det(J_q^T J)."""
    n, rows = t[m.N], t[m.ROWS]
    held, jc = vector(t[m.HELD], n), matrix(t[m.JC], rows, n)
    free = 0
    for k in range(n):
        if held[k] == 0.0:
            free += 1
    if free > t[m.RANK]:
        return 0.0
    g = matrix(t[m.SIDES], free, free)
    square = rows == free
    before = matrix(t[m.JC_BEFORE], rows, n)
    j = 0
    for k in range(n):
        if held[k] != 0.0:
            continue
        if square:
            for i in range(rows):
                g[i, j] = jc[i, k]
        else:
            i = 0
            for other in range(n):
                if held[other] == 0.0:
                    g[i, j] = 0.0
                    for row in range(rows):
                        g[i, j] += before[row, other] * jc[row, k]
                    i += 1
        j += 1
    return 1.0 if _has_positive_determinant(g, free) else -1.0


@compiled
def _has_positive_determinant(a: Array, n: int) -> bool:
    """Of a (n, n), which is lost (Gauss's elimination, the largest of a column first)."""
    positive = True
    for i in range(n):
        best = i
        for other in range(i + 1, n):
            if abs(a[other, i]) > abs(a[best, i]):
                best = other
        if best != i:
            positive = not positive
            for k in range(i, n):
                a[i, k], a[best, k] = a[best, k], a[i, k]
        if a[i, i] == 0.0:
            return False
        if a[i, i] < 0.0:
            positive = not positive
        for other in range(i + 1, n):
            part = a[other, i] / a[i, i]
            for k in range(i + 1, n):
                a[other, k] -= part * a[i, k]
    return positive


@compiled
def _improve(t: Table) -> bool:
    """One Newton step on the loops at `trial`, motors held; False where they are closed, or won't be."""
    n = t[m.N]
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    largest = loop_rows(t, False)
    rounding = t[m.CORRECTIONS] > 0 and largest > 0.5 * settings[m.GAP]
    settings[m.CLOSED] = largest
    tolerance = settings[m.TOLERANCE]
    if largest <= tolerance or (largest <= CLOSURE and rounding) or t[m.CORRECTIONS] >= _MOST or not largest < 1e30:
        return False
    if t[m.RANK] == 0:
        return False
    # old factors shrink a gap by about the distance to where they were made
    if largest * settings[m.SHARP] > tolerance:
        _factor(t)
        settings[m.SHARP] = largest
    settings[m.GAP] = largest
    t[m.CORRECTIONS] += 1
    step, held = vector(t[m.STEP], n), vector(t[m.HELD], n)
    loop_correction(t, squared_gap(t), step)
    longest = 0.0
    for k in range(n):
        if held[k] != 0.0:
            step[k] = 0.0
        longest = max(longest, abs(step[k]))
    cut = min(1.0, _LONGEST / max(longest, 1e-300))
    for k in range(n):
        step[k] *= cut
    bend_on(t, step)
    move(t, step)
    return True


def prepare_walk() -> None:
    """Compiles it, or loads it from disk."""
    prepare(walk, TABLE)
