"""Try a step: close the loops after it, judge it, and shorten it if it is rejected."""

from __future__ import annotations

import math

from cinegen.ik._kernels.bounds import TOUCH
from cinegen.ik._kernels.decomposition import (
    add_solution,
    find_basis,
    find_corrected,
    find_singular_values,
    predict_gain,
    reach_of,
    to_joints,
    unweighted,
)
from cinegen.ik._kernels.levels import (
    correct_lower,
    find_lower_lack,
    promise,
    scale_parts,
    shorten_levels,
)
from cinegen.ik._kernels.limits import must_go_back
from cinegen.ik._kernels.memory import (
    SVD_UNLOCKED,
    AttemptMemory,
    BoundsMemory,
    LevelsMemory,
    SecondaryMemory,
    SolverMemory,
    StepMemory,
)
from cinegen.ik._kernels.proposal import can_be_refined
from cinegen.ik._kernels.record import finish
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
    LEAST_SCALE,
    NOISE,
    SECONDARY_TRIES,
    SLOWER_TRIES,
    TRIES,
)
from cinegen.jit.compiled import compiled
from cinegen.jit.vectors import copy, inner
from cinegen.loops._kernels.closure import correct, cut_correction, find_null_space
from cinegen.loops._kernels.kinematics import difference, evaluate, integrate
from cinegen.loops._kernels.memory import AT_TRIAL, NOWHERE, cluster_at
from cinegen.loops._kernels.residual import evaluate_loops
from cinegen.loops.thresholds import CLOSED, CLOSURE, CORRECTION

_AGAIN, _GOOD = -1, -2  # another trial is to be judged; nothing speaks against this one


@compiled
def set_out(memory: StepMemory) -> None:
    """Move `trial` from q by the attempted step."""
    memory.corrections = 0
    copy(memory.q, memory.trial, memory.nq)
    for j in range(memory.n):
        memory.locked[j] = 0.0
        memory.delta[j] = memory.attempted[j] * memory.scale[j]
    _move(memory)


@compiled
def _move(memory: StepMemory) -> None:
    """Move the trial by `delta`. Joints beyond limits are set to them and locked; loops are then factored again."""
    q, candidate, moved = memory.q, memory.candidate, memory.moved
    integrate(memory, memory.trial, memory.delta, candidate)
    for j in range(memory.n):
        i = memory.q_index[j]
        if i < 0:
            continue
        bottom, top = min(memory.lower[j], q[i]), max(memory.upper[j], q[i])
        touch = TOUCH * memory.scale[j]  # rounding may not matter: a joint this near to its limit is on it
        if candidate[i] >= top - touch or candidate[i] <= bottom + touch:
            candidate[i] = top if candidate[i] >= top - touch else bottom
            if memory.locked[j] == 0.0:
                memory.locked[j] = 1.0
                memory.factored_at = NOWHERE
    copy(candidate, memory.trial, memory.nq)
    difference(memory, q, candidate, moved)
    for j in range(memory.n):
        moved[j] /= memory.scale[j]


@compiled
def try_step(memory: SolverMemory) -> int:
    """Try the step, shortened until it is accepted; return DONE, ERRORS_NEEDED or CLEARANCE_NEEDED."""
    request = _AGAIN
    while request == _AGAIN:
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
    return try_step(memory) if request == _AGAIN else request


@compiled
def _judge(memory: SolverMemory) -> int:
    """Correct the trial, shorten the step, or accept it."""
    looped, refined = memory.rows > 0, memory.is_refined != 0
    gap = evaluate_loops(memory, False) if looped else 0.0
    distance = try_tasks(memory)
    lack = _find_lack(memory) if refined else 0.0
    if _can_be_nearer(memory, gap, lack):
        memory.corrections += 1
        memory.gap, memory.lack = gap, lack
        _correct(memory)
        return _AGAIN
    if looped and not gap <= CLOSURE:
        return _shorten(memory, 0.5)
    seconds = memory.has_secondary != 0 and memory.tries < SECONDARY_TRIES  # this trial includes some of it
    if refined and seconds and not lack <= 10.0 * EXACT:
        return _shorten(memory, 0.5)
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
        return _shorten(memory, _part_in_limit(memory, fastest, FULL * (1.0 - 1e-3 * memory.tries) / excess))
    if memory.has_acceleration_limits != 0 and _is_abrupt(memory):
        request = _be_smooth(memory)
        if request != _GOOD:
            return request
    return _shorten(memory, 0.5) if added > CORRECTION * size + CLOSURE else _GOOD


