"""Set out on a step, close the loops after it, and shorten it if it is rejected."""

from __future__ import annotations

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
from cinegen.ik._kernels.level_parts import correct_lower, find_lower_lack, scale_parts
from cinegen.ik._kernels.levels import promise
from cinegen.ik._kernels.memory import (
    SVD_UNLOCKED,
    BoundsMemory,
    LevelsMemory,
    SecondaryMemory,
    SolverMemory,
    StepMemory,
)
from cinegen.ik._kernels.proposal import can_be_refined
from cinegen.ik._kernels.record import finish
from cinegen.ik.thresholds import (
    BRAKINGS,
    DONE,
    LEAST_SCALE,
    SECONDARY_TRIES,
    SLOWER_TRIES,
    TRIES,
)
from cinegen.jit.compiled import compiled
from cinegen.jit.vectors import copy, inner
from cinegen.loops._kernels.closure import correct, cut_correction, find_null_space
from cinegen.loops._kernels.kinematics import difference, integrate
from cinegen.loops._kernels.memory import AT_TRIAL, NOWHERE, cluster_at
from cinegen.loops.thresholds import CLOSED

AGAIN = -1
"""Another trial is to be judged."""


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
def set_out_again(memory: StepMemory) -> None:
    """Set out with a new attempt; factors of the loops at the last trial are not used for it."""
    if memory.factored_at == AT_TRIAL:
        memory.factored_at = NOWHERE
    set_out(memory)


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
def find_lack(memory: LevelsMemory) -> float:
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
def correct_trial(memory: SolverMemory) -> None:
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
def shorten(memory: SolverMemory, part: float) -> int:
    """Shorten the step, the secondary step first; give up after `TRIES` times."""
    has_secondary, accelerated = memory.has_secondary != 0, memory.has_acceleration_limits != 0
    attempted, secondary, braking = memory.attempted, memory.secondary, memory.braking
    memory.tries += 1
    if memory.is_nudged != 0 and memory.has_spare != 0:
        _make_spare_step(memory)
        return AGAIN
    if memory.tries >= most_tries(memory) or memory.is_nudged != 0:
        if _slow_down(memory):
            return AGAIN
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
        last_try = accelerated and memory.tries == most_tries(memory) - 1
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
    set_out_again(memory)
    return AGAIN


@compiled
def most_tries(memory: SecondaryMemory) -> int:
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
def _slow_down(memory: SolverMemory) -> bool:
    """Set out with half of the last step if the loops don't even close after braking: better stop in some ticks, with
    more than the limits of acceleration, than in one. Return whether there is a step to try."""
    least = most_tries(memory)
    if memory.has_acceleration_limits == 0 or memory.closes != 0 or not least <= memory.tries < least + SLOWER_TRIES:
        return False
    for j in range(memory.n):
        memory.attempted[j] *= 0.5
    memory.brakings = BRAKINGS  # it is as slow as it must be
    set_out_again(memory)
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
    set_out_again(memory)
