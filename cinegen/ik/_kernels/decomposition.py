"""Singular values of the tasks in the null space of the loops, compiled; plain form: `tests/ik/reference_tick.py`."""

from __future__ import annotations

import math

from cinegen.ik._kernels.memory import BASIS, SVD, AttemptMemory, DirectionsMemory
from cinegen.ik.thresholds import RESTING
from cinegen.jit.compiled import Array, compiled
from cinegen.jit.factor import factor, null_space
from cinegen.jit.svd import decompose, straighten
from cinegen.jit.vectors import add_multiple, copy, inner
from cinegen.loops._kernels.closure import from_motions, from_orthonormal, to_motions, to_orthonormal
from cinegen.loops._kernels.memory import LoopMemory, cluster_at

_LOST = 1e-12  # directions of singular values below this fraction of the largest are undetermined


@compiled
def to_free(memory: LoopMemory, x: Array, y: Array) -> None:
    """Write the products y (mobility,) of a row x (n,) with the basis of the loops' null space: those of its clusters,
    then those of joints in none."""
    if memory.idle == memory.n:  # no loop, and no joint is locked
        copy(x, y, memory.n)
        return
    at = 0
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        to_motions(cluster, x, y[at:])
        at += cluster.mobility
    for i in range(memory.idle):
        y[at + i] = x[memory.idle_dof[i]]


@compiled
def project_step(memory: DirectionsMemory, x: Array, y: Array, free_of_tasks: bool) -> None:
    """Write the coordinates y (mobility,) of the step in the null space of the loops, and of the tasks if requested,
    that is nearest to a joint step x (n,): as the joints of the model move, whatever cut joints do."""
    to_free(memory, x, y)
    _to_orthonormal(memory, y)
    if free_of_tasks:
        _leave_tasks_alone(memory, y)
    at = 0
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        from_orthonormal(cluster, y[at:])
        at += cluster.mobility


@compiled
def _to_orthonormal(memory: LoopMemory, y: Array) -> None:
    """Replace the products y (mobility,) of a row with the basis by those with an orthonormal basis."""
    at = 0
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        to_orthonormal(cluster, y[at:])
        at += cluster.mobility


@compiled
def to_joints(memory: LoopMemory, y: Array, x: Array) -> None:
    """Write the joint step x (n,) of a step y (mobility,) in the null space."""
    if memory.idle == memory.n:  # no loop, and no joint is locked
        copy(y, x, memory.n)
        return
    at = 0
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        from_motions(cluster, y[at:], x)
        at += cluster.mobility
    for i in range(memory.idle):
        x[memory.idle_dof[i]] = y[at + i]


@compiled
def damping(square: float, emphasis: float, error: float, threshold: float) -> float:
    """Return the damping that is added to a squared singular value, as in `tests/ik/reference_tick.py`."""
    ratio = square / emphasis / (threshold * threshold)
    return emphasis * (1.0 - ratio) * (1.0 - ratio) * (0.25 * threshold * threshold + error) if ratio < 1.0 else 0.0


@compiled
def find_emphasis(
    weights: Array, rows: int, vectors: Array, squares: Array, lesser: int, is_wide: bool, out: Array
) -> None:
    """Write |W u_i|^2 of each left singular vector u_i of weighted rows W A: the weight that its tasks have.

    A singular value s_i divided by |W u_i| is |A^T x| for the unit vector x along W u_i. So it is 0 where a singular
    value of A is, and with independent rows at least the smallest of these, whatever the weights.

    Args:
        weights: (rows,) the diagonal of W.
        rows: number of rows.
        vectors: (lesser, rows) the u_i, or s_i u_i if there are more rows than columns.
        squares: (lesser,) the s_i^2.
        lesser: number of singular values.
        is_wide: there are no more rows than columns.
        out: (lesser,) exactly 1 if all weights are.
    """
    differ = False
    for j in range(rows):
        differ = differ or weights[j] != 1.0
    for i in range(lesser):
        out[i] = 1.0
        if not differ or (not is_wide and squares[i] <= _LOST * _LOST * squares[0]):
            continue
        total = 0.0
        for j in range(rows):
            total += weights[j] * vectors[i, j] * weights[j] * vectors[i, j]
        out[i] = max(total if is_wide else total / squares[i], 1e-300)


@compiled
def unweighted(memory: DirectionsMemory, i: int) -> float:
    """Return the square of the i-th singular value that does not depend on the weights of tasks."""
    return float(memory.squares[i] / memory.emphasis[i])


@compiled
def size_of(error: Array, weights: Array, rows: int) -> float:
    """Return the length of an error (rows,) without its weights (rows,)."""
    total = 0.0
    for i in range(rows):
        part = error[i] / max(weights[i], 1e-300)
        total += part * part
    return math.sqrt(total)


