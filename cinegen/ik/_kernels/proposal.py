"""The step that a tick sets out to make."""

from __future__ import annotations

import math

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.aims import aim_at, distance_left
from cinegen.ik._kernels.directions import promise, singular_values
from cinegen.ik._kernels.escape import nudge
from cinegen.ik._kernels.limits import keep_bounds, must_go_back
from cinegen.ik._kernels.redundancy import project_wish
from cinegen.ik._kernels.resolve import far_from_singular, to_joints, unbounded
from cinegen.ik.thresholds import ARRIVED, NOISE, REST
from cinegen.jit.compiled import Array, Table, compiled, matrices, matrix, vector
from cinegen.jit.null_space import free_motions
from cinegen.loops._kernels.closing import factor_loops, loop_rows


@compiled
def propose(t: Table) -> bool:
    """The step from here; False where there is none."""
    n, rank = t[m.N], t[m.RANK]
    settings, record = vector(t[m.SETTINGS], m.SETTINGS_WIDTH), vector(t[m.RECORD], m.R_HEAD)
    t[m.TICKS] += 1
    t[m.TRIES] = 0
    t[m.CLOSES] = 0
    t[m.EVALUATIONS] = 0
    t[m.SWEEPS] = 0
    t[m.QUICK] = 0
    record[m.R_PACE], record[m.R_SLOWEST], settings[m.LOOP_SIGMA] = 1.0, -1.0, math.inf
    settings[m.CLEAR] = 1.0
    stopped, step = vector(t[m.STOPPED], n + t[m.BARRIERS]), vector(t[m.STEP], n)
    for j in range(n + t[m.BARRIERS]):
        stopped[j] = 0.0
    for j in range(n):
        step[j] = 0.0
    still = aim_at(t)
    if t[m.DETOUR] != 0:
        t[m.P] = 0
    k = n - rank
    t[m.K] = k
    settings[m.DISTANCE] = distance_left(t)
    settings[m.GAINED] = 0.0
    if k <= 0:
        t[m.SWEEPS] = 0
        t[m.K] = 0
        return False
    p, looped = t[m.P], rank > 0
    if t[m.LOOPS] > 0:
        loop_rows(t, True)
    if looped:
        factor_loops(t, False)
        t[m.FACTORED] = 1
        free_motions(n, rank, vector(t[m.TAU], n), matrix(t[m.H], rank, n), matrix(t[m.MOTIONS], k, n))
    motions = matrix(t[m.MOTIONS], k, n)
    lesser, larger = min(p, k), max(p, k)
    u, b = matrix(t[m.U], lesser, lesser), matrix(t[m.B], lesser, larger)
    square = vector(t[m.SQUARE], lesser)
    e, y = vector(t[m.E], p), vector(t[m.Y], k)
    if settings[m.DISTANCE] <= NOISE:  # all are there: no step of rounding
        for i in range(p):
            e[i] = 0.0
    pull_rank = min(t[m.PULL_RANK], lesser)
    jp, a = matrix(t[m.JP], p, n), matrix(t[m.A], lesser, larger)
    triangle = matrices(t[m.TRIANGLE], 2, p, p)
    t[m.QUICK] = 0
    near = settings[m.NEAR]
    if p == pull_rank and far_from_singular(jp, p, motions, k, n, looped, e, a, triangle, y, near):
        t[m.QUICK] = 1
    else:
        singular_values(t)
        unbounded(e, p, k, pull_rank, u, b, square, y, near)
    to_joints(y, motions, k, n, looped, step)
    wishing = t[m.WISHING] != 0
    if wishing and not project_wish(t, pull_rank):
        t[m.WISHING] = 0
    keep_bounds(t, step, y, pull_rank, _room(t) if still else math.inf)
    largest = _largest(step, n)
    t[m.NUDGED] = 0
    to_win = 0.0
    if largest < REST * settings[m.GAIN] and p > 0 and t[m.WISHING] == 0 and settings[m.DISTANCE] > ARRIVED * ARRIVED:
        to_win = nudge(t, step, pull_rank)
        if to_win > 0.0:
            t[m.NUDGED] = 1
            largest = _largest(step, n)
    if not largest > 0.0:
        return False
    settings[m.SHARP] = largest
    pace = record[m.R_PACE]
    turns_back = _turns_back(step, vector(t[m.LAST], n), n)
    if still and t[m.NUDGED] == 0 and turns_back and not must_go_back(t):  # half of it: no zigzag
        pace *= 0.5
        secondary, braking = vector(t[m.SECONDARY], n), vector(t[m.BRAKING], n)
        for j in range(n):
            step[j] = braking[j] + 0.5 * (step[j] - braking[j])
            secondary[j] *= 0.5
    taken = vector(t[m.TAKEN], n)
    for j in range(n):
        taken[j] = step[j]
    promise(t)
    if t[m.NUDGED] != 0:
        settings[m.GAINED] = to_win * math.sqrt(2.0 * settings[m.DISTANCE])
    # pulls are made exact together with the loops where nothing bends or damps them
    refine = (wishing or (looped and record[m.R_PACE] == 1.0)) and p > 0 and t[m.NUDGED] == 0
    if refine:
        for j in range(n + t[m.BARRIERS]):
            refine = refine and stopped[j] == 0.0
        if t[m.QUICK] == 0:
            for i in range(pull_rank):
                refine = refine and square[i] >= near * near
        state = matrix(t[m.PULL_STATE], t[m.PULLS], m.STATE_WIDTH)
        for i in range(t[m.PULLS]):
            if state[i, m.HOLDS] != 0.0:
                cap = settings[m.ERROR_CAP]
                refine = refine and state[i, m.METRES] / settings[m.LENGTH] <= cap and state[i, m.RADIANS] <= cap
    t[m.REFINE] = 1 if refine else 0
    if refine and pace < 1.0:  # then less of them is wanted of this tick
        for i in range(p):
            e[i] *= pace
    return True


