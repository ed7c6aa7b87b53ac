"""Errors and rows of the tasks in a tick: `FrameTask.equations`, compiled."""

from __future__ import annotations

import math

from cinegen.ik._kernels.memory import OF_NODE, OF_WORLD, TaskMemory, TasksMemory, task_at
from cinegen.ik.thresholds import ERROR_CAP, ROTATION
from cinegen.jit import se3
from cinegen.jit.compiled import Array, compiled, inlined
from cinegen.jit.foreign import frame_at
from cinegen.jit.se3 import combine, compose, dot
from cinegen.jit.vectors import copy

_SAME = 1e-13  # rad or lengths: rounding of an error that is evaluated twice
FURTHEST = 1e100  # m: targets are clipped to this, so that no square overflows


@compiled
def is_rotation(target: Array) -> bool:
    """Return whether the first three rows of a frame (4, 3) are right-handed, orthogonal and of length 1."""
    x, y, z = target[0], target[1], target[2]
    for i in range(3):
        for j in range(i + 1):
            if not abs(dot(target[i], target[j]) - (1.0 if i == j else 0.0)) <= ROTATION:
                return False
    across = (x[1] * y[2] - x[2] * y[1]) * z[0] + (x[2] * y[0] - x[0] * y[2]) * z[1]
    return bool(across + (x[0] * y[1] - x[1] * y[0]) * z[2] > 0.0)


@compiled
def read_tasks(memory: TasksMemory) -> bool:
    """Read which tasks are valid. Return False if their rank is not known."""
    signature = 0
    for level in range(memory.levels):
        memory.heaviest[level] = 0.0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        good = task.is_valid != 0
        if good and task.python_rows == 0:
            target = frame_at(task.target)
            for c in range(4):
                for k in range(3):
                    good = good and math.isfinite(target[c, k])
            good = good and is_rotation(target)
        task.is_active = 1 if good else 0
        if good:
            signature |= 1 << (i % 62)
            memory.heaviest[task.level] = max(memory.heaviest[task.level], task.weight)
    if signature != memory.signature:
        memory.signature = signature
        return False
    return True


@compiled
def aim_tasks(memory: TasksMemory) -> bool:
    """Compute the target of each task in this tick, its error and rows. Return whether no target has moved."""
    row, still = 0, True
    error, wanted = memory.error, memory.wanted
    memory.lightest = 1.0
    for level in range(memory.levels):
        memory.level_end[level] = 0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        if task.is_active == 0:
            continue
        if task.python_rows > 0:
            is_still = _is_unmoved(task)
            copy(task.given_error, error[row:], task.python_rows)
        else:
            is_still = _aim(memory, task)
            _find_error(memory, task, error[row:])
        still = still and (is_still or task.level > 0)
        for k in range(task.translation + task.rotation):
            memory.row_weights[row + k] = task.weight / memory.heaviest[task.level] * task.row_weight[k]
            if task.level == 0:
                memory.lightest = min(memory.lightest, memory.row_weights[row + k])
        if task.python_rows > 0:
            _take_rows(memory, task, row)
        else:
            _find_rows(memory, task, memory.row_weights[row:], memory.task_jacobian[row:])
        measure(task, error[row:], memory.length)
        gain = 1.0 if task.is_twist != 0 else memory.gain
        linear = gain * min(1.0, ERROR_CAP / max(task.linear, 1e-300))
        angular = gain * min(1.0, ERROR_CAP / max(task.angular, 1e-300))
        for k in range(task.translation + task.rotation):
            wanted[row + k] = (
                memory.row_weights[row + k] * error[row + k] * (linear if k < task.translation else angular)
            )
        row += task.translation + task.rotation
        memory.level_end[task.level] = row
        task.is_still = 1 if is_still else 0
    for level in range(1, memory.levels):
        memory.level_end[level] = max(memory.level_end[level], memory.level_end[level - 1])
    memory.active_rows = memory.level_end[0]
    return still


