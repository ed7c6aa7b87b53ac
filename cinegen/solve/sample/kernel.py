"""Many configurations one after the other, compiled: each is closed with its motors held, and measured."""

from __future__ import annotations

import math

from cinegen.solve.kernel import memory as m
from cinegen.solve.kernel.closing import factor_loops, loop_correction, loop_rows
from cinegen.solve.kernel.compiled import TABLE, Array, Table, compiled, entry, matrix, prepare, vector
from cinegen.solve.kernel.equations import compose
from cinegen.solve.kernel.null_space import free_motions
from cinegen.solve.kernel.svd import COLD_SWEEPS, orthogonalise
from cinegen.solve.kernel.thresholds import CLOSURE, CORRECTION

# the list of what is to be done: how many configurations, which is the next, whether one is under way, how often a step
# towards it was halved, whether this step leads all the way, how many motors, singular values; then addresses of the
# motors' columns (motors,), their places in q (motors,), their values (count, motors), the step that all joints are
# foreseen to make (n,), the last configuration of the list that was closed (nq,), scratch; and of the results: q
# (count, nq), placements (count, 4, 4), Jacobians (count, 6, motors), singular values, closures
COUNT, NEXT, BEGUN, HALVED, WHOLE, MOTORS, WIDTH, COLUMNS, PLACES, VALUES, WAY, ANCHOR, WORK = range(13)
Q, PLACEMENTS, JACOBIANS, SINGULAR_VALUES, CLOSURES, SIZE = range(13, 19)

_STRIDE = 0.3  # rad or lengths: a longer way of a joint is gone in parts, so that no branch is left
_MOST_HALVED = 6
_FAR = 1e6  # rad or lengths: no joint goes there
_TIGHT = 1e-11  # rad or lengths: loops are closed to this
_MOST = 12  # iterations that closing the loops may take
_LONGEST = 0.6  # rad or lengths of one joint in an iteration


@entry
def measure_next(t: Table, todo: Table) -> None:
    """Without loops: writes down what Pinocchio was evaluated at."""
    _measure(t, todo)
    todo[NEXT] += 1


@entry
def go_on(t: Table, todo: Table) -> bool:
    """With loops: whether Pinocchio's Jacobians are wanted at the new `trial`, that is at `before` moved by `delta`.

    To be called until it returns False, from `trial` = q = a closed configuration that Pinocchio was evaluated at. Of a
    configuration that can't be closed nothing is written.
    """
    q, trial = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ])
    if todo[BEGUN] == 0:
        todo[BEGUN] = 1
        _find_motions(t)
        return _begin(t, todo)
    if _improve(t, todo):
        return True
    if _is_near(t, todo):
        for i in range(t[m.NQ]):
            q[i] = trial[i]
        if todo[WHOLE] == 0:
            _find_motions(t)
        else:
            _measure(t, todo)
            todo[NEXT] += 1
            return _begin(t, todo)
    else:
        todo[HALVED] += 1
    if todo[HALVED] <= _MOST_HALVED and _lead(t, todo):
        return True
    return _give_up(t, todo)


@compiled
def _begin(t: Table, todo: Table) -> bool:
    """Sets out for the next configuration; False if there is none."""
    q, anchor = vector(t[m.Q], t[m.NQ]), vector(todo[ANCHOR], t[m.NQ])
    for i in range(t[m.NQ]):
        anchor[i] = q[i]
    while todo[NEXT] < todo[COUNT]:
        todo[HALVED] = 0
        if _lead(t, todo):
            return True
        todo[NEXT] += 1
    return False


@compiled
def _give_up(t: Table, todo: Table) -> bool:
    """Leaves this configuration open, and goes back to where the way to it began."""
    q, anchor, trial = vector(t[m.Q], t[m.NQ]), vector(todo[ANCHOR], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ])
    for i in range(t[m.NQ]):
        q[i] = trial[i] = anchor[i]
    todo[NEXT] += 1
    todo[BEGUN] = 0  # free motions must be found there again
    return bool(todo[NEXT] < todo[COUNT])


