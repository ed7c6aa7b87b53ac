"""Torques of the actuated joints, at one configuration after the other.

The recursive Newton-Euler algorithm (R. Featherstone, "Rigid body dynamics algorithms", 2008, section 5.3), in the
world's axes at its origin, gives the torques tau that the tree would need in all joints. With a basis N of the motions
that keep the loops closed, those of the actuated joints do the same work on each: (S N)^T tau_a = N^T tau, where S
picks the actuated joints. Of several solutions the shortest is taken.
"""

from __future__ import annotations

from cinegen.dynamics._kernels.memory import DynamicsMemory
from cinegen.dynamics._kernels.motions import (
    CLEAR,
    columns_of,
    complete,
    complete_acceleration,
    drift_contradiction,
    factor_actuated,
    find_accelerations,
    find_drift,
    find_velocities,
    loop_opening,
)
from cinegen.jit.compiled import compiled, entry
from cinegen.jit.factor import shortest_solution
from cinegen.jit.se3 import combine, compose, cross, dot
from cinegen.jit.vectors import add_multiple, copy, inner
from cinegen.loops._kernels.closure import factor_loops
from cinegen.loops._kernels.kinematics import evaluate
from cinegen.loops._kernels.memory import cluster_at
from cinegen.loops._kernels.residual import BALL, PRISMATIC, REVOLUTE, evaluate_loops
from cinegen.loops.thresholds import CLOSURE

HELD, OPEN, UNCLEAR = range(3)
"""Results: torques were found; loops are open; near a singularity, or actuated joints don't control everything, which
the plain form decides."""

RESTING = 1e-9
"""A joint whose speed is below this part of the fastest one's, dimensionless, is at rest: in a closed mechanism, speeds
that should be 0 are rounding errors. Its Coulomb friction is undetermined, and left out."""


@entry
def find_torques(memory: DynamicsMemory) -> None:
    """Find the torques at all given configurations; results where the status is not HELD are not written."""
    if memory.moves == 0:
        memory.velocity[:] = 0.0
        memory.acceleration[:] = 0.0
    for i in range(memory.count):
        memory.now = i
        memory.statuses[i] = _find(memory, i)


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
            gaps[1] = loop_opening(memory, memory.v)
        find_velocities(memory)
        if memory.rows > 0:
            find_drift(memory)
        if memory.completes != 0 and not is_direct:
            gaps[2] = complete_acceleration(memory)
        elif memory.rows > 0:
            gaps[2] = drift_contradiction(memory)
    if memory.moves != 0:
        find_accelerations(memory, True)
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
    """Write the reaction that is asked for, if one is; components that statics does not determine have any value.

    The multipliers of a loop are the force f, N, and the moment m, N m, on its second end, in the axes of its first
    end, the frame (R, p); they are 0 in directions in which it is free. About the world's origin, in the world's axes,
    these are R f and R m + p x R f. A joint transmits the tree's wrench (F, M) there (`_find_tau`), and those of the
    loops that close over it, with the signs `passed_on`. In the joint's frame (R, p) this is R^T F and R^T (M - p x F).

    Args:
        memory: with the frames, torques and tree's wrenches of the configuration.
        i: index of the configuration; row i of `reaction` is written.

    Returns:
        HELD; UNCLEAR if the multipliers can't be computed.
    """
    joint, asked, out = memory.asked_joint, memory.asked_loop, memory.reaction
    force, moment, f, m = memory.vectors[0], memory.vectors[1], memory.vectors[4], memory.vectors[5]
    loop_force, loop_moment = memory.vectors[2], memory.vectors[3]
    if joint == 0 and asked < 0:
        return HELD
    if memory.rows > 0 and not _find_multipliers(memory, i):
        return UNCLEAR
    if joint > 0:
        copy(memory.wrench[joint], force, 3)
        copy(memory.wrench[joint, 3:], moment, 3)
    end = memory.ends[0]
    for loop in range(memory.loops):
        if loop != asked and (joint == 0 or memory.passed_on[loop] == 0.0):
            continue
        compose(memory.frames[memory.loop_joints[loop, 0]], memory.loop_offsets[loop, 0], end)
        kind, row = memory.loop_kind[loop], memory.loop_row[loop]
        linear = 2 if kind == PRISMATIC else 3
        angular = 0 if kind == BALL else 2 if kind == REVOLUTE else 3
        for k in range(3):
            f[k] = memory.multipliers[row + k] / memory.length if k < linear else 0.0
            m[k] = memory.multipliers[row + linear + k] if k < angular else 0.0
        if loop == asked:
            copy(f, out[i], 3)
            copy(m, out[i, 3:], 3)
            return HELD
        combine(f, end, loop_force)
        combine(m, end, loop_moment)
        cross(end[3], loop_force, f)
        for k in range(3):
            force[k] += memory.passed_on[loop] * loop_force[k]
            moment[k] += memory.passed_on[loop] * (loop_moment[k] + f[k])
    frame = memory.frames[joint]
    cross(frame[3], force, loop_moment)
    for k in range(3):
        moment[k] -= loop_moment[k]
    for k in range(3):
        out[i, k], out[i, 3 + k] = dot(frame[k], force), dot(frame[k], moment)
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


# --- the tree ---------------------------------------------------------------------------------------------------------


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
            for k in range(columns_of(memory.joint_kind[j])):
                memory.tau[dof + k] = inner(memory.screws[dof + k], wrench, 6)
        for i in range(6):
            parent[i] += wrench[i]


@compiled
def _subtract_load(memory: DynamicsMemory, load: int) -> None:
    """Subtract a wrench that acts on a node from what its joint must transmit."""
    frame, w, local, wrench = memory.ends[0], memory.vectors, memory.load[load], memory.wrench[memory.load_joint[load]]
    compose(memory.frames[memory.load_joint[load]], memory.load_offset[load], frame)
    copy(local, w[0], 3)
    copy(local[3:], w[1], 3)
    if memory.load_turns[load] != 0:
        combine(local, frame, w[0])
        combine(local[3:], frame, w[1])
    cross(frame[3], w[0], w[2])
    for i in range(3):
        wrench[i] -= w[0, i]
        wrench[3 + i] -= w[1, i] + w[2, i]
