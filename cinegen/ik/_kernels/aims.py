"""Where the pulls aim in a tick, their rows, and how far the robot is from there."""

from __future__ import annotations

import math

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.pulls import FURTHEST, pull_error, pull_rows
from cinegen.jit import rotation
from cinegen.jit.compiled import Array, Table, compiled, matrix, vector
from cinegen.jit.placement import compose, rotation_of


@compiled
def holding(t: Table) -> bool:
    """Reads the pulls: which make sense, where they aim. False where their rank is not known."""
    pulls = t[m.PULLS]
    table = matrix(t[m.PULL_TABLE], pulls, m.PULL_WIDTH)
    state = matrix(t[m.PULL_STATE], pulls, m.STATE_WIDTH)
    signature = 0
    for i in range(pulls):
        good = table[i, m.VALID] != 0.0
        if good:
            target = vector(int(table[i, m.TARGET]), 12)
            for k in range(12):
                good = good and math.isfinite(target[k])
        state[i, m.HOLDS] = 1.0 if good else 0.0
        if good:
            signature |= 1 << (i % 62)
    if signature != t[m.SIGNATURE]:
        t[m.SIGNATURE] = signature
        return False
    return True


@compiled
def aim_at(t: Table) -> bool:
    """Where each pull aims in this tick and whose axes it holds; its rows and errors. Whether no aim has moved."""
    n, offset, nv = t[m.N], t[m.OFFSET], t[m.NV]
    pulls = t[m.PULLS]
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    table = matrix(t[m.PULL_TABLE], pulls, m.PULL_WIDTH)
    state = matrix(t[m.PULL_STATE], pulls, m.STATE_WIDTH)
    columns = matrix(t[m.COLUMNS] + 48 * offset, n, 6)
    scale = vector(t[m.SCALE] + 8 * offset, n)
    w, r = matrix(t[m.W], 16, 3), matrix(t[m.R], 4, 3)
    length = settings[m.LENGTH]
    heaviest = 0.0
    for i in range(pulls):
        if state[i, m.HOLDS] != 0.0:
            heaviest = max(heaviest, table[i, m.WEIGHT])
    p, still = 0, True
    for i in range(pulls):
        if state[i, m.HOLDS] == 0.0:
            continue
        translation, angular = int(table[i, m.TRANSLATION]), int(table[i, m.ROTATION])
        joint = int(table[i, m.JOINT])
        compose(vector(t[m.PLACEMENTS] + 96 * joint, 12), table[i, m.LOCAL : m.LOCAL + 12], r[0:3], r[3])
        aim = state[i, m.AIM : m.AIM + 12]
        axes = matrix(t[m.PULL_STATE] + 8 * (i * m.STATE_WIDTH + m.AXES_NOW), 3, 3)
        target = vector(int(table[i, m.TARGET]), 12)
        kind = int(table[i, m.AXES_OF])
        twist = table[i, m.IS_TWIST] != 0.0
        if kind == m.OF_NODE:
            other = matrix(t[m.PULL_TABLE] + 8 * (i * m.PULL_WIDTH + m.AXES_LOCAL), 3, 3)
            rotation_of(vector(t[m.PLACEMENTS] + 96 * int(table[i, m.AXES_JOINT]), 12), w[0:3])
            rotation.times(w[0:3], other, axes)
        elif kind == m.OF_WORLD:
            for a in range(3):
                for b in range(3):
                    axes[a, b] = 1.0 if a == b else 0.0
        elif twist:
            for a in range(3):
                for b in range(3):
                    axes[a, b] = r[a, b]
        else:
            rotation_of(target, axes)
        if twist:
            still = False
            _carry(state[i], table[i, m.TWIST : m.TWIST + 6], r[0:3], r[3], axes, translation, angular, settings, w)
        else:
            for k in range(12):
                still = still and aim[k] == target[k]
                aim[k] = target[k]
        e = vector(t[m.E_WHOLE] + 8 * p, 6)
        pull_error(r[0:3], r[3], aim, axes, translation, angular, length, e, w)
        rows = matrix(t[m.JP] + 8 * p * n, 6, n)
        weight = table[i, m.WEIGHT] / heaviest
        moves = vector(t[m.MOVES] + 8 * (i * nv + offset), n)
        pull_rows(r[3], axes, translation, angular, length, weight, columns, moves, scale, n, rows, w)
        measure(state[i], e, translation, angular, length)
        wanted = vector(t[m.E] + 8 * p, 6)
        gain = 1.0 if twist else settings[m.GAIN]
        cap = settings[m.ERROR_CAP]
        straight = gain * weight * min(1.0, cap / max(state[i, m.METRES] / length, 1e-300))
        turn = gain * weight * min(1.0, cap / max(state[i, m.RADIANS], 1e-300))
        for k in range(translation):
            wanted[k] = straight * e[k]
        for k in range(translation, translation + angular):
            wanted[k] = turn * e[k]
        p += translation + angular
    t[m.P] = p
    return still


