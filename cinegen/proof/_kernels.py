"""Residuals of closures over boxes, with first and second derivatives, as numbers within radii.

The placement of a chain's end is a product of matrices (4, 4), one for each slot; a derivative replaces a factor by its
own derivative, a second one two of them. With the placements A and B of both ends of a closure, V = B - A and
E = A^T V (rotations by columns), an equation is V_i4 / L, E_i4 / L, E_ij or E_ij - E_ji (L: characteristic length).
Rates, of which only derivatives matter, are E_34 / L, or the ends' relative angular velocity: by an axis a_s +- a_s,
whose derivative by a joint r before s is a_r x a_s.

Matrices are (2, 4, 4), a midpoint and a radius. Radii do not include what rounding does: they decide what is claimed,
and the checker of the claims computes all again.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, Table, compiled, entry
from cinegen.jit.memory import Memory, array, foreign, parameter

SLIDES, TURNS, TURNS_OFFSET = range(3)
"""Kinds of slots: a translation along z; a rotation about z; a translation that is rotated about z."""

NO_RATES, SLIDE_RATE, TURN_RATES = range(3)
"""Rates of a closure, and their rows: none; one; three."""


class BoxMemory(Memory):
    """The closures of a document, dimensionless but for lengths, and boxes."""

    closures: int = parameter(0)
    slots: int = parameter(0)
    longest: int = parameter(0)  # of slots of a chain
    ends: int = parameter(0)  # longest + 1
    columns: int = parameter(0)
    rows: int = parameter(0)
    parameters: int = parameter(0)
    sums: int = parameter(0)  # parameters + 2
    over: int = parameter(0)  # the first of the parameters: eps
    pairs: int = parameter(0)  # products of eps, if third derivatives are wanted
    length: float = parameter(1.0)
    chain: Table = array("closures", 3, dtype=int)  # first slot of both chains, and the end of the second
    linear: Table = array("closures", dtype=int)  # number of constrained translations
    turns: Table = array("closures", dtype=int)  # ... and rotations
    rates: Table = array("closures", dtype=int)  # which
    row: Table = array("closures", dtype=int)  # the first
    kind: Table = array("slots", dtype=int)
    before: Array = array("slots", 2, 4, 4)
    offset: Array = array("slots", 2, 4, 4)
    end: Array = array("closures", 2, 2, 4, 4)  # of both chains
    by_slot: Array = array("slots", "columns")  # the slots' values by the columns

    count: int = parameter(0)  # of boxes
    order: int = parameter(0)  # of derivatives
    q: Array = foreign("count", "slots")  # values of the slots
    along: Array = foreign("count", "slots", "parameters")  # their change by eps
    away: Array = foreign("count", "slots")  # radius about that
    residual: Array = foreign("count", 2, "rows")
    jacobian: Array = foreign("count", 2, "rows", "columns")
    by: Array = foreign("count", "parameters", "rows", "columns")  # G
    bent: Array = foreign("count", "rows", "columns")  # R_1, of the second derivatives
    apart: Array = foreign("count", "rows", "columns")  # R_2, by the distance from X(eps)
    sharper: Array = foreign("count", "pairs", "rows", "columns")  # what third derivatives add to G
    narrow: Array = foreign("count", "rows", "columns")  # R_1 without that

    power: Array = array("longest", 4, 2, 4, 4)  # factors of a chain with their derivatives
    after: Array = array("ends", 2, 4, 4)
    at: Array = array(2, 2, 4, 4)  # both ends
    first: Array = array(2, "longest", 2, 4, 4)
    second: Array = array(2, "longest", "longest", 2, 4, 4)
    axis: Array = array(2, "longest", 2, 3)
    scratch: Array = array(6, 2, 4, 4)
    values: Array = array(2, 10)  # of a closure's rows
    part: Array = array("slots", 10, "sums")  # of a slot: rows by parameters, then bent, then apart


@entry
def evaluate_boxes(memory: BoxMemory) -> None:
    """Evaluate the closures over all boxes."""
    for box in range(memory.count):
        for c in range(memory.closures):
            _evaluate(memory, box, c)


@compiled
def _product(a: Array, b: Array, out: Array) -> None:
    out[:] = 0.0
    _add_product(a, b, out)


@compiled
def _add_product(a: Array, b: Array, out: Array) -> None:
    for i in range(4):
        for j in range(4):
            m, r = 0.0, 0.0
            for k in range(4):
                m += a[0, i, k] * b[0, k, j]
                r += abs(a[0, i, k]) * b[1, k, j] + a[1, i, k] * (abs(b[0, k, j]) + b[1, k, j])
            out[0, i, j] += m
            out[1, i, j] += r


@compiled
def _copy(a: Array, out: Array) -> None:
    for k in range(2):
        for i in range(4):
            for j in range(4):
                out[k, i, j] = a[k, i, j]


@compiled
def _back(a: Array, out: Array) -> None:
    """Transpose the rotation."""
    out[:] = 0.0
    for i in range(3):
        for j in range(3):
            out[0, j, i], out[1, j, i] = a[0, i, j], a[1, i, j]


@compiled
def _shift(a: Array, out: Array) -> None:
    """Write what an end of the first chain adds to V."""
    out[:] = 0.0
    for i in range(3):
        out[0, i, 3], out[1, i, 3] = -a[0, i, 3], a[1, i, 3]


@compiled
def _write_power(memory: BoxMemory, slot: int, i: int, q: float, r: float) -> None:
    raw, kind = memory.scratch[0], memory.kind[slot]
    s, c = math.sin(q), math.cos(q)
    spread_s, spread_c = abs(c) * r + 0.5 * abs(s) * r * r + r**3 / 6.0, abs(s) * r + 0.5 * abs(c) * r * r + r**3 / 6.0
    for n in range(4):
        raw[:] = 0.0
        if kind == SLIDES:
            if n == 0:
                for k in range(4):
                    raw[0, k, k] = 1.0
                raw[0, 2, 3], raw[1, 2, 3] = q, r
            elif n == 1:
                raw[0, 2, 3] = 1.0
        else:
            raw[0, 0, 0], raw[0, 0, 1], raw[0, 1, 0], raw[0, 1, 1] = c, -s, s, c
            raw[1, 0, 0], raw[1, 0, 1], raw[1, 1, 0], raw[1, 1, 1] = spread_c, spread_s, spread_s, spread_c
            if n == 0:
                raw[0, 2, 2], raw[0, 3, 3] = 1.0, 1.0
            s, c, spread_s, spread_c = c, -s, spread_c, spread_s
            if kind == TURNS_OFFSET:
                _product(raw, memory.offset[slot], memory.scratch[1])
                _copy(memory.scratch[1], raw)
                if n == 0:
                    for k in range(4):
                        raw[0, k, k] += 1.0
        _product(memory.before[slot], raw, memory.power[i, n])


@compiled
def _varies(memory: BoxMemory, box: int, slot: int) -> bool:
    spread = memory.away[box, slot]
    for k in range(memory.parameters):
        spread += abs(memory.along[box, slot, k])
    return bool(spread != 0.0)


@compiled
def _follow(memory: BoxMemory, box: int, c: int, side: int) -> None:
    """Write the placement of a chain's end and its derivatives."""
    start, n = memory.chain[c, side], memory.chain[c, side + 1] - memory.chain[c, side]
    for i in range(n):
        radius = memory.away[box, start + i]
        for k in range(memory.parameters):
            radius += abs(memory.along[box, start + i, k])
        _write_power(memory, start + i, i, memory.q[box, start + i], radius)
    _copy(memory.end[c, side], memory.after[n])
    for i in range(n - 1, -1, -1):
        _product(memory.power[i, 0], memory.after[i + 1], memory.after[i])
    _copy(memory.after[0], memory.at[side])
    if memory.order == 0:
        return
    before, along, other = memory.scratch[0], memory.scratch[1], memory.scratch[2]
    before[:] = 0.0
    for k in range(4):
        before[0, k, k] = 1.0
    for i in range(n):
        _product(before, memory.power[i, 1], along)
        _product(along, memory.after[i + 1], memory.first[side, i])
        memory.axis[side, i] = 0.0
        if memory.kind[start + i] == TURNS and memory.rates[c] == TURN_RATES:
            _product(before, memory.before[start + i], other)
            for k in range(2):
                for j in range(3):
                    memory.axis[side, i, k, j] = other[k, j, 2] * (1.0 if side or k else -1.0)
        if memory.order == 2:
            _product(before, memory.power[i, 2], other)
            _product(other, memory.after[i + 1], memory.second[side, i, i])
            for j in range(i + 1, n):
                if _varies(memory, box, start + i) or _varies(memory, box, start + j):
                    _product(along, memory.power[j, 1], other)
                    _product(other, memory.after[j + 1], memory.second[side, i, j])
                _product(along, memory.power[j, 0], other)
                _copy(other, along)
        _product(before, memory.power[i, 0], other)
        _copy(other, before)


