"""Close all loops by Gauss-Newton steps: the steps of `raff2urdf.closure.close`, up to rounding.

Its damped step (J^T J + mu 1) d = -J^T c uses the singular value decomposition. With the pivoted factorisation
J = L Q^T, the same step is d = Q y with (L^T L + mu 1) y = -L^T c, without iterations, where the rank is clear. Where
it is not, singular vectors are used here, too.

Each cluster of loops is factored, damped and judged by itself: only that of the slowest takes more steps.

Factors are reused while they are good enough: they reduce a gap by about the gap at which they were computed.
"""

from __future__ import annotations

import math

from cinegen.jit import banded
from cinegen.jit.banded import factor_blocks
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.factor import damped_solution, factor, null_space, shortest_solution
from cinegen.jit.svd import decompose
from cinegen.jit.vectors import add_multiple, copy, inner
from cinegen.loops._kernels.kinematics import evaluate, integrate
from cinegen.loops._kernels.memory import AT_TRIAL, NOWHERE, ClusterMemory, LoopMemory, cluster_at
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
    trial, candidate, delta = memory.trial, memory.candidate, memory.delta
    evaluate(memory, trial)
    memory.gap = evaluate_loops(memory, False)
    memory.corrections = 0
    goes_on = False
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        cluster.gap, cluster.squared, cluster.mu = _gap(memory, cluster), _squared_residual(memory, cluster), 1.0
        cluster.is_open = 1 if cluster.gap > tolerance else 0
        goes_on = goes_on or cluster.is_open != 0
    while goes_on and memory.corrections < most and memory.gap < math.inf:
        correct(memory, tolerance, exact)
        cut_correction(memory)
        for c in range(memory.clusters):
            cluster = cluster_at(memory.cluster_handles[c])
            if cluster.is_open == 0:
                _stop(memory, cluster)
        integrate(memory, trial, delta, candidate)
        evaluate(memory, candidate)
        memory.gap = evaluate_loops(memory, False)
        memory.corrections += 1
        goes_on, is_worse = False, False
        for c in range(memory.clusters):
            cluster = cluster_at(memory.cluster_handles[c])
            if cluster.is_open == 0:
                continue
            squared, gap = _squared_residual(memory, cluster), _gap(memory, cluster)
            if squared < cluster.squared:
                shrinks = gap > CLOSED or gap <= 0.5 * cluster.gap
                cluster.gap, cluster.squared, cluster.mu = gap, squared, max(0.1 * cluster.mu, 1e-4)
            else:
                is_worse = True
                _stop(memory, cluster)
                shrinks = cluster.gap > CLOSED and cluster.mu <= 1e12
                cluster.mu *= 10.0
            cluster.is_open = 1 if shrinks and cluster.gap > tolerance else 0
            goes_on = goes_on or cluster.is_open != 0
        if is_worse:
            integrate(memory, trial, delta, candidate)
            evaluate(memory, candidate)
            memory.gap = evaluate_loops(memory, False)
        copy(candidate, trial, memory.nq)


@compiled
def _stop(memory: LoopMemory, cluster: ClusterMemory) -> None:
    """Remove the motion of a cluster's joints from `delta`."""
    delta, dof = memory.delta, cluster.dof
    for k in range(cluster.n):
        delta[dof[k]] = 0.0


@compiled
def _gap(memory: LoopMemory, cluster: ClusterMemory) -> float:
    """Return a cluster's largest residual."""
    largest, residual, row = 0.0, memory.residual, cluster.row
    for i in range(cluster.rows):
        largest = max(largest, abs(residual[row[i]]))
    return largest


@compiled
def _squared_residual(memory: LoopMemory, cluster: ClusterMemory) -> float:
    """Return c^T c of a cluster's residual c."""
    s, residual, row = 0.0, memory.residual, cluster.row
    for i in range(cluster.rows):
        s += residual[row[i]] * residual[row[i]]
    return s


@compiled
def correct(memory: LoopMemory, tolerance: float, exact: bool) -> None:
    """Set `correction` to the step that removes the present residual."""
    if exact or memory.factored_at == NOWHERE or memory.gap * memory.factors_gap > tolerance:
        evaluate_loops(memory, True)
        factor_loops(memory, exact)
        memory.factored_at, memory.factors_gap = AT_TRIAL, memory.gap
    loop_correction(memory, True, memory.correction)


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
    """Factor `jacobian` without the columns of locked joints, cluster by cluster.

    Args:
        memory: `factors` become the factors, or the singular vectors if the rank is not clear.
        exact: count rows, too, that are independent only because loops are open.
    """
    memory.is_singular, memory.sigma = 0, 1.0
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        _factor_cluster(memory, cluster, exact)
        memory.is_singular = max(memory.is_singular, cluster.is_singular)
        memory.sigma = min(memory.sigma, cluster.sigma)