@compiled
def _aim(memory: TasksMemory, task: TaskMemory) -> bool:
    """Compute the target and the axes of a task in this tick; its frame becomes ends[0]. Return whether the target has
    not moved."""
    compose(memory.frames[task.joint], task.offset, memory.ends[0])
    target = frame_at(task.target)
    _find_axes(memory, task, target)
    if task.is_twist != 0:
        _advance(memory, task)
        return False
    still = True
    for c in range(4):
        for k in range(3):
            still = still and task.aim[c, k] == target[c, k]
            task.aim[c, k] = target[c, k]
    return still


@compiled
def _is_unmoved(task: TaskMemory) -> bool:
    """Return whether a task whose error Python gives has the same as at the end of the last tick, where the mechanism
    still is: its target has not moved, then."""
    still = True
    for k in range(task.python_rows):
        still = still and abs(task.given_error[k] - task.kept_error[k]) <= _SAME
    copy(task.given_error, task.kept_error, task.python_rows)
    return still


@compiled
def _take_rows(memory: TasksMemory, task: TaskMemory, row: int) -> None:
    """Write the rows that Python gives, weighted, from `row` on."""
    for k in range(task.python_rows):
        for j in range(memory.n):
            memory.task_jacobian[row + k, j] = memory.row_weights[row + k] * task.given_rows[k, j]


@compiled
def tasks_left(memory: TasksMemory, level: int) -> float:
    """Return the cost of a level whose gradient the capped errors are: half the squared error up to the cap, linear
    beyond (Huber), from the distances in the tasks."""
    total = 0.0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        if task.is_active != 0 and task.level == level:
            weight = task.weight / memory.heaviest[level]
            a, b = min(task.linear, ERROR_CAP), min(task.angular, ERROR_CAP)
            total += weight * weight * (a * (task.linear - 0.5 * a) + b * (task.angular - 0.5 * b))
    return total


@compiled
def try_tasks(memory: TasksMemory) -> float:
    """Return `tasks_left` of the first level at the present frames of the joints; all errors are written to
    `trial_error`."""
    row = 0
    for i in range(memory.tasks):
        task = task_at(memory.task_handles[i])
        if task.is_active != 0:
            if task.python_rows > 0:
                copy(task.given_error, memory.trial_error[row:], task.python_rows)
            else:
                compose(memory.frames[task.joint], task.offset, memory.ends[0])
                _find_error(memory, task, memory.trial_error[row:])
            measure(task, memory.trial_error[row:], memory.length)
            row += task.translation + task.rotation
    return tasks_left(memory, 0)


@compiled
def measure(task: TaskMemory, error: Array, length: float) -> None:
    """Set `distance` (m) and `angle` (rad) of a dimensionless error, and the same weighted, without squares that
    overflow."""
    largest, total, weighted = 0.0, 0.0, 0.0
    for k in range(task.translation):
        largest = max(largest, abs(error[k]))
    if largest > 0.0:
        for k in range(task.translation):
            part = error[k] / largest
            total += part * part
            weighted += part * part * task.row_weight[k] * task.row_weight[k]
    task.distance, task.linear = largest * math.sqrt(total) * length, largest * math.sqrt(weighted)
    total, weighted = 0.0, 0.0
    for k in range(task.translation, task.translation + task.rotation):
        total += error[k] * error[k]
        weighted += error[k] * error[k] * task.row_weight[k] * task.row_weight[k]
    task.angle, task.angular = math.sqrt(total), math.sqrt(weighted)


# --- one task -------------------------------------------------------------------------------------------------------
# Its frame is ends[0]. Vectors 1 to 3 are the axes as the node carries them, 7 to 9 the derivative of its rotation, 10
# the rotation vector: rows use them.


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
    """Advance the target of a twist: from that of the last tick if it was reached, else from the pose of the node. So
    there is no drift while the twist is followed, and no windup while it is not."""
    frame, aim, axes, twist, dt = memory.ends[0], task.aim, task.world_axes, task.twist, memory.dt
    off, turn = memory.vectors[0], memory.vectors[1]
    for i in range(3):
        off[i] = aim[3, i] - frame[3, i] if task.is_followed != 0 else 0.0
        turn[i] = dt * (axes[0, i] * twist[3] + axes[1, i] * twist[4] + axes[2, i] * twist[5])
        turn[i] = min(max(turn[i], -FURTHEST), FURTHEST)  # so that no square overflows
    for i in range(3):
        aim[3, i] = frame[3, i] + dt * (axes[0, i] * twist[0] + axes[1, i] * twist[1] + axes[2, i] * twist[2])
        for k in range(task.translation):  # constrained axes only
            axis = axes[task.row_axis[k]]
            aim[3, i] += axis[i] * dot(axis, off)
        if task.is_followed == 0 or task.rotation < 3:
            for c in range(3):
                aim[c, i] = frame[c, i]
    for c in range(3):
        off[c] = dot(aim[c], turn)
    sine, cosine = se3.sinc(dot(off, off))
    se3.turn(aim, off, sine, cosine)


