"""The end of a tick: the trial is accepted or not, and the record is written."""

from __future__ import annotations

import math

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.aims import measure
from cinegen.ik.thresholds import (
    ARRIVED,
    ASTRAY,
    AT_LIMIT,
    BAD_TARGET,
    BEGIN,
    FOLLOWING,
    IDLE,
    IS_BARRED,
    NEAR_TYPE_2,
    ON_DETOUR,
    OUT_OF_REACH,
    REFUSED,
    REST,
    SINGULAR,
    TRIES,
)
from cinegen.jit.compiled import Table, compiled, matrix, vector


@compiled
def finish(t: Table, accepted: bool) -> None:
    """Accepts the trial, or stays; writes the record."""
    n, offset, nv, pulls = t[m.N], t[m.OFFSET], t[m.NV], t[m.PULLS]
    size = t[m.NQ]
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    lesser = min(t[m.P], t[m.K])
    sigmas = min(t[m.PULL_RANK], lesser)
    record = vector(t[m.RECORD], m.R_HEAD + t[m.NQ] + 2 * t[m.NV] + (8 + m.WANTED) * t[m.PULLS])
    state = matrix(t[m.PULL_STATE], pulls, m.STATE_WIDTH)
    table = matrix(t[m.PULL_TABLE], pulls, m.PULL_WIDTH)
    q, trial = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ])
    moved, last = vector(t[m.MOVED], n), vector(t[m.LAST], n)
    taken, drift = vector(t[m.TAKEN], n), vector(t[m.DRIFT], n)
    scale = vector(t[m.SCALE] + 8 * offset, n)
    stopped, square = vector(t[m.STOPPED], n + t[m.BARRIERS]), vector(t[m.SQUARE], lesser)
    fastest = 0.0
    secondary = vector(t[m.SECONDARY], n)
    for j in range(n):
        if not accepted:
            moved[j] = 0.0
            secondary[j] = 0.0
        last[j] = moved[j]
        drift[j] = moved[j] - taken[j] if accepted else 0.0
        fastest = max(fastest, abs(moved[j]))
    if accepted:
        for i in range(size):
            q[i] = trial[i]
    if not accepted:
        # what is left is what was left before
        p = 0
        e = vector(t[m.E_WHOLE], 6 * pulls)
        for i in range(pulls):
            if state[i, m.HOLDS] != 0.0:
                translation, angular = int(table[i, m.TRANSLATION]), int(table[i, m.ROTATION])
                measure(state[i], e[p : p + translation + angular], translation, angular, settings[m.LENGTH])
                p += translation + angular
    at = m.R_HEAD
    for i in range(size):
        record[at + i] = q[i]
    at += size
    for j in range(nv):
        record[at + j] = moved[j - offset] * scale[j - offset] / settings[m.DT] if j >= offset else 0.0
    at += nv
    left, good = 0.0, 0
    for i in range(pulls):
        if state[i, m.HOLDS] != 0.0:
            good += 1
            record[at + 2 * i], record[at + 2 * i + 1] = state[i, m.METRES], state[i, m.RADIANS]
            error = max(state[i, m.METRES] / settings[m.LENGTH], state[i, m.RADIANS])
            left = max(left, error)
            state[i, m.FOLLOWED] = 1.0 if table[i, m.IS_TWIST] != 0.0 and error < 1e-3 else 0.0
        else:
            record[at + 2 * i], record[at + 2 * i + 1] = math.nan, math.nan
    at += 2 * pulls
    for i in range(pulls):
        for j in range(21):
            record[at + j] = state[i, m.AIM + j]
        record[at + 21], record[at + 22] = table[i, m.TRANSLATION], table[i, m.ROTATION]
        record[at + 23], record[at + 24] = table[i, m.WEIGHT], state[i, m.HOLDS]
        at += m.WANTED
    smallest = math.inf
    if t[m.QUICK] == 0:
        for i in range(sigmas):
            record[at + i] = math.sqrt(square[i])
            smallest = record[at + i]
    record[m.R_SIGMA] = 1.0 if t[m.QUICK] == 0 else 0.0
    at += 6 * pulls
    saturated = False
    for j in range(nv):
        record[at + j] = stopped[j - offset] if j >= offset else 0.0
        saturated = saturated or record[at + j] != 0.0
    barred = 0
    for b in range(t[m.BARRIERS]):
        if stopped[n + b] != 0.0:
            barred |= 1 << min(b, m.MOST_LEFT_OUT)
    record[m.R_BARRED] = barred
    refused = not accepted and t[m.TRIES] >= TRIES and t[m.CLOSES] == 0
    if good < pulls:
        status = BAD_TARGET
    elif pulls == 0:
        status = IDLE
    elif refused:
        status = REFUSED
    elif left <= ARRIVED:
        status = FOLLOWING
    elif t[m.DETOUR] != 0:
        status = ON_DETOUR
    elif barred != 0 or (not accepted and settings[m.CLEAR] < 1.0):
        status = IS_BARRED
    elif saturated:
        status = AT_LIMIT
    elif fastest < REST * settings[m.GAIN]:
        status = OUT_OF_REACH
    elif smallest < settings[m.NEAR] or settings[m.LOOP_SIGMA] < NEAR_TYPE_2:
        status = SINGULAR
    else:
        status = FOLLOWING
    sure = accepted and t[m.PHASE] == BEGIN
    record[m.R_MEASURED] = 0.0 if sure else 1.0
    if sure:
        status = FOLLOWING
    t[m.PHASE] = ASTRAY if not accepted and t[m.EVALUATIONS] > 0 else BEGIN
    if accepted:
        settings[m.CLOSED] = settings[m.GAP]
    record[m.R_CLOSURE] = settings[m.CLOSED] if t[m.LOOPS] > 0 else 0.0
    record[m.R_STATUS] = status
    record[m.R_PULL_RANK] = sigmas
    if record[m.R_SLOWEST] >= 0.0:
        record[m.R_SLOWEST] += offset
    record[m.R_EVALUATIONS], record[m.R_SWEEPS] = t[m.EVALUATIONS], t[m.SWEEPS]
    record[m.R_LEFT_OUT] = t[m.LEFT_OUT]
    t[m.WISHING], t[m.LEFT_OUT] = 0, 0  # a wish is for one tick