@compiled
def _reduce(memory: DirectionsMemory, transposed: bool) -> None:
    """Compute `reduced`: the tasks' rows in the null space, (rows, mobility), or transposed."""
    a = memory.reduced
    for i in range(memory.active_rows):
        if not transposed:
            to_free(memory, memory.task_jacobian[i], a[i])
            continue
        to_free(memory, memory.task_jacobian[i], memory.coordinates)
        for j in range(memory.mobility):
            a[j, i] = memory.coordinates[j]


@compiled
def find_singular_values(memory: DirectionsMemory) -> None:
    """Decompose the tasks' rows in the null space: `squares` of the singular values, largest first.

    Where there are no more rows than columns, rows are made orthogonal: right_i = s_i w_i, left_i = u_i. Else columns
    are: right_i = s_i u_i, and left holds the w_i.
    """
    p, k = memory.active_rows, memory.mobility
    lesser = min(p, k)
    if memory.is_warm != 0 and memory.ticks % 32 == 0:
        straighten(memory.left, lesser)
    _reduce(memory, p > k)
    memory.sweeps = decompose(
        memory.reduced, lesser, max(p, k), memory.left, memory.right, memory.squares, memory.is_warm != 0
    )
    memory.is_warm = 1
    memory.found_by = SVD
    if p <= k:
        find_emphasis(memory.row_weights, p, memory.left, memory.squares, lesser, True, memory.emphasis)
    else:
        find_emphasis(memory.row_weights, p, memory.right, memory.squares, lesser, False, memory.emphasis)


@compiled
def find_basis(memory: DirectionsMemory, error: Array) -> bool:
    """Compute `free_step` as `solve_damped` does, at a third of the cost, if no singular value is below the threshold;
    otherwise return False.

    The rows become orthonormal, A = T Q with T triangular (Gram and Schmidt); the smallest singular value is at least
    1 / |T^-1 W|, in Frobenius's norm, where W are the weights. `reduced` becomes Q, `triangle` T and its inverse.

    Args:
        memory: memory with independent rows.
        error: (rows,).
    """
    a, lower, inverse, y = memory.reduced, memory.triangle[0], memory.triangle[1], memory.free_step
    p, k, least = memory.active_rows, memory.mobility, memory.damping_threshold * memory.damping_threshold
    _reduce(memory, False)
    total = 0.0
    for i in range(p):
        # the row's part along the rows before, and that row of the inverse
        for c in range(i):
            lower[i, c] = inner(a[c], a[i], k)
            add_multiple(-lower[i, c], a[c], a[i], k)
        s = inner(a[i], a[i], k)
        weight = memory.row_weights[i]
        if not s > least * weight * weight:
            return False
        s = 1.0 / math.sqrt(s)
        for j in range(k):
            a[i, j] *= s
        inverse[i, i] = s
        total += s * weight * s * weight
        for c in range(i):
            dot = 0.0
            for j in range(c, i):
                dot += lower[i, j] * inverse[j, c]
            dot *= -s
            inverse[i, c] = dot
            total += dot * memory.row_weights[c] * dot * memory.row_weights[c]
    if total * least > 1.0:
        return False
    memory.found_by = BASIS
    y[:k] = 0.0
    add_solution(memory, error, y)
    return True


@compiled
def add_solution(memory: DirectionsMemory, error: Array, y: Array) -> None:
    """Add to y (mobility,) the shortest step that removes an error (rows,), undamped."""
    p, k = memory.active_rows, memory.mobility
    if memory.found_by == BASIS:
        for i in range(p):
            add_multiple(inner(memory.triangle[1, i], error, i + 1), memory.reduced[i], y, k)
        return
    for i in range(_corrected(memory)):
        s = _along(memory, i, error) / memory.squares[i]
        for j in range(k):
            y[j] += s * (memory.right[i, j] if p <= k else memory.left[i, j])


@compiled
def _corrected(memory: DirectionsMemory) -> int:
    """Return the number of singular directions in which errors are corrected with the loops."""
    if memory.aims != 0:
        return memory.refined_rank
    return min(memory.task_rank, memory.active_rows, memory.mobility)


@compiled
def find_corrected(memory: DirectionsMemory) -> None:
    """Let errors be corrected with the loops in all singular directions that are not damped."""
    rank, least = 0, memory.damping_threshold * memory.damping_threshold
    if memory.found_by != BASIS:
        for i in range(min(memory.task_rank, memory.active_rows, memory.mobility)):
            if unweighted(memory, i) >= least:
                rank += 1
    memory.refined_rank = rank


@compiled
def _along(memory: DirectionsMemory, i: int, error: Array) -> float:
    """Return the component of an error (rows,) along the i-th left singular vector; times its singular value if there
    are more rows than columns."""
    s = 0.0
    for j in range(memory.active_rows):
        s += (memory.left[i, j] if memory.active_rows <= memory.mobility else memory.right[i, j]) * error[j]
    return s


