"""Try a step, and judge it."""

from __future__ import annotations

import math

from cinegen.ik._kernels.bounds import TOUCH
from cinegen.ik._kernels.level_parts import shorten_levels
from cinegen.ik._kernels.limits import must_go_back
from cinegen.ik._kernels.memory import (
    AttemptMemory,
    SolverMemory,
    StepMemory,
)
from cinegen.ik._kernels.record import finish
from cinegen.ik._kernels.steps import AGAIN, correct_trial, find_lack, most_tries, set_out_again, shorten
from cinegen.ik._kernels.tasks import try_tasks
from cinegen.ik.thresholds import (
    ARMIJO,
    BEGIN,
    BRAKINGS,
    CLEARANCE_NEEDED,
    CORRECTIONS,
    DONE,
    ERRORS_NEEDED,
    EXACT,
    FULL,
    GUARD,
    JUDGE,
    NOISE,
    SECONDARY_TRIES,
)
from cinegen.jit.compiled import compiled
from cinegen.loops._kernels.kinematics import evaluate
from cinegen.loops._kernels.residual import evaluate_loops
from cinegen.loops.thresholds import CLOSED, CLOSURE, CORRECTION

_GOOD = -2  # nothing speaks against this trial


@compiled
def try_step(memory: SolverMemory) -> int:
    """Try the step, shortened until it is accepted; return DONE, ERRORS_NEEDED or CLEARANCE_NEEDED."""
    request = AGAIN
    while request == AGAIN:
        evaluate(memory, memory.trial)
        memory.is_at_q = 0
        if memory.has_given != 0:
            memory.phase = JUDGE
            return ERRORS_NEEDED
        request = _judge(memory)
    return request


@compiled
def judge_given(memory: SolverMemory) -> int:
    """Judge a trial for which Python has given errors."""
    memory.phase = BEGIN
    request = _judge(memory)
    return try_step(memory) if request == AGAIN else request


@compiled
def _judge(memory: SolverMemory) -> int:
    """Correct the trial, shorten the step, or accept it."""
    looped, refined = memory.rows > 0, memory.is_refined != 0
    gap = evaluate_loops(memory, False) if looped else 0.0
    distance = try_tasks(memory)
    lack = find_lack(memory) if refined else 0.0
    if _can_be_nearer(memory, gap, lack):
        memory.corrections += 1
        memory.gap, memory.lack = gap, lack
        correct_trial(memory)
        return AGAIN
    if looped and not gap <= CLOSURE:
        return shorten(memory, 0.5)
    seconds = memory.has_secondary != 0 and memory.tries < SECONDARY_TRIES  # this trial includes some of it
    if refined and seconds and not lack <= 10.0 * EXACT:
        return shorten(memory, 0.5)
    memory.gap = gap
    request = _keep_pace(memory)
    if request == _GOOD:
        request = _keep_gain(memory, distance, seconds)
    if request != _GOOD:
        return request
    if memory.is_guarded != 0:
        memory.phase = GUARD
        return CLEARANCE_NEEDED
    finish(memory, True, False)
    return DONE


@compiled
def _can_be_nearer(memory: AttemptMemory, gap: float, lack: float) -> bool:
    """Return whether another correction can close the loops or tasks further: a residual that does not halve is
    rounding."""
    loose, inexact = memory.rows > 0 and not gap <= CLOSED, memory.is_refined != 0 and lack > EXACT
    first = memory.corrections == 0
    goes_on = loose and (first or gap <= 0.5 * memory.gap or gap > CLOSURE)
    goes_on = goes_on or (inexact and (first or lack <= 0.5 * memory.lack))
    return bool(goes_on and memory.corrections < CORRECTIONS and gap < 1.0)


