"""Torques of the actuated joints, at one configuration after the other.

The recursive Newton-Euler algorithm (R. Featherstone, "Rigid body dynamics algorithms", 2008, section 5.3), in the
world's axes at its origin, gives the torques tau that the tree would need in all joints. With a basis N of the motions
that keep the loops closed, those of the actuated joints do the same work on each: (S N)^T tau_a = N^T tau, where S
picks the actuated joints. Of several solutions the shortest is taken.
"""

from __future__ import annotations

from cinegen.dynamics._kernels.memory import DynamicsMemory
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.factor import factor, shortest_solution
from cinegen.jit.se3 import combine, compose, cross, dot
from cinegen.jit.vectors import add_multiple, copy, inner
from cinegen.loops._kernels.closure import factor_loops, find_null_space, from_motions, loop_correction
from cinegen.loops._kernels.kinematics import FREE_FLYER, SPHERICAL, evaluate
from cinegen.loops._kernels.memory import cluster_at
from cinegen.loops._kernels.residual import BALL, PRISMATIC, REVOLUTE, evaluate_loops
from cinegen.loops.thresholds import CLOSURE

HELD, OPEN, UNCLEAR = range(3)
"""Results: torques were found; loops are open; near a singularity, or actuated joints don't control everything, which
the plain form decides."""

CLEAR = 1e-4  # a smaller pivot, as a fraction of the first, or singular value of the loops may be none
RESTING = 1e-9
"""A joint whose speed is below this part of the fastest one's, dimensionless, is at rest: in a closed mechanism, speeds
that should be 0 are rounding errors. Its Coulomb friction is undetermined, and left out."""

_LEAST = 1e-300  # divisor


@entry
def find_torques(memory: DynamicsMemory) -> None:
    """Find the torques at all given configurations; results where `found` is not HELD are not written."""
    if memory.moves == 0:
        memory.velocity[:] = 0.0
        memory.acceleration[:] = 0.0
    for i in range(memory.count):
        memory.now = i
        memory.found[i] = _find(memory, i)


@compiled
def _find(memory: DynamicsMemory, i: int) -> int:
    n, actuated = memory.n, memory.actuated
    copy(memory.given_q[i], memory.q, memory.nq)
    evaluate(memory, memory.q)
    is_direct = memory.rows == 0 and actuated == n
    gaps = memory.gaps[i]
    gaps[0], gaps[1], gaps[2] = 0.0, 0.0, 0.0
    if memory.rows > 0:
        gaps[0] = evaluate_loops(memory, True)
        if not gaps[0] <= CLOSURE:
            return OPEN
        factor_loops(memory, False)
        if memory.sigma < CLEAR:
            return UNCLEAR
    if not is_direct and not factor_actuated(memory):
        return UNCLEAR
    if memory.moves != 0:
        copy(memory.given_v[i, memory.fixed :], memory.v, n)
        copy(memory.given_a[i, memory.fixed :], memory.a, n)
        if memory.completes != 0 and not is_direct:
            gaps[1] = complete(memory, memory.v)
        elif memory.rows > 0:
            gaps[1] = _opening(memory, memory.v)
        _find_velocities(memory)
        if memory.rows > 0:
            _find_drift(memory)
        if memory.completes != 0 and not is_direct:
            gaps[2] = _complete_acceleration(memory)
        elif memory.rows > 0:
            gaps[2] = _contradiction(memory)
    if memory.moves != 0:
        _find_accelerations(memory, True)
    _find_tau(memory)
    if memory.moves != 0:
        _add_joints(memory)
    if is_direct:
        for k in range(actuated):
            memory.torques[i, k] = memory.tau[memory.actuated_dof[k]]
        return _find_reaction(memory, i)
    for m in range(memory.mobility):
        s, motion = 0.0, memory.null_space[m]
        for k in range(n):
            s += motion[k] * memory.scale[k] * memory.tau[k]
        memory.coordinates[m] = s
    shortest_solution(
        memory.factors, memory.mobility, memory.order, memory.tau_of, memory.reflectors, memory.coordinates,
        memory.effort,
    )  # fmt: skip
    for k in range(actuated):
        memory.torques[i, k] = memory.effort[k] / memory.step[k]
    return _find_reaction(memory, i)


