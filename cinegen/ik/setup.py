"""Memory of the kernels that move a mechanism, set up for it and its tasks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cinegen.arrays import Array
from cinegen.ik._kernels.memory import OF_NODE, OF_TARGET, OF_WORLD, SolverMemory, TasksMemory
from cinegen.ik.given_task import AnyTask, GivenTask
from cinegen.jit.foreign import frame_of
from cinegen.joints import supporting_columns, translations
from cinegen.loops import setup as loops
from cinegen.model import Mechanism


def set_up(memory: TasksMemory, mechanism: Mechanism, fixed: int = 0) -> None:
    """Fill a memory with a mechanism and its position limits.

    Args:
        memory: of a solver.
        mechanism: mechanism to move.
        fixed: 6 to hold a floating base, else 0.
    """
    loops.set_up(memory, mechanism.structure.system, mechanism.cluster_ranks, fixed)
    at_q, at_v = mechanism.structure.scalar_joints
    memory.lower[:], memory.upper[:] = -np.inf, np.inf
    memory.lower[at_v - fixed], memory.upper[at_v - fixed] = mechanism.limits.lower[at_q], mechanism.limits.upper[at_q]
    for column in mechanism.structure.held_columns:  # it does not move: nothing limits it
        memory.lower[column - fixed], memory.upper[column - fixed] = -np.inf, np.inf


def set_up_tasks(
    memory: TasksMemory, mechanism: Mechanism, tasks: Sequence[AnyTask], priorities: Sequence[int] = (0,)
) -> None:
    """Fill a memory with tasks, whose numbers it uses where they are.

    Args:
        memory: of a solver.
        mechanism: mechanism to move.
        tasks: in the order in which they were added.
        priorities: distinct, the smallest first: each is a level. With one, all tasks are of one level.
    """
    for place, task in enumerate(tasks):
        _bind(task, mechanism, memory.fixed)
        task.memory.place = place
        task.memory.level = priorities.index(task.priority) if len(priorities) > 1 else 0
    rows = sum(task.memory.translation + task.memory.rotation for task in tasks)
    memory.resize(tasks=len(tasks), task_rows=rows, levels=len(priorities))
    memory.task_handles[:] = [task.memory.handle for task in sorted(tasks, key=lambda task: task.memory.level)]
    memory.signature = -1


def _bind(task: AnyTask, mechanism: Mechanism, fixed: int) -> None:
    """Write into a task's memory what depends on the mechanism."""
    model, memory = mechanism.model, task.memory
    memory.resize(n=model.nv - fixed)
    if isinstance(task, GivenTask):
        task.hold(mechanism.structure.held_columns)
        return
    task.write()
    frame, (named, offset) = model.frames[task.frame], task.valid_axes_and_offset
    memory.joint, memory.offset[:] = frame.parentJoint, frame_of(frame.placement * offset)
    memory.moved_by[:] = supporting_columns(model, frame.parentJoint)[fixed:]
    memory.moved_by[[column - fixed for column in mechanism.structure.held_columns]] = 0.0
    memory.axes_of = {"target": OF_TARGET, "world": OF_WORLD}.get(named, OF_NODE)
    if memory.axes_of == OF_NODE:
        axes = model.frames[mechanism.frame_id(named)]
        memory.axes_joint, memory.axes[:] = axes.parentJoint, axes.placement.rotation.T


def set_up_solver(memory: SolverMemory, mechanism: Mechanism) -> None:
    """Fill a solver's memory as `set_up` does; `JointSettings.write` adds limits and weights."""
    set_up(memory, mechanism)
    mobility = mechanism.mobility
    memory.resize(mobility=mobility, most_active=mobility + 1)
    make_room_for_barriers(memory, memory.barrier_capacity)
    if memory.is_watched:
        loops.set_up_screws(memory, mechanism.structure.screws)
    memory.is_at_q = 0


def set_up_solver_tasks(memory: SolverMemory, mechanism: Mechanism, tasks: Sequence[AnyTask]) -> None:
    """Fill a solver's memory with tasks, in levels by their priorities."""
    priorities = sorted({task.priority for task in tasks}) or [0]
    set_up_tasks(memory, mechanism, tasks, priorities)
    rows, mobility, several = memory.task_rows, memory.mobility, len(priorities) > 1
    lesser, larger = min(rows, mobility), max(rows, mobility)
    memory.resize(lesser=lesser, larger=larger, parts=len(priorities) + 1 if several else 0)
    sizes = (lesser, larger, mobility) if several else (0, 0, 0)
    memory.resize(**dict(zip(("level_lesser", "level_larger", "level_free"), sizes, strict=True)))
    memory.level_scale[:], memory.level_last[:] = 1.0, 0.0
    memory.has_given = int(any(isinstance(task, GivenTask) for task in tasks))
    memory.is_warm = 0


def make_room_for_barriers(memory: SolverMemory, count: int) -> None:
    """Make room for so many rows of barriers in a tick."""
    memory.resize(barrier_capacity=count, bounds=memory.n + count)


def second_derivative(mechanism: Mechanism, lower: Array, upper: Array) -> float:
    """Return a bound of the second derivative of any placement by the joints, in characteristic lengths; infinite where
    a joint may slide without end or has more than one degree of freedom.

    Args:
        mechanism: its held joints do not move.
        lower: (nq,) least positions, rad and m.
        upper: (nq,) greatest positions.
    """
    model, held = mechanism.model, mechanism.structure.held_columns
    reach = sum(float(np.linalg.norm(placement.translation)) for placement in model.jointPlacements)
    reach += max(float(np.linalg.norm(frame.placement.translation)) for frame in model.frames)
    for joint in model.joints:
        is_held = joint.idx_v in held
        if joint.idx_v >= 0 and not (joint.nq == 1 and joint.nv == 1) and not is_held:
            return np.inf
        if joint.idx_v >= 0 and translations(joint):
            low, high = lower[joint.idx_q], upper[joint.idx_q]
            reach += abs(mechanism.structure.held_at[joint.idx_q]) if is_held else max(abs(low), abs(high))
    return reach / mechanism.length + 1.0
