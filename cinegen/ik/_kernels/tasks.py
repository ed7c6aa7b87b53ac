"""Tasks: where they lead in a tick, their rows, and what is left of them. `FrameTask.equations`, compiled."""

from __future__ import annotations

import math

from cinegen.ik._kernels.memory import OF_NODE, OF_WORLD, TaskMemory, TasksMemory, task_at
from cinegen.ik.thresholds import ERROR_CAP
from cinegen.jit import se3
from cinegen.jit.compiled import Array, compiled
from cinegen.jit.foreign import frame_at
from cinegen.jit.se3 import combine, compose, dot

FURTHEST = 1e100  # m: a target beyond is aimed at from here all the same, and no square overflows


@compiled
def read_tasks(memory: TasksMemory) -> bool:
    """Read which tasks are valid. Return False where their rank is not known."""
    signature = 0
    memory.heaviest = 0.0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        good = task.is_valid != 0
        if good:
            target = frame_at(task.target)
            for c in range(4):
                for k in range(3):
                    good = good and math.isfinite(target[c, k])
        task.is_active = 1 if good else 0
        if good:
            signature |= 1 << (i % 62)
            memory.heaviest = max(memory.heaviest, task.weight)
    if signature != memory.signature:
        memory.signature = signature
        return False
    return True


@compiled
def aim_tasks(memory: TasksMemory) -> bool:
    """Compute where each task leads in this tick, its rows, and what is left of it. Return whether no aim has moved."""
    row, still = 0, True
    error, wanted, frame = memory.error, memory.wanted, memory.ends[0]
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        if task.is_active == 0:
            continue
        compose(memory.frames[task.joint], task.offset, frame)
        target = frame_at(task.target)
        _find_axes(memory, task, target)
        if task.is_twist != 0:
            still = False
            _advance(memory, task)
        else:
            for c in range(4):
                for k in range(3):
                    still = still and task.aim[c, k] == target[c, k]
                    task.aim[c, k] = target[c, k]
        _find_error(memory, task, error[row:])
        weight = task.weight / memory.heaviest
        _find_rows(memory, task, weight, memory.task_jacobian[row:])
        measure(task, error[row:], memory.length)
        gain = 1.0 if task.is_twist != 0 else memory.gain
        linear = gain * weight * min(1.0, ERROR_CAP / max(task.distance / memory.length, 1e-300))
        angular = gain * weight * min(1.0, ERROR_CAP / max(task.angle, 1e-300))
        for k in range(task.translation + task.rotation):
            wanted[row + k] = error[row + k] * (linear if k < task.translation else angular)
        row += task.translation + task.rotation
    memory.active_rows = row
    return still


@compiled
def tasks_left(memory: TasksMemory) -> float:
    """How far all tasks are from where they lead, as one number that the capped errors are the gradient of: half the
    square up to the cap, linear beyond (Huber). By the distances that stand in the tasks."""
    total = 0.0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        if task.is_active != 0:
            weight = task.weight / memory.heaviest
            linear, angular = task.distance / memory.length, task.angle
            a, b = min(linear, ERROR_CAP), min(angular, ERROR_CAP)
            total += weight * weight * (a * (linear - 0.5 * a) + b * (angular - 0.5 * b))
    return total


@compiled
def try_tasks(memory: TasksMemory) -> float:
    """As `tasks_left`, at the joints' frames as they are now; errors go to `trial_error`."""
    row = 0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        if task.is_active != 0:
            compose(memory.frames[task.joint], task.offset, memory.ends[0])
            _find_error(memory, task, memory.trial_error[row:])
            measure(task, memory.trial_error[row:], memory.length)
            row += task.translation + task.rotation
    return tasks_left(memory)


@compiled
def measure(task: TaskMemory, error: Array, length: float) -> None:
    """Set `distance` (m) and `angle` (rad) of a dimensionless error, without squares that overflow."""
    largest, total = 0.0, 0.0
    for k in range(task.translation):
        largest = max(largest, abs(error[k]))
    if largest > 0.0:
        for k in range(task.translation):
            total += (error[k] / largest) * (error[k] / largest)
    task.distance = largest * math.sqrt(total) * length
    total = 0.0
    for k in range(task.translation, task.translation + task.rotation):
        total += error[k] * error[k]
    task.angle = math.sqrt(total)


# --- one task -------------------------------------------------------------------------------------------------------
# Its frame stands in ends[0]. Vectors 1 to 3 are the axes as the node carries them, 7 to 9 the derivative of its
# rotation, 10 the rotation vector: they are left for the rows.


