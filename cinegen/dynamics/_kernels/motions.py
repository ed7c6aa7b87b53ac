"""Motions of the closed mechanism, from those of the actuated joints: its velocities, and accelerations."""

from __future__ import annotations

from cinegen.dynamics._kernels.memory import DynamicsMemory
from cinegen.jit.compiled import Array, compiled
from cinegen.jit.factor import factor
from cinegen.jit.se3 import combine, compose, cross, dot
from cinegen.jit.vectors import add_multiple, copy, inner
from cinegen.loops._kernels.closure import find_null_space, from_motions, loop_correction
from cinegen.loops._kernels.kinematics import FREE_FLYER, SPHERICAL
from cinegen.loops._kernels.memory import cluster_at
from cinegen.loops._kernels.residual import BALL, PRISMATIC, REVOLUTE

CLEAR = 1e-4  # a smaller pivot, as a fraction of the first, or singular value of the loops may be none
_LEAST = 1e-300  # divisor


@compiled
def factor_actuated(memory: DynamicsMemory) -> bool:
    """Compute the null space of the loops, and factor the motions of the actuated joints in it; return whether these
    clearly determine the motion."""
    at = 0
    if memory.rows > 0:
        find_null_space(memory)
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
    if memory.actuated < memory.mobility:
        return False
    for i in range(memory.mobility):
        for k in range(memory.actuated):
            dof = memory.actuated_dof[k]
            memory.factors[i, k] = memory.null_space[i, dof] * memory.scale[dof] / memory.step[k]
    shortest = factor(memory.factors, memory.mobility, memory.order, memory.left, memory.tau_of, memory.reflectors)
    return shortest >= CLEAR


@compiled
def complete(memory: DynamicsMemory, v: Array) -> float:
    """Set v (n,), of which only the actuated joints' velocities are given, to the motion of the closed mechanism.

    With a basis N of the motions that keep the loops closed, and S, which picks the actuated joints, all dimensionless,
    (S N) y = S v determines v = N y. By the factors S N P = H [L^T; 0] of `factor_actuated` (P permutes columns, H is
    orthogonal), L^T P^T y is the beginning of H^T S v; the remainder of it is 0 unless the joints contradict each
    other.

    Args:
        memory: with these factors.
        v: rad/s and m/s; or accelerations, rad/s^2 and m/s^2.

    Returns:
        by how much the actuated joints' velocities contradict each other, as a fraction of the fastest one's.
    """
    rates, y, rank = memory.effort, memory.coordinates, memory.mobility
    largest = 0.0
    for k in range(memory.actuated):
        rates[k] = v[memory.actuated_dof[k]] / memory.step[k]
        largest = max(largest, abs(rates[k]))
    for t in range(rank):
        h, width = memory.reflectors[t, t:], memory.actuated - t
        add_multiple(-memory.tau_of[t] * inner(h, rates[t:], width), h, rates[t:], width)
    contradiction = 0.0
    for k in range(rank, memory.actuated):
        contradiction = max(contradiction, abs(rates[k]))
    for t in range(rank - 1, -1, -1):
        s = rates[t]
        for j in range(t + 1, rank):
            s -= memory.factors[j, t] * rates[j]
        rates[t] = s / memory.factors[t, t]
        y[memory.order[t]] = rates[t]
    for k in range(memory.n):
        v[k] = 0.0
    for m in range(rank):
        add_multiple(y[m], memory.null_space[m], v, memory.n)
    for k in range(memory.n):
        v[k] *= memory.scale[k]
    return contradiction / max(largest, _LEAST)


@compiled
def complete_acceleration(memory: DynamicsMemory) -> float:
    """Set `a`, of which only the actuated joints' accelerations are given, to that of the closed mechanism; return as
    `complete`."""
    particular, a = memory.delta, memory.a
    loop_correction(memory, False, particular)  # the residual is the loops' drift
    for k in range(memory.n):
        a[k] -= particular[k] * memory.scale[k]
    gap = complete(memory, a)
    for k in range(memory.n):
        a[k] += particular[k] * memory.scale[k]
    return gap


@compiled
def loop_opening(memory: DynamicsMemory, v: Array) -> float:
    """Return the largest velocity with which v (n,) opens a loop, as a fraction of the largest joint velocity;
    dimensionless."""
    largest, opening = 0.0, 0.0
    for k in range(memory.n):
        memory.delta[k] = v[k] / memory.scale[k]
        largest = max(largest, abs(memory.delta[k]))
    for i in range(memory.rows):
        opening = max(opening, abs(inner(memory.jacobian[i], memory.delta, memory.n)))
    return opening / max(largest, _LEAST)