@compiled
def _write_rows(memory: BoxMemory, c: int, v: Array, e: Array) -> int:
    """Write the equations of V and E, and last what is positive; return their number."""
    linear, turns, out, n = memory.linear[c], memory.turns[c], memory.values, 0
    for i in range(linear):
        for k in range(2):
            out[k, n] = (v[k, i, 3] if linear == 3 else e[k, i, 3]) / memory.length
        n += 1
    for row in range(turns):
        i, j = (row, 2) if turns == 2 else (row, (row + 1) % 3)
        out[0, n], out[1, n] = e[0, i, j], e[1, i, j]
        if turns == 3:
            out[0, n] -= e[0, j, i]
            out[1, n] += e[1, j, i]
        n += 1
    if turns > 0:
        out[0, n], out[1, n] = 0.0, 0.0
        for i in range(2 if turns == 2 else 0, 3):
            out[0, n] += e[0, i, i]
            out[1, n] += e[1, i, i]
        n += 1
    if memory.rates[c] == SLIDE_RATE:
        out[0, n], out[1, n] = e[0, 2, 3] / memory.length, e[1, 2, 3] / memory.length
        n += 1
    elif memory.rates[c] == TURN_RATES:
        out[:, n : n + 3] = 0.0
        n += 3
    return n


@compiled
def _write_axis(memory: BoxMemory, side: int, s: int, n: int) -> None:
    """Write the relative angular velocity by a slot as the last three rows."""
    for k in range(2):
        for i in range(3):
            memory.values[k, n - 3 + i] = memory.axis[side, s, k, i]


