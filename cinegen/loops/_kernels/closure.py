"""Close all loops by Gauss-Newton steps: the steps of `raff2urdf.closure.close`, up to rounding.

Its damped step (J^T J + mu 1) d = -J^T c uses the singular value decomposition. With the pivoted factorisation
J = L Q^T, the same step is d = Q y with (L^T L + mu 1) y = -L^T c, without iterations, where the rank is clear. Where
it is not, singular vectors are used here, too.

Factors are reused while they are good enough: they reduce a gap by about the gap at which they were computed.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.factor import damped_solution, factor, shortest_solution
from cinegen.jit.svd import decompose
from cinegen.jit.vectors import add_multiple, copy, inner
from cinegen.loops._kernels.kinematics import evaluate, integrate
from cinegen.loops._kernels.memory import AT_TRIAL, NOWHERE, LoopMemory
from cinegen.loops._kernels.residual import evaluate_loops
from cinegen.loops.thresholds import CLOSED, HEALTHY, NEGLIGIBLE, NOTHING_ADDED, ROUNDING, STEP_CAP


@entry
def close_from_trial(memory: LoopMemory) -> None:
    """Close the loops as `raff2urdf.closure.close` does; `gap` is NaN if a number of `trial` is not finite."""
    memory.factored_at = NOWHERE
    memory.gap = math.nan
    for i in range(memory.nq):
        if not math.isfinite(memory.trial[i]):
            return
    close(memory, ROUNDING, 100, True)


@compiled
def close(memory: LoopMemory, tolerance: float, most: int, exact: bool) -> None:
    """Close the loops from `trial`, which becomes the best configuration found; locked joints stay.

    Levenberg's and Marquardt's damping, mu c^T c, keeps the convergence quadratic where rows are dependent
    (N. Yamashita and M. Fukushima, 2001); mu grows if a step does not reduce the residual.

    Args:
        memory: `gap` becomes the remaining gap.
        tolerance: rad or characteristic lengths. Below `CLOSED`, iterations also end when the gap stops shrinking.
        most: largest number of corrections; `corrections` becomes their number.
        exact: see `factor_loops`.
    """
    trial, candidate = memory.trial, memory.candidate
    evaluate(memory, trial)
    memory.gap = evaluate_loops(memory, False)
    memory.corrections = 0
    squared, mu, shrinks = squared_residual(memory), 1.0, True
    while memory.gap > tolerance and shrinks and memory.corrections < most and memory.gap < math.inf:
        correct(memory, mu * squared, tolerance, exact)
        cut_correction(memory)
        integrate(memory, trial, memory.delta, candidate)
        evaluate(memory, candidate)
        gap = evaluate_loops(memory, False)
        now = squared_residual(memory)
        memory.corrections += 1
        if now < squared:
            copy(candidate, trial, memory.nq)
            shrinks = gap > CLOSED or gap <= 0.5 * memory.gap
            memory.gap, squared, mu = gap, now, max(0.1 * mu, 1e-4)
        else:
            evaluate(memory, trial)
            evaluate_loops(memory, False)
            shrinks = memory.gap > CLOSED and mu <= 1e12
            mu *= 10.0


@compiled
def squared_residual(memory: LoopMemory) -> float:
    """Return c^T c of the residual c."""
    return float(inner(memory.residual, memory.residual, memory.rows))


@compiled
def correct(memory: LoopMemory, damping: float, tolerance: float, exact: bool) -> None:
    """Set `correction` to the step that removes the present residual."""
    if exact or memory.factored_at == NOWHERE or memory.gap * memory.factors_gap > tolerance:
        evaluate_loops(memory, True)
        factor_loops(memory, exact)
        memory.factored_at, memory.factors_gap = AT_TRIAL, memory.gap
    loop_correction(memory, damping, memory.correction)


@compiled
def cut_correction(memory: LoopMemory) -> None:
    """Set `delta` to `correction`, limited to `STEP_CAP`, without locked joints."""
    step, delta, longest = memory.correction, memory.delta, 0.0
    for k in range(memory.n):
        if memory.locked[k] != 0.0:
            step[k] = 0.0
        longest = max(longest, abs(step[k]))
    cut = min(1.0, STEP_CAP / max(longest, 1e-300))
    for k in range(memory.n):
        step[k] *= cut
        delta[k] = step[k] * memory.scale[k]


@compiled
def factor_loops(memory: LoopMemory, exact: bool) -> None:
    """Factor `jacobian` without the columns of locked joints.

    Args:
        memory: `factors` become the factors, or the singular vectors if the rank is not clear.
        exact: count rows, too, that are independent only because loops are open.
    """
    f, tau, h, order = memory.factors, memory.tau, memory.reflectors, memory.row_order
    rows, n, free = memory.rows, memory.n, 0
    for k in range(n):
        if memory.locked[k] == 0.0:
            free += 1
    _copy_unlocked(memory)
    rank = min(memory.rank, free)
    memory.factored_rank = rank
    memory.is_singular = 0
    clear = factor(f, rank, order, memory.row_left, tau, h) >= HEALTHY
    if exact:
        nothing = NOTHING_ADDED * NOTHING_ADDED * f[0, 0] * f[0, 0] if rank > 0 else 0.0
        for i in range(rank, rows):
            clear = clear and memory.row_left[i] <= nothing
    if clear:
        if free == n:
            memory.sigma = 1.0
        return
    memory.is_singular = 1
    _copy_unlocked(memory)
    u, b, square = memory.left_vectors, memory.right_vectors, memory.squared_sigma
    decompose(f, rows, n, u, b, square, False)
    if free == n and rank > 0:  # reflections along the right singular vectors, for `null_space`
        memory.sigma = math.sqrt(square[rank - 1])
        for i in range(rank):
            s = 1.0 / math.sqrt(square[i]) if square[i] > 1e-30 * square[0] else 0.0
            for k in range(n):
                f[i, k] = s * b[i, k]
        factor(f[:rank], rank, order, memory.row_left, tau, h)


@compiled
def _copy_unlocked(memory: LoopMemory) -> None:
    for i in range(memory.rows):
        for k in range(memory.n):
            memory.factors[i, k] = 0.0 if memory.locked[k] != 0.0 else memory.jacobian[i, k]


@compiled
def loop_correction(memory: LoopMemory, damping: float, out: Array) -> None:
    """Write the shortest step (n,) that removes the residual: Newton's, or Levenberg and Marquardt's if damped."""
    f, tau, h, order, rank = memory.factors, memory.tau, memory.reflectors, memory.row_order, memory.factored_rank
    right = memory.minus_residual
    for i in range(memory.rows):
        right[i] = -memory.residual[i]
    if memory.is_singular == 0:
        if rank == 0 or damping <= NEGLIGIBLE * f[rank - 1, rank - 1] * f[rank - 1, rank - 1]:
            shortest_solution(f, rank, order, tau, h, right, out)
        else:
            damped_solution(f, rank, order, tau, h, right, damping, memory.left_vectors, out)
        return
    u, b, square = memory.left_vectors, memory.right_vectors, memory.squared_sigma
    out[: memory.n] = 0.0
    for i in range(memory.rows):
        if square[i] <= 1e-20 * square[0]:
            break
        add_multiple(inner(u[i], right, memory.rows) / (square[i] + damping), b[i], out, memory.n)