@compiled
def _add_joints(memory: DynamicsMemory) -> None:
    """Add what the joints' rotors and friction need."""
    fastest = 0.0
    for k in range(memory.n):
        fastest = max(fastest, abs(memory.v[k]) / memory.scale[k])
    for k in range(memory.n):
        memory.tau[k] += memory.armature[k] * memory.a[k] + memory.damping[k] * memory.v[k]
        if abs(memory.v[k]) / memory.scale[k] > RESTING * fastest:
            memory.tau[k] += memory.friction[k] if memory.v[k] > 0.0 else -memory.friction[k]


# --- the reaction of one joint or loop --------------------------------------------------------------------------------


@compiled
def _find_reaction(memory: DynamicsMemory, i: int) -> int:
    """Write the reaction that is asked for, if one is; components that statics does not determine have any value."""
    joint, asked, w, out = memory.asked_joint, memory.asked_loop, memory.vectors, memory.reaction
    if joint == 0 and asked < 0:
        return HELD
    if memory.rows > 0 and not _find_multipliers(memory, i):
        return UNCLEAR
    if joint > 0:
        copy(memory.wrench[joint], w[0], 3)
        copy(memory.wrench[joint, 3:], w[1], 3)
    end = memory.ends[0]
    for loop in range(memory.loops):
        if loop != asked and (joint == 0 or memory.passed_on[loop] == 0.0):
            continue
        compose(memory.frames[memory.loop_joints[loop, 0]], memory.loop_offsets[loop, 0], end)
        kind, row = memory.loop_kind[loop], memory.loop_row[loop]
        linear = 2 if kind == PRISMATIC else 3
        angular = 0 if kind == BALL else 2 if kind == REVOLUTE else 3
        w[4], w[5] = 0.0, 0.0  # its wrench on its second end, in the axes of the first, where that is
        for k in range(linear):
            w[4, k] = memory.multipliers[row + k] / memory.length
        for k in range(angular):
            w[5, k] = memory.multipliers[row + linear + k]
        if loop == asked:
            copy(w[4], out[i], 3)
            copy(w[5], out[i, 3:], 3)
            return HELD
        combine(w[4], end, w[2])
        combine(w[5], end, w[3])
        cross(end[3], w[2], w[4])
        for k in range(3):
            w[0, k] += memory.passed_on[loop] * w[2, k]
            w[1, k] += memory.passed_on[loop] * (w[3, k] + w[4, k])
    frame = memory.frames[joint]
    cross(frame[3], w[0], w[2])
    for k in range(3):
        w[1, k] -= w[2, k]
    for k in range(3):
        out[i, k], out[i, 3 + k] = dot(frame[k], w[0]), dot(frame[k], w[1])
    return HELD


@compiled
def _find_multipliers(memory: DynamicsMemory, i: int) -> bool:
    """Compute multipliers of the loops and couplings, J, for the torques of configuration i: those of dependent rows
    are 0. Return False where the factors of a cluster of loops are no triangles.

    With J^T = Q [L^T; 0], the rows of J permuted, L^T lambda is the beginning of Q^T (tau - S^T tau_a).
    """
    left = memory.loads_left
    for k in range(memory.n):
        left[k] = memory.scale[k] * memory.tau[k]
    for k in range(memory.actuated):
        dof = memory.actuated_dof[k]
        left[dof] -= memory.scale[dof] * memory.torques[i, k]
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        if cluster.blocks > 0 or cluster.is_singular != 0:
            return False
        part, f, n, rank = cluster.part, cluster.factors, cluster.n, cluster.factored_rank
        for k in range(n):
            part[k] = left[cluster.dof[k]]
        for t in range(rank):
            h, width = cluster.reflectors[t, t:], n - t
            add_multiple(-cluster.tau[t] * inner(h, part[t:], width), h, part[t:], width)
        for t in range(rank - 1, -1, -1):
            s = part[t]
            for j in range(t + 1, rank):
                s -= f[j, t] * part[j]
            part[t] = s / f[t, t]
        for j in range(cluster.rows):
            memory.multipliers[cluster.row[cluster.row_order[j]]] = part[j] if j < rank else 0.0
    return True