@compiled
def reach_of(memory: DirectionsMemory, error: Array) -> float:
    """Return the largest component of an error (rows,) that motions in the null space can correct."""
    p, k, largest = memory.active_rows, memory.mobility, 0.0
    if memory.found_by == BASIS:
        for j in range(p):
            largest = max(largest, abs(error[j]))
        return largest
    for i in range(_corrected(memory)):
        s = abs(_along(memory, i, error))
        largest = max(largest, s if p <= k else s / math.sqrt(memory.squares[i]))
    return largest


@compiled
def solve_damped(memory: DirectionsMemory) -> None:
    """Set `free_step` to the minimiser of |A y - wanted|^2 + damping, without bounds."""
    p, k, y = memory.active_rows, memory.mobility, memory.free_step
    error = size_of(memory.wanted, memory.row_weights, p)
    y[:k] = 0.0
    for i in range(min(p, k)):
        square = memory.squares[i]
        h = square + damping(square, memory.emphasis[i], error, memory.damping_threshold)
        h = h if i < memory.task_rank else RESTING
        s = _along(memory, i, memory.wanted) / h  # of s_i w_i where rows, of w_i else
        for j in range(k):
            y[j] += s * (memory.right[i, j] if p <= k else memory.left[i, j])


@compiled
def _norm(x: Array, size: int) -> float:
    """Return |x|, of the first `size` components."""
    return math.sqrt(inner(x, x, size))


@compiled
def find_axes(memory: DirectionsMemory) -> int:
    """Set `axes` to all right singular vectors w_i, and `size` to the roots of s_i^2 + damping_i.

    Returns:
        the index of the first that no task uses.
    """
    if memory.found_by != SVD:
        find_singular_values(memory)
    p, k, rank, axes = memory.active_rows, memory.mobility, min(memory.task_rank, memory.lesser), memory.axes
    rank = min(rank, p)
    error, threshold = size_of(memory.wanted, memory.row_weights, p), memory.damping_threshold
    if p > k:
        for i in range(k):
            copy(memory.left[i], axes[i], k)
            square = memory.squares[i]
            square += damping(square, memory.emphasis[i], error, threshold)
            memory.size[i] = math.sqrt(square if i < rank else RESTING)
        return rank
    known, f = 0, memory.active_normals[0]
    for i in range(rank):
        square = memory.squares[i]
        if square > _LOST * _LOST * memory.squares[0]:
            s = 1.0 / math.sqrt(square)
            for j in range(k):
                axes[i, j] = s * memory.right[i, j]
                f[i, j] = axes[i, j]
            memory.size[i] = math.sqrt(square + damping(square, memory.emphasis[i], error, threshold))
            known += 1
    if known < k:  # the factors of the loops are needed later
        tau, reflectors = memory.active[1], memory.active_normals[1]
        factor(f[:known], known, memory.axis_order, memory.active[0], tau, reflectors)
        null_space(known, tau, reflectors, axes[known:])
    for i in range(known, k):
        memory.size[i] = math.sqrt(damping(0.0, 1.0, error, threshold) if i < rank else RESTING)
    return known


@compiled
def _leave_tasks_alone(memory: DirectionsMemory, y: Array) -> None:
    """Remove from y (mobility,), in the orthonormal basis, all motion of the tasks; `axes` is used."""
    p, k, rows, known = memory.active_rows, memory.mobility, memory.axes, 0
    for i in range(min(memory.task_rank, p, k)):
        if is_lost(memory, i):
            continue
        row = rows[known]
        for j in range(k):
            row[j] = direction(memory, i, j)
        _to_orthonormal(memory, row)
        for c in range(known):
            add_multiple(-inner(rows[c], row, k), rows[c], row, k)
        s = 1.0 / _norm(row, k)
        for j in range(k):
            row[j] *= s
        add_multiple(-inner(row, y, k), row, y, k)
        known += 1


@compiled
def is_lost(memory: DirectionsMemory, i: int) -> bool:
    """Return whether the i-th direction of the tasks is undetermined: its singular value is nothing but rounding."""
    is_wide = memory.active_rows <= memory.mobility
    return bool(memory.found_by == SVD and is_wide and memory.squares[i] <= _LOST * _LOST * memory.squares[0])


@compiled
def direction(memory: DirectionsMemory, i: int, j: int) -> float:
    """Return a component of the i-th direction of those that span the tasks."""
    if memory.found_by != SVD:
        return float(memory.reduced[i, j])
    return float(memory.right[i, j] if memory.active_rows <= memory.mobility else memory.left[i, j])


@compiled
def predict_gain(memory: AttemptMemory) -> None:
    """Set `promised`, the reduction of the cost of the tasks that `attempted` predicts to first order."""
    total = 0.0
    for i in range(memory.active_rows):
        total += memory.wanted[i] * inner(memory.task_jacobian[i], memory.attempted, memory.n)
    memory.promised = total / memory.gain