@compiled
def _lead(t: Table, todo: Table) -> bool:
    """Moves `trial` from q one step towards the next configuration; False where no step makes sense.

    All joints are moved as the free motions at q (k, n) foresee, so that what the loops add tells how far one may go.
    """
    n, offset, count = t[m.N], t[m.OFFSET], todo[MOTORS]
    k = n - t[m.RANK]
    q, trial, way = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ]), vector(todo[WAY], n)
    columns, places = vector(todo[COLUMNS], count), vector(todo[PLACES], count)
    values = vector(todo[VALUES] + 8 * count * todo[NEXT], count)
    scale, motions = vector(t[m.SCALE] + 8 * offset, n), matrix(t[m.MOTIONS], k, n)
    for j in range(n):
        way[j] = 0.0
    if count == k:
        a = matrix(todo[WORK], k, k + 1)
        for c in range(k):
            j = int(columns[c]) - offset
            for i in range(k):
                a[c, i] = motions[i, j]
            a[c, k] = (values[c] - q[int(places[c])]) / scale[j]
        _eliminate(a, k, 1)
        for i in range(k):
            for j in range(n):
                way[j] += a[i, k] * motions[i, j]
    else:
        for c in range(count):
            way[int(columns[c]) - offset] = (values[c] - q[int(places[c])]) / scale[int(columns[c]) - offset]
    furthest = 0.0
    for j in range(n):
        if not abs(way[j]) <= furthest:  # so that what is no number is far
            furthest = abs(way[j])
    if not furthest < _FAR:
        return False
    part = min(1.0, _STRIDE * 0.5 ** todo[HALVED] / max(furthest, 1e-300))
    todo[WHOLE] = 1 if part == 1.0 else 0
    for j in range(n):
        way[j] *= part
    for i in range(t[m.NQ]):
        trial[i] = q[i]
    _move(t, way)
    for c in range(count):
        i = int(places[c])
        trial[i] = values[c] if part == 1.0 else q[i] + part * (values[c] - q[i])
    t[m.CORRECTIONS] = 0
    t[m.FACTORED] = 0
    return True


@compiled
def _is_near(t: Table, todo: Table) -> bool:
    """Whether `trial` is closed, and not much further than was foreseen: else it is another branch."""
    if not vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.CLOSED] <= CLOSURE:
        return False
    n, offset = t[m.N], t[m.OFFSET]
    q, trial, way = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ]), vector(todo[WAY], n)
    at, scale = vector(t[m.AT] + 8 * offset, n), vector(t[m.SCALE] + 8 * offset, n)
    astray, size = 0.0, 0.0
    for j in range(n):
        size = max(size, abs(way[j]))
        if at[j] >= 0.0:
            i = int(at[j])
            astray = max(astray, abs((trial[i] - q[i]) / scale[j] - way[j]))
    return bool(astray <= CORRECTION * size + CLOSURE)


@compiled
def _improve(t: Table, todo: Table) -> bool:
    """One Newton step on the loops at `trial`, motors held; False where they are closed, or won't be."""
    n, count = t[m.N], todo[MOTORS]
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    largest = loop_rows(t, False)
    rounding = t[m.CORRECTIONS] > 0 and largest > 0.5 * settings[m.GAP]
    settings[m.CLOSED] = largest
    if largest <= _TIGHT or (largest <= CLOSURE and rounding) or t[m.CORRECTIONS] >= _MOST or not largest < 1e30:
        return False
    # old factors shrink a gap by about the distance to where they were made
    if t[m.FACTORED] == 0 or largest * settings[m.SHARP] > _TIGHT:
        held, columns = vector(t[m.HELD], n), vector(todo[COLUMNS], count)
        for j in range(n):
            held[j] = 0.0
        for c in range(count):
            held[int(columns[c]) - t[m.OFFSET]] = 1.0
        loop_rows(t, True)
        factor_loops(t, True)
        t[m.FACTORED] = 1
        settings[m.SHARP] = largest
    settings[m.GAP] = largest
    t[m.CORRECTIONS] += 1
    step, held = vector(t[m.STEP], n), vector(t[m.HELD], n)
    loop_correction(t, step)
    longest = 0.0
    for j in range(n):
        if held[j] != 0.0:
            step[j] = 0.0
        longest = max(longest, abs(step[j]))
    cut = min(1.0, _LONGEST / max(longest, 1e-300))
    for j in range(n):
        step[j] *= cut
    _move(t, step)
    return True


@compiled
def _move(t: Table, step: Array) -> None:
    """Moves `trial` by a step (n,) without unit."""
    n, offset = t[m.N], t[m.OFFSET]
    trial, before = vector(t[m.TRIAL], t[m.NQ]), vector(t[m.BEFORE], t[m.NQ])
    at, delta = vector(t[m.AT] + 8 * offset, n), vector(t[m.DELTA] + 8 * offset, n)
    scale = vector(t[m.SCALE] + 8 * offset, n)
    for i in range(t[m.NQ]):
        before[i] = trial[i]
    for j in range(n):
        delta[j] = step[j] * scale[j]
        if at[j] >= 0.0:
            trial[int(at[j])] += delta[j]


# --- what is measured -----------------------------------------------------------------------------------------------


