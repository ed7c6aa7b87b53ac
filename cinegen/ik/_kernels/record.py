"""End of a tick: accept the trial or not, and write the record."""

from __future__ import annotations

import math

from cinegen.ik._kernels import memory as m
from cinegen.ik._kernels.decomposition import unweighted
from cinegen.ik._kernels.level_parts import keep_parts
from cinegen.ik._kernels.memory import SVD, LevelsMemory, RecordMemory, SolverMemory, task_at
from cinegen.ik._kernels.tasks import measure
from cinegen.ik.thresholds import (
    ARRIVED,
    AT_LIMIT,
    BAD_TARGET,
    BARRED,
    BEGIN,
    DETOUR,
    FOLLOWING,
    IDLE,
    NO_FREEDOM,
    OUT_OF_REACH,
    REFUSED,
    REST,
    SINGULAR,
    TRIES,
)
from cinegen.jit.compiled import compiled
from cinegen.jit.vectors import copy
from cinegen.loops.thresholds import AT_SINGULAR


@compiled
def finish(memory: SolverMemory, accepted: bool, is_sure: bool) -> None:
    """Accept or reject the trial, and write the record; `is_sure` if it was accepted without evaluation."""
    report = memory.report
    fastest = _accept(memory, accepted)
    if is_sure:
        memory.is_at_q = 0
    left, active = _record_tasks(memory, accepted)
    if memory.parts > 0:
        keep_parts(memory, accepted)
        fastest = min(fastest, memory.first_speed)
    smallest = _record_singular_values(memory)
    saturated, barred = _record_limits(memory)
    if accepted:
        memory.closure = memory.gap
    if is_sure and active == memory.tasks:
        left = 0.0
    status = _find_status(memory, accepted, active, left)
    if status == FOLLOWING and not left <= ARRIVED:  # what hinders the motion to the targets, if anything does
        status = _find_hindrance(memory, accepted, fastest, smallest, saturated, barred)
    memory.record_levels[0, 1] = smallest
    if memory.parts > 0:
        status = _record_levels(memory, status, accepted)
    report[m.STATUS] = status
    report[m.CLOSURE] = memory.closure if memory.rows > 0 else 0.0
    report[m.TASK_RANK] = min(memory.task_rank, memory.active_rows, memory.mobility)
    if report[m.LIMITING_DOF] >= 0.0:
        report[m.LIMITING_DOF] += memory.fixed
    report[m.EVALUATIONS], report[m.SWEEPS] = memory.evaluations, memory.sweeps
    report[m.ERRORS_KNOWN] = 0.0 if is_sure else 1.0
    report[m.FAILED_OBJECTIVES], report[m.ACTIVE_BARRIERS] = memory.failed_objectives, barred
    memory.has_secondary, memory.failed_objectives = 0, 0  # a null-space velocity is for one tick
    memory.phase = BEGIN


@compiled
def _find_status(memory: SolverMemory, accepted: bool, active: int, left: float) -> int:
    """Return the status of a tick but for hindrances, from the number of active tasks and the largest error of the
    first level."""
    if active < memory.tasks:
        return BAD_TARGET
    if memory.tasks == 0:
        return IDLE
    if not accepted and memory.tries >= TRIES and memory.closes == 0:
        return REFUSED
    return DETOUR if not left <= ARRIVED and memory.tasks_are_suspended != 0 else FOLLOWING


@compiled
def _find_hindrance(
    memory: SolverMemory, accepted: bool, fastest: float, smallest: float, saturated: bool, barred: int
) -> int:
    """Return the status of a motion towards targets: what hinders it, or FOLLOWING.

    Args:
        memory: at the end of a tick.
        accepted: the mechanism moved.
        fastest: largest motion of a joint by the first level, dimensionless.
        smallest: singular value of the first level.
        saturated: a limit restricts the motion.
        barred: bits of the barriers that do.
    """
    if barred != 0 or (not accepted and memory.clear_part < 1.0):
        return BARRED
    if saturated:
        return AT_LIMIT
    if fastest < REST * memory.gain:
        return OUT_OF_REACH
    if smallest < memory.damping_threshold or memory.sigma < AT_SINGULAR:
        return SINGULAR
    return FOLLOWING


@compiled
def _accept(memory: SolverMemory, accepted: bool) -> float:
    """Set q to the trial if it is accepted; return the largest motion of a joint, dimensionless."""
    fastest = 0.0
    for j in range(memory.n):
        if not accepted:
            memory.moved[j] = memory.secondary[j] = 0.0
        memory.last[j] = memory.moved[j]
        memory.drift[j] = memory.moved[j] - memory.attempted[j] if accepted else 0.0
        fastest = max(fastest, abs(memory.moved[j]))
        memory.record_v[memory.fixed + j] = memory.moved[j] * memory.scale[j] / memory.dt
    for i in range(memory.nq):
        if accepted:
            memory.q[i] = memory.trial[i]
        memory.record_q[i] = memory.q[i]
    if accepted:
        memory.is_at_q = 1
    return fastest


