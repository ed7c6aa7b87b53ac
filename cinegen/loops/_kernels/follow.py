"""Follow the actuated joints on one branch: they move along a straight line to their goal, loops stay closed.

Each step is predicted along the tangent of the path and corrected with the actuated joints locked. It is accepted only
if it is proved to stay on the branch (`proof`). Where that can't be, as at a singular start, or is not asked for, it is
accepted if the correction is small: a large one would lead into another assembly mode. Otherwise half of the step is
tried (predictor-corrector; E. L. Allgower and K. Georg, "Introduction to numerical continuation methods", 2003).

If passive joints have limits here, the motion ends where one of them would pass its limit. On proved steps they are
proved to keep them; on others this is only known at the ends of the steps.

If the actuated joints move by as much as before, as along the lines of a grid, the second-order terms of the last two
steps are extrapolated to this one, which leaves an error of order h^4 for a step h.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import compiled, entry
from cinegen.jit.factor import eliminate
from cinegen.jit.vectors import copy
from cinegen.loops._kernels.closure import close, factor_loops, loop_correction
from cinegen.loops._kernels.kinematics import difference, evaluate, integrate
from cinegen.loops._kernels.memory import AT_Q, NOWHERE, ClusterMemory, LoopMemory, cluster_at
from cinegen.loops._kernels.proof import NO_PROOF, PROVED, find_beyond, keep, keeps_limits, prepare, prove
from cinegen.loops._kernels.residual import evaluate_loops
from cinegen.loops.thresholds import CLOSURE

_MOST_HALVED = 6
_MOST_PROVED = 18  # halvings of a step that may be proved
_MOST = 12  # corrections of a step
_FAR = 1e6  # rad or lengths: a longer tangent has diverged
_ALIKE = 1e-6  # relative difference of two steps of the actuated joints that count as equal


@entry
def follow(memory: LoopMemory) -> bool:
    """Move the actuated joints from `q`, closed, towards `goal`; `q` becomes the end. Return whether it is the goal."""
    set_out(memory)
    return go_on(memory)


@compiled
def set_out(memory: LoopMemory) -> None:
    """Start the path from q to the goal."""
    memory.halvings, memory.beyond = 0, 0
    _find_tangent(memory)


@compiled
def go_on(memory: LoopMemory) -> bool:
    """Follow the path. Return whether its end was reached; then frames are evaluated there."""
    while memory.halvings <= (_MOST_PROVED if memory.proves != 0 else _MOST_HALVED) and _step(memory):
        close(memory, memory.tolerance, _MOST, False)
        if _is_accepted(memory):
            copy(memory.trial, memory.q, memory.nq)
            memory.closure = memory.gap
            if memory.corrections == 0:
                memory.factored_at = NOWHERE  # the factors are those of another configuration
            if memory.part == 1.0:
                _keep_curvature(memory)
                return True
            memory.halvings = max(memory.halvings - 1, 0)
            memory.alike = 0
            _find_tangent(memory)
        else:
            memory.halvings += 1
            memory.alike = 0
            memory.factored_at = NOWHERE
    return False


@compiled
def _find_tangent(memory: LoopMemory) -> None:
    """Compute `tangent`, the path to the goal to first order: the passive joints compensate the motion of the actuated
    ones in the loops, and close what is open at the start."""
    tangent, delta = memory.tangent, memory.delta
    is_new, is_open = memory.factored_at == NOWHERE, False
    if is_new:  # otherwise they are of a configuration near by, which suffices
        evaluate(memory, memory.q)
        memory.gap = evaluate_loops(memory, True)
        is_open = memory.gap > memory.tolerance
        factor_loops(memory, False)
        memory.factored_at = AT_Q
    delta[: memory.n] = 0.0
    for a in range(memory.actuated):
        k = memory.actuated_dof[a]
        delta[k] = (memory.goal[a] - memory.q[memory.q_index[k]]) / memory.scale[k]
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        _keep_jacobian(memory, cluster)
        if is_new:
            cluster.side = _side(memory, cluster)
        for i in range(cluster.rows):
            s = memory.residual[cluster.row[i]] if is_open else 0.0
            for k in range(cluster.n):
                s += cluster.jacobian_at_q[i, k] * delta[cluster.dof[k]]
            memory.residual[cluster.row[i]] = s
    loop_correction(memory, False, tangent)
    for k in range(memory.n):
        if memory.locked[k] != 0.0:
            tangent[k] = 0.0
    for a in range(memory.actuated):
        tangent[memory.actuated_dof[a]] = delta[memory.actuated_dof[a]]
    if memory.proves != 0:
        prepare(memory, is_new)


@compiled
def _keep_jacobian(memory: LoopMemory, cluster: ClusterMemory) -> None:
    """Keep the rows of a cluster at q."""
    for i in range(cluster.rows):
        for k in range(cluster.n):
            cluster.jacobian_at_q[i, k] = memory.jacobian[cluster.row[i], cluster.dof[k]]


@compiled
def _step(memory: LoopMemory) -> bool:
    """Move `trial` from q along the tangent, to the goal or by the longest stride, whichever is nearer; each of the
    `halvings` halves this step. Return False if the tangent has diverged."""
    n, q, trial, tangent, delta = memory.n, memory.q, memory.trial, memory.tangent, memory.delta
    furthest = 0.0
    for k in range(n):
        if not abs(tangent[k]) <= furthest:  # NaN counts as far
            furthest = abs(tangent[k])
    if not furthest < _FAR:
        return False
    part = min(1.0, memory.longest_stride / max(furthest, 1e-300)) * 0.5**memory.halvings
    memory.part = part
    if part == 1.0:
        _extrapolate_curvature(memory)
    for k in range(n):
        delta[k] = memory.scale[k] * (part * tangent[k] + (memory.curvature[k] if part == 1.0 else 0.0))
    integrate(memory, q, delta, trial)
    for a in range(memory.actuated):
        i = memory.q_index[memory.actuated_dof[a]]
        trial[i] = memory.goal[a] if part == 1.0 else q[i] + part * (memory.goal[a] - q[i])
    memory.factors_gap = math.inf  # the factors are those of q, and not good enough
    return True


@compiled
def _is_accepted(memory: LoopMemory) -> bool:
    """Return whether `trial` is on the branch of q, and limits are kept: proved, if that is asked for and possible."""
    memory.beyond = 0
    if not memory.gap <= CLOSURE:
        return False
    difference(memory, memory.q, memory.trial, memory.delta)
    if memory.proves != 0:
        evaluate_loops(memory, True)
        status = prove(memory)
        if status == PROVED:
            memory.beyond = find_beyond(memory)
            if memory.beyond == 0 and keeps_limits(memory):
                keep(memory)
                return True
        if status != NO_PROOF:
            return False
        if memory.halvings > _MOST_HALVED:
            memory.halvings = _MOST_PROVED
    if not (_is_near(memory) and (memory.corrections == 0 or _is_on_branch(memory))):
        return False
    memory.is_proved = 0
    memory.beyond = find_beyond(memory)
    if memory.beyond != 0:
        memory.halvings = _MOST_PROVED
    return bool(memory.beyond == 0)


@compiled
def _is_near(memory: LoopMemory) -> bool:
    """Return whether `trial` is near the prediction: otherwise it is on another branch."""
    added, size = 0.0, 0.0
    for k in range(memory.n):
        predicted = memory.part * memory.tangent[k]
        size = max(size, abs(predicted))
        added = max(added, abs(memory.delta[k] / memory.scale[k] - predicted))
    return bool(added <= memory.most_added * size + CLOSURE)


@compiled
def _is_on_branch(memory: LoopMemory) -> bool:
    """Return whether no cluster's determinant has changed its sign since q."""
    same = True
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        same = same and _side(memory, cluster) * cluster.side >= 0.0
    return same