@compiled
def _measure(t: Table, todo: Table) -> None:
    """Placement, Jacobian, singular values and closure where Pinocchio was evaluated last, loops closed."""
    n, offset, count, i = t[m.N], t[m.OFFSET], todo[MOTORS], todo[NEXT]
    k = n - t[m.RANK]
    placement, jacobian = matrix(todo[PLACEMENTS] + 128 * i, 4, 4), matrix(todo[JACOBIANS] + 48 * count * i, 6, count)
    values = vector(todo[SINGULAR_VALUES] + 8 * todo[WIDTH] * i, todo[WIDTH])
    motors = vector(todo[COLUMNS], count)
    rows, moved = matrix(todo[WORK], 6, n), matrix(todo[WORK] + 48 * n, 6, k)
    spare = todo[WORK] + 48 * (n + k)
    _place(t, placement)
    _own_rows(t, placement, rows)
    scale, length = vector(t[m.SCALE] + 8 * offset, n), vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.LENGTH]
    if t[m.LOOPS] == 0:
        for c in range(count):
            j = int(motors[c]) - offset
            for a in range(6):
                jacobian[a, c] = rows[a, j] * (length if a < 3 else 1.0) / scale[j]
        _values(t, rows, n, spare, values)
        return
    _find_motions(t)
    motions = matrix(t[m.MOTIONS], k, n)
    for a in range(6):
        for b in range(k):
            s = 0.0
            for j in range(n):
                s += rows[a, j] * motions[b, j]
            moved[a, b] = s
    _by_motors(motions, motors, offset, moved, k, matrix(spare, k, k + 6), jacobian)
    for a in range(6):
        for c in range(count):
            jacobian[a, c] *= (length if a < 3 else 1.0) / scale[int(motors[c]) - offset]
    _values(t, moved, k, spare, values)
    vector(todo[CLOSURES] + 8 * i, 1)[0] = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.CLOSED]
    q, trial = vector(todo[Q] + 8 * t[m.NQ] * i, t[m.NQ]), vector(t[m.TRIAL], t[m.NQ])
    for a in range(t[m.NQ]):
        q[a] = trial[a]


@compiled
def _find_motions(t: Table) -> None:
    """The motions (k, n) that the loops leave free where Pinocchio was evaluated last."""
    n, rank = t[m.N], t[m.RANK]
    motions = matrix(t[m.MOTIONS], n - rank, n)
    if rank > 0:
        loop_rows(t, True)
        factor_loops(t, False)
        free_motions(n, rank, vector(t[m.TAU], n), matrix(t[m.H], rank, n), motions)
        return
    for a in range(n):
        for j in range(n):
            motions[a, j] = 1.0 if a == j else 0.0


def work_size(n: int, k: int) -> int:
    """Numbers of the scratch, for n joints and k free motions."""
    return 6 * (n + k) + max(2 * 6 * max(n, 6) + 6, k * (k + 6))


@compiled
def _place(t: Table, placement: Array) -> None:
    table = matrix(t[m.PULL_TABLE], 1, m.PULL_WIDTH)
    r = matrix(t[m.R], 4, 3)
    compose(vector(t[m.PLACEMENTS] + 96 * int(table[0, m.JOINT]), 12), table[0, m.LOCAL : m.LOCAL + 12], r[0:3], r[3])
    for i in range(3):
        for j in range(3):
            placement[i, j] = r[i, j]
        placement[i, 3] = r[3, i]
        placement[3, i] = 0.0
    placement[3, 3] = 1.0


@compiled
def _own_rows(t: Table, placement: Array, rows: Array) -> None:
    """(6, n) the node's Jacobian in its own axes, without unit."""
    n, offset = t[m.N], t[m.OFFSET]
    scale, moves = vector(t[m.SCALE] + 8 * offset, n), vector(t[m.MOVES] + 8 * offset, n)
    columns = matrix(t[m.COLUMNS] + 48 * offset, n, 6)
    length = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.LENGTH]
    x, y, z = placement[0, 3], placement[1, 3], placement[2, 3]
    for j in range(n):
        if moves[j] == 0.0:
            for i in range(6):
                rows[i, j] = 0.0
            continue
        a, b, c = columns[j, 3], columns[j, 4], columns[j, 5]
        u = columns[j, 0] + b * z - c * y
        v = columns[j, 1] + c * x - a * z
        w = columns[j, 2] + a * y - b * x
        straight, turn = scale[j] / length, scale[j]
        for i in range(3):
            rows[i, j] = straight * (placement[0, i] * u + placement[1, i] * v + placement[2, i] * w)
            rows[3 + i, j] = turn * (placement[0, i] * a + placement[1, i] * b + placement[2, i] * c)