@compiled
def _factor_cluster(memory: LoopMemory, cluster: ClusterMemory, exact: bool) -> None:
    """Factor a cluster: J^T P = H_1 ... H_r [L^T; 0], or J = U S W^T where the rank is not clear."""
    f, free, locked, dof = cluster.factors, 0, memory.locked, cluster.dof
    for k in range(cluster.n):
        if locked[dof[k]] == 0.0:
            free += 1
    _copy_unlocked(memory, cluster)
    rank, is_whole = min(cluster.rank, free), free == cluster.n
    cluster.factored_rank = rank
    cluster.is_singular = 0
    if cluster.blocks > 0:
        _factor_large(cluster, is_whole)
        return
    clear = factor(f, rank, cluster.row_order, cluster.row_left, cluster.tau, cluster.reflectors) >= HEALTHY
    if exact:
        nothing = NOTHING_ADDED * NOTHING_ADDED * f[0, 0] * f[0, 0] if rank > 0 else 0.0
        for i in range(rank, cluster.rows):
            clear = clear and cluster.row_left[i] <= nothing
    if not clear:
        _copy_unlocked(memory, cluster)
        _decompose(cluster, is_whole, exact)
    elif is_whole:
        cluster.sigma = 1.0


@compiled
def _factor_large(cluster: ClusterMemory, is_whole: bool) -> None:
    """Factor a large cluster block by block; `is_whole` is true if no joint of it is locked."""
    rank, tau, reach = cluster.factored_rank, cluster.tau, cluster.reach
    sine = factor_blocks(
        cluster.factors, rank, cluster.block_row, cluster.block_end, cluster.row_first, cluster.row_order,
        cluster.row_left, cluster.row_size, cluster.row_applied, cluster.row_filled, tau, cluster.reflectors, reach,
    )  # fmt: skip
    for t in range(rank, cluster.rank):
        tau[t], reach[t] = 0.0, t
    if is_whole:
        cluster.sigma = sine if sine < HEALTHY else 1.0


@compiled
def _decompose(cluster: ClusterMemory, is_whole: bool, exact: bool) -> None:
    """Compute the singular vectors of a cluster whose rank is not clear, and, if no joint of it is locked, reflections
    along the right ones, for the null space."""
    f, rows, n, rank = cluster.factors, cluster.rows, cluster.n, cluster.factored_rank
    b, square = cluster.right_vectors, cluster.squared_sigma
    cluster.is_singular = 1
    decompose(f, rows, n, cluster.left_vectors, b, square, False)
    if not exact:  # other rows are independent only by rounding, or because loops are open
        square[rank:rows] = 0.0
    if is_whole and rank > 0:
        cluster.sigma = math.sqrt(square[rank - 1])
        for i in range(rank):
            s = 1.0 / math.sqrt(square[i]) if square[i] > 1e-30 * square[0] else 0.0
            for k in range(n):
                f[i, k] = s * b[i, k]
        factor(f[:rank], rank, cluster.row_order, cluster.row_left, cluster.tau, cluster.reflectors)


@compiled
def _copy_unlocked(memory: LoopMemory, cluster: ClusterMemory) -> None:
    """Write the rows of a cluster into its factors, with columns of zeros for locked joints."""
    rows, n, row, dof, factors, jacobian = (
        cluster.rows, cluster.n, cluster.row, cluster.dof, cluster.factors, memory.jacobian
    )  # fmt: skip
    locked = memory.locked
    if cluster.blocks == 0:
        for i in range(rows):
            equation, f = jacobian[row[i]], factors[i]
            for k in range(n):
                f[k] = 0.0 if locked[dof[k]] != 0.0 else equation[dof[k]]
        return
    for b in range(cluster.blocks):
        for i in range(cluster.block_row[b], cluster.block_row[b + 1]):
            equation, f = jacobian[row[i]], factors[i]
            f[cluster.row_filled[i, 0] : cluster.row_filled[i, 1]] = 0.0
            for k in range(cluster.row_first[i], cluster.block_end[b]):
                f[k] = equation[dof[k]]
    for k in range(n):
        if locked[dof[k]] != 0.0:
            for i in range(rows):
                factors[i, k] = 0.0


@compiled
def find_null_space(memory: LoopMemory) -> None:
    """Compute the null space of each cluster from its factors: a basis that is orthonormal together with the motions of
    the joints that were cut, as `cinegen.loops.motions.orthonormal`; of large clusters without them."""
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        if cluster.blocks == 0:
            null_space(cluster.rank, cluster.tau, cluster.reflectors, cluster.null_space)
            if cluster.cut > 0:
                _count_cut_joints(memory, cluster)
            continue
        for t in range(cluster.kept):  # the loops may be factored again while these motions are used
            cluster.kept_tau[t], cluster.kept_reach[t] = cluster.tau[t], cluster.reach[t]
            copy(cluster.reflectors[t, t:], cluster.kept_reflectors[t, t:], cluster.reach[t] - t)


