"""Functions of generated code, in terms of the compiled kernels. Only translations of these functions run."""

from __future__ import annotations

import math

from cinegen.ik._kernels.decomposition import find_singular_values
from cinegen.ik._kernels.memory import ERRORS_KNOWN, STATUS, SolverMemory, task_at
from cinegen.ik._kernels.tasks import aim_tasks, read_tasks, try_tasks
from cinegen.ik._kernels.tick import tick
from cinegen.ik.thresholds import BEGIN, RANK_NEEDED
from cinegen.jit.compiled import Array, Table, compiled
from cinegen.jit.memory import array, parameter, state
from cinegen.jit.se3 import compose
from cinegen.jit.vectors import copy
from cinegen.loops._kernels.closure import close_from_trial, factor_loops, find_null_space
from cinegen.loops._kernels.follow import follow
from cinegen.loops._kernels.kinematics import evaluate
from cinegen.loops._kernels.memory import AT_Q, NOWHERE
from cinegen.loops._kernels.residual import evaluate_loops
from cinegen.loops.thresholds import CLOSED
from cinegen.model.forward import FURTHEST


class RobotMemory(SolverMemory):
    """A mechanism with tasks, and the poses of its nodes."""

    has_pinocchio = False
    nodes: int = parameter(0)
    node_joint: Table = array("nodes", dtype=int)  # that carries it
    node_offset: Array = array("nodes", 4, 3)  # relative to the joint
    node_frame: Array = array("nodes", 4, 3)  # in the world: three axes, then the origin
    signatures: int = parameter(1)  # 2^tasks
    ranks: Table = array("signatures", dtype=int)  # generic rank of the tasks, by the bits of those that are valid
    follows: int = state(0)  # the last motion was one of the actuated joints, whose factors may be used again


def place(memory: RobotMemory) -> None:
    """Compute the frames of all nodes at q."""
    evaluate(memory, memory.q)
    memory.is_at_q = 1
    for i in range(memory.nodes):
        compose(memory.frames[memory.node_joint[i]], memory.node_offset[i], memory.node_frame[i])


def close(memory: RobotMemory) -> float:
    """Close the loops from `trial`, which is changed; locked joints stay. Return the largest residual that is left, in
    rad or characteristic lengths; NaN if a number of `trial` is not finite."""
    memory.follows = 0
    close_from_trial(memory)
    return memory.gap


@compiled
def set_q(memory: RobotMemory) -> None:
    """Move to `trial`, closed, at once and at rest."""
    copy(memory.trial, memory.q, memory.nq)
    memory.follows = 0
    memory.is_at_q, memory.phase, memory.factored_at = 0, BEGIN, NOWHERE
    for k in range(memory.n):
        memory.last[k] = memory.drift[k] = memory.secondary[k] = 0.0
    memory.secondary_scale = memory.turn_scale = 1.0


def forward(memory: RobotMemory) -> bool:
    """Move the actuated joints along a straight line to `goal`, loops closed on their branch. Return False, and move
    nothing, if they can't get there, or if a value is not finite or too far away."""
    for a in range(memory.actuated):
        dof = memory.actuated_dof[a]
        if not abs(memory.goal[a] - memory.q[memory.q_index[dof]]) <= FURTHEST * memory.scale[dof]:
            return False
    memory.is_at_q = 0
    if memory.rows == 0:
        for a in range(memory.actuated):
            memory.q[memory.q_index[memory.actuated_dof[a]]] = memory.goal[a]
        return True
    copy(memory.q, memory.record_q, memory.nq)
    for a in range(memory.actuated):
        memory.locked[memory.actuated_dof[a]] = 1.0
    if memory.follows == 0:
        memory.factored_at, memory.alike = NOWHERE, 0
    memory.follows = 1 if follow(memory) and memory.closure <= CLOSED else 0
    for a in range(memory.actuated):
        memory.locked[memory.actuated_dof[a]] = 0.0
    if memory.follows == 0:
        copy(memory.record_q, memory.q, memory.nq)
    return memory.follows != 0


def step(memory: RobotMemory) -> int:
    """Move q towards the targets for one period. Return the status."""
    memory.follows = 0
    request = tick(memory)
    if request == RANK_NEEDED:
        memory.task_rank, memory.is_warm = memory.ranks[memory.signature], 0
        tick(memory)
    record_errors(memory)
    return int(memory.report[STATUS])


@compiled
def record_errors(memory: RobotMemory) -> None:
    """Record what a tick has left of the tasks' errors if it was accepted without evaluation."""
    if memory.report[ERRORS_KNOWN] != 0.0:
        return
    evaluate(memory, memory.q)
    memory.is_at_q = 1
    try_tasks(memory)
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        memory.record_errors[i, 0], memory.record_errors[i, 1] = task.distance, task.angle


def find_sigma(memory: RobotMemory) -> int:
    """Compute the singular values of the tasks in the null space of the loops at q, dimensionless: the square roots of
    `squares`, the largest first. Return their number."""
    memory.follows = 0
    if not read_tasks(memory):
        memory.task_rank, memory.is_warm = memory.ranks[memory.signature], 0
    evaluate(memory, memory.q)
    memory.is_at_q = 1
    aim_tasks(memory)
    if memory.mobility == 0:
        return 0
    if memory.rows > 0:
        memory.gap = evaluate_loops(memory, True)
        factor_loops(memory, False)
        memory.factored_at = AT_Q
        find_null_space(memory)
    find_singular_values(memory)
    count = min(memory.task_rank, memory.active_rows, memory.mobility)
    for i in range(count):
        memory.squares[i] = math.sqrt(memory.squares[i])
    return count
