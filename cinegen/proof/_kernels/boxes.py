"""Residuals of closures over boxes, with first and second derivatives, as numbers within radii.

The placement of a chain's end is a product of matrices (4, 4), one for each slot; a derivative replaces a factor by its
own derivative, a second one two of them. With the placements A and B of both ends of a closure, V = B - A and
E = A^T V (rotations by columns), an equation is V_i4 / L, E_i4 / L, E_ij or E_ij - E_ji (L: characteristic length).
Rates, of which only derivatives matter, are E_34 / L, or the ends' relative angular velocity: by an axis a_s +- a_s,
whose derivative by a joint r before s is a_r x a_s. A placement is all of E, its last column E_i4 / L.

Matrices are (2, 4, 4), a midpoint and a radius. Radii do not include what rounding does: they decide what is claimed,
and the checker of the claims computes all again.
"""

from __future__ import annotations

from cinegen.jit.compiled import Array, compiled, entry
from cinegen.proof._kernels.chains import add_product, copy, follow, move, product, varies, write_back, write_shift
from cinegen.proof._kernels.memory import PLACEMENT, SLIDE_RATE, TURN_RATES, BoxMemory


@entry
def evaluate_boxes(memory: BoxMemory) -> None:
    """Evaluate the closures over all boxes."""
    for box in range(memory.count):
        for c in range(memory.closures):
            _evaluate(memory, box, c)


@compiled
def _has_e(memory: BoxMemory, c: int) -> bool:
    rates = memory.rates[c]
    return bool(memory.turns[c] > 0 or memory.linear[c] == 2 or rates in (SLIDE_RATE, PLACEMENT))


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
    elif memory.rates[c] == PLACEMENT:
        for i in range(3):
            for j in range(4):
                for k in range(2):
                    out[k, n] = e[k, i, j] / (memory.length if j == 3 else 1.0)
                n += 1
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
        write_shift(memory.first[0, s], v)
        write_back(memory.first[0, s], turned)
        add_product(turned, gap, e)
    else:
        copy(memory.first[1, s], v)
    add_product(back, v, e)
    return _write_rows(memory, c, v, e)


@compiled
def _write_second(memory: BoxMemory, c: int, side: int, s: int, t: int, back: Array, gap: Array) -> int:
    """... by two slots of a chain, s <= t."""
    v, e, turned, other = memory.scratch[2], memory.scratch[3], memory.scratch[4], memory.scratch[5]
    e[:] = 0.0
    if side == 0:
        if _has_e(memory, c):
            write_back(memory.second[0, s, t], turned)
            add_product(turned, gap, e)
            for k in range(2):
                write_back(memory.first[0, t if k else s], turned)
                write_shift(memory.first[0, s if k else t], other)
                add_product(turned, other, e)
        write_shift(memory.second[0, s, t], v)
    else:
        copy(memory.second[1, s, t], v)
    if _has_e(memory, c):
        add_product(back, v, e)
    return _write_rows(memory, c, v, e)


@compiled
def _write_mixed(memory: BoxMemory, c: int, s: int, t: int) -> int:
    """... by a slot of each chain."""
    v, e, turned = memory.scratch[2], memory.scratch[3], memory.scratch[4]
    v[:] = 0.0
    write_back(memory.first[0, s], turned)
    product(turned, memory.first[1, t], e)
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
    """Add the third derivatives of V along one chain, the one that was followed last, to T and R_1."""
    start, out, other = memory.chain[c, side], memory.column[0], memory.column[1]
    n = memory.chain[c, side + 1] - start
    for a in range(n):
        for b in range(a, n):
            for e in range(b, n):
                if memory.virtual[start + a] or memory.virtual[start + b] or memory.virtual[start + e]:
                    continue
                for k in range(2):
                    for i in range(4):
                        out[k, i] = memory.after[e + 1, k, i, 3]
                for i in range(e, -1, -1):
                    move(memory.power[i, int(i == a) + int(i == b) + int(i == e)], out, other)
                    out, other = other, out
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
        m, r = third[0, i], third[1, i]
        far = abs(m) * (linear_t * rest_u + rest_t * linear_u + rest_t * rest_u)
        far += memory.unsure * r * (linear_t + rest_t) * (linear_u + rest_u)
        for j in range(memory.columns):
            unit = weight * memory.by_slot[start + s, j]
            if unit != 0.0:
                memory.bent[box, row + i, j] += far * unit
                q = 0
                for a in range(n):
                    for b in range(a, n):
                        value = of_t[a] * of_u[b] + (of_t[b] * of_u[a] if a != b else 0.0)
                        memory.sharper[box, q, row + i, j] += sign * m * value * unit
                        q += 1


@compiled
def _is_third_known(memory: BoxMemory, c: int) -> bool:
    return bool(memory.order == 2 and memory.pairs > 0 and memory.turns[c] == 0 and memory.linear[c] == 3)


@compiled
def _evaluate(memory: BoxMemory, box: int, c: int) -> None:
    for side in range(2):
        follow(memory, box, c, side)
        if _is_third_known(memory, c):
            _add_third(memory, box, c, side)
    row, back, gap, e = memory.row[c], memory.scratch[0], memory.scratch[1], memory.scratch[3]
    write_back(memory.at[0], back)
    write_shift(memory.at[0], gap)
    for i in range(4):
        for j in range(4):
            gap[0, i, j] += memory.at[1, 0, i, j]
            gap[1, i, j] += memory.at[1, 1, i, j]
    product(back, gap, e)
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
            if not (varies(memory, box, s) or varies(memory, box, t)):
                continue
            if t < middle:
                _write_second(memory, c, 0, s - start, t - start, back, gap)
            elif s >= middle:
                _write_second(memory, c, 1, s - middle, t - middle, back, gap)
            elif _has_e(memory, c):
                _write_mixed(memory, c, s - start, t - middle)
            else:
                continue
            _add_part(memory, box, s, t, height)
            if t != s:
                if memory.rates[c] == TURN_RATES and (t < middle or s >= middle):
                    side, first = (0, start) if t < middle else (1, middle)
                    _write_turn(memory, side, s - first, t - first, height)
                _add_part(memory, box, t, s, height)
    n, is_known = memory.parameters, _is_third_known(memory, c)
    for s in range(start, stop):
        for j in range(memory.columns):
            unit = memory.by_slot[s, j]
            if unit != 0.0:
                for i in range(height):
                    for k in range(n):
                        memory.by[box, k, row + i, j] += memory.part[s, i, k] * unit
                    if i >= 3 or not is_known or memory.virtual[s]:
                        memory.bent[box, row + i, j] += memory.part[s, i, n] * unit
                    memory.apart[box, row + i, j] += memory.part[s, i, n + 1] * unit
