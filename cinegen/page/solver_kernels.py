"""Kernels of the page's solver, whose tasks are free: any nodes, any number of rows. Only translations of them run."""

from __future__ import annotations

import math

from cinegen.codegen.kernels import RobotMemory, record_errors
from cinegen.ik._kernels.decomposition import find_singular_values
from cinegen.ik._kernels.memory import STATUS, task_at
from cinegen.ik._kernels.tasks import aim_tasks, read_tasks
from cinegen.ik._kernels.tick import tick
from cinegen.ik.thresholds import RANK_NEEDED
from cinegen.jit.compiled import Array, Table, compiled
from cinegen.jit.memory import array, parameter, state
from cinegen.jit.se3 import compose
from cinegen.jit.svd import decompose
from cinegen.jit.vectors import copy
from cinegen.loops._kernels.ball_joints import count_balls
from cinegen.loops._kernels.closure import factor_loops, find_null_space
from cinegen.loops._kernels.kinematics import evaluate
from cinegen.loops._kernels.memory import NOWHERE
from cinegen.loops._kernels.residual import evaluate_loops
from cinegen.loops._kernels.screws import find_screws
from raff2urdf.closure import NOTHING, RANK


class PageMemory(RobotMemory):
    """A mechanism whose tasks are set while it runs: `tasks` is their present number."""

    # input: of each task its node, frame in that node, target, numbers of translations and rotations, and weight
    capacity: int = parameter(0)
    task_node: Table = array("capacity", dtype=int)
    task_offset: Array = array("capacity", 4, 3)
    task_target: Array = array("capacity", 4, 3)
    task_dof: Table = array("capacity", 2, dtype=int)
    task_weight: Array = array("capacity")

    node_is_inner: Table = array("nodes", dtype=int)  # it lies between joints that stand for a ball joint
    joint_moved_by: Array = array("joints", "n")  # 1 for DoF that move the joint, else 0
    samples: int = parameter(0)
    sample: Array = array("samples", "nq")  # closed configurations

    # the passive joints' columns in the screw matrix, those of the shorter side as rows
    passive: int = parameter(0)
    passive_column: Table = array("passive", dtype=int)
    passive_rank: int = parameter(0)
    passive_lesser: int = parameter(0)  # of passive and screw_rows
    passive_larger: int = parameter(0)
    passive_rows: Array = array("passive_lesser", "passive_larger")
    passive_left: Array = array("passive_lesser", "passive_lesser")
    passive_right: Array = array("passive_lesser", "passive_larger")
    passive_squares: Array = array("passive_lesser")

    sigma_tasks: float = state(math.nan)  # smallest singular value of the tasks; NaN if they never move
    sigma_passive: float = state(math.nan)  # of the passive joints; NaN without any, or if it is not known


def take_tasks(memory: PageMemory) -> None:
    """Read all of the tasks but their targets."""
    for i in range(memory.tasks):
        task, node = task_at(memory.task_handles[i]), memory.task_node[i]
        task.joint, task.place = memory.node_joint[node], i
        compose(memory.node_offset[node], memory.task_offset[i], task.offset)
        copy(memory.joint_moved_by[task.joint], task.moved_by, memory.n)
        task.translation, task.rotation = memory.task_dof[i, 0], memory.task_dof[i, 1]
        for k in range(task.translation):
            task.row_axis[k] = k
        first = 5 if task.rotation == 1 else 3  # of two, the direction of z: it is rotated about x and y
        for k in range(task.rotation):
            task.row_axis[task.translation + k] = first + k
        for k in range(6):
            task.row_weight[k] = 1.0
        task.weight = memory.task_weight[i]
    memory.signature = -1


def step(memory: PageMemory) -> int:
    """Move q towards the targets for one period. Return the status."""
    memory.follows = 0
    _take_targets(memory)
    request = tick(memory)
    if request == RANK_NEEDED:
        _find_rank(memory)
        tick(memory)
    record_errors(memory)
    return int(memory.report[STATUS])


def find_sigma(memory: PageMemory) -> None:
    """Compute the smallest singular values at q, dimensionless: of the tasks in the null space of the loops
    (type 1), as if they were at their targets, and of the passive joints in the screw matrix (type 2). A ball joint
    counts as one joint, unless a task's node lies inside of it."""
    memory.follows = 0
    _take_targets(memory)
    if not read_tasks(memory):
        _find_rank(memory)
    memory.sigma_tasks = memory.sigma_passive = math.nan
    _unlock(memory)
    evaluate(memory, memory.q)
    memory.is_at_q, memory.factored_at, memory.is_warm = 1, NOWHERE, 0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        compose(memory.frames[task.joint], task.offset, task.own_target)
    aim_tasks(memory)
    if memory.rows > 0:
        memory.gap = evaluate_loops(memory, True)
        if memory.passive > 0:
            find_screws(memory)
            if _is_inside_ball(memory) or count_balls(memory, memory.task_jacobian):
                memory.sigma_passive = _passive_sigma(memory)
        factor_loops(memory, False)
        find_null_space(memory)
    if memory.mobility > 0 and memory.task_rank > 0:
        find_singular_values(memory)
        last = min(memory.task_rank, memory.active_rows, memory.mobility) - 1
        memory.sigma_tasks = math.sqrt(memory.squares[last])
    memory.is_warm = 0
    _take_targets(memory)
    aim_tasks(memory)  # the next tick compares its targets with these


@compiled
def _take_targets(memory: PageMemory) -> None:
    for i in range(memory.tasks):
        task, target = task_at(memory.task_handles[i]), memory.task_target[i]
        for c in range(4):
            for k in range(3):
                task.own_target[c, k] = target[c, k]


@compiled
def _find_rank(memory: PageMemory) -> None:
    """Find the generic rank of the tasks, as `cinegen.ik.equations.task_rank` does."""
    memory.task_rank = 0
    _unlock(memory)
    for i in range(memory.samples):
        evaluate(memory, memory.sample[i])
        aim_tasks(memory)
        if memory.rows > 0:
            evaluate_loops(memory, True)
            factor_loops(memory, False)
            find_null_space(memory)
        memory.is_warm = 0
        if memory.mobility > 0:
            find_singular_values(memory)
            rank = 0
            for k in range(min(memory.active_rows, memory.mobility)):
                if math.sqrt(memory.squares[k]) > max(RANK * math.sqrt(memory.squares[0]), NOTHING):
                    rank += 1
            memory.task_rank = max(memory.task_rank, rank)
    memory.is_at_q, memory.factored_at, memory.is_warm = 0, NOWHERE, 0


@compiled
def _unlock(memory: PageMemory) -> None:
    for j in range(memory.n):
        memory.locked[j] = 0.0


@compiled
def _is_inside_ball(memory: PageMemory) -> bool:
    """Return whether a task's node lies between joints that stand for a ball joint, which count by themselves then."""
    inside = False
    for i in range(memory.tasks):
        if memory.node_is_inner[memory.task_node[i]] != 0:
            inside = True
    return inside


@compiled
def _passive_sigma(memory: PageMemory) -> float:
    a, lies = memory.passive_rows, memory.passive <= memory.screw_rows
    for j in range(memory.passive):
        for i in range(memory.screw_rows):
            number = memory.screw_matrix[i, memory.passive_column[j]]
            if lies:
                a[j, i] = number
            else:
                a[i, j] = number
    n, wide = memory.passive_lesser, memory.passive_larger
    decompose(a, n, wide, memory.passive_left, memory.passive_right, memory.passive_squares, False)
    return math.sqrt(memory.passive_squares[memory.passive_rank - 1])
