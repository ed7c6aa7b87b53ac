"""The step that a tick attempts."""

from __future__ import annotations

import math

from cinegen.ik._kernels.decomposition import (
    find_basis,
    find_corrected,
    find_singular_values,
    predict_gain,
    solve_damped,
    to_joints,
    unweighted,
)
from cinegen.ik._kernels.escape import nudge
from cinegen.ik._kernels.levels import promise
from cinegen.ik._kernels.limits import keep_limits, must_go_back
from cinegen.ik._kernels.memory import LIMITING_DOF, SPEED_SCALE, SVD, SolverMemory, StepMemory, TasksMemory, task_at
from cinegen.ik._kernels.secondary import project_secondary
from cinegen.ik._kernels.tasks import aim_tasks, tasks_left
from cinegen.ik._kernels.weights import weigh
from cinegen.ik.thresholds import ARRIVED, ERROR_CAP, FAR_APART, LEAST_SCALE, NOISE, REST
from cinegen.jit.compiled import Array, compiled
from cinegen.jit.vectors import copy
from cinegen.loops._kernels.closure import factor_loops, find_null_space
from cinegen.loops._kernels.memory import AT_Q
from cinegen.loops._kernels.residual import evaluate_loops


@compiled
def propose(memory: SolverMemory) -> bool:
    """Compute the step from q, where the joints' frames are evaluated; return False if there is none."""
    _begin(memory)
    still = aim_tasks(memory)
    if memory.tasks_are_suspended != 0:
        memory.active_rows = 0
        memory.level_end[:] = 0
    memory.task_distance = tasks_left(memory, 0)
    if memory.mobility == 0:
        return False
    if memory.rows > 0:
        memory.gap = evaluate_loops(memory, True)
        factor_loops(memory, False)
        memory.factored_at = AT_Q
        find_null_space(memory)
    _solve(memory)
    if memory.weighted != 0 and memory.parts == 0:
        weigh(memory)
    had_secondary = memory.has_secondary != 0
    if memory.parts == 0 and had_secondary and not project_secondary(memory):
        memory.has_secondary = 0
    keep_limits(memory, _ticks_left(memory) if still else math.inf)
    largest = _largest(memory.step)
    to_win = _escape(memory, largest)
    if to_win > 0.0:
        largest = _largest(memory.step)
    if not largest > 0.0:
        return False
    memory.factors_gap = largest
    _attempt(memory, still, had_secondary, to_win)
    return True


@compiled
def _solve(memory: SolverMemory) -> None:
    """Set `free_step`, and `step` in joints, to what the first level's tasks want, without limits."""
    p, wanted = memory.active_rows, memory.wanted
    rank = min(memory.task_rank, p, memory.mobility)
    if memory.task_distance <= NOISE:  # all are reached: no step of rounding errors
        wanted[:p] = 0.0
    if memory.has_given != 0:  # singular values of rows that Python gives can't be computed later
        find_singular_values(memory)
        solve_damped(memory)
        for i in range(rank):
            memory.record_sigma[i] = math.sqrt(memory.squares[i])
    elif not (p == rank and find_basis(memory, wanted)):
        find_singular_values(memory)
        solve_damped(memory)
    to_joints(memory, memory.free_step, memory.step)


@compiled
def _escape(memory: SolverMemory, largest: float) -> float:
    """Replace the step, whose largest motion of a joint is given, by one out of a singularity if the first level rests
    unreached. Return the reduction of its error that this requires, or 0."""
    if not _first_speed(memory, largest) < REST * memory.gain:
        return 0.0
    if memory.active_rows == 0 or memory.task_distance <= (ARRIVED * memory.lightest) ** 2:
        return 0.0
    copy(memory.step, memory.spare, memory.n)
    to_win = nudge(memory)
    if to_win > 0.0:
        memory.is_nudged, memory.has_spare = 1, 1 if memory.has_secondary != 0 and largest > 0.0 else 0
    elif memory.has_secondary != 0:
        copy(memory.spare, memory.step, memory.n)
    return to_win


@compiled
def _attempt(memory: SolverMemory, still: bool, had_secondary: bool, to_win: float) -> None:
    """Let the step be attempted, with what it promises and is corrected to."""
    step, scale = memory.step, memory.report[SPEED_SCALE]
    if memory.parts > 0:
        memory.turn_scale = 1.0
    else:
        _scale_turns(memory, still)
    if memory.turn_scale < 1.0:
        scale *= memory.turn_scale
        for j in range(memory.n):
            step[j] = memory.braking[j] + memory.turn_scale * (step[j] - memory.braking[j])
            memory.secondary[j] *= memory.turn_scale
    copy(step, memory.attempted, memory.n)
    predict_gain(memory)
    if memory.is_nudged != 0:
        memory.promised = to_win * memory.lightest * math.sqrt(2.0 * memory.task_distance)
    memory.aims = 1 if memory.parts > 0 or memory.lightest < FAR_APART else 0
    memory.is_refined = 1 if can_be_refined(memory, had_secondary) else 0
    if memory.aims != 0:
        promise(memory)
        find_corrected(memory)
    elif memory.is_refined != 0 and scale < 1.0:  # this tick corrects less of them
        for i in range(memory.active_rows):
            memory.wanted[i] *= scale


