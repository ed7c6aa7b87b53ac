"""Trying a step: what it leads to is corrected until loops are closed, judged, and shortened where it is no good."""

from __future__ import annotations

import math

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.aims import distance_now
from cinegen.ik._kernels.bounds import TOUCH
from cinegen.ik._kernels.directions import promise, singular_values
from cinegen.ik._kernels.limits import must_go_back
from cinegen.ik._kernels.record import finish
from cinegen.ik._kernels.resolve import far_from_singular
from cinegen.ik.thresholds import (
    ARMIJO,
    CLEAR_PLEASE,
    CORRECTIONS,
    DONE,
    EVALUATE,
    EXACT,
    GUARD,
    JUDGE,
    LEAST_TRUST,
    NOISE,
    STEP_CAP,
    TIGHT,
    TRIES,
    WISHES,
)
from cinegen.jit.compiled import Array, Table, compiled, matrices, matrix, vector
from cinegen.jit.null_space import free_motions
from cinegen.loops._kernels.closing import factor_loops, loop_correction, loop_rows, squared_gap
from cinegen.loops.thresholds import CLOSURE, CORRECTION


@compiled
def set_out(t: Table) -> None:
    """Sets out from q by what is taken of the step."""
    n, offset = t[m.N], t[m.OFFSET]
    held = vector(t[m.HELD], n)
    for j in range(n):
        held[j] = 0.0
    t[m.CORRECTIONS] = 0
    q, trial = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ])
    before, delta = vector(t[m.BEFORE], t[m.NQ]), vector(t[m.DELTA], t[m.NV])
    taken, scale = vector(t[m.TAKEN], n), vector(t[m.SCALE] + 8 * offset, n)
    size = t[m.NQ]
    for i in range(size):
        before[i] = q[i]
        trial[i] = q[i]
    for j in range(offset):
        delta[j] = 0.0
    for j in range(n):
        delta[offset + j] = taken[j] * scale[j]
    if _move(t):
        t[m.FACTORED] = 0
    t[m.EVALUATIONS] += 1


@compiled
def _move(t: Table) -> bool:
    """Adds `delta` to the trial, joints beyond their limits put on them and held; whether some joint is newly held."""
    n, offset = t[m.N], t[m.OFFSET]
    q, trial = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ])
    at, delta = vector(t[m.AT] + 8 * offset, n), vector(t[m.DELTA] + 8 * offset, n)
    low, high = vector(t[m.LOW] + 8 * offset, n), vector(t[m.HIGH] + 8 * offset, n)
    held, moved = vector(t[m.HELD], n), vector(t[m.MOVED], n)
    scale = vector(t[m.SCALE] + 8 * offset, n)
    newly = False
    for j in range(n):
        if at[j] < 0.0:
            continue
        i = int(at[j])
        here = q[i]
        there = trial[i] + delta[j]
        bottom, top = min(low[j], here), max(high[j], here)
        if there >= top or there <= bottom:
            there = min(max(there, bottom), top)
            if held[j] == 0.0:
                held[j] = 1.0
                newly = True
        trial[i] = there
        moved[j] = (there - here) / scale[j]
    return newly