# --- motions of the closed mechanism ----------------------------------------------------------------------------------


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

    Returns:
        by how much the actuated joints' velocities contradict each other, as a fraction of the longest.
    """
    effort, y, rank = memory.effort, memory.coordinates, memory.mobility
    largest = 0.0
    for k in range(memory.actuated):
        effort[k] = v[memory.actuated_dof[k]] / memory.step[k]
        largest = max(largest, abs(effort[k]))
    for t in range(rank):  # (S N) y = v_a, with the factors of (S N)^T
        h, width = memory.reflectors[t, t:], memory.actuated - t
        add_multiple(-memory.tau_of[t] * inner(h, effort[t:], width), h, effort[t:], width)
    contradiction = 0.0
    for k in range(rank, memory.actuated):
        contradiction = max(contradiction, abs(effort[k]))
    for t in range(rank - 1, -1, -1):
        s = effort[t]
        for j in range(t + 1, rank):
            s -= memory.factors[j, t] * effort[j]
        effort[t] = s / memory.factors[t, t]
        y[memory.order[t]] = effort[t]
    for k in range(memory.n):
        v[k] = 0.0
    for m in range(rank):
        add_multiple(y[m], memory.null_space[m], v, memory.n)
    for k in range(memory.n):
        v[k] *= memory.scale[k]
    return contradiction / max(largest, _LEAST)


@compiled
def _complete_acceleration(memory: DynamicsMemory) -> float:
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
def _opening(memory: DynamicsMemory, v: Array) -> float:
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
def _find_drift(memory: DynamicsMemory) -> None:
    """Set `residual` to (dJ/dt) v, the accelerations with which the loops open if no joint accelerates; dimensionless.

    On the closed set the rows of a loop are its first end's axes. With the twists V_1, V_2 of its ends and their rates
    A_1, A_2, all at the world's origin, the twist of the second end relative to the first, seen from the first, changes
    by A_2 - A_1 - V_1 x (V_2 - V_1).
    """
    end, w, residual, first = memory.ends[0], memory.vectors, memory.residual, memory.rows - memory.couplings
    _find_accelerations(memory, False)
    for loop in range(memory.loops):
        one, two = memory.loop_joints[loop, 0], memory.loop_joints[loop, 1]
        compose(memory.frames[two], memory.loop_offsets[loop, 1], end)
        copy(end[3], w[4], 3)
        compose(memory.frames[one], memory.loop_offsets[loop, 0], end)
        v, v2, a, a2 = memory.velocity[one], memory.velocity[two], memory.acceleration[one], memory.acceleration[two]
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
def _contradiction(memory: DynamicsMemory) -> float:
    """Return the largest acceleration with which `a` opens a loop, as a fraction of the largest joint acceleration or
    drift; dimensionless."""
    largest, opening = 0.0, 0.0
    for k in range(memory.n):
        memory.delta[k] = memory.a[k] / memory.scale[k]
        largest = max(largest, abs(memory.delta[k]))
    for i in range(memory.rows):
        largest = max(largest, abs(memory.residual[i]))
        opening = max(opening, abs(memory.residual[i] + inner(memory.jacobian[i], memory.delta, memory.n)))
    return opening / max(largest, _LEAST)


# --- the tree ---------------------------------------------------------------------------------------------------------


@compiled
def _cross_twists(v: Array, linear: Array, angular: Array, out: Array, out_angular: Array, scratch: Array) -> None:
    """Write the rate of a twist that moves with a body of twist v (6,): v x (linear, angular)."""
    cross(v[3:], angular, out_angular)
    cross(v[3:], linear, out)
    cross(v, angular, scratch)
    for i in range(3):
        out[i] += scratch[i]


@compiled
def _from_base(memory: DynamicsMemory, given: Array, out: Array) -> None:
    """Write a twist (6,) at the world's origin, given in the axes of the joint 1, the base, at its origin."""
    frame, w = memory.frames[1], memory.vectors
    combine(given[3:], frame, w[0])
    combine(given, frame, w[1])
    cross(frame[3], w[0], w[2])
    for i in range(3):
        out[i], out[3 + i] = w[1, i] + w[2, i], w[0, i]


