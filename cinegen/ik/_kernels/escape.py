"""Escape from singularities where the error has no gradient: an outstretched arm whose target moves straight inwards.

There a motion along a singular direction changes the error to second order only. So at rest, one small step per tick is
tried along each of these directions in turn, and accepted if it reduces the error.
"""

from __future__ import annotations

from cinegen.ik._kernels.bounds import keeps_bounds
from cinegen.ik._kernels.decomposition import find_axes, to_joints, unweighted
from cinegen.ik._kernels.memory import SecondaryMemory
from cinegen.jit.compiled import compiled

_NUDGE = 0.02  # rad or lengths of the step
_WINS = 0.01  # required reduction, as a fraction of the largest possible second-order term


@compiled
def nudge(memory: SecondaryMemory) -> float:
    """Set `step` to the next one to try; return the reduction of the error that it requires, or 0 if there is none
    within the bounds."""
    first, step, threshold = find_axes(memory), memory.step, memory.damping_threshold
    while first > 0 and unweighted(memory, first - 1) < threshold * threshold:
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
        step[: memory.n] = 0.0
        return 0.0
    return float(_WINS * size * size)