@compiled
def judge(t: Table) -> int:
    """What to do with the trial that was evaluated: correct it, shorten the step, or accept it."""
    n, p = t[m.N], t[m.P]
    looped = t[m.LOOPS] > 0
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    refine = t[m.REFINE] != 0
    largest = loop_rows(t, False) if looped else 0.0
    distance = distance_now(t)
    rest = 0.0
    if refine:
        rest = _refined(t)
    loose, inexact = looped and not largest <= TIGHT, refine and rest > EXACT
    if loose or inexact:
        first = t[m.CORRECTIONS] == 0
        # what does not shrink by half is rounding
        goes_on = loose and (first or largest <= 0.5 * settings[m.GAP] or largest > CLOSURE)
        goes_on = goes_on or (inexact and (first or rest <= 0.5 * settings[m.LACK]))
        if goes_on and t[m.CORRECTIONS] < CORRECTIONS and largest < 1.0:
            t[m.CORRECTIONS] += 1
            settings[m.GAP], settings[m.LACK] = largest, rest
            _correct(t, largest, refine)
            t[m.EVALUATIONS] += 1
            return EVALUATE
        if looped and not largest <= CLOSURE:
            return _shorten(t, 0.5)
    wishing = t[m.WISHING] != 0 and t[m.TRIES] < WISHES  # something of it is in this trial
    if refine and wishing and not rest <= 10.0 * EXACT:
        return _shorten(t, 0.5)
    settings[m.GAP] = largest
    moved, taken = vector(t[m.MOVED], n), vector(t[m.TAKEN], n)
    longest = vector(t[m.LONGEST] + 8 * t[m.OFFSET], n)
    excess, astray, size = 0.0, 0.0, 0.0
    for j in range(n):
        excess = max(excess, abs(moved[j]) / longest[j])
        astray = max(astray, abs(moved[j] - taken[j]))
        size = max(size, abs(taken[j]))
    if excess > 1.0:  # closing the loops added a little
        return _shorten(t, 0.98 / excess)
    if astray > CORRECTION * size + CLOSURE:
        return _shorten(t, 0.5)
    t[m.CLOSES] = 1
    won, promised = settings[m.DISTANCE] - distance, settings[m.GAINED]
    noise = NOISE
    if refine and wishing:  # what is exact enough is no loss
        noise += 10.0 * EXACT * (10.0 * EXACT + math.sqrt(2.0 * settings[m.DISTANCE]))
    forced = t[m.ACCELERATED] != 0 and (promised <= 0.0 or t[m.TRIES] == _most_tries(t) - 1)  # it can't stop at once
    forced = forced or (promised <= 0.0 and must_go_back(t))  # that costs the pulls something
    if p > 0 and not forced and won < ARMIJO * promised - noise:
        return _shorten(t, min(max(0.5 * promised / (promised - won), 0.1), 0.7))  # where a parabola is lowest
    if t[m.GUARDED] != 0:
        t[m.PHASE] = GUARD
        return CLEAR_PLEASE
    finish(t, True)
    return DONE


@compiled
def guard(t: Table) -> int:
    """What to do with a trial that is good, now that barriers have said how much of the way to it is clear."""
    clear = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.CLEAR]
    if clear >= 1.0:
        finish(t, True)
        return DONE
    t[m.PHASE] = JUDGE
    return _shorten(t, min(max(clear, 0.1), 0.7))


@compiled
def _refined(t: Table) -> float:
    """What the pulls still lack of what this tick should win; left in `e_trial`."""
    pulls = t[m.PULLS]
    table = matrix(t[m.PULL_TABLE], pulls, m.PULL_WIDTH)
    state = matrix(t[m.PULL_STATE], pulls, m.STATE_WIDTH)
    e, whole, now = vector(t[m.E], t[m.P]), vector(t[m.E_WHOLE], t[m.P]), vector(t[m.E_TRIAL], t[m.P])
    heaviest = 0.0
    for i in range(pulls):
        if state[i, m.HOLDS] != 0.0:
            heaviest = max(heaviest, table[i, m.WEIGHT])
    p = 0
    largest = 0.0
    for i in range(pulls):
        if state[i, m.HOLDS] == 0.0:
            continue
        weight = table[i, m.WEIGHT] / heaviest
        for j in range(p, p + int(table[i, m.TRANSLATION]) + int(table[i, m.ROTATION])):
            now[j] = weight * (now[j] - whole[j]) + e[j]
        p += int(table[i, m.TRANSLATION]) + int(table[i, m.ROTATION])
    # only what the free motions can do about it counts
    if t[m.QUICK] == 1:
        for j in range(p):
            largest = max(largest, abs(now[j]))
        return largest
    k = t[m.K]
    rows = p <= k
    lesser, larger = min(p, k), max(p, k)
    u, b, square = matrix(t[m.U], lesser, lesser), matrix(t[m.B], lesser, larger), vector(t[m.SQUARE], lesser)
    for i in range(min(t[m.PULL_RANK], lesser)):
        s = 0.0
        for j in range(p):
            s += (u[i, j] if rows else b[i, j]) * now[j]
        largest = max(largest, abs(s) if rows else abs(s) / math.sqrt(square[i]))
    return largest