@compiled
def _first_speed(memory: SolverMemory, largest: float) -> float:
    """Return the largest motion of a joint by the tasks of the first level, from that of the whole step."""
    if memory.parts > 0:
        memory.first_speed = _largest(memory.level_part[0])
        return memory.first_speed
    if memory.has_secondary == 0:
        return largest
    largest = 0.0
    for j in range(memory.n):
        largest = max(largest, abs(memory.step[j] - memory.secondary[j]))
    return largest


@compiled
def _begin(memory: SolverMemory) -> None:
    """Forget the last tick's step, bounds and report."""
    memory.ticks += 1
    memory.level_tries, memory.has_spare, memory.first_speed = 0, 0, 0.0
    memory.tries, memory.closes, memory.sweeps, memory.is_nudged, memory.clear_part = 0, 0, 0, 0, 1.0
    memory.found_by = SVD
    memory.sigma, memory.promised = math.inf, 0.0
    memory.report[SPEED_SCALE], memory.report[LIMITING_DOF] = 1.0, -1.0
    memory.stopped[: memory.n + memory.barriers] = 0.0
    for j in range(memory.n):
        memory.step[j] = memory.locked[j] = 0.0


@compiled
def _largest(step: Array) -> float:
    """Return the largest |step[j]|."""
    largest = 0.0
    for j in range(step.shape[0]):
        largest = max(largest, abs(step[j]))
    return largest


@compiled
def can_be_refined(memory: SolverMemory, had_secondary: bool) -> bool:
    """Return whether tasks can be corrected together with the loops, or with a secondary step: no limit restricts them
    and no damping acts. The first of several levels can be, to what the step promises, unless a velocity limit
    restricts it: then it is far from its targets, and corrections would exceed the limit."""
    if memory.parts > 0:
        return memory.is_nudged == 0 and memory.report[SPEED_SCALE] == 1.0
    if memory.aims != 0:
        return True
    scaled = memory.rank == 0 or memory.report[SPEED_SCALE] != 1.0
    if (scaled and not had_secondary) or memory.active_rows == 0 or memory.is_nudged != 0:
        return False
    can = True
    for j in range(memory.n + memory.barriers):
        can = can and memory.stopped[j] == 0.0
    if memory.found_by == SVD:
        least = memory.damping_threshold * memory.damping_threshold
        for i in range(min(memory.task_rank, memory.active_rows, memory.mobility)):
            can = can and unweighted(memory, i) >= least
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        if task.is_active != 0:
            can = can and task.linear <= ERROR_CAP and task.angular <= ERROR_CAP
    return can


@compiled
def _ticks_left(memory: TasksMemory) -> float:
    """Return the number of ticks to the targets at the capped rate; at least 1."""
    most = 1.0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        if task.is_active != 0:
            most = max(most, task.linear / ERROR_CAP, task.angular / ERROR_CAP)
    return float(most / memory.gain)


@compiled
def is_sure(memory: SolverMemory) -> bool:
    """Return whether the trial can be accepted without evaluation: no loop, limit or singularity is involved, and the
    second-order error of the step is far less than the reduction of the error."""
    if memory.found_by == SVD or memory.rows > 0 or memory.active_rows == 0 or memory.is_guarded != 0:
        return False
    if memory.parts > 0 or memory.has_given != 0:
        return False
    total, largest = 0.0, 0.0
    for j in range(memory.n):
        if memory.stopped[j] != 0.0 or memory.locked[j] != 0.0:
            return False
        total += abs(memory.attempted[j])
        largest = max(largest, abs(memory.attempted[j]))
    if memory.report[SPEED_SCALE] != 1.0 or memory.is_refined != 0 or memory.is_nudged != 0:
        return False
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        if task.is_twist != 0 or task.is_active == 0:
            return False
    # |e| >= promised / |J s|, and each task's second-order error is at most the second derivative * total^2 / 2
    bent = 0.5 * memory.second_derivative * total * total
    small = memory.tasks * bent * bent < 0.01 * memory.gain * memory.promised
    return bool(small and largest >= 10.0 * REST * memory.gain)


@compiled
def _scale_turns(memory: SolverMemory, still: bool) -> None:
    """Set the scale of a step towards targets at rest, so that it does not oscillate: half the last one if the step
    turns back, else twice that, up to 1.

    Let the whole step be r times as long as that to the optimum, r > 1. The scale ends alternating between s and
    s / 2 with 1 < s r <= 2; together, these two steps leave (s r - 1) (1 - s r / 2) <= 1/8 of it.
    """
    if not still or memory.is_nudged != 0 or must_go_back(memory):
        memory.turn_scale = 1.0
    elif _turns_back(memory):
        memory.turn_scale = max(0.5 * memory.turn_scale, LEAST_SCALE)
    else:
        memory.turn_scale = min(2.0 * memory.turn_scale, 1.0)


@compiled
def _turns_back(memory: StepMemory) -> bool:
    """Return whether the step is opposite to the last one, within 60 degrees."""
    along, square, last_square = 0.0, 0.0, 0.0
    for j in range(memory.n):
        along += memory.step[j] * memory.last[j]
        square += memory.step[j] * memory.step[j]
        last_square += memory.last[j] * memory.last[j]
    return bool(along < 0.0 and along * along > 0.25 * square * last_square)
