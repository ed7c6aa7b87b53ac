"""Out of a singularity in which nothing can be won to first order: a stretched arm that is pulled straight inwards.

There the joints' motion along a lost direction has no part in the error's gradient, and all in its curvature. So at
rest one small step is tried in each tick along these directions, one after the other, and taken if it wins.
"""

from __future__ import annotations

from cinegen.ik._kernels.bounds import keeps_bounds
from cinegen.ik._kernels.decomposition import find_axes, to_joints
from cinegen.ik._kernels.memory import SolverMemory
from cinegen.jit.compiled import compiled

_NUDGE = 0.02  # rad or lengths of the step
_WINS = 0.01  # of what curvature might give at the best: then it was worth it


@compiled
def nudge(memory: SolverMemory) -> float:
    """Set `step` to the next one to be tried; return how much of the error's size it has to win, or 0 if there is none
    within the bounds."""
    first, step, threshold = find_axes(memory), memory.step, memory.damping_threshold
    while first > 0 and memory.squares[first - 1] < threshold * threshold:
        first -= 1
    if first == memory.mobility:
        return 0.0
    turn = memory.ticks % (2 * (memory.mobility - first))
    to_joints(memory, memory.axes[first + turn // 2], step)
    size = _NUDGE
    for j in range(memory.n):
        fastest = min(0.5 * memory.longest_step[j], memory.longest_change[j])
        if abs(step[j]) * size > fastest:
            size = fastest / abs(step[j])
    sign = 1.0 if turn % 2 == 0 else -1.0
    for j in range(memory.n):
        step[j] *= sign * size
    if not keeps_bounds(memory, step, memory.floor, memory.ceiling):
        for j in range(memory.n):
            step[j] = 0.0
        return 0.0
    return float(_WINS * size * size)