@compiled
def _write_turn(memory: BoxMemory, side: int, s: int, t: int, n: int) -> None:
    """Write its derivative by slot s before t."""
    a, b, sign = memory.axis[side, s], memory.axis[side, t], 1.0 if side else -1.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        memory.values[0, n - 3 + i] = sign * (a[0, j] * b[0, k] - a[0, k] * b[0, j])
        memory.values[1, n - 3 + i] = (
            abs(a[0, j]) * b[1, k] + a[1, j] * (abs(b[0, k]) + b[1, k])
            + abs(a[0, k]) * b[1, j] + a[1, k] * (abs(b[0, j]) + b[1, j])
        )  # fmt: skip


@compiled
def _write_first(memory: BoxMemory, c: int, side: int, s: int, back: Array, gap: Array) -> int:
    v, e, turned = memory.scratch[2], memory.scratch[3], memory.scratch[4]
    e[:] = 0.0
    if side == 0:
        _shift(memory.first[0, s], v)
        _back(memory.first[0, s], turned)
        _add_product(turned, gap, e)
    else:
        _copy(memory.first[1, s], v)
    _add_product(back, v, e)
    return _write_rows(memory, c, v, e)


@compiled
def _write_second(memory: BoxMemory, c: int, side: int, s: int, t: int, back: Array, gap: Array) -> int:
    """... by two slots of a chain, s <= t."""
    v, e, turned, other = memory.scratch[2], memory.scratch[3], memory.scratch[4], memory.scratch[5]
    e[:] = 0.0
    if side == 0:
        if memory.turns[c] > 0 or memory.linear[c] == 2 or memory.rates[c] == SLIDE_RATE:
            _back(memory.second[0, s, t], turned)
            _add_product(turned, gap, e)
            for k in range(2):
                _back(memory.first[0, t if k else s], turned)
                _shift(memory.first[0, s if k else t], other)
                _add_product(turned, other, e)
        _shift(memory.second[0, s, t], v)
    else:
        _copy(memory.second[1, s, t], v)
    if memory.turns[c] > 0 or memory.linear[c] == 2 or memory.rates[c] == SLIDE_RATE:
        _add_product(back, v, e)
    return _write_rows(memory, c, v, e)