@compiled
def _record_tasks(memory: RecordMemory, accepted: bool) -> tuple[float, int]:
    """Record the tasks; return the largest error of the first level, dimensionless, and how many are active."""
    row, left, active = 0, 0.0, 0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        place = task.place
        errors, kept = memory.record_errors[place], memory.record_tasks[place]
        for k in range(3):
            for c in range(4):
                memory.record_aims[place, c, k] = task.aim[c, k]
            for c in range(3):
                memory.record_axes[place, c, k] = task.world_axes[c, k]
        kept[0], kept[1] = task.weight, task.is_active
        for a in range(6):
            kept[2 + a] = 0.0
        if task.python_rows == 0:
            for k in range(task.translation + task.rotation):
                kept[2 + task.row_axis[k]] = task.row_weight[k]
        if task.is_active == 0:
            errors[0] = errors[1] = math.nan
            continue
        if not accepted:  # the errors are those at the beginning
            measure(task, memory.error[row:], memory.length)
        elif task.python_rows > 0:
            copy(task.given_error, task.kept_error, task.python_rows)
        row += task.translation + task.rotation
        active += 1
        errors[0], errors[1] = task.distance, task.angle
        error = max(task.distance / memory.length, task.angle)
        task.remaining = error
        if task.level == 0:
            left = max(left, error)
        task.is_followed = 1 if task.is_twist != 0 and error < 1e-3 else 0
    return left, active


@compiled
def _record_singular_values(memory: SolverMemory) -> float:
    """Record the singular values if they are known; return the smallest without the weights of tasks."""
    smallest = math.inf
    known = memory.found_by == SVD or memory.has_given != 0
    count = min(memory.task_rank, memory.active_rows, memory.mobility)
    memory.report[m.SIGMA_KNOWN] = 1.0 if known else 0.0
    if memory.has_given != 0:
        for i in range(count):
            smallest = min(smallest, memory.record_sigma[i] / math.sqrt(memory.emphasis[i]))
    elif memory.found_by == SVD:
        for i in range(count):
            memory.record_sigma[i] = math.sqrt(memory.squares[i])
            smallest = min(smallest, math.sqrt(unweighted(memory, i)))
    return smallest


@compiled
def _record_limits(memory: SolverMemory) -> tuple[bool, int]:
    """Record the active limits; return whether a joint is at one, and the active barriers: bit b is set for barrier b,
    the last bit for all further ones."""
    saturated, barred = False, 0
    for j in range(memory.n):
        memory.record_stopped[memory.fixed + j] = memory.stopped[j]
        if memory.parts > 0 and memory.stopped[j] == 0.0:
            memory.record_stopped[memory.fixed + j] = memory.level_stopped[j]
        saturated = saturated or memory.stopped[j] != 0.0
    for b in range(memory.barriers):
        if memory.stopped[memory.n + b] != 0.0:
            barred |= 1 << min(b, m.MOST_FLAGS)
    return saturated, barred


@compiled
def _record_levels(memory: SolverMemory, first: int, accepted: bool) -> int:
    """Record status and smallest singular value of each level; return the first status that is not FOLLOWING.

    Args:
        memory: at the end of a tick.
        first: status of the first level, or one of all levels.
        accepted: the mechanism moved.
    """
    memory.record_levels[0, 0], overall = first, first
    for level in range(1, memory.levels):
        status = first
        if first != BAD_TARGET and first != REFUSED and first != DETOUR:
            status = _status_of(memory, level, accepted)
        memory.record_levels[level, 0], memory.record_levels[level, 1] = status, memory.level_sigma[level]
        if overall == FOLLOWING:
            overall = status
    return overall


@compiled
def _status_of(memory: LevelsMemory, level: int, accepted: bool) -> int:
    """Return the status of a level below the first, from what is left of its errors, what restricts its part, and its
    smallest singular value."""
    left, fastest = 0.0, 0.0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        if task.level == level and task.is_active != 0:
            left = max(left, task.remaining)
    for j in range(memory.n):
        fastest = max(fastest, abs(memory.moved[j]))
    if left <= ARRIVED:
        return FOLLOWING
    if memory.level_freedom[level] <= 0 or memory.level_rank[level] == 0:
        return NO_FREEDOM
    if memory.level_limit[level] >= 0:
        return int(memory.level_limit[level])
    if fastest < REST * memory.gain or not accepted:
        return OUT_OF_REACH
    return SINGULAR if memory.level_sigma[level] < memory.damping_threshold else FOLLOWING