@compiled
def _count_cut_joints(memory: LoopMemory, cluster: ClusterMemory) -> None:
    """Make an orthonormal basis N orthonormal together with the motions of the joints that were cut: it becomes R^-1 N,
    where R R^T is the Cholesky factorisation of 1 + N C^T C N^T."""
    basis, moved, r, dof = cluster.null_space, cluster.cut_motions, cluster.metric, cluster.dof
    n, width, first = cluster.n, cluster.cut, cluster.cut_first
    for i in range(cluster.mobility):
        moved[i, :width] = 0.0
        for k in range(n):
            add_multiple(basis[i, k], memory.cut_rates[dof[k], first:], moved[i], width)
        for j in range(i):
            r[i, j] = (inner(moved[i], moved[j], width) - inner(r[i], r[j], j)) / r[j, j]
            add_multiple(-r[i, j], basis[j], basis[i], n)
        r[i, i] = math.sqrt(1.0 + inner(moved[i], moved[i], width) - inner(r[i], r[i], i))
        s = 1.0 / r[i, i]
        for k in range(n):
            basis[i, k] *= s


@compiled
def to_orthonormal(cluster: ClusterMemory, y: Array) -> None:
    """Replace products y (mobility,) of a row with the basis R^-1 N by R y, those with the orthonormal N."""
    if cluster.cut > 0:
        for i in range(cluster.mobility - 1, -1, -1):
            y[i] = inner(cluster.metric[i], y, i + 1)


@compiled
def from_orthonormal(cluster: ClusterMemory, y: Array) -> None:
    """Replace the coordinates y (mobility,) of a motion in the orthonormal basis N by those in the cluster's basis
    R^-1 N: R^T y."""
    if cluster.cut > 0:
        for i in range(cluster.mobility):
            s = 0.0
            for j in range(i, cluster.mobility):
                s += cluster.metric[j, i] * y[j]
            y[i] = s


@compiled
def to_motions(cluster: ClusterMemory, x: Array, y: Array) -> None:
    """Write the products y (mobility,) of a row x (n,) of the mechanism with the basis of a cluster's null space."""
    part, dof, n = cluster.part, cluster.dof, cluster.n
    for k in range(n):
        part[k] = x[dof[k]]
    if cluster.blocks == 0:
        basis = cluster.null_space
        for i in range(cluster.mobility):
            y[i] = inner(basis[i], part, n)
        return
    banded.to_motions(part, cluster.kept, cluster.kept_tau, cluster.kept_reflectors, cluster.kept_reach)
    for i in range(cluster.mobility):
        y[i] = part[cluster.rank + i]


@compiled
def from_motions(cluster: ClusterMemory, y: Array, x: Array) -> None:
    """Write the step of a cluster's joints, in x (n,) of the mechanism, with coordinates y (mobility,) in its null
    space."""
    part, dof, n = cluster.part, cluster.dof, cluster.n
    for k in range(n):
        part[k] = 0.0
    if cluster.blocks == 0:
        basis = cluster.null_space
        for i in range(cluster.mobility):
            add_multiple(y[i], basis[i], part, n)
    else:
        for i in range(cluster.mobility):
            part[cluster.rank + i] = y[i]
        banded.from_motions(part, cluster.kept, cluster.kept_tau, cluster.kept_reflectors, cluster.kept_reach)
    for k in range(n):
        x[dof[k]] = part[k]


@compiled
def loop_correction(memory: LoopMemory, is_damped: bool, out: Array) -> None:
    """Write the shortest step (n,) that removes the residual: Newton's, or Levenberg's and Marquardt's if damped."""
    for i in range(memory.idle):
        out[memory.idle_dof[i]] = 0.0
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        squared, row, right, residual = 0.0, cluster.row, cluster.right, memory.residual
        for i in range(cluster.rows):
            lack = residual[row[i]]
            right[i] = -lack
            squared += lack * lack
        damping = cluster.mu * squared if is_damped else 0.0
        _cluster_correction(cluster, damping)
        dof, part = cluster.dof, cluster.part
        for k in range(cluster.n):
            out[dof[k]] = part[k]


@compiled
def _cluster_correction(cluster: ClusterMemory, damping: float) -> None:
    """Set `part` to the step of a cluster's joints that removes the residual -`right`."""
    f, tau, h, order, rank = cluster.factors, cluster.tau, cluster.reflectors, cluster.row_order, cluster.factored_rank
    right, out = cluster.right, cluster.part
    if cluster.blocks > 0:
        banded.newton_step(f, rank, order, tau, h, cluster.reach, right, damping, out)
        return
    if cluster.is_singular == 0:
        if rank == 0 or damping <= NEGLIGIBLE * f[rank - 1, rank - 1] * f[rank - 1, rank - 1]:
            shortest_solution(f, rank, order, tau, h, right, out)
        else:
            damped_solution(f, rank, order, tau, h, right, damping, cluster.left_vectors, out)
        return
    u, b, square = cluster.left_vectors, cluster.right_vectors, cluster.squared_sigma
    out[: cluster.n] = 0.0
    for i in range(cluster.rows):
        if square[i] <= 1e-20 * square[0]:
            break
        add_multiple(inner(u[i], right, cluster.rows) / (square[i] + damping), b[i], out, cluster.n)