@compiled
def find_drift(memory: DynamicsMemory) -> None:
    """Set `residual` to (dJ/dt) v, the accelerations with which the loops open if no joint accelerates; dimensionless.

    On the closed set the rows of a loop are its first end's axes. With the twists V_1, V_2 of its ends and their rates
    A_1, A_2, all at the world's origin, the twist of the second end relative to the first, seen from the first, changes
    by A_2 - A_1 - V_1 x (V_2 - V_1).
    """
    end, w, residual, first = memory.ends[0], memory.vectors, memory.residual, memory.rows - memory.couplings
    find_accelerations(memory, False)
    for loop in range(memory.loops):
        j1, j2 = memory.loop_joints[loop, 0], memory.loop_joints[loop, 1]
        compose(memory.frames[j2], memory.loop_offsets[loop, 1], end)
        copy(end[3], w[4], 3)
        compose(memory.frames[j1], memory.loop_offsets[loop, 0], end)
        v, v2, a, a2 = memory.velocity[j1], memory.velocity[j2], memory.acceleration[j1], memory.acceleration[j2]
        for i in range(3):
            w[0, i], w[1, i] = v2[i] - v[i], v2[3 + i] - v[3 + i]
        _cross_twists(v, w[0], w[1], w[2], w[3], w[5])
        for i in range(3):
            w[2, i], w[3, i] = a2[i] - a[i] - w[2, i], a2[3 + i] - a[3 + i] - w[3, i]
        cross(w[3], w[4], w[5])
        for i in range(3):
            w[2, i] += w[5, i]
        kind, row = memory.loop_kind[loop], memory.loop_row[loop]
        linear = 2 if kind == PRISMATIC else 3
        angular = 0 if kind == BALL else 2 if kind == REVOLUTE else 3
        for i in range(linear):
            residual[row + i] = dot(end[i], w[2]) / memory.length
        for i in range(angular):
            residual[row + linear + i] = dot(end[i], w[3])
    for i in range(memory.couplings):
        residual[first + i] = 0.0
    for t in range(memory.coupling_terms):
        k, bend = memory.term_dof[t], 0.0
        q = memory.coupled_q[memory.q_index[k]]
        for power in range(memory.coupling_degree - 1, 0, -1):  # of p''(q), by Horner's scheme
            bend = bend * q + (power + 1) * power * memory.term_coefficients[t, power]
        residual[first + memory.term_coupling[t]] += bend * memory.v[k] * memory.v[k]


@compiled
def drift_contradiction(memory: DynamicsMemory) -> float:
    """Return the largest acceleration with which `a` opens a loop, |J a + (dJ/dt) v|, as a fraction of the largest
    component of a or of the drift (dJ/dt) v, which `find_drift` has left in `residual`; all are dimensionless."""
    largest, opening = 0.0, 0.0
    for k in range(memory.n):
        memory.delta[k] = memory.a[k] / memory.scale[k]
        largest = max(largest, abs(memory.delta[k]))
    for i in range(memory.rows):
        largest = max(largest, abs(memory.residual[i]))
        opening = max(opening, abs(memory.residual[i] + inner(memory.jacobian[i], memory.delta, memory.n)))
    return opening / max(largest, _LEAST)


@compiled
def _cross_twists(v: Array, linear: Array, angular: Array, out: Array, out_angular: Array, scratch: Array) -> None:
    """Write the rate of a twist that moves with a body of twist v (6,): v x (linear, angular)."""
    cross(v[3:], angular, out_angular)
    cross(v[3:], linear, out)
    cross(v, angular, scratch)
    for i in range(3):
        out[i] += scratch[i]


@compiled
def _from_base(memory: DynamicsMemory, twist: Array, out: Array) -> None:
    """Write a twist (6,) at the world's origin, given in the axes of the joint 1, the base, at its origin."""
    frame, w = memory.frames[1], memory.vectors
    combine(twist[3:], frame, w[0])
    combine(twist, frame, w[1])
    cross(frame[3], w[0], w[2])
    for i in range(3):
        out[i], out[3 + i] = w[1, i] + w[2, i], w[0, i]


@compiled
def find_velocities(memory: DynamicsMemory) -> None:
    """Compute the twists of all bodies, and what they add to accelerations, from `v`."""
    for j in range(1, memory.joints):
        relative, twist, bias, parent = memory.relative[j], memory.velocity[j], memory.bias[j], memory.joint_parent[j]
        dof = memory.joint_dof[j]
        if dof < 0:
            _from_base(memory, memory.given_v[memory.now], relative)
        else:
            sum_screws(memory, j, memory.v, relative)
        for i in range(6):
            twist[i] = memory.velocity[parent, i] + relative[i]
        _cross_twists(twist, relative, relative[3:], bias, bias[3:], memory.vectors[0])


@compiled
def columns_of(kind: int) -> int:
    """Return the DoF of a joint."""
    return 6 if kind == FREE_FLYER else 3 if kind == SPHERICAL else 1


@compiled
def sum_screws(memory: DynamicsMemory, j: int, rates: Array, out: Array) -> None:
    """Write the twist (6,) of a joint alone, by its rates in (n,)."""
    dof = memory.joint_dof[j]
    for i in range(6):
        out[i] = rates[dof] * memory.screws[dof, i]
    for k in range(1, columns_of(memory.joint_kind[j])):
        for i in range(6):
            out[i] += rates[dof + k] * memory.screws[dof + k, i]


@compiled
def find_accelerations(memory: DynamicsMemory, with_joints: bool) -> None:
    """Compute the rates of all twists, with the joints' accelerations `a` or without them."""
    for j in range(1, memory.joints):
        rate, parent = memory.acceleration[j], memory.joint_parent[j]
        if memory.joint_dof[j] < 0:
            _from_base(memory, memory.given_a[memory.now], rate)
        elif with_joints:
            sum_screws(memory, j, memory.a, rate)
        else:
            for i in range(6):
                rate[i] = 0.0
        for i in range(6):
            rate[i] += memory.acceleration[parent, i] + memory.bias[j, i]
