"""Local inverse kinematics: iterations from one start, until they converge or stall.

Loops and tasks are one system of equations r(q) = 0 here (the extended Jacobian), and joint limits a box. The damping
of the Levenberg-Marquardt step d = J^T (J J^T + mu |r|^2 1)^-1 r vanishes with the residual: convergence is quadratic
at the end, also if rows are dependent (N. Yamashita and M. Fukushima, "On the rate of convergence of the
Levenberg-Marquardt method", 2001). A joint that is driven against its limit is left out of J.
"""

from __future__ import annotations

import math

from cinegen.ik._kernels.memory import LocalIKMemory
from cinegen.ik._kernels.tasks import aim_tasks, read_tasks
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.factor import cholesky
from cinegen.jit.vectors import copy, inner
from cinegen.loops._kernels.kinematics import evaluate, integrate
from cinegen.loops._kernels.residual import evaluate_loops

_LONGEST = 0.8  # rad or lengths of one joint in an iteration
_SOFT = 0.03  # the first mu
_SMALLEST, _LARGEST = 1e-6, 1e7  # of mu
_FLOOR = 1e-13  # least damping, as a fraction of J J^T's trace: rows may be dependent
_SLOW = 0.95  # an iteration that leaves more of the squared residual makes no progress
_PATIENCE = 5  # of these in a row
_ROUNDING = 1e-12  # rad or lengths


@entry
def solve(memory: LocalIKMemory) -> bool:
    """Iterate from `trial`; `q` becomes the best configuration found. Return whether `goal_residual` is reached."""
    memory.cost, memory.damping, memory.stalled, memory.iterations = math.inf, _SOFT, 0.0, 0
    memory.tasks_left = memory.loops_left = math.inf
    read_tasks(memory)
    while True:
        evaluate(memory, memory.trial)
        reached, before = _is_reached(memory), memory.cost
        cost, tasks_left, loops_left = _residuals(memory)
        memory.iterations += 1
        if cost < before:
            memory.cost, memory.tasks_left, memory.loops_left = cost, tasks_left, loops_left
            copy(memory.trial, memory.q, memory.nq)
            if max(tasks_left, loops_left) <= _ROUNDING or (reached and cost > 0.01 * before):
                return True
            memory.stalled = memory.stalled + 1.0 if cost > _SLOW * before else 0.0
            memory.damping = max(_SMALLEST, memory.damping * (0.2 if cost < 0.5 * before else 0.7))
            _keep_system(memory)
        else:
            if reached:
                return True
            memory.damping *= 6.0
            memory.stalled += 0.5
        if memory.iterations > memory.most_iterations or memory.stalled >= _PATIENCE or memory.damping > _LARGEST:
            return False
        if not memory.cost < 1e30:
            return False
        if not _step(memory):
            return _is_reached(memory)


@compiled
def _is_reached(memory: LocalIKMemory) -> bool:
    """Return whether the best configuration leaves no residual above the goal."""
    return bool(max(memory.tasks_left, memory.loops_left) <= memory.goal_residual)


@compiled
def _residuals(memory: LocalIKMemory) -> tuple[float, float, float]:
    """Compute tasks and loops; return the squared residual, and the largest of tasks and of loops."""
    aim_tasks(memory)
    loops = evaluate_loops(memory, True) if memory.rows > 0 else 0.0
    cost, tasks = 0.0, 0.0
    for i in range(memory.active_rows):
        cost += memory.error[i] * memory.error[i]
        tasks = max(tasks, abs(memory.error[i]))
    cost += inner(memory.residual, memory.residual, memory.rows)
    return cost, tasks, loops


@compiled
def _keep_system(memory: LocalIKMemory) -> None:
    """Keep r = [task errors; -loop residuals] and J = [rows of tasks, without weights; rows of loops] at q."""
    p = memory.active_rows
    for i in range(p):
        memory.right_side[i] = memory.error[i]
        weight = max(memory.row_weights[i], 1e-300)  # all is to be exact: weights do not matter
        for j in range(memory.n):
            memory.system[i, j] = memory.task_jacobian[i, j] / weight
    for i in range(memory.rows):
        memory.right_side[p + i] = -memory.residual[i]
        copy(memory.jacobian[i], memory.system[p + i], memory.n)


@compiled
def _step(memory: LocalIKMemory) -> bool:
    """Move `trial` one step away from q. Return False if limits block every joint that would help."""
    n, size, trial, d = memory.n, memory.active_rows + memory.rows, memory.trial, memory.correction
    for j in range(n):
        memory.free[j] = 0.0 if _is_blocked(memory, j, _along(memory, j, memory.right_side)) else 1.0
    for _ in range(4):
        if not _solve_damped(memory, size):
            return False
        if not _block(memory):
            break
    longest = 0.0
    for j in range(n):
        d[j] *= memory.free[j]
        longest = max(longest, abs(d[j]))
    cut = min(1.0, _LONGEST / max(longest, 1e-300))
    for j in range(n):
        memory.delta[j] = cut * d[j] * memory.scale[j]
    integrate(memory, memory.q, memory.delta, trial)
    for j in range(n):
        i = memory.q_index[j]
        if i >= 0:
            trial[i] = min(max(trial[i], memory.lower[j]), memory.upper[j])
    return longest > 0.0


@compiled
def _along(memory: LocalIKMemory, j: int, x: Array) -> float:
    """Return component j of J^T x, for x (equations,)."""
    s = 0.0
    for i in range(memory.active_rows + memory.rows):
        s += memory.system[i, j] * x[i]
    return s


@compiled
def _solve_damped(memory: LocalIKMemory, size: int) -> bool:
    """Solve (J F J^T + (mu |r|^2 + epsilon trace) 1) z = r, where F leaves out joints that are not free. Return False
    if J F is zero."""
    jacobian, normal, z, free, trace = memory.system, memory.normal, memory.solution, memory.free, 0.0
    for i in range(size):
        for k in range(i + 1):
            s = 0.0
            for j in range(memory.n):
                s += jacobian[i, j] * free[j] * jacobian[k, j]
            normal[i, k] = s
        trace += normal[i, i]
        z[i] = memory.right_side[i]
    if not trace > 0.0:
        return False
    for i in range(size):
        normal[i, i] += memory.damping * memory.cost + _FLOOR * trace
    cholesky(normal, size, z)
    return True


@compiled
def _block(memory: LocalIKMemory) -> bool:
    """Set the step d = F J^T z. Return whether limits block joints that were free: these are no longer."""
    free, again = memory.free, False
    for j in range(memory.n):
        s = _along(memory, j, memory.solution)
        memory.correction[j] = s * free[j]
        if free[j] != 0.0 and _is_blocked(memory, j, s):
            free[j] = 0.0
            again = True
    return again


@compiled
def _is_blocked(memory: LocalIKMemory, j: int, direction: float) -> bool:
    """Return whether a joint is at a limit and would move beyond it."""
    i = memory.q_index[j]
    if i < 0:
        return False
    return bool(
        (memory.q[i] >= memory.upper[j] and direction > 0.0) or (memory.q[i] <= memory.lower[j] and direction < 0.0)
    )