@compiled
def _correct(t: Table, largest: float, refine: bool) -> None:
    """One Newton step on the loops, and on the pulls inside of what they leave."""
    n, offset, p = t[m.N], t[m.OFFSET], t[m.P]
    delta, scale = vector(t[m.DELTA], t[m.NV]), vector(t[m.SCALE] + 8 * offset, n)
    held, settings = vector(t[m.HELD], n), vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    y = vector(t[m.SCRATCH], n)  # the correction, without unit
    for j in range(n):
        y[j] = 0.0
    holding = False
    for j in range(n):
        holding = holding or held[j] != 0.0
    if t[m.LOOPS] > 0:
        # old factors shrink a gap by about the distance to where they were made
        if t[m.FACTORED] == 0 or largest * settings[m.SHARP] > TIGHT:
            loop_rows(t, True)
            factor_loops(t, holding)
            t[m.FACTORED] = 2
            settings[m.SHARP] = largest
        if t[m.RANK] > 0:
            loop_correction(t, squared_gap(t), y)
    if refine:
        jp, now = matrix(t[m.JP], p, n), vector(t[m.E_TRIAL], p)
        if t[m.LOOPS] > 0:
            for i in range(p):
                s = 0.0
                for c in range(n):
                    s += jp[i, c] * y[c]
                now[i] -= s
        if not holding or _without_held(t):
            _pull_back(t, now, y)
    largest_step = 0.0
    for j in range(n):
        largest_step = max(largest_step, abs(y[j]))
    cut = min(1.0, 6.0 * STEP_CAP / max(largest_step, 1e-300))
    trial, before = vector(t[m.TRIAL], t[m.NQ]), vector(t[m.BEFORE], t[m.NQ])
    for i in range(t[m.NQ]):
        before[i] = trial[i]
    for j in range(offset):
        delta[j] = 0.0
    for j in range(n):
        delta[offset + j] = cut * y[j] * scale[j]
        if held[j] != 0.0:
            delta[offset + j] = 0.0
    if _move(t):
        t[m.FACTORED] = 0


@compiled
def _without_held(t: Table) -> bool:
    """Factors the pulls again, without the joints that are held; False where too little is left of them."""
    n, p, k, looped = t[m.N], t[m.P], t[m.K], t[m.RANK] > 0
    if looped and t[m.SINGULAR] != 0:
        return False
    held, jp, motions = vector(t[m.HELD], n), matrix(t[m.JP], p, n), matrix(t[m.MOTIONS], k, n)
    for i in range(p):
        for j in range(n):
            if held[j] != 0.0:
                jp[i, j] = 0.0
    if looped:
        free_motions(n, t[m.RANK], vector(t[m.TAU], n), matrix(t[m.H], t[m.RANK], n), motions)
    lesser = min(p, k)
    rank = min(t[m.PULL_RANK], lesser)
    near = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.NEAR]
    if p == rank:
        e, y, triangle = vector(t[m.E_TRIAL], p), vector(t[m.Y], k), matrices(t[m.TRIANGLE], 2, p, p)
        if far_from_singular(jp, p, motions, k, n, looped, e, matrix(t[m.A], p, k), triangle, y, near):
            t[m.QUICK] = 1
            return True
    singular_values(t)
    t[m.QUICK] = 2
    if rank > 0 and vector(t[m.SQUARE], lesser)[rank - 1] >= near * near:
        return True
    t[m.REFINE] = 0
    return False


