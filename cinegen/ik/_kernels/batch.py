"""Many configurations one after the other, compiled: each is closed with its motors held, and measured."""

from __future__ import annotations

import math

from cinegen.ik._kernels import memory as m
from cinegen.jit.compiled import TABLE, Array, Table, compiled, entry, matrix, prepare, together, vector
from cinegen.jit.null_space import free_motions
from cinegen.jit.placement import compose
from cinegen.jit.smallest import smallest_singular_value
from cinegen.jit.svd import COLD_SWEEPS, orthogonalise
from cinegen.loops._kernels.closing import factor_loops, loop_rows
from cinegen.loops._kernels.walk import ARRIVED, ONWARD, go_on, set_out

# the list of what is to be done: how many configurations, which is the next, whether one is under way, how many
# singular values; then addresses of the motors' values (count, motors), the last configuration of the list that was
# closed (nq,), scratch; and of the results: q (count, nq), placements (count, 4, 4), Jacobians (count, 6, motors),
# singular values, closures, and the smallest singular value of the passive joints (count,); how many these are, 0 if
# nobody wants it, their columns, how many ball joints are written as three of them each, and which columns (balls, 3);
# whether all this is wanted: else, of placements, Jacobians and singular values, only the smallest of these, and the
# placements' memory is that of one
COUNT, NEXT, BEGUN, WIDTH, VALUES, ANCHOR, WORK = range(7)
Q, PLACEMENTS, JACOBIANS, SINGULAR_VALUES, CLOSURES, SECOND = range(7, 13)
PASSIVE, PASSIVE_COLUMNS, BALLS, BALL_COLUMNS, SECOND_WORK, WHOLE, SIZE = range(13, 20)

_GIMBAL = 1e-4  # volume that a ball joint's axes span: below, they lie in a plane


@entry
def measure_next(t: Table, todo: Table) -> None:
    """Without loops: writes down what Pinocchio was evaluated at."""
    _measure(t, todo, todo[NEXT])
    todo[NEXT] += 1


@entry
def measure_given(t: Table, todo: Table) -> None:
    """With loops: writes down what Pinocchio was evaluated at, that is at `trial`, closed or not."""
    q, trial = vector(t[m.Q], t[m.NQ]), vector(t[m.TRIAL], t[m.NQ])
    for i in range(t[m.NQ]):
        q[i] = trial[i]
    vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.CLOSED] = loop_rows(t, False)
    _measure(t, todo, todo[NEXT])
    todo[NEXT] += 1


@entry
def measure_closed(t: Table, todo: Table) -> bool:
    """With loops: whether Pinocchio's Jacobians are wanted at the new `trial`, that is at `before` moved by `delta`.

    To be called until it returns False, from `trial` = q = a closed configuration that Pinocchio was evaluated at. Of a
    configuration that can't be closed nothing is written.
    """
    if todo[BEGUN] == 0:
        todo[BEGUN] = 1
        return _begin(t, todo)
    asked = go_on(t)
    if asked == ONWARD:
        return True
    if asked != ARRIVED:
        return _give_up(t, todo)
    here = todo[NEXT]
    todo[NEXT] += 1
    more = _begin(t, todo)  # from the factors of the loops that will be lost
    _measure(t, todo, here)
    t[m.FACTORED] = 0
    return more


@compiled
def _begin(t: Table, todo: Table) -> bool:
    """Sets out for the next configuration; False if there is none."""
    q, anchor = vector(t[m.Q], t[m.NQ]), vector(todo[ANCHOR], t[m.NQ])
    for i in range(t[m.NQ]):
        anchor[i] = q[i]
    goal = vector(t[m.GOAL], t[m.MOTORS])
    while todo[NEXT] < todo[COUNT]:
        values = vector(todo[VALUES] + 8 * t[m.MOTORS] * todo[NEXT], t[m.MOTORS])
        for motor in range(t[m.MOTORS]):
            goal[motor] = values[motor]
        if set_out(t):
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
    todo[BEGUN] = 0  # the way from there must be found there again
    t[m.FACTORED] = 0
    return bool(todo[NEXT] < todo[COUNT])


# --- what is measured -----------------------------------------------------------------------------------------------


@compiled
def _measure(t: Table, todo: Table, i: int) -> None:
    """Placement, Jacobian, singular values and closure where Pinocchio was evaluated last, that is at q."""
    n, offset, count = t[m.N], t[m.OFFSET], t[m.MOTORS]
    k = n - t[m.RANK]
    whole = todo[WHOLE] != 0
    placement = matrix(todo[PLACEMENTS] + (128 * i if whole else 0), 4, 4)
    jacobian = matrix(todo[JACOBIANS] + 48 * count * i, 6, count)
    values = vector(todo[SINGULAR_VALUES] + 8 * todo[WIDTH] * i, todo[WIDTH])
    motors = vector(t[m.MOTOR_COLUMNS], count)
    rows, moved = matrix(todo[WORK], 6, n), matrix(todo[WORK] + 48 * n, 6, k)
    spare = todo[WORK] + 48 * (n + k)
    _place(t, placement)
    _own_rows(t, placement, rows)
    scale, length = vector(t[m.SCALE] + 8 * offset, n), vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.LENGTH]
    if t[m.LOOPS] == 0:
        for c in range(count if whole else 0):
            j = int(motors[c]) - offset
            for a in range(6):
                jacobian[a, c] = rows[a, j] * (length if a < 3 else 1.0) / scale[j]
        _values(t, rows, n, whole, spare, values)
        return
    right = _find_motions(t, todo, rows)
    motions = matrix(t[m.MOTIONS], k, n)
    for a in range(6):
        for b in range(k):
            s = 0.0
            for j in range(n):
                s += rows[a, j] * motions[b, j]
            moved[a, b] = s
    if whole:
        _by_motors(motions, motors, offset, moved, k, matrix(spare, k, k + 6), jacobian)
        for a in range(6):
            for c in range(count):
                jacobian[a, c] *= (length if a < 3 else 1.0) / scale[int(motors[c]) - offset]
    _values(t, moved, k, whole, spare, values)
    if todo[PASSIVE] > 0:
        vector(todo[SECOND] + 8 * i, 1)[0] = _second(t, todo) if right else math.nan
    vector(todo[CLOSURES] + 8 * i, 1)[0] = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.CLOSED]
    written, q = vector(todo[Q] + 8 * t[m.NQ] * i, t[m.NQ]), vector(t[m.Q], t[m.NQ])
    for a in range(t[m.NQ]):
        written[a] = q[a]