@compiled
def _find_axes(memory: TasksMemory, task: TaskMemory, target: Array) -> None:
    """Compute a task's axes in the world."""
    axes = task.world_axes
    if task.axes_of == OF_NODE:
        compose(memory.frames[task.axes_joint], task.axes, axes)
        return
    for c in range(3):
        for i in range(3):
            if task.axes_of == OF_WORLD:
                axes[c, i] = 1.0 if c == i else 0.0
            else:
                axes[c, i] = memory.ends[0, c, i] if task.is_twist != 0 else target[c, i]


@compiled
def _advance(memory: TasksMemory, task: TaskMemory) -> None:
    """Advance a twist's aim: from where it led in the last tick if the node is there, else from where the node is. So
    nothing drifts while the twist is followed, and nothing winds up while it is not."""
    frame, aim, axes, twist, dt = memory.ends[0], task.aim, task.world_axes, task.twist, memory.dt
    off, turn = memory.vectors[0], memory.vectors[1]
    for i in range(3):
        off[i] = aim[3, i] - frame[3, i] if task.is_followed != 0 else 0.0
        turn[i] = dt * (axes[0, i] * twist[3] + axes[1, i] * twist[4] + axes[2, i] * twist[5])
        turn[i] = min(max(turn[i], -FURTHEST), FURTHEST)  # so that no square overflows
    for i in range(3):
        aim[3, i] = frame[3, i] + dt * (axes[0, i] * twist[0] + axes[1, i] * twist[1] + axes[2, i] * twist[2])
        for k in range(task.translation):  # only of what is constrained
            aim[3, i] += axes[k, i] * dot(axes[k], off)
        if task.is_followed == 0 or task.rotation < 3:
            for c in range(3):
                aim[c, i] = frame[c, i]
    for c in range(3):
        off[c] = dot(aim[c], turn)
    sine, cosine = se3.sinc(dot(off, off))
    se3.turn(aim, off, sine, cosine)


@compiled
def _find_error(memory: TasksMemory, task: TaskMemory, error: Array) -> None:
    """Compute what a task has left to do, as `FrameTask.errors`; dimensionless, translations first."""
    frame, aim, axes, w = memory.ends[0], task.aim, task.world_axes, memory.vectors
    off, carried, seen, by, turn = w[0], w[1:4], w[4:7], w[7:10], w[10]
    linear, angular = task.translation, task.rotation
    for i in range(3):
        off[i] = min(max(aim[3, i], -FURTHEST), FURTHEST) - frame[3, i]
    for i in range(linear):
        error[i] = dot(axes[i], off) / memory.length
    if angular == 0:
        return
    for k in range(3):  # what would have the axes' directions if the node were at its target
        for i in range(3):
            off[i] = dot(aim[i], axes[k])
        combine(off, frame, carried[k])
    if angular == 2:
        z = carried[2]
        se3.swing(dot(axes[0], z), dot(axes[1], z), dot(axes[2], z), turn, by)
        error[linear], error[linear + 1] = -turn[0], -turn[1]
        return
    se3.relative(carried, axes, seen)
    se3.log(seen, turn)
    for i in range(angular):
        error[linear + i] = turn[3 - angular + i]


@compiled
def _find_rows(memory: TasksMemory, task: TaskMemory, weight: float, rows: Array) -> None:
    """Compute how the joints take a task's error away, as `FrameTask.equations`; right after `_find_error`."""
    p, axes, w, screws, scale = memory.ends[0, 3], task.world_axes, memory.vectors, memory.screws, memory.scale
    carried, seen, by, turn = w[1:4], w[4:7], w[7:10], w[10]
    linear, angular = task.translation, task.rotation
    if angular == 1:
        se3.log_derivative(turn, by)
        combine(by[2], carried, seen[0])
    for i in range(angular):
        if angular == 2:
            combine(by[i], axes, seen[i])
        elif angular == 3:  # the derivative of log times log itself is log: the node's own angular velocity will do
            for j in range(3):
                seen[i, j] = carried[i, j]
    for k in range(memory.n):
        if task.moved_by[k] == 0.0:
            for i in range(linear + angular):
                rows[i, k] = 0.0
            continue
        s = weight * scale[k]
        velocity, omega = screws[k], screws[k, 3:6]
        if linear > 0:
            x = velocity[0] + omega[1] * p[2] - omega[2] * p[1]
            y = velocity[1] + omega[2] * p[0] - omega[0] * p[2]
            z = velocity[2] + omega[0] * p[1] - omega[1] * p[0]
            for i in range(linear):
                rows[i, k] = s / memory.length * (axes[i, 0] * x + axes[i, 1] * y + axes[i, 2] * z)
        for i in range(angular):
            rows[linear + i, k] = s * dot(seen[i], omega)