@compiled
def _write_mixed(memory: BoxMemory, c: int, s: int, t: int) -> int:
    """... by a slot of each chain."""
    v, e, turned = memory.scratch[2], memory.scratch[3], memory.scratch[4]
    v[:] = 0.0
    _back(memory.first[0, s], turned)
    _product(turned, memory.first[1, t], e)
    return _write_rows(memory, c, v, e)


@compiled
def _add_part(memory: BoxMemory, box: int, s: int, t: int, height: int) -> None:
    """Add second derivatives by slots s and t to what belongs to s."""
    n, spread, away = memory.parameters, 0.0, memory.away[box, t]
    for k in range(n):
        spread += abs(memory.along[box, t, k])
    for i in range(height):
        m, r = memory.values[0, i], memory.values[1, i]
        for k in range(n):
            memory.part[s, i, k] += m * memory.along[box, t, k]
        memory.part[s, i, n] += 0.5 * r * spread
        memory.part[s, i, n + 1] += (abs(m) + 0.5 * r) * away


@compiled
def _add_third(memory: BoxMemory, box: int, c: int, side: int) -> None:
    """Add the third derivatives of V along one chain, the one that was followed last, to G and R_1."""
    start, out, other = memory.chain[c, side], memory.scratch[0], memory.scratch[1]
    n = memory.chain[c, side + 1] - start
    for a in range(n):
        for b in range(a, n):
            for e in range(b, n):
                if not (_varies(memory, box, start + a) and _varies(memory, box, start + b)):
                    continue
                if not _varies(memory, box, start + e):
                    continue
                _copy(memory.after[e + 1], out)
                for i in range(e, -1, -1):
                    _product(memory.power[i, int(i == a) + int(i == b) + int(i == e)], out, other)
                    _copy(other, out)
                _add_quadratic(memory, box, c, side, a, b, e, out)
                if b != a:
                    _add_quadratic(memory, box, c, side, b, a, e, out)
                if e != b:
                    _add_quadratic(memory, box, c, side, e, a, b, out)


@compiled
def _add_quadratic(memory: BoxMemory, box: int, c: int, side: int, s: int, t: int, u: int, third: Array) -> None:
    """... of a slot s by slots t and u."""
    start, row = memory.chain[c, side], memory.row[c]
    weight, sign, n = (0.5 if t == u else 1.0) / memory.length, 1.0 if side else -1.0, memory.over
    of_t, of_u = memory.along[box, start + t], memory.along[box, start + u]
    linear_t, linear_u, rest_t, rest_u = 0.0, 0.0, memory.away[box, start + t], memory.away[box, start + u]
    for k in range(memory.parameters):
        if k < n:
            linear_t += abs(of_t[k])
            linear_u += abs(of_u[k])
        else:
            rest_t += abs(of_t[k])
            rest_u += abs(of_u[k])
    for i in range(3):
        m, r = third[0, i, 3], third[1, i, 3]
        far = abs(m) * (linear_t * rest_u + rest_t * linear_u + rest_t * rest_u)
        far += r / 3.0 * (linear_t + rest_t) * (linear_u + rest_u)
        for j in range(memory.columns):
            unit = weight * memory.by_slot[start + s, j]
            if unit != 0.0:
                memory.narrow[box, row + i, j] += far * unit
                q = 0
                for a in range(n):
                    for b in range(a, n):
                        value = of_t[a] * of_u[b] + (of_t[b] * of_u[a] if a != b else 0.0)
                        memory.sharper[box, q, row + i, j] += sign * m * value * unit
                        q += 1