@compiled
def _keep_pace(memory: SolverMemory) -> int:
    """Shorten a closed trial whose motion is too fast, too abrupt, or little like the attempted one. Return _GOOD if it
    is none of these."""
    excess, fastest, added, size = 0.0, 0, 0.0, 0.0
    for j in range(memory.n):
        part = abs(memory.moved[j]) / memory.longest_step[j]
        if part > excess:
            excess, fastest = part, j
        added = max(added, abs(memory.moved[j] - memory.attempted[j]))
        size = max(size, abs(memory.attempted[j]))
    if excess > 1.0:  # closing the loops added a little, of second order
        return shorten(memory, _part_in_limit(memory, fastest, FULL * (1.0 - 1e-3 * memory.tries) / excess))
    if memory.has_acceleration_limits != 0 and _is_abrupt(memory):
        request = _be_smooth(memory)
        if request != _GOOD:
            return request
    return shorten(memory, 0.5) if added > CORRECTION * size + CLOSURE else _GOOD


@compiled
def _be_smooth(memory: SolverMemory) -> int:
    """Try less where a limit of acceleration is exceeded. Return _GOOD if nothing is left to try."""
    if memory.tries >= most_tries(memory) - 1:
        if memory.rows > 0 and memory.brakings < BRAKINGS:
            _brake_again(memory)
            return AGAIN
        return _GOOD
    if memory.is_refined == 0:
        return shorten(memory, 0.5)
    memory.is_refined = 0  # the corrections of the tasks do not know the limits
    set_out_again(memory)
    return AGAIN


@compiled
def _keep_gain(memory: SolverMemory, distance: float, seconds: bool) -> int:
    """Shorten a trial whose tasks win too little. Return _GOOD if they win enough.

    Args:
        memory: with a closed trial.
        distance: cost of the first level there.
        seconds: the trial includes some of the secondary step.
    """
    memory.closes = 1
    won, promised, noise = memory.task_distance - distance, memory.promised, NOISE
    last_try = memory.tries >= most_tries(memory) - 1
    if memory.is_refined != 0 and seconds:  # errors that are small enough do not count
        noise += 10.0 * EXACT * (10.0 * EXACT + math.sqrt(2.0 * memory.task_distance))
    forced = memory.has_acceleration_limits != 0 and (promised <= 0.0 or last_try)  # it can't stop immediately
    forced = forced or (promised <= 0.0 and must_go_back(memory))  # at a cost for the tasks
    if memory.active_rows > 0 and not forced and won < ARMIJO * promised - noise:
        return shorten(memory, min(max(0.5 * promised / (promised - won), 0.1), 0.7))  # minimum of a parabola
    if memory.parts > 0 and memory.is_nudged == 0 and not last_try and shorten_levels(memory):
        set_out_again(memory)
        return AGAIN
    return _GOOD


@compiled
def _part_in_limit(memory: StepMemory, j: int, scale: float) -> float:
    """Return the fraction of the step, beyond what braking leaves of it, with which the step of a joint is scaled."""
    step = abs(memory.attempted[j])
    beyond = abs(memory.attempted[j] - memory.braking[j])
    return max(1.0 - (1.0 - scale) * step / beyond, 0.0) if beyond > 0.0 else scale


@compiled
def _brake_again(memory: AttemptMemory) -> None:
    """Scale the step so that the joint whose change exceeds its limit most moves by what braking leaves: closing the
    loops changed that, too."""
    memory.brakings += 1
    worst, most, wanted = 0, 0.0, 0.0
    for j in range(memory.n):
        change = abs(memory.moved[j] - memory.last[j]) / memory.longest_change[j]
        if change > most and memory.locked[j] == 0.0:
            worst, most, wanted = j, change, memory.braking[j] + memory.drift[j]
    if memory.moved[worst] * wanted > 0.0:
        factor = min(max(wanted / memory.moved[worst], 0.9), 1.1)
        for j in range(memory.n):
            memory.attempted[j] *= factor
    set_out_again(memory)


@compiled
def _is_abrupt(memory: StepMemory) -> bool:
    """Return whether the motion to the trial exceeds a limit of acceleration."""
    abrupt = False
    for j in range(memory.n):
        abrupt = abrupt or abs(memory.moved[j] - memory.last[j]) > memory.longest_change[j] + TOUCH
    return abrupt


@compiled
def guard(memory: SolverMemory) -> int:
    """Judge an accepted trial by the fraction of the path to it that barriers report as clear."""
    if memory.clear_part >= 1.0:
        finish(memory, True, False)
        return DONE
    request = shorten(memory, min(max(memory.clear_part, 0.1), 0.7))
    return try_step(memory) if request == AGAIN else request
