"""Levels while a step is tried: their correction with the loops, and shorter parts of them."""

from __future__ import annotations

from cinegen.ik._kernels.levels import decompose_level, first_left, promise
from cinegen.ik._kernels.memory import LevelsMemory
from cinegen.ik._kernels.tasks import tasks_left
from cinegen.ik.thresholds import (
    ARMIJO,
    ARRIVED,
    LEAST_SCALE,
    LEVEL_TRIES,
    NOISE,
)
from cinegen.jit.compiled import compiled
from cinegen.jit.vectors import add_multiple, inner


@compiled
def find_lower_lack(memory: LevelsMemory) -> float:
    """Return the largest component of the lower levels' errors in `trial_error` that is to be corrected."""
    lack = 0.0
    for level in range(1, memory.guarded_levels):
        start = memory.level_end[level - 1]
        rows = memory.level_end[level] - start
        for i in range(memory.level_kept[level]):
            lack = max(lack, abs(inner(memory.level_in[level, i], memory.trial_error[start:], rows)))
    return lack


@compiled
def correct_lower(memory: LevelsMemory, is_locked: bool) -> None:
    """Add the corrections of lower levels to `correction`; `trial_error` is what is left of them without it."""
    if is_locked:
        _find_directions_again(memory)
    for level in range(1, memory.guarded_levels):
        start = memory.level_end[level - 1]
        rows, left = memory.level_end[level] - start, memory.level_error
        for i in range(rows):
            s = inner(memory.task_jacobian[start + i], memory.correction, memory.n)
            left[i] = memory.trial_error[start + i] - s
        for i in range(memory.level_kept[level]):
            s = inner(memory.level_in[level, i], left, rows)
            add_multiple(s, memory.level_out[level, i], memory.correction, memory.n)


@compiled
def _find_directions_again(memory: LevelsMemory) -> None:
    """Find the directions in which lower levels are corrected, after the first level's rows were decomposed again."""
    found_by = memory.found_by
    first = first_left(memory)
    memory.found_by = found_by
    for level in range(1, memory.guarded_levels):
        rows = memory.level_end[level] - memory.level_end[level - 1]
        memory.level_kept[level] = 0
        if rows > 0 and first < memory.mobility:
            decompose_level(memory, level, first)
            first += min(memory.level_rank[level], rows, memory.mobility - first)


@compiled
def shorten_levels(memory: LevelsMemory) -> bool:
    """Shorten lower levels' parts if one of these levels loses by the trial; return whether it was necessary.

    Parts below that level are shortened, or its own if they are zero. No level shortens those above.
    """
    for level in range(1, memory.levels):
        cost, left, promised = tasks_left(memory, level), memory.level_rest[level], memory.level_promised[level]
        arrived = 0.5 * ARRIVED * ARRIVED
        is_near = max(memory.level_cost[level], left) <= arrived
        if cost <= arrived or (not is_near and (promised <= 0.0 or left - cost >= ARMIJO * promised - NOISE)):
            continue
        if not _has_parts(memory, level + 1):
            if not _has_part(memory, level):
                continue
            _shorten_part(memory, level)
        else:
            for below in range(level + 1, memory.parts):
                _shorten_part(memory, below)
        memory.level_tries += 1
        promise(memory)
        return True
    return False


@compiled
def _has_part(memory: LevelsMemory, level: int) -> bool:
    """Return whether a level moves a joint."""
    has = False
    for j in range(memory.n):
        has = has or memory.level_part[level, j] != 0.0
    return has


@compiled
def _has_parts(memory: LevelsMemory, level: int) -> bool:
    """Return whether a level or one below it moves a joint."""
    has = False
    for below in range(level, memory.parts):
        has = has or _has_part(memory, below)
    return has


@compiled
def _shorten_part(memory: LevelsMemory, level: int) -> None:
    """Halve a level's part of the attempted step; leave it out after some tries."""
    part = memory.level_part[level]
    left = 0.5 if memory.level_tries % LEVEL_TRIES < LEVEL_TRIES - 1 else 0.0
    for j in range(memory.n):
        memory.attempted[j] -= (1.0 - left) * part[j]
        memory.secondary[j] -= (1.0 - left) * part[j]
        part[j] *= left
    memory.level_scale[level] = max(0.5 * memory.level_scale[level], LEAST_SCALE)


@compiled
def scale_parts(memory: LevelsMemory, factor: float, eases: bool) -> None:
    """Scale the parts below the first, as the secondary step was scaled; also in later ticks if `eases`."""
    if memory.parts == 0:
        return
    for level in range(1, memory.parts):
        for j in range(memory.n):
            memory.level_part[level, j] *= factor
        if eases:
            memory.level_scale[level] = max(factor * memory.level_scale[level], LEAST_SCALE)
    promise(memory)


@compiled
def keep_parts(memory: LevelsMemory, accepted: bool) -> None:
    """Keep the parts of a tick's step for the next, which may turn back."""
    for level in range(memory.parts):
        for j in range(memory.n):
            memory.level_last[level, j] = memory.level_part[level, j] if accepted else 0.0