@compiled
def _by_motors(motions: Array, motors: Array, offset: int, moved: Array, k: int, a: Array, jacobian: Array) -> None:
    """(6, motors) what moves by the free motions (6, k), moves by the motors: moved (motions of motors)^-1.

    Not a number where motors don't determine the motion; a (k, k + 6) is scratch.
    """
    count = motors.shape[0]
    if count != k:
        for i in range(6):
            for c in range(count):
                jacobian[i, c] = math.nan
        return
    for i in range(k):
        for c in range(k):
            a[i, c] = motions[i, int(motors[c]) - offset]
        for c in range(6):
            a[i, k + c] = moved[c, i]
    _eliminate(a, k, 6)
    for i in range(6):
        for c in range(k):
            jacobian[i, c] = a[c, k + i]


@compiled
def _eliminate(a: Array, k: int, more: int) -> None:
    """Solves the first k columns of a (k, k + more) for the others, in their place (Gauss and Jordan)."""
    for i in range(k):
        best = i
        for other in range(i + 1, k):
            if abs(a[other, i]) > abs(a[best, i]):
                best = other
        for c in range(k + more):
            a[i, c], a[best, c] = a[best, c], a[i, c]
        inverse = 1.0 / a[i, i]
        for c in range(i, k + more):
            a[i, c] *= inverse
        for other in range(k):
            if other != i:
                part = a[other, i]
                for c in range(i, k + more):
                    a[other, c] -= part * a[i, c]


@compiled
def _values(t: Table, rows: Array, width: int, spare: int, out: Array) -> None:
    """Singular values of those rows (6, width) that the pull holds, largest first.

    Vectors are factored before, the longest first, B = L Q with L triangular: Jacobi's rotations have less to do with
    L^T (Z. Drmac and K. Veselic, "New fast and accurate Jacobi SVD algorithm", 2008).
    """
    table, moves = matrix(t[m.PULL_TABLE], 1, m.PULL_WIDTH), vector(t[m.MOVES] + 8 * t[m.OFFSET], t[m.N])
    translation, turn = int(table[0, m.TRANSLATION]), int(table[0, m.ROTATION])
    size = translation + turn
    first = 5 if turn == 1 else 3  # of two, the direction of z: it is turned about x and y
    free = 0  # columns that count
    for j in range(width):
        if t[m.LOOPS] > 0 or moves[j] != 0.0:
            free += 1
    n, wide = min(size, free), max(size, free)
    if n == 0:
        return
    b, low = matrix(spare, n, wide), matrix(spare + 8 * n * wide, n, n)
    square = vector(spare + 8 * n * (wide + n), n)
    k = 0
    for j in range(width):
        if t[m.LOOPS] > 0 or moves[j] != 0.0:
            for i in range(size):
                entry_here = rows[i if i < translation else first + i - translation, j]
                if size <= free:
                    b[i, k] = entry_here
                else:
                    b[k, i] = entry_here
            k += 1
    _factor(b, low, n, wide)
    for i in range(n):
        for j in range(i):
            low[i, j], low[j, i] = low[j, i], low[i, j]
    orthogonalise(low, b, n, n, 0, square, COLD_SWEEPS)
    for i in range(n):  # sorted
        j = i
        value = math.sqrt(square[i])
        while j > 0 and out[j - 1] < value:
            out[j] = out[j - 1]
            j -= 1
        out[j] = value
    for i in range(n, out.shape[0]):
        out[i] = 0.0


@compiled
def _factor(b: Array, low: Array, n: int, width: int) -> None:
    """b (n, width) = low Q, rows in another order: Gram and Schmidt, the longest that is left first. b is lost."""
    for i in range(n):
        for j in range(n):
            low[i, j] = 0.0
    for i in range(n):
        best, longest = i, -1.0
        for other in range(i, n):
            s = 0.0
            for k in range(width):
                s += b[other, k] * b[other, k]
            if s > longest:
                best, longest = other, s
        if not longest > 0.0:
            return
        if best != i:
            for k in range(width):
                b[i, k], b[best, k] = b[best, k], b[i, k]
            for k in range(i):
                low[i, k], low[best, k] = low[best, k], low[i, k]
        low[i, i] = math.sqrt(longest)
        s = 1.0 / low[i, i]
        for k in range(width):
            b[i, k] *= s
        for other in range(i + 1, n):
            dot = 0.0
            for k in range(width):
                dot += b[i, k] * b[other, k]
            low[other, i] = dot
            for k in range(width):
                b[other, k] -= dot * b[i, k]


def prepare_sample() -> None:
    """Compiles these kernels, or loads them from disk."""
    prepare(measure_next, TABLE, TABLE)
    prepare(go_on, TABLE, TABLE)