@compiled
def _find_motions(t: Table, todo: Table, rows: Array) -> bool:
    """The motions (k, n) that the loops leave free where Pinocchio was evaluated last; rows and result as of
    `_count_balls`."""
    n, rank = t[m.N], t[m.RANK]
    motions = matrix(t[m.MOTIONS], n - rank, n)
    if rank > 0:
        loop_rows(t, True)
        right = _count_balls(t, todo, rows)
        factor_loops(t, False)
        free_motions(n, rank, vector(t[m.TAU], n), matrix(t[m.H], rank, n), motions)
        return right
    for a in range(n):
        for j in range(n):
            motions[a, j] = 1.0 if a == j else 0.0
    return True


@compiled
def _count_balls(t: Table, todo: Table, rows: Array) -> bool:
    """Lets ball joints that are written as three joints that turn count as balls: their columns in the loops, and in
    the node's rows (6, n), become those of turns about the world's axes.

    They are linear in the axes, L a1, L a2, L a3 with the same L, which is wanted. False where these lie in a plane.
    """
    offset, right = t[m.OFFSET], True
    columns = matrix(t[m.COLUMNS] + 48 * offset, t[m.N], 6)
    jc = matrix(t[m.JC], t[m.ROWS], t[m.N])
    balls = matrix(todo[BALL_COLUMNS], todo[BALLS], 3)
    for b in range(todo[BALLS]):
        one, two, three = int(balls[b, 0]) - offset, int(balls[b, 1]) - offset, int(balls[b, 2]) - offset
        u, v, w = columns[one, 3:], columns[two, 3:], columns[three, 3:]
        ux, uy, uz = v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]
        vx, vy, vz = w[1] * u[2] - w[2] * u[1], w[2] * u[0] - w[0] * u[2], w[0] * u[1] - w[1] * u[0]
        wx, wy, wz = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
        volume = u[0] * ux + u[1] * uy + u[2] * uz
        if abs(volume) < _GIMBAL:
            right = False
            continue
        f = 1.0 / volume
        for a in (jc, rows):
            for i in range(a.shape[0]):  # rows of the inverse of (u v w) are the cross products
                c0, c1, c2 = a[i, one] * f, a[i, two] * f, a[i, three] * f
                a[i, one] = c0 * ux + c1 * vx + c2 * wx
                a[i, two] = c0 * uy + c1 * vy + c2 * wy
                a[i, three] = c0 * uz + c1 * vz + c2 * wz
    return right


@compiled
def _second(t: Table, todo: Table) -> float:
    """The smallest singular value of the passive joints' columns in the loops, whose rows are up to date."""
    n, rows, offset, count = t[m.N], t[m.ROWS], t[m.OFFSET], todo[PASSIVE]
    jc = matrix(t[m.JC], rows, n)
    passive = vector(todo[PASSIVE_COLUMNS], count)
    a = matrix(todo[SECOND_WORK], rows, count)
    x = vector(todo[SECOND_WORK] + 8 * rows * count, count)
    y = vector(todo[SECOND_WORK] + 8 * (rows + 1) * count, count)
    for j in range(count):
        column = int(passive[j]) - offset
        for i in range(rows):
            a[i, j] = jc[i, column]
    return smallest_singular_value(a, rows, count, x, y)


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
def _values(t: Table, rows: Array, width: int, whole: bool, spare: int, out: Array) -> None:
    """Singular values of those rows (6, width) that the pull holds, largest first; or only the smallest, as the last.

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
    if not whole:
        _smallest(t, rows, width, size, n, wide, spare, out)
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
def _smallest(t: Table, rows: Array, width: int, size: int, n: int, wide: int, spare: int, out: Array) -> None:
    """As `_values`: only the smallest, of (wide, n)."""
    table, moves = matrix(t[m.PULL_TABLE], 1, m.PULL_WIDTH), vector(t[m.MOVES] + 8 * t[m.OFFSET], t[m.N])
    translation = int(table[0, m.TRANSLATION])
    first = 5 if size == translation + 1 else 3
    b, x, y = matrix(spare, wide, n), vector(spare + 8 * wide * n, n), vector(spare + 8 * (wide + 1) * n, n)
    lies = size < wide  # then it is laid on its side
    k = 0
    for j in range(width):
        if t[m.LOOPS] > 0 or moves[j] != 0.0:
            for i in range(size):
                row = i if i < translation else first + i - translation
                if lies:
                    b[k, i] = rows[row, j]
                else:
                    b[i, k] = rows[row, j]
            k += 1
    out[out.shape[0] - 1] = smallest_singular_value(b, wide, n, x, y) if n == out.shape[0] else 0.0


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
    with together():
        prepare(measure_next, TABLE, TABLE)
        prepare(measure_given, TABLE, TABLE)
        prepare(measure_closed, TABLE, TABLE)