@compiled
def _be_smooth(memory: SolverMemory) -> int:
    """Try less where a limit of acceleration is exceeded. Return _GOOD if nothing is left to try."""
    if memory.tries >= _most_tries(memory) - 1:
        if memory.rows > 0 and memory.brakings < BRAKINGS:
            _brake_again(memory)
            return _AGAIN
        return _GOOD
    if memory.is_refined == 0:
        return _shorten(memory, 0.5)
    memory.is_refined = 0  # the corrections of the tasks do not know the limits
    _set_out_again(memory)
    return _AGAIN


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
    last_try = memory.tries >= _most_tries(memory) - 1
    if memory.is_refined != 0 and seconds:  # errors that are small enough do not count
        noise += 10.0 * EXACT * (10.0 * EXACT + math.sqrt(2.0 * memory.task_distance))
    forced = memory.has_acceleration_limits != 0 and (promised <= 0.0 or last_try)  # it can't stop immediately
    forced = forced or (promised <= 0.0 and must_go_back(memory))  # at a cost for the tasks
    if memory.active_rows > 0 and not forced and won < ARMIJO * promised - noise:
        return _shorten(memory, min(max(0.5 * promised / (promised - won), 0.1), 0.7))  # minimum of a parabola
    if memory.parts > 0 and memory.is_nudged == 0 and not last_try and shorten_levels(memory):
        _set_out_again(memory)
        return _AGAIN
    return _GOOD


@compiled
def _set_out_again(memory: StepMemory) -> None:
    """Set out with a new attempt; factors of the loops at the last trial are not used for it."""
    if memory.factored_at == AT_TRIAL:
        memory.factored_at = NOWHERE
    set_out(memory)


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
    _set_out_again(memory)


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
    request = _shorten(memory, min(max(memory.clear_part, 0.1), 0.7))
    return try_step(memory) if request == _AGAIN else request


@compiled
def _find_lack(memory: LevelsMemory) -> float:
    """Set `trial_error` to the errors that remain of those to be corrected in this tick; return the largest component
    that can be corrected."""
    lack = memory.trial_error
    if memory.aims != 0:
        for i in range(memory.level_end[memory.levels - 1]):
            lack[i] = memory.row_weights[i] * (lack[i] - memory.error[i]) + memory.aimed[i]
        return max(reach_of(memory, lack), find_lower_lack(memory))
    for i in range(memory.active_rows):
        lack[i] = memory.row_weights[i] * (lack[i] - memory.error[i]) + memory.wanted[i]
    return reach_of(memory, lack)


@compiled
def _correct(memory: SolverMemory) -> None:
    """Take one Newton step on the loops, and on the tasks in their null space."""
    correction, is_locked = memory.correction, False
    for j in range(memory.n):
        correction[j] = 0.0
        is_locked = is_locked or memory.locked[j] != 0.0
    if memory.rows > 0:
        correct(memory, CLOSED, False)
    if memory.is_refined != 0:
        if memory.rows > 0:
            for i in range(memory.active_rows):
                memory.trial_error[i] -= inner(memory.task_jacobian[i], correction, memory.n)
        if not is_locked or _leave_out_locked(memory):
            memory.free_step[: memory.mobility] = 0.0
            add_solution(memory, memory.trial_error, memory.free_step)
            to_joints(memory, memory.free_step, memory.fresh)
            for j in range(memory.n):
                correction[j] += memory.fresh[j]
            if memory.parts > 0:
                correct_lower(memory, is_locked)
    cut_correction(memory)
    _move(memory)


@compiled
def _leave_out_locked(memory: SolverMemory) -> bool:
    """Decompose the tasks again without locked joints; return False if they are singular then."""
    if memory.is_singular != 0:
        return False
    for i in range(memory.level_end[memory.levels - 1]):
        for j in range(memory.n):
            if memory.locked[j] != 0.0:
                memory.task_jacobian[i, j] = 0.0
    find_null_space(memory)
    rank = min(memory.task_rank, memory.active_rows, memory.mobility)
    if memory.active_rows == rank and find_basis(memory, memory.trial_error):
        return True
    find_singular_values(memory)
    memory.found_by = SVD_UNLOCKED
    if memory.aims != 0:
        find_corrected(memory)
        return True
    if rank > 0 and unweighted(memory, rank - 1) >= memory.damping_threshold * memory.damping_threshold:
        return True
    memory.is_refined = 0
    return False


