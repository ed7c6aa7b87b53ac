"""Residual of all loops and couplings, and its exact derivative, closed or open: `raff2urdf.residual` and
`raff2urdf.coupling`, compiled; dimensionless."""

from __future__ import annotations

from cinegen.jit import se3
from cinegen.jit.compiled import Array, compiled, inlined
from cinegen.jit.se3 import combine, compose, dot
from cinegen.loops._kernels.memory import LoopMemory

RIGID, PRISMATIC, REVOLUTE, BALL = range(4)
"""Kinds of loops."""


@compiled
def evaluate_loops(memory: LoopMemory, with_jacobian: bool) -> float:
    """Compute `residual`, and `jacobian` and `cut_rates` if requested, from the joints' frames; return the largest
    residual.

    Entries of DoF that do not change an equation are never written: they remain zero.
    """
    for i in range(memory.loops):
        _evaluate_loop(memory, i, with_jacobian)
    if memory.couplings > 0:
        _evaluate_couplings(memory, with_jacobian)
    largest = 0.0
    for i in range(memory.rows):
        if not abs(memory.residual[i]) <= largest:  # NaN counts as large
            largest = abs(memory.residual[i])
    return largest


@compiled
def _evaluate_loop(memory: LoopMemory, loop: int, with_jacobian: bool) -> None:
    """Compute the residual of a loop from the frames of its ends, and its rows if requested."""
    for side in range(2):
        compose(memory.frames[memory.loop_joints[loop, side]], memory.loop_offsets[loop, side], memory.ends[side])
    kind = memory.loop_kind[loop]
    linear = 2 if kind == PRISMATIC else 3
    angular = 2 if kind == REVOLUTE else 0 if kind == BALL else 3
    _find_gap(memory, linear, angular, memory.residual[memory.loop_row[loop] :])
    if with_jacobian:
        _find_rows(memory, loop, linear, angular)


# --- one loop -------------------------------------------------------------------------------------------------------
# Its ends are frames (R1, p1) and (R2, p2). Vectors 4 to 6 are the derivative of the rotation between them, 7 the
# rotation vector: rows use them.


@inlined
def _find_gap(memory: LoopMemory, linear: int, angular: int, gap: Array) -> None:
    """gap = [R1^T (p2 - p1) / length; log(R1^T R2)]; where `angular` is 2, the swing between the axes z instead of the
    logarithm."""
    first, second, w = memory.ends[0], memory.ends[1], memory.vectors
    d, seen, by, turned = w[0], w[1:4], w[4:7], w[7]
    for i in range(3):
        d[i] = second[3, i] - first[3, i]
    for i in range(linear):
        gap[i] = dot(first[i], d) / memory.length
    if angular == 2:
        se3.swing(dot(first[0], second[2]), dot(first[1], second[2]), dot(first[2], second[2]), turned, by)
    elif angular == 3:
        se3.relative(first, second, seen)
        se3.log(seen, turned)
    for i in range(angular):
        gap[linear + i] = turned[i]


@inlined
def _find_rows(memory: LoopMemory, loop: int, linear: int, angular: int) -> None:
    """Write the rows of a loop: for a DoF whose screw moves p2 by v and turns it by omega, R1^T v / length above
    B R1^T omega, where B is the derivative of the rotation; and the velocity of the joint that was cut."""
    first, p, w, row, length = memory.ends[0], memory.ends[1, 3], memory.vectors, memory.loop_row[loop], memory.length
    seen, by, turned, jacobian, screws = w[1:4], w[4:7], w[7], memory.jacobian, memory.screws
    if angular == 3:
        se3.log_derivative(turned, by)
    for i in range(angular):
        combine(by[i], first, seen[i])
    for step in range(memory.loop_steps[loop, 0], memory.loop_steps[loop, 1]):
        k, s = memory.step_dof[step], memory.step_size[step]
        x, y, z = se3.velocity_at(screws[k], p)
        for i in range(linear):
            jacobian[row + i, k] = s / length * (first[i, 0] * x + first[i, 1] * y + first[i, 2] * z)
        for i in range(angular):
            jacobian[row + linear + i, k] = s * dot(seen[i], screws[k, 3:6])
        _find_cut_rate(memory, loop, step, x, y, z)


@inlined
def _find_cut_rate(memory: LoopMemory, loop: int, step: int, x: float, y: float, z: float) -> None:
    """Write the velocity of the joint that was cut, by a DoF that moves p2 by (x, y, z): along or about its axis z, or
    of a ball the angular velocity."""
    kind, k, s, axis = memory.loop_kind[loop], memory.step_dof[step], memory.step_size[step], memory.ends[0, 2]
    rates, cut, omega = memory.cut_rates, memory.loop_cut[loop], memory.screws[k, 3:6]
    if kind == REVOLUTE:
        rates[k, cut] = s * dot(axis, omega)
    elif kind == PRISMATIC:
        rates[k, cut] = s / memory.length * (axis[0] * x + axis[1] * y + axis[2] * z)
    elif kind == BALL:
        for i in range(3):
            rates[k, cut + i] = s * omega[i]


@compiled
def _evaluate_couplings(memory: LoopMemory, with_jacobian: bool) -> None:
    """Couplings: residual = sum of polynomials p_k(q_k) - constant, row = p_k'(q_k) scale_k."""
    first, jacobian, degree = memory.rows - memory.couplings, memory.jacobian, memory.coupling_degree
    for i in range(memory.couplings):
        memory.residual[first + i] = -memory.coupling_constant[i]
    for t in range(memory.coupling_terms):
        row, k, coefficients = first + memory.term_coupling[t], memory.term_dof[t], memory.term_coefficients[t]
        q, value, slope = memory.coupled_q[memory.q_index[k]], 0.0, 0.0
        for power in range(degree - 1, -1, -1):  # Horner's scheme
            slope = slope * q + value + coefficients[power]
            value = (value + coefficients[power]) * q
        memory.residual[row] += value
        if with_jacobian:
            jacobian[row, k] = slope * memory.scale[k]