@compiled
def _find_velocities(memory: DynamicsMemory) -> None:
    """Compute the twists of all bodies, and what they add to accelerations, from `v`."""
    for j in range(1, memory.joints):
        own, twist, bias, parent = memory.relative[j], memory.velocity[j], memory.bias[j], memory.joint_parent[j]
        dof = memory.joint_dof[j]
        if dof < 0:
            _from_base(memory, memory.given_v[memory.now], own)
        else:
            sum_screws(memory, j, memory.v, own)
        for i in range(6):
            twist[i] = memory.velocity[parent, i] + own[i]
        _cross_twists(twist, own, own[3:], bias, bias[3:], memory.vectors[0])


@compiled
def _width(kind: int) -> int:
    """Return the DoF of a joint."""
    return 6 if kind == FREE_FLYER else 3 if kind == SPHERICAL else 1


@compiled
def sum_screws(memory: DynamicsMemory, j: int, rates: Array, out: Array) -> None:
    """Write the twist (6,) of a joint alone, by its rates in (n,)."""
    dof = memory.joint_dof[j]
    for i in range(6):
        out[i] = rates[dof] * memory.screws[dof, i]
    for k in range(1, _width(memory.joint_kind[j])):
        for i in range(6):
            out[i] += rates[dof + k] * memory.screws[dof + k, i]


@compiled
def _find_accelerations(memory: DynamicsMemory, with_joints: bool) -> None:
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


@compiled
def _find_tau(memory: DynamicsMemory) -> None:
    """Compute `tau`, and the wrenches that the tree's joints transmit, from velocities and accelerations."""
    w, wrenches = memory.vectors, memory.wrench
    wrenches[0] = 0.0
    for j in range(1, memory.joints):
        wrench, frame, v, a = wrenches[j], memory.frames[j], memory.velocity[j], memory.acceleration[j]
        combine(memory.centre[j], frame, w[0])
        for i in range(3):
            w[0, i] += frame[3, i]
        cross(v[3:], w[0], w[1])
        for i in range(3):
            w[1, i] += v[i]  # velocity of the centre of mass
        cross(v[3:], w[1], w[2])
        cross(a[3:], w[0], w[3])
        for i in range(3):
            wrench[i] = memory.mass[j] * (a[i] + w[2, i] + w[3, i] - memory.gravity[i])
            w[4, i], w[5, i] = dot(frame[i], v[3:]), dot(frame[i], a[3:])  # in the body's axes
        for i in range(3):
            w[6, i], w[7, i] = dot(memory.inertia[j, i], w[4]), dot(memory.inertia[j, i], w[5])
        cross(w[4], w[6], w[8])
        for i in range(3):
            w[7, i] += w[8, i]
        combine(w[7], frame, w[8])
        cross(w[0], wrench, w[9])
        for i in range(3):
            wrench[3 + i] = w[8, i] + w[9, i]
    for load in range(memory.loads):
        _subtract_load(memory, load)
    for j in range(memory.joints - 1, 0, -1):
        dof, wrench, parent = memory.joint_dof[j], wrenches[j], wrenches[memory.joint_parent[j]]
        if dof >= 0:
            for k in range(_width(memory.joint_kind[j])):
                memory.tau[dof + k] = inner(memory.screws[dof + k], wrench, 6)
        for i in range(6):
            parent[i] += wrench[i]


@compiled
def _subtract_load(memory: DynamicsMemory, load: int) -> None:
    """Subtract a wrench that acts on a node from what its joint must transmit."""
    frame, w, given, wrench = memory.ends[0], memory.vectors, memory.load[load], memory.wrench[memory.load_joint[load]]
    compose(memory.frames[memory.load_joint[load]], memory.load_offset[load], frame)
    copy(given, w[0], 3)
    copy(given[3:], w[1], 3)
    if memory.load_turns[load] != 0:
        combine(given, frame, w[0])
        combine(given[3:], frame, w[1])
    cross(frame[3], w[0], w[2])
    for i in range(3):
        wrench[i] -= w[0, i]
        wrench[3 + i] -= w[1, i] + w[2, i]