@compiled
def _pull_back(t: Table, lack: Array, step: Array) -> None:
    """Adds to a step what takes the pulls' lack (p,) away."""
    n, p, k = t[m.N], t[m.P], t[m.K]
    motions, y = matrix(t[m.MOTIONS], k, n), vector(t[m.Y], k)
    lesser, larger = min(p, k), max(p, k)
    for j in range(k):
        y[j] = 0.0
    if t[m.QUICK] == 1:
        a, triangle = matrix(t[m.A], p, k), matrices(t[m.TRIANGLE], 2, p, p)
        for i in range(p):
            s = 0.0
            for c in range(i + 1):
                s += triangle[1, i, c] * lack[c]
            for j in range(k):
                y[j] += s * a[i, j]
    else:
        u, b, square = matrix(t[m.U], lesser, lesser), matrix(t[m.B], lesser, larger), vector(t[m.SQUARE], lesser)
        for i in range(min(t[m.PULL_RANK], lesser)):
            s = 0.0
            for j in range(p):
                s += (u[i, j] if p <= k else b[i, j]) * lack[j]
            s /= square[i]
            for j in range(k):
                y[j] += s * (b[i, j] if p <= k else u[i, j])
    if t[m.RANK] > 0:
        for i in range(k):
            for j in range(n):
                step[j] += y[i] * motions[i, j]
    else:
        for j in range(n):
            step[j] += y[j]


@compiled
def _most_tries(t: Table) -> int:
    return TRIES + WISHES if t[m.WISHING] != 0 else TRIES


@compiled
def _is_spare(t: Table, part: float) -> bool:
    """Whether barriers allow what is left of the step without so much of what redundancy adds: that may be what keeps
    them."""
    n, taken, secondary = t[m.N], vector(t[m.TAKEN], t[m.N]), vector(t[m.SECONDARY], t[m.N])
    rows, room = matrix(t[m.BARRIER_ROWS], t[m.BARRIERS], n), vector(t[m.BARRIER_ROOM], t[m.BARRIERS])
    spare = True
    for b in range(t[m.BARRIERS]):
        s = 0.0
        for j in range(n):
            s += rows[b, j] * (taken[j] - part * secondary[j])
        spare = spare and s <= max(room[b], 0.0) + TOUCH
    return spare


@compiled
def _shorten(t: Table, part: float) -> int:
    """Tries again with less of the step; gives up after ten times. What redundancy adds gives way first."""
    n = t[m.N]
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    wishing, accelerated = t[m.WISHING] != 0, t[m.ACCELERATED] != 0
    t[m.TRIES] += 1
    if t[m.TRIES] >= _most_tries(t) or t[m.NUDGED] != 0:
        finish(t, False)
        return DONE
    taken, secondary = vector(t[m.TAKEN], n), vector(t[m.SECONDARY], n)
    spare = min(part, 0.5) if t[m.TRIES] < WISHES else 0.0
    if wishing and t[m.P] > 0 and t[m.TRIES] <= WISHES and _is_spare(t, 1.0 - spare):
        part = spare
        for j in range(n):
            taken[j] -= (1.0 - part) * secondary[j]
            secondary[j] *= part
        settings[m.TRUST] = max(part * settings[m.TRUST], LEAST_TRUST)
    else:
        if accelerated and t[m.TRIES] == _most_tries(t) - 1:
            part = 0.0
        braking = vector(t[m.BRAKING], n)  # 0 where accelerations are not limited
        for j in range(n):
            taken[j] = braking[j] + part * (taken[j] - braking[j])
            secondary[j] *= part
        settings[m.GAINED] *= part
        if accelerated:
            promise(t)
        t[m.REFINE] = 0
    if t[m.FACTORED] == 2:
        t[m.FACTORED] = 0
    set_out(t)
    return EVALUATE
