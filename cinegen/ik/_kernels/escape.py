"""Out of a singularity in which nothing can be won to first order: a stretched arm that is pulled straight inwards.

There the joints' motion along a lost direction has no part in the error's gradient, and all in its curvature. So at
rest one small step is tried in each tick along these directions, one after the other, and taken if it wins.
"""

from __future__ import annotations

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.directions import all_axes
from cinegen.ik._kernels.resolve import to_joints, within
from cinegen.jit.compiled import Array, Table, compiled, matrix, vector

_NUDGE = 0.02  # rad or lengths of the step
_WINS = 0.01  # of what curvature might give at the best: then it was worth it


@compiled
def nudge(t: Table, step: Array, pull_rank: int) -> float:
    """Sets the step (n,) to the next one to be tried; how much of the error's size it has to win, or 0 if there is none
    within the bounds."""
    n, k, lesser = t[m.N], t[m.K], min(t[m.P], t[m.K])
    known = all_axes(t, pull_rank)
    square = vector(t[m.SQUARE], lesser)
    first = known
    near = vector(t[m.SETTINGS], m.SETTINGS_WIDTH)[m.NEAR]
    while first > 0 and square[first - 1] < near * near:
        first -= 1
    if first == k:
        return 0.0
    turn = t[m.TICKS] % (2 * (k - first))
    axes, motions = matrix(t[m.AXES], k, k), matrix(t[m.MOTIONS], k, n)
    to_joints(axes[first + turn // 2], motions, k, n, t[m.RANK] > 0, step)
    longest = vector(t[m.LONGEST] + 8 * t[m.OFFSET], n)
    limit = vector(t[m.ACCELERATION] + 8 * t[m.OFFSET], n)
    total = n + t[m.BARRIERS]
    floor, ceiling = vector(t[m.FLOOR], total), vector(t[m.CEILING], total)
    size = _NUDGE
    for j in range(n):
        fastest = min(0.5 * longest[j], limit[j])
        if abs(step[j]) * size > fastest:
            size = fastest / abs(step[j])
    sign = 1.0 if turn % 2 == 0 else -1.0
    for j in range(n):
        step[j] *= sign * size
    if not within(step, floor, ceiling, matrix(t[m.BARRIER_ROWS], t[m.BARRIERS], n), n):
        for j in range(n):
            step[j] = 0.0
        return 0.0
    return float(_WINS * size * size)
