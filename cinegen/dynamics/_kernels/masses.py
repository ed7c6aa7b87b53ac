"""Inertia seen at the actuated joints, at one configuration after the other.

The kinetic energy of the closed mechanism is v_a^T M v_a / 2. With the motion that each actuated joint causes alone, M
is the sum over all bodies of m (u_k . u_l) + w_k . I w_l: u their centre's velocity, w their angular velocity; and over
all joints of v_k A v_l: v their velocity, A their armature.
"""

from __future__ import annotations

from cinegen.dynamics._kernels.memory import DynamicsMemory
from cinegen.dynamics._kernels.motions import CLEAR, complete, factor_actuated, sum_screws
from cinegen.dynamics._kernels.torques import HELD, OPEN, UNCLEAR
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.se3 import combine, cross, dot
from cinegen.jit.vectors import copy
from cinegen.loops._kernels.closure import factor_loops
from cinegen.loops._kernels.kinematics import evaluate
from cinegen.loops._kernels.residual import evaluate_loops
from cinegen.loops.thresholds import CLOSURE


@entry
def find_masses(memory: DynamicsMemory) -> None:
    """Find the inertia at all given configurations; results where the status is not HELD are not written."""
    for i in range(memory.count):
        memory.statuses[i] = _find(memory, i)


@compiled
def _find(memory: DynamicsMemory, i: int) -> int:
    n, actuated = memory.n, memory.actuated
    copy(memory.given_q[i], memory.q, memory.nq)
    evaluate(memory, memory.q)
    if memory.rows > 0:
        if not evaluate_loops(memory, True) <= CLOSURE:
            return OPEN
        factor_loops(memory, False)
        if memory.sigma < CLEAR:
            return UNCLEAR
    is_direct = memory.rows == 0 and actuated == n
    if not is_direct and (actuated != memory.mobility or not factor_actuated(memory)):
        return UNCLEAR
    for k in range(actuated):
        motion = memory.motions[k]
        for j in range(n):
            motion[j] = 0.0
        motion[memory.actuated_dof[k]] = 1.0
        if not is_direct:
            complete(memory, motion)
    masses = memory.masses[i]
    for k in range(actuated):
        for m in range(actuated):
            masses[k, m] = 0.0
            for j in range(n):
                masses[k, m] += memory.armature[j] * memory.motions[k, j] * memory.motions[m, j]
    for j in range(1, memory.joints):
        _add_body(memory, j, masses)
    for k in range(actuated):
        for m in range(k):
            masses[m, k] = masses[k, m]
    return HELD


@compiled
def _add_body(memory: DynamicsMemory, j: int, masses: Array) -> None:
    """Add a body to the lower triangle, and compute its twists for the joints that it carries."""
    w, frame, parent, dof = memory.vectors, memory.frames[j], memory.joint_parent[j], memory.joint_dof[j]
    centre, relative, spin = w[0], memory.relative[0], w[1]
    combine(memory.centre[j], frame, centre)
    for i in range(3):
        centre[i] += frame[3, i]
    for k in range(memory.actuated):
        twist, moved, spun = memory.twists[j, k], memory.moved[k], memory.spun[k]
        copy(memory.twists[parent, k], twist, 6)
        if dof >= 0:
            sum_screws(memory, j, memory.motions[k], relative)
            for i in range(6):
                twist[i] += relative[i]
        cross(twist[3:], centre, moved)
        for i in range(3):
            moved[i] += twist[i]
            spin[i] = dot(frame[i], twist[3:])  # in the body's axes
        copy(spin, memory.spin[k], 3)
        for i in range(3):
            spun[i] = dot(memory.inertia[j, i], spin)
        for m in range(k + 1):
            masses[k, m] += memory.mass[j] * dot(moved, memory.moved[m]) + dot(spun, memory.spin[m])