@compiled
def _largest(step: Array, n: int) -> float:
    largest = 0.0
    for j in range(n):
        largest = max(largest, abs(step[j]))
    return largest


@compiled
def _room(t: Table) -> float:
    """How many of the step that makes the capped errors good lead to the targets; at least 1."""
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    state = matrix(t[m.PULL_STATE], t[m.PULLS], m.STATE_WIDTH)
    most = 1.0
    for i in range(t[m.PULLS]):
        if state[i, m.HOLDS] != 0.0:
            most = max(most, state[i, m.METRES] / settings[m.LENGTH] / settings[m.ERROR_CAP])
            most = max(most, state[i, m.RADIANS] / settings[m.ERROR_CAP])
    return float(most / settings[m.GAIN])


@compiled
def is_sure(t: Table) -> bool:
    """Whether the trial can be accepted without looking: no loop, limit or singularity has a part in it, and the step
    is so small that its error of second order is far less than what it wins."""
    n, p = t[m.N], t[m.P]
    if t[m.QUICK] == 0 or t[m.LOOPS] > 0 or p == 0 or t[m.GUARDED] != 0:
        return False
    record = vector(t[m.RECORD], m.R_HEAD)
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    taken, stopped, held = vector(t[m.TAKEN], n), vector(t[m.STOPPED], n), vector(t[m.HELD], n)
    total, largest = 0.0, 0.0
    for j in range(n):
        if stopped[j] != 0.0 or held[j] != 0.0:
            return False
        total += abs(taken[j])
        largest = max(largest, abs(taken[j]))
    if record[m.R_PACE] != 1.0 or t[m.REFINE] != 0 or t[m.NUDGED] != 0 or largest < 10.0 * REST * settings[m.GAIN]:
        return False
    pulls = t[m.PULLS]
    table = matrix(t[m.PULL_TABLE], pulls, m.PULL_WIDTH)
    state = matrix(t[m.PULL_STATE], pulls, m.STATE_WIDTH)
    for i in range(pulls):
        if table[i, m.IS_TWIST] != 0.0 or state[i, m.HOLDS] == 0.0:
            return False
    # |e| >= gained / |J s|, and what bends away is at most bend * total^2 / 2, in each of the pulls
    bent = 0.5 * settings[m.BEND] * total * total
    return bool(pulls * bent * bent < 0.01 * settings[m.GAIN] * settings[m.GAINED])


@compiled
def _turns_back(step: Array, last: Array, n: int) -> bool:
    """Whether a step leads back where the last one came from, within 60 degrees."""
    along, here, there = 0.0, 0.0, 0.0
    for j in range(n):
        along += step[j] * last[j]
        here += step[j] * step[j]
        there += last[j] * last[j]
    return bool(along < 0.0 and along * along > 0.25 * here * there)