@compiled
def _carry(
    state: Array,
    twist: Array,
    r: Array,
    p: Array,
    axes: Array,
    translation: int,
    angular: int,
    settings: Array,
    w: Array,
) -> None:
    """A twist's aim: where it leads in this tick, from where it led last if the node is there, else from where the
    node is. So nothing drifts while the twist is followed, and nothing winds up while it is not."""
    aim = state[m.AIM : m.AIM + 12]
    followed = state[m.FOLLOWED] != 0.0
    for i in range(3):
        s = p[i]
        if followed:  # of what is held only
            for k in range(translation):
                along = 0.0
                for j in range(3):
                    along += axes[j, k] * (aim[9 + j] - p[j])
                s += axes[i, k] * along
        w[13, i] = s
    dt = settings[m.DT]
    for i in range(3):
        turn = dt * (axes[i, 0] * twist[3] + axes[i, 1] * twist[4] + axes[i, 2] * twist[5])
        w[14, i] = min(max(turn, -FURTHEST), FURTHEST)  # so that no square overflows
        w[13, i] += dt * (axes[i, 0] * twist[0] + axes[i, 1] * twist[1] + axes[i, 2] * twist[2])
    rotation.exp(w[14], w[0:3])
    if followed and angular == 3:
        rotation_of(aim, w[3:6])
    else:
        for i in range(3):
            for j in range(3):
                w[3 + i, j] = r[i, j]
    rotation.times(w[0:3], w[3:6], w[6:9])
    for i in range(3):
        for j in range(3):
            aim[3 * j + i] = w[6 + i, j]
        aim[9 + i] = w[13, i]


@compiled
def measure(state: Array, e: Array, translation: int, angular: int, length: float) -> None:
    """What is left of a pull, m and rad: without squares that overflow."""
    largest = 0.0
    for k in range(translation):
        largest = max(largest, abs(e[k]))
    s = 0.0
    if largest > 0.0:
        for k in range(translation):
            s += (e[k] / largest) * (e[k] / largest)
    state[m.METRES] = largest * math.sqrt(s) * length
    s = 0.0
    for k in range(translation, translation + angular):
        s += e[k] * e[k]
    state[m.RADIANS] = math.sqrt(s)


@compiled
def distance_now(t: Table) -> float:
    """How far all pulls are from where they aim, as one number that the capped errors are the gradient of: half the
    square up to the cap, linear beyond (Huber). With the errors left in `e_trial`, and their sizes in the state."""
    pulls = t[m.PULLS]
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    table = matrix(t[m.PULL_TABLE], pulls, m.PULL_WIDTH)
    state = matrix(t[m.PULL_STATE], pulls, m.STATE_WIDTH)
    w, r = matrix(t[m.W], 16, 3), matrix(t[m.R], 4, 3)
    p = 0
    for i in range(pulls):
        if state[i, m.HOLDS] == 0.0:
            continue
        translation, angular = int(table[i, m.TRANSLATION]), int(table[i, m.ROTATION])
        place = vector(t[m.PLACEMENTS] + 96 * int(table[i, m.JOINT]), 12)
        compose(place, table[i, m.LOCAL : m.LOCAL + 12], r[0:3], r[3])
        axes = matrix(t[m.PULL_STATE] + 8 * (i * m.STATE_WIDTH + m.AXES_NOW), 3, 3)
        e = vector(t[m.E_TRIAL] + 8 * p, 6)
        pull_error(r[0:3], r[3], state[i, m.AIM : m.AIM + 12], axes, translation, angular, settings[m.LENGTH], e, w)
        measure(state[i], e, translation, angular, settings[m.LENGTH])
        p += translation + angular
    return distance_left(t)


@compiled
def distance_left(t: Table) -> float:
    """`distance_now`, of the sizes of the errors that stand in the state."""
    pulls = t[m.PULLS]
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    table = matrix(t[m.PULL_TABLE], pulls, m.PULL_WIDTH)
    state = matrix(t[m.PULL_STATE], pulls, m.STATE_WIDTH)
    heaviest = 0.0
    for i in range(pulls):
        if state[i, m.HOLDS] != 0.0:
            heaviest = max(heaviest, table[i, m.WEIGHT])
    cap = settings[m.ERROR_CAP]
    total = 0.0
    for i in range(pulls):
        if state[i, m.HOLDS] == 0.0:
            continue
        weight = table[i, m.WEIGHT] / heaviest
        straight, turn = state[i, m.METRES] / settings[m.LENGTH], state[i, m.RADIANS]
        a, b = min(straight, cap), min(turn, cap)
        total += weight * weight * (a * (straight - 0.5 * a) + b * (turn - 0.5 * b))
    return total
