"""Residual of all loops and couplings, and its exact derivative, closed or open: `raff2urdf.residual` and
`raff2urdf.coupling`, compiled; dimensionless."""

from __future__ import annotations

from cinegen.jit import se3
from cinegen.jit.compiled import compiled
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
    ends, w, c, length = memory.ends, memory.vectors, memory.residual, memory.length
    first, second, d, seen, by, turned = ends[0], ends[1], w[0], w[1:4], w[4:7], w[7]
    for side in range(2):
        compose(memory.frames[memory.loop_joints[loop, side]], memory.loop_offsets[loop, side], ends[side])
    for i in range(3):
        d[i] = second[3, i] - first[3, i]
    kind, row = memory.loop_kind[loop], memory.loop_row[loop]
    linear = 2 if kind == PRISMATIC else 3
    for i in range(linear):
        c[row + i] = dot(first[i], d) / length
    angular = 0
    if kind == REVOLUTE:
        angular = 2
        se3.swing(dot(first[0], second[2]), dot(first[1], second[2]), dot(first[2], second[2]), turned, by)
    elif kind != BALL:
        angular = 3
        se3.relative(first, second, seen)
        se3.log(seen, turned)
    for i in range(angular):
        c[row + linear + i] = turned[i]
    if not with_jacobian:
        return
    if angular == 3:
        se3.log_derivative(turned, by)
    for i in range(angular):
        combine(by[i], first, seen[i])
    p, jacobian, screws, rates, cut = (
        second[3], memory.jacobian, memory.screws, memory.cut_rates, memory.loop_cut[loop]
    )  # fmt: skip
    for step in range(memory.loop_steps[loop, 0], memory.loop_steps[loop, 1]):
        k, s = memory.step_dof[step], memory.step_size[step]
        velocity, omega = screws[k], screws[k, 3:6]
        x = velocity[0] + omega[1] * p[2] - omega[2] * p[1]  # of the second end's origin
        y = velocity[1] + omega[2] * p[0] - omega[0] * p[2]
        z = velocity[2] + omega[0] * p[1] - omega[1] * p[0]
        for i in range(linear):
            jacobian[row + i, k] = s / length * (first[i, 0] * x + first[i, 1] * y + first[i, 2] * z)
        for i in range(angular):
            jacobian[row + linear + i, k] = s * dot(seen[i], omega)
        if kind == REVOLUTE:
            rates[k, cut] = s * dot(first[2], omega)
        elif kind == PRISMATIC:
            rates[k, cut] = s / length * (first[2, 0] * x + first[2, 1] * y + first[2, 2] * z)
        elif kind == BALL:
            for i in range(3):
                rates[k, cut + i] = s * omega[i]


@compiled
def _evaluate_couplings(memory: LoopMemory, with_jacobian: bool) -> None:
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