@compiled
def _side(memory: LoopMemory, cluster: ClusterMemory) -> float:
    """Return the sign of the determinant of a cluster's Jacobian J by its passive joints, or of det(J_q^T J) if there
    are more rows than joints. 0 if the actuated joints do not determine the others,
    and for large clusters, for which it is not computed.

    The determinant is 0 between two branches, so its sign separates them.
    """
    locked, jacobian, dof, row = memory.locked, memory.jacobian, cluster.dof, cluster.row
    rows, free = cluster.rows, 0
    for k in range(cluster.n):
        if locked[dof[k]] == 0.0:
            free += 1
    if free > cluster.rank or cluster.blocks > 0:
        return 0.0
    a, j = cluster.determinant, 0
    for k in range(cluster.n):
        if locked[dof[k]] != 0.0:
            continue
        if rows == free:
            for i in range(rows):
                a[i, j] = jacobian[row[i], dof[k]]
        else:
            i = 0
            for other in range(cluster.n):
                if locked[dof[other]] == 0.0:
                    a[i, j] = 0.0
                    for r in range(rows):
                        a[i, j] += cluster.jacobian_at_q[r, other] * jacobian[row[r], dof[k]]
                    i += 1
        j += 1
    return eliminate(a, free, free)


# --- second order -----------------------------------------------------------------------------------------------------


@compiled
def _extrapolate_curvature(memory: LoopMemory) -> None:
    """Extrapolate `curvature` from the last whole steps, if the actuated joints moved by as much in them."""
    change, size = 0.0, 0.0
    for a in range(memory.actuated):
        now = memory.tangent[memory.actuated_dof[a]]
        size = max(size, abs(now))
        change = max(change, abs(now - memory.actuated_step[a]))
    if change > _ALIKE * size:
        memory.alike = 0
    for k in range(memory.n):
        memory.curvature[k] = 0.0
        if memory.alike == 1:
            memory.curvature[k] = memory.curvature_1[k]
        elif memory.alike == 2:
            memory.curvature[k] = 2.0 * memory.curvature_1[k] - memory.curvature_2[k]


@compiled
def _keep_curvature(memory: LoopMemory) -> None:
    """Keep the second-order term of a whole step for the next."""
    for k in range(memory.n):  # `delta` is the step: see `_is_near`
        memory.curvature_2[k] = memory.curvature_1[k]
        memory.curvature_1[k] = memory.delta[k] / memory.scale[k] - memory.tangent[k]
    for a in range(memory.actuated):
        memory.actuated_step[a] = memory.tangent[memory.actuated_dof[a]]
    memory.alike = min(memory.alike + 1, 2)
