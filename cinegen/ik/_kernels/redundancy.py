"""What redundancy does: a wish, in the motions that loops and pulls leave free, as far as all bounds allow.

Lexicographic, as pulls are inside of loops: what a wish adds moves no pull, and gives way where it would (L. Sentis and
O. Khatib, "Synthesis of whole-body behaviors through hierarchical control of behavioral primitives", 2005; with bounds,
O. Kanoun, F. Lamiraux and P.-B. Wieber, "Kinematic control of redundant manipulators: generalizing the task-priority
framework to inequality task", 2011).
"""

from __future__ import annotations

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.bounds import nearest
from cinegen.ik._kernels.directions import all_axes
from cinegen.ik._kernels.resolve import seen_by_barriers, to_joints, within, without_pulls
from cinegen.ik.thresholds import IDLE_WISH, LEAST_TRUST, SPARE_SPEED, TRUST_GROWS
from cinegen.jit.compiled import Array, Table, compiled, matrices, matrix, vector


@compiled
def project_wish(t: Table, pull_rank: int) -> bool:
    """The part of the wish that neither opens a loop nor moves a pull, in `wish_free` and as joints in `secondary`;
    False where next to nothing is left. Of a wish that turns back half is taken, so that it does not tremble."""
    n, k, p, looped = t[m.N], t[m.K], t[m.P], t[m.RANK] > 0
    settings = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)
    wanted, wish = vector(t[m.WISH] + 8 * t[m.OFFSET], n), vector(t[m.WISH_FREE], k)
    motions = matrix(t[m.MOTIONS], k, n)
    for i in range(k):
        s = 0.0 if looped else wanted[i]
        if looped:
            for c in range(n):
                s += motions[i, c] * wanted[c]
        wish[i] = s
    lesser, larger = min(p, k), max(p, k)
    a, u, b = matrix(t[m.A], lesser, larger), matrix(t[m.U], lesser, lesser), matrix(t[m.B], lesser, larger)
    without_pulls(wish, p, k, pull_rank, t[m.QUICK] != 0, a, u, b, vector(t[m.SQUARE], lesser))
    fresh, secondary = vector(t[m.ROOM], n), vector(t[m.SECONDARY], n)
    to_joints(wish, motions, k, n, looped, fresh)
    along, largest = 0.0, 0.0
    for j in range(n):
        along += fresh[j] * secondary[j]
        largest = max(largest, abs(fresh[j]))
    trust = settings[m.TRUST]
    trust = max(0.5 * trust, LEAST_TRUST) if along < 0.0 else min(TRUST_GROWS * trust, 1.0)
    settings[m.TRUST] = trust
    left = trust * largest > IDLE_WISH
    for j in range(n):
        secondary[j] = trust * fresh[j] if left else 0.0
    for i in range(k):
        wish[i] *= trust
    return bool(left)


@compiled
def add_wish(t: Table, step: Array, pull_rank: int, whole: bool) -> bool:
    """Adds to the step what of the wish keeps all bounds, and keeps it in `secondary`.

    Args:
        t: the table.
        step: (n,) for the pulls.
        pull_rank: their generic rank.
        whole: whether the step must stay whole: where it breaks a bound, the motions that are left have to mend that.

    Returns:
        False where they can't, with moderate speed; then nothing is added.
    """
    n = t[m.N]
    barriers = t[m.BARRIERS]
    total = n + barriers
    floor, ceiling = vector(t[m.FLOOR], total), vector(t[m.CEILING], total)
    rows = matrix(t[m.BARRIER_ROWS], barriers, n)
    longest, secondary = vector(t[m.LONGEST] + 8 * t[m.OFFSET], n), vector(t[m.SECONDARY], n)
    room = matrix(t[m.ROOM], 3, total)
    for j in range(n):
        fastest = max(SPARE_SPEED * longest[j], abs(step[j]))
        room[0, j] = max(floor[j], -fastest) - step[j]
        room[1, j] = min(ceiling[j], fastest) - step[j]
        if not whole:
            room[0, j], room[1, j] = min(room[0, j], 0.0), max(room[1, j], 0.0)
    for b in range(barriers):
        s = 0.0
        for j in range(n):
            s += rows[b, j] * step[j]
        room[0, n + b], room[1, n + b] = floor[n + b], ceiling[n + b] - s
        if not whole:
            room[1, n + b] = max(room[1, n + b], 0.0)
    if not within(secondary, room[0], room[1], rows, n) and not _bounded_wish(t, pull_rank):
        if whole:
            return False
        for j in range(n):
            secondary[j] = 0.0
    for j in range(n):
        step[j] += secondary[j]
    return True


@compiled
def _bounded_wish(t: Table, pull_rank: int) -> bool:
    """`secondary` becomes what is nearest to the wish within `room`; False where there is nothing, or only what goes
    faster than the wish and the last tick."""
    n, k, looped = t[m.N], t[m.K], t[m.RANK] > 0
    first = all_axes(t, pull_rank)
    width = k - first
    if width <= 0:
        return False
    wish, motions, axes = vector(t[m.WISH_FREE], k), matrix(t[m.MOTIONS], k, n), matrix(t[m.AXES], k, k)
    barriers = t[m.BARRIERS]
    total = n + barriers
    x, g = vector(t[m.X], width), matrix(t[m.G], total, width)
    for i in range(width):
        s = 0.0
        for j in range(k):
            s += axes[first + i, j] * wish[j]
        x[i] = s
        for c in range(n):
            s = 0.0 if looped else axes[first + i, c]
            if looped:
                for j in range(k):
                    s += axes[first + i, j] * motions[j, c]
            g[c, i] = s
    seen_by_barriers(matrix(t[m.BARRIER_ROWS], barriers, n), g, n, width)
    room, work = matrix(t[m.ROOM], 3, total), matrices(t[m.WORK], 3, width, width)
    secondary, last = vector(t[m.SECONDARY], n), vector(t[m.LAST], n)
    scratch = matrix(t[m.SCRATCH], 6, width)
    if not nearest(x, g, room[0], room[1], total, width, room[2], work[0], work[1], work[2], scratch):
        return False
    fast, found = 0.0, 0.0
    for j in range(n):
        s = 0.0
        for i in range(width):
            s += g[j, i] * x[i]
        room[2, j] = s
        found = max(found, abs(s))
        fast = max(fast, abs(secondary[j]), abs(last[j]))
    if found > 2.0 * fast:
        return False
    for j in range(n):
        secondary[j] = room[2, j]
    return True
