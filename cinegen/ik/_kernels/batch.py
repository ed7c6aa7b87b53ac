"""Evaluate a node at many configurations: close each with the actuated joints locked, and compute its results."""

from __future__ import annotations

import math

from cinegen.ik._kernels.memory import BatchMemory
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.factor import eliminate
from cinegen.jit.se3 import compose, cross, dot
from cinegen.jit.smallest import smallest_singular_value
from cinegen.jit.svd import COLD_SWEEPS, orthogonalise
from cinegen.jit.vectors import add_multiple, copy, inner, swap
from cinegen.loops._kernels.ball_joints import count_balls
from cinegen.loops._kernels.closure import factor_loops, find_null_space, from_motions
from cinegen.loops._kernels.follow import go_on, set_out
from cinegen.loops._kernels.kinematics import evaluate
from cinegen.loops._kernels.memory import NOWHERE, cluster_at
from cinegen.loops._kernels.residual import evaluate_loops
from cinegen.loops._kernels.screws import find_screws


@entry
def measure_all(memory: BatchMemory) -> None:
    """Evaluate all configurations: the given ones as they are, or from q, closed, those to which the values of the
    actuated joints lead. Results of configurations that can't be closed are not written."""
    memory.evaluations = 0
    if memory.is_given != 0:
        for i in range(memory.count):
            copy(memory.configurations[i], memory.q, memory.nq)
            evaluate(memory, memory.q)
            memory.closure = evaluate_loops(memory, False) if memory.rows > 0 else 0.0
            _measure(memory, i)
        return
    memory.factored_at, memory.alike = NOWHERE, 0
    is_begun = False
    for i in range(memory.count):
        if not is_begun:
            _begin(memory, i)
        is_begun = False
        if go_on(memory):
            if i + 1 < memory.count:
                is_begun = True
                _begin(memory, i + 1)  # before the factors of the loops are overwritten
            _measure(memory, i)
        else:  # back to where the path to it began
            copy(memory.anchor, memory.q, memory.nq)
        memory.factored_at = NOWHERE


@compiled
def _begin(memory: BatchMemory, i: int) -> None:
    """Begin the path to the next configuration."""
    copy(memory.q, memory.anchor, memory.nq)
    copy(memory.values[i], memory.goal, memory.actuated)
    set_out(memory)


# --- results --------------------------------------------------------------------------------------------------------


@compiled
def _measure(memory: BatchMemory, i: int) -> None:
    """Write placement, Jacobian, singular values and closure at q, where frames are evaluated."""
    _find_node(memory)
    copy(memory.q, memory.result_q[i], memory.nq)
    memory.closures[i] = memory.closure
    if memory.is_whole != 0:
        for c in range(4):
            for a in range(3):
                memory.placements[i, a, c] = memory.node[c, a]
            memory.placements[i, 3, c] = 1.0 if c == 3 else 0.0
    rows, width = memory.node_rows, memory.n
    if memory.rows > 0:
        right = _find_null_space(memory)
        rows, width = memory.free_rows, memory.mobility
        for a in range(6):
            for b in range(width):
                rows[a, b] = inner(memory.node_rows[a], memory.null_space[b], memory.n)
        if memory.passive > 0:
            memory.passive_sigma[i] = _find_passive_sigma(memory) if right else math.nan
    if memory.is_whole != 0:
        _find_jacobian(memory, memory.jacobians[i])
    _find_singular_values(memory, rows, width, memory.singular_values[i])


@compiled
def _find_node(memory: BatchMemory) -> None:
    """Compute the node's frame, and its Jacobian in its own axes (6, n), dimensionless."""
    node, rows, screws = memory.node, memory.node_rows, memory.screws
    compose(memory.frames[memory.joint], memory.node_offset, node)
    velocity = memory.vectors[0]
    for j in range(memory.n):
        s = memory.scale[j] if memory.moved_by[j] != 0.0 else 0.0
        omega = screws[j, 3:6]
        cross(omega, node[3], velocity)
        for i in range(3):
            velocity[i] += screws[j, i]
        for i in range(3):
            rows[i, j] = s / memory.length * dot(node[i], velocity)
            rows[3 + i, j] = s * dot(node[i], omega)


@compiled
def _find_null_space(memory: BatchMemory) -> bool:
    """Compute the null space (mobility, n) of the loops; return as `count_balls`."""
    memory.locked[: memory.n] = 0.0
    evaluate_loops(memory, True)
    if memory.passive > 0:
        find_screws(memory)
    right = count_balls(memory, memory.node_rows)
    factor_loops(memory, False)
    find_null_space(memory)
    at = 0
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        unit = memory.correction[: cluster.mobility]
        for i in range(cluster.mobility):
            unit[:] = 0.0
            unit[i] = 1.0
            from_motions(cluster, unit, memory.null_space[at + i])
        at += cluster.mobility
    for i in range(memory.idle):
        memory.null_space[at + i, memory.idle_dof[i]] = 1.0
    for a in range(memory.actuated):
        memory.locked[memory.actuated_dof[a]] = 1.0
    return right