@compiled
def _find_error(memory: TasksMemory, task: TaskMemory, error: Array) -> None:
    """Compute the error of a task, as `FrameTask.errors`; dimensionless, translations first."""
    frame, aim, axes, w = memory.ends[0], task.aim, task.world_axes, memory.vectors
    off, carried, seen, by, turn = w[0], w[1:4], w[4:7], w[7:10], w[10]
    linear, angular = task.translation, task.rotation
    for i in range(3):
        off[i] = min(max(aim[3, i], -FURTHEST), FURTHEST) - frame[3, i]
    for i in range(linear):
        error[i] = dot(axes[task.row_axis[i]], off) / memory.length
    if angular == 0:
        return
    for k in range(3):  # these have the directions of the axes if the node is at its target
        for i in range(3):
            off[i] = dot(aim[i], axes[k])
        combine(off, frame, carried[k])
    if angular == 2:
        x, y = task.row_axis[linear] - 3, task.row_axis[linear + 1] - 3
        z = carried[3 - x - y]
        se3.swing(dot(axes[x], z), dot(axes[y], z), dot(axes[3 - x - y], z), turn, by)
        error[linear], error[linear + 1] = -turn[0], -turn[1]
        return
    se3.relative(carried, axes, seen)
    se3.log(seen, turn)
    for i in range(angular):
        error[linear + i] = turn[task.row_axis[linear + i] - 3]


@compiled
def _find_rows(memory: TasksMemory, task: TaskMemory, weights: Array, rows: Array) -> None:
    """Compute the rows of a task, as `FrameTask.equations`; directly after `_find_error`."""
    p, axes, seen, screws, scale = memory.ends[0, 3], task.world_axes, memory.vectors[4:7], memory.screws, memory.scale
    linear, angular = task.translation, task.rotation
    _find_turning(task, memory.vectors)
    for k in range(memory.n):
        if task.moved_by[k] == 0.0:
            for i in range(linear + angular):
                rows[i, k] = 0.0
            continue
        s = scale[k]
        if linear > 0:
            x, y, z = se3.velocity_at(screws[k], p)
            for i in range(linear):
                axis = axes[task.row_axis[i]]
                rows[i, k] = weights[i] * s / memory.length * (axis[0] * x + axis[1] * y + axis[2] * z)
        for i in range(angular):
            rows[linear + i, k] = weights[linear + i] * s * dot(seen[i], screws[k, 3:6])


@inlined
def _find_turning(task: TaskMemory, w: Array) -> None:
    """Write the derivative of a task's rotational error by the angular velocity of its node to vectors 4 to 6, a vector
    for each component: B C, with the derivative B of the rotation vector and the axes C as the node carries them."""
    axes, carried, seen, by, turn = task.world_axes, w[1:4], w[4:7], w[7:10], w[10]
    linear, angular = task.translation, task.rotation
    if angular == 2:
        x, y = task.row_axis[linear] - 3, task.row_axis[linear + 1] - 3
        for i in range(2):
            for j in range(3):
                seen[i, j] = by[i, 0] * axes[x, j] + by[i, 1] * axes[y, j] + by[i, 2] * axes[3 - x - y, j]
    elif angular == 3 and task.is_even != 0:  # log's derivative times log is log: the node's angular velocity will do
        for i in range(3):
            copy(carried[i], seen[i], 3)
    elif angular > 0:
        se3.log_derivative(turn, by)
        for i in range(angular):
            combine(by[task.row_axis[linear + i] - 3], carried, seen[i])
