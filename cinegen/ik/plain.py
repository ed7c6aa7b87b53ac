"""The equations of one tick in plain numpy: what the kernels compute, as it reads in the papers.

Slow, and the standard that the kernels are held against; and where something is counted once, such as a rank.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik.resolve import free_motions
from cinegen.ik.task import FrameTask
from cinegen.ik.thresholds import ERROR_CAP
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.model import Mechanism
from raff2urdf.closure import rank

Array = NDArray[np.float64]


def axes_of(task: FrameTask, mechanism: Mechanism, system: ClosedLoops) -> Array:
    """(3, 3) whose axes a task holds, in the world; Pinocchio's placements must be up to date in the system's data."""
    if task.axes == "target":
        return np.asarray(task.target.rotation)
    if task.axes == "world":
        return np.eye(3)
    frame = mechanism.frame_id(task.axes)
    return np.asarray(pin.updateFramePlacement(mechanism.model, system.data, frame).rotation)


def equations(
    mechanism: Mechanism, system: ClosedLoops, tasks: Sequence[tuple[FrameTask, Array]]
) -> tuple[Array, Array]:
    """Of all tasks after poses together, without unit: what is left to do (capped, weighted), and the rows that do it.

    Args:
        mechanism: which is pulled.
        system: whose `evaluate` has left Pinocchio's Jacobians where they are asked for.
        tasks: that make sense, each with its axes in the world (3, 3).

    Returns:
        (rows,) and (rows, nv).
    """
    model, data, length = mechanism.model, system.data, system.length
    errors, rows = [np.zeros(0)], [np.zeros((0, model.nv))]
    heaviest = max((task.weight for task, _ in tasks), default=1.0)  # only the weights' proportions matter
    for task, axes in tasks:
        placement = pin.updateFramePlacement(model, data, task.frame) * task.offset
        jacobian = np.zeros((6, model.nv))
        if model.nv:
            of_node = pin.getFrameJacobian(model, data, task.frame, pin.ReferenceFrame.LOCAL).reshape(6, -1)
            jacobian[:] = task.offset.toActionMatrixInverse() @ of_node
        error, row = task.equations(placement, jacobian * system.scale, axes)
        straight, turn = error[: task.translation] / length, error[task.translation :]
        weight = task.weight / heaviest
        errors += [weight * _capped(straight), weight * _capped(turn)]
        rows.append(weight * units(task, length)[:, None] * row)
    return np.concatenate(errors), np.vstack(rows)


def units(task: FrameTask, length: float) -> Array:
    """(rows,) what takes the unit from each equation of a task: the characteristic length (m) counts as 1."""
    return np.where(np.arange(task.rows) < task.translation, 1.0 / length, 1.0)


def task_rank(mechanism: Mechanism, system: ClosedLoops, tasks: Sequence[FrameTask], moving: slice) -> int:
    """The generic rank of all tasks: a planar mechanism never moves along z, and is not singular for that.

    Args:
        mechanism: which is pulled.
        system: scratch.
        tasks: that make sense.
        moving: columns that may move.
    """
    highest = 0
    for q in mechanism.samples:
        _, loops = system.evaluate(q)
        motions, _ = free_motions(loops[:, moving], mechanism.loop_rank)
        with_axes = [(task, axes_of(task, mechanism, system)) for task in tasks]
        highest = max(highest, rank(equations(mechanism, system, with_axes)[1][:, moving] @ motions))
    return highest


def _capped(error: Array) -> Array:
    largest = float(np.abs(error).max(initial=0.0))
    if largest <= 0.5 * ERROR_CAP:
        return error
    direction = error / largest  # first, so that no square overflows
    return error * min(1.0, ERROR_CAP / largest / math.hypot(*direction))
