"""Inverse kinematics of generated code: the local solver of `cinegen.ik`, from the present configuration and then from
a few that are known. Only translations of these functions run."""

from __future__ import annotations

from dataclasses import replace

from cinegen.codegen.kernels import RobotMemory, set_q
from cinegen.ik._kernels.local_ik import solve
from cinegen.ik._kernels.memory import LocalIKMemory, SolverMemory, task_at
from cinegen.ik._kernels.tasks import read_tasks
from cinegen.jit.compiled import Array, compiled
from cinegen.jit.memory import array, parameter, state
from cinegen.jit.se3 import compose, dot
from cinegen.jit.vectors import copy
from cinegen.loops._kernels.kinematics import evaluate
from cinegen.loops.thresholds import CLOSURE

BAD_TARGET, NOT_FOUND, FOUND = range(3)
"""Results of `find`."""


_IK = {name: replace(field, slot=-1) for name, field in LocalIKMemory.fields.items() if name not in SolverMemory.fields}
"""What the solver has no field for: the same fields, at other positions of the memory."""


class InverseMemory(RobotMemory, LocalIKMemory):
    """A mechanism whose tasks are also solved from configurations far away."""

    vars().update(_IK)

    starts: int = parameter(0)
    start_q: Array = array("starts", "nq")  # closed configurations from which targets are reached
    start_weights: Array = array("tasks", 4)  # of a task's three axes and its origin in the distance of two frames
    start_distances: Array = array("starts")  # squared, from the targets; -1 of those that were tried
    ik_tolerance: float = state(1e-6)  # largest error of a target, m and rad
    ik_iterations: int = state(0)  # from all starts


def find(memory: InverseMemory) -> int:
    """Move at once to a configuration, loops closed and joints within their limits, that brings the tasks to their
    targets: from q, then from the starts, the nearest first. If none is found, nothing moves."""
    memory.follows = 0
    memory.ik_iterations = 0
    read_tasks(memory)
    memory.signature = -1  # a tick counts the tasks again
    for i in range(memory.tasks):
        if task_at(memory.task_handles[i]).is_active == 0:
            return BAD_TARGET
    memory.goal_residual = 0.5 * min(memory.ik_tolerance, memory.ik_tolerance / memory.length)
    copy(memory.q, memory.record_q, memory.nq)
    copy(memory.q, memory.trial, memory.nq)
    _measure_starts(memory)
    for _ in range(memory.starts + 1):
        solved = solve(memory)
        memory.ik_iterations += memory.iterations
        if solved and memory.loops_left <= CLOSURE:
            copy(memory.q, memory.trial, memory.nq)
            set_q(memory)
            memory.signature = -1
            return FOUND
        _take_start(memory)
    copy(memory.record_q, memory.trial, memory.nq)
    set_q(memory)
    memory.signature = -1
    return NOT_FOUND


@compiled
def _measure_starts(memory: InverseMemory) -> None:
    """Compute the squared distance of each start from the targets.

    A frame (4, 3) has the rows x, y, z (axes) and its origin, m. With F that of a task's node at the start, T its
    target and the weights w (4,), the square is the sum over the tasks of sum_c w_c |T_c - F_c|^2, dimensionless; see
    `cinegen.ik.global_ik.placement_weights`.
    """
    difference, frame = memory.vectors[0], memory.ends[0]
    for s in range(memory.starts):
        total = 0.0
        evaluate(memory, memory.start_q[s])
        for i in range(memory.tasks):
            task = task_at(memory.task_handles[i])
            compose(memory.frames[task.joint], task.offset, frame)
            for c in range(4):
                for k in range(3):
                    difference[k] = task.own_target[c, k] - frame[c, k]
                total += memory.start_weights[i, c] * dot(difference, difference)
        memory.start_distances[s] = total


@compiled
def _take_start(memory: InverseMemory) -> None:
    """Begin at the nearest start that was not tried."""
    best = -1
    for s in range(memory.starts):
        distance = memory.start_distances[s]
        if distance >= 0.0 and (best < 0 or distance < memory.start_distances[best]):
            best = s
    if best >= 0:
        copy(memory.start_q[best], memory.trial, memory.nq)
        memory.start_distances[best] = -1.0