@compiled
def _find_passive_sigma(memory: BatchMemory) -> float:
    """Return the smallest singular value of the passive joints' columns in the screw matrix, which is up to date."""
    a = memory.passive_columns
    for j in range(memory.passive):
        for i in range(memory.screw_rows):
            a[i, j] = memory.screw_matrix[i, memory.passive_column[j]]
    return smallest_singular_value(a, memory.screw_rows, memory.passive, memory.passive_work[0], memory.passive_work[1])


@compiled
def _find_jacobian(memory: BatchMemory, jacobian: Array) -> None:
    """Write (6, actuated) the node's velocity in its own axes, m/s and rad/s, by the actuated joints' velocities.

    With loops, motions N y move the node by V y (`free_rows`) and the actuated joints by N_a y, so the Jacobian J is
    V N_a^-1: N_a^T J^T = V^T is solved. NaN if N_a is not square: then the actuated joints do not determine the motion.
    """
    k, count, a, dof = memory.mobility, memory.actuated, memory.system, memory.actuated_dof
    if memory.rows > 0 and count == k:
        for i in range(k):
            for c in range(k):
                a[i, c] = memory.null_space[i, dof[c]]
            for c in range(6):
                a[i, k + c] = memory.free_rows[c, i]
        eliminate(a, k, k + 6)
        for c in range(6):
            for i in range(k - 1, -1, -1):
                for other in range(i + 1, k):
                    a[i, k + c] -= a[i, other] * a[other, k + c]
                a[i, k + c] /= a[i, i]
    for c in range(count):
        for i in range(6):
            unit = (memory.length if i < 3 else 1.0) / memory.scale[dof[c]]
            if memory.rows == 0:
                jacobian[i, c] = unit * memory.node_rows[i, dof[c]]
            else:
                jacobian[i, c] = unit * a[c, k + i] if count == k else math.nan


@compiled
def _find_singular_values(memory: BatchMemory, rows: Array, width: int, out: Array) -> None:
    """Write the singular values of the selected rows (6, width), largest first; or only the smallest, as the last.

    A pivoted factorisation B = L Q precedes, since Jacobi rotations converge faster on L^T (Z. Drmac and K. Veselic,
    "New fast and accurate Jacobi SVD algorithm", 2008).
    """
    size = memory.translation + memory.rotation
    free = 0  # columns that count
    for j in range(width):
        if memory.rows > 0 or memory.moved_by[j] != 0.0:
            free += 1
    n, wide = min(size, free), max(size, free)
    if n == 0:
        return
    _select(memory, rows, width, size, size <= free)
    last = out.shape[0] - 1
    if memory.is_whole == 0:
        x, y = memory.squares[0], memory.squares[1]
        out[last] = smallest_singular_value(memory.tall_rows, wide, n, x, y) if n == last + 1 else 0.0
        return
    flat, low, square = memory.wide_rows, memory.triangle, memory.squares[0]
    _factor(flat, low, n, wide)
    orthogonalise(low, flat, n, n, 0, square, COLD_SWEEPS)
    for i in range(n):  # sorted
        j = i
        value = math.sqrt(square[i])
        while j > 0 and out[j - 1] < value:
            out[j] = out[j - 1]
            j -= 1
        out[j] = value
    out[n : last + 1] = 0.0


@compiled
def _select(memory: BatchMemory, rows: Array, width: int, size: int, is_wide: bool) -> None:
    """Write the rows of the translations and rotations that count, without columns of joints that do not move the node,
    to where their singular values are computed: `wide_rows`, for all of them; or `tall_rows`, for the smallest only.

    Args:
        memory: with `translation` and `rotation`, the numbers of components that count: the first translations; the
            rotations about x and y (which tilt the z axis), about z if there is one, or all.
        rows: (6, width) the node's motions in its own axes: by joints, or with loops by motions that keep them closed.
        width: number of columns.
        size: number of rows that count.
        is_wide: whether the result has no more rows than columns; it is transposed where the other is wanted.
    """
    out = memory.wide_rows if memory.is_whole != 0 else memory.tall_rows
    is_transposed = is_wide != (memory.is_whole != 0)
    first_rotation = 5 if memory.rotation == 1 else 3
    k = 0
    for j in range(width):
        if memory.rows > 0 or memory.moved_by[j] != 0.0:
            for i in range(size):
                value = rows[i if i < memory.translation else first_rotation + i - memory.translation, j]
                if is_transposed:
                    out[k, i] = value
                else:
                    out[i, k] = value
            k += 1


@compiled
def _factor(b: Array, upper: Array, n: int, width: int) -> None:
    """Factor b (n, width) = L Q with pivoted rows, by Gram-Schmidt; `upper` becomes L^T. b is overwritten."""
    for i in range(n):
        upper[i, :n] = 0.0
    for i in range(n):
        best, longest = i, -1.0
        for other in range(i, n):
            s = inner(b[other], b[other], width)
            if s > longest:
                best, longest = other, s
        if not longest > 0.0:
            return
        if best != i:
            swap(b[i], b[best], width)
            for k in range(i):
                upper[k, i], upper[k, best] = upper[k, best], upper[k, i]
        upper[i, i] = math.sqrt(longest)
        s = 1.0 / upper[i, i]
        for k in range(width):
            b[i, k] *= s
        for other in range(i + 1, n):
            upper[i, other] = inner(b[i], b[other], width)
            add_multiple(-upper[i, other], b[i], b[other], width)