@compiled
def _most_tries(memory: SecondaryMemory) -> int:
    """Return how often a step may be shortened: more often with a null-space velocity, which is shortened first."""
    return TRIES + SECONDARY_TRIES if memory.has_secondary != 0 else TRIES


@compiled
def _is_spare(memory: BoundsMemory, part: float) -> bool:
    """Return whether barriers allow the step without a fraction of the secondary step, which may be what keeps them."""
    spare = True
    for b in range(memory.barriers):
        s = 0.0
        for j in range(memory.n):
            s += memory.barrier_rows[b, j] * (memory.attempted[j] - part * memory.secondary[j])
        spare = spare and s <= max(memory.barrier_room[b], 0.0) + TOUCH
    return spare


@compiled
def _shorten(memory: SolverMemory, part: float) -> int:
    """Shorten the step, the secondary step first; give up after `TRIES` times."""
    has_secondary, accelerated = memory.has_secondary != 0, memory.has_acceleration_limits != 0
    attempted, secondary, braking = memory.attempted, memory.secondary, memory.braking
    memory.tries += 1
    if memory.is_nudged != 0 and memory.has_spare != 0:
        _make_spare_step(memory)
        return _AGAIN
    if memory.tries >= _most_tries(memory) or memory.is_nudged != 0:
        if _slow_down(memory):
            return _AGAIN
        finish(memory, False, False)
        return DONE
    spare = min(part, 0.5) if memory.tries < SECONDARY_TRIES else 0.0
    if has_secondary and memory.active_rows > 0 and memory.tries <= SECONDARY_TRIES and _is_spare(memory, 1.0 - spare):
        for j in range(memory.n):
            attempted[j] -= (1.0 - spare) * secondary[j]
            secondary[j] *= spare
        memory.secondary_scale = max(spare * memory.secondary_scale, LEAST_SCALE)
        scale_parts(memory, spare, True)
    else:
        last_try = accelerated and memory.tries == _most_tries(memory) - 1
        if last_try:
            part, memory.brakings = 0.0, 0
        for j in range(memory.n):  # braking is 0 where accelerations are not limited
            attempted[j] = braking[j] + part * (attempted[j] - braking[j])
            secondary[j] *= part
        for c in range(memory.clusters if last_try else 0):
            cluster = cluster_at(memory.cluster_handles[c])
            for i in range(cluster.n):  # which may be more than what closed the loops
                attempted[cluster.dof[i]] += memory.drift[cluster.dof[i]]
        memory.promised *= part
        scale_parts(memory, part, False)
        if accelerated:
            predict_gain(memory)
        if memory.aims != 0 and memory.parts == 0 and memory.tries < TRIES // 2:
            promise(memory)
        else:
            memory.is_refined = 0
    _set_out_again(memory)
    return _AGAIN


@compiled
def _slow_down(memory: SolverMemory) -> bool:
    """Set out with half of the last step if the loops don't even close after braking: better stop in some ticks, with
    more than the limits of acceleration, than in one. Return whether there is a step to try."""
    least = _most_tries(memory)
    if memory.has_acceleration_limits == 0 or memory.closes != 0 or not least <= memory.tries < least + SLOWER_TRIES:
        return False
    for j in range(memory.n):
        memory.attempted[j] *= 0.5
    memory.brakings = BRAKINGS  # it is as slow as it must be
    _set_out_again(memory)
    return True


@compiled
def _make_spare_step(memory: SolverMemory) -> None:
    """Set out with the step that an escape from a singularity replaced, since that failed."""
    memory.is_nudged, memory.has_spare, memory.tries, memory.clear_part = 0, 0, 0, 1.0
    copy(memory.spare, memory.attempted, memory.n)
    predict_gain(memory)
    memory.is_refined = 1 if memory.parts > 0 or can_be_refined(memory, True) else 0
    if memory.aims != 0:
        promise(memory)
    _set_out_again(memory)