@compiled
def _evaluate(memory: BoxMemory, box: int, c: int) -> None:
    sharp = memory.order == 2 and memory.pairs > 0
    for side in range(2):
        _follow(memory, box, c, side)
        if sharp and memory.turns[c] == 0 and memory.linear[c] == 3:
            _add_third(memory, box, c, side)
    row, back, gap, e = memory.row[c], memory.scratch[0], memory.scratch[1], memory.scratch[3]
    _back(memory.at[0], back)
    _shift(memory.at[0], gap)
    for i in range(4):
        for j in range(4):
            gap[0, i, j] += memory.at[1, 0, i, j]
            gap[1, i, j] += memory.at[1, 1, i, j]
    _product(back, gap, e)
    height = _write_rows(memory, c, gap, e)
    for i in range(height):
        memory.residual[box, 0, row + i], memory.residual[box, 1, row + i] = memory.values[0, i], memory.values[1, i]
    if memory.order == 0:
        return
    memory.jacobian[box, :, row : row + height] = 0.0
    start, middle, stop = memory.chain[c, 0], memory.chain[c, 1], memory.chain[c, 2]
    for s in range(start, stop):
        side, first = (0, start) if s < middle else (1, middle)
        _write_first(memory, c, side, s - first, back, gap)
        if memory.rates[c] == TURN_RATES:
            _write_axis(memory, side, s - first, height)
        for i in range(height):
            for j in range(memory.columns):
                memory.jacobian[box, 0, row + i, j] += memory.values[0, i] * memory.by_slot[s, j]
                memory.jacobian[box, 1, row + i, j] += memory.values[1, i] * memory.by_slot[s, j]
    if memory.order == 2:
        _evaluate_second(memory, box, c, height, back, gap)


@compiled
def _evaluate_second(memory: BoxMemory, box: int, c: int, height: int, back: Array, gap: Array) -> None:
    start, middle, stop, row = memory.chain[c, 0], memory.chain[c, 1], memory.chain[c, 2], memory.row[c]
    memory.part[start:stop] = 0.0
    for s in range(start, stop):
        for t in range(s, stop):
            if not (_varies(memory, box, s) or _varies(memory, box, t)):
                continue
            if t < middle:
                _write_second(memory, c, 0, s - start, t - start, back, gap)
            elif s >= middle:
                _write_second(memory, c, 1, s - middle, t - middle, back, gap)
            elif memory.turns[c] > 0 or memory.linear[c] == 2 or memory.rates[c] == SLIDE_RATE:
                _write_mixed(memory, c, s - start, t - middle)
            else:
                continue
            _add_part(memory, box, s, t, height)
            if t != s:
                if memory.rates[c] == TURN_RATES and (t < middle or s >= middle):
                    side, first = (0, start) if t < middle else (1, middle)
                    _write_turn(memory, side, s - first, t - first, height)
                _add_part(memory, box, t, s, height)
    n = memory.parameters
    memory.by[box, :, row : row + height] = 0.0
    memory.bent[box, row : row + height] = 0.0
    memory.apart[box, row : row + height] = 0.0
    for s in range(start, stop):
        for j in range(memory.columns):
            unit = memory.by_slot[s, j]
            if unit != 0.0:
                for i in range(height):
                    for k in range(n):
                        memory.by[box, k, row + i, j] += memory.part[s, i, k] * unit
                    memory.bent[box, row + i, j] += memory.part[s, i, n] * unit
                    is_known = memory.turns[c] == 0 and memory.linear[c] == 3 and i < 3 and _varies(memory, box, s)
                    if memory.pairs > 0 and not is_known:
                        memory.narrow[box, row + i, j] += memory.part[s, i, n] * unit
                    memory.apart[box, row + i, j] += memory.part[s, i, n + 1] * unit
