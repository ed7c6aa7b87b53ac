"""Placements of chains over boxes, with derivatives: products of matrices (2, 4, 4), a midpoint and a radius."""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled
from cinegen.proof._kernels.memory import SLIDES, TURN_RATES, TURNS, TURNS_OFFSET, BoxMemory


@compiled
def product(a: Array, b: Array, out: Array) -> None:
    out[:] = 0.0
    add_product(a, b, out)


@compiled
def add_product(a: Array, b: Array, out: Array) -> None:
    for i in range(4):
        for j in range(4):
            m, r = 0.0, 0.0
            for k in range(4):
                m += a[0, i, k] * b[0, k, j]
                r += abs(a[0, i, k]) * b[1, k, j] + a[1, i, k] * (abs(b[0, k, j]) + b[1, k, j])
            out[0, i, j] += m
            out[1, i, j] += r


@compiled
def move(a: Array, column: Array, out: Array) -> None:
    """Multiply a column (2, 4)."""
    for i in range(4):
        m, r = 0.0, 0.0
        for k in range(4):
            m += a[0, i, k] * column[0, k]
            r += abs(a[0, i, k]) * column[1, k] + a[1, i, k] * (abs(column[0, k]) + column[1, k])
        out[0, i], out[1, i] = m, r


@compiled
def copy(a: Array, out: Array) -> None:
    for k in range(2):
        for i in range(4):
            for j in range(4):
                out[k, i, j] = a[k, i, j]


@compiled
def write_back(a: Array, out: Array) -> None:
    """Transpose the rotation."""
    out[:] = 0.0
    for i in range(3):
        for j in range(3):
            out[0, j, i], out[1, j, i] = a[0, i, j], a[1, i, j]


@compiled
def write_shift(a: Array, out: Array) -> None:
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
                product(raw, memory.offset[slot], memory.scratch[1])
                copy(memory.scratch[1], raw)
                if n == 0:
                    for k in range(4):
                        raw[0, k, k] += 1.0
        product(memory.before[slot], raw, memory.power[i, n])


@compiled
def varies(memory: BoxMemory, box: int, slot: int) -> bool:
    spread = memory.away[box, slot]
    for k in range(memory.parameters):
        spread += abs(memory.along[box, slot, k])
    return bool(spread != 0.0)


@compiled
def follow(memory: BoxMemory, box: int, c: int, side: int) -> None:
    """Write the placement of a chain's end and its derivatives."""
    start, n = memory.chain[c, side], memory.chain[c, side + 1] - memory.chain[c, side]
    for i in range(n):
        radius = memory.away[box, start + i]
        for k in range(memory.parameters):
            radius += abs(memory.along[box, start + i, k])
        _write_power(memory, start + i, i, memory.q[box, start + i], radius)
    copy(memory.end[c, side], memory.after[n])
    for i in range(n - 1, -1, -1):
        product(memory.power[i, 0], memory.after[i + 1], memory.after[i])
    copy(memory.after[0], memory.at[side])
    if memory.order == 0:
        return
    before, along, other = memory.scratch[0], memory.scratch[1], memory.scratch[2]
    before[:] = 0.0
    for k in range(4):
        before[0, k, k] = 1.0
    for i in range(n):
        product(before, memory.power[i, 1], along)
        product(along, memory.after[i + 1], memory.first[side, i])
        memory.axis[side, i] = 0.0
        if memory.kind[start + i] == TURNS and memory.rates[c] == TURN_RATES:
            product(before, memory.before[start + i], other)
            for k in range(2):
                for j in range(3):
                    memory.axis[side, i, k, j] = other[k, j, 2] * (1.0 if side or k else -1.0)
        if memory.order == 2:
            product(before, memory.power[i, 2], other)
            product(other, memory.after[i + 1], memory.second[side, i, i])
            for j in range(i + 1, n):
                if varies(memory, box, start + i) or varies(memory, box, start + j):
                    product(along, memory.power[j, 1], other)
                    product(other, memory.after[j + 1], memory.second[side, i, j])
                product(along, memory.power[j, 0], other)
                copy(other, along)
        product(before, memory.power[i, 0], other)
        copy(other, before)
