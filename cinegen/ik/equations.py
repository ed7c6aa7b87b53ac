"""Equations of the tasks, in plain numpy.

The kernels compute the same in each tick, and are tested against this; it serves where speed does not matter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.ik.given_task import AnyTask, GivenTask, rows_of
from cinegen.ik.state import State
from cinegen.ik.task import FrameTask
from cinegen.ik.thresholds import ERROR_CAP
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.motions import motions_of
from cinegen.model import Mechanism
from raff2urdf.closure import rank


def axes_of(task: FrameTask, mechanism: Mechanism, system: ClosedLoops) -> Array:
    """Return the axes of a task in the world, (3, 3); Pinocchio's placements must be up to date in the system's
    data."""
    if task.axes == "target":
        return np.asarray(task.target.rotation)
    if task.axes == "world":
        return np.eye(3)
    frame = mechanism.frame_id(task.axes)
    return np.asarray(pin.updateFramePlacement(mechanism.model, system.data, frame).rotation)


def equations(
    mechanism: Mechanism, system: ClosedLoops, tasks: Sequence[tuple[FrameTask, Array]], weighted: bool = True
) -> tuple[Array, Array]:
    """Return the remaining errors of tasks that follow poses, capped and weighted, and their Jacobian; dimensionless.

    Args:
        mechanism: mechanism that is moved.
        system: its loops, whose `evaluate` has left Pinocchio's Jacobians at the configuration in question.
        tasks: valid tasks, each with its axes in the world (3, 3).
        weighted: use the weights of tasks and of their rows; all are 1 otherwise.

    Returns:
        errors (rows,) and Jacobian (rows, nv).
    """
    model, data, length = mechanism.model, system.data, system.length
    errors, rows = [np.zeros(0)], [np.zeros((0, model.nv))]
    heaviest = max((task.heaviest for task, _ in tasks), default=1.0)  # only the proportions of weights matter
    for task, axes in tasks:
        placement = pin.updateFramePlacement(model, data, task.frame) * task.offset
        jacobian = np.zeros((6, model.nv))
        if model.nv:
            of_node = pin.getFrameJacobian(model, data, task.frame, pin.ReferenceFrame.LOCAL).reshape(6, -1)
            jacobian[:] = task.offset.toActionMatrixInverse() @ of_node
        error, row = task.equations(placement, jacobian * system.scale, axes)
        weight, of_row = task.heaviest / heaviest, task.row_weights / task.heaviest
        if not weighted:
            weight, of_row = 1.0, np.ones(task.rows)
        linear, angular = np.split(of_row * error, [task.translation])
        errors += [weight * _capped(linear / length), weight * _capped(angular)]
        rows.append((weight * of_row * units(task, length))[:, None] * row)
    return np.concatenate(errors), np.vstack(rows)


def units(task: FrameTask, length: float) -> Array:
    """Return the factors (rows,) that make a task's equations dimensionless: the characteristic length (m) counts 1."""
    return np.where(np.arange(task.rows) < task.translation, 1.0 / length, 1.0)


def task_rank(mechanism: Mechanism, system: ClosedLoops, tasks: Sequence[AnyTask]) -> int:
    """Return the generic rank of all tasks. A planar mechanism never moves along z, and is not singular for that.

    Args:
        mechanism: mechanism that is moved.
        system: its loops; scratch.
        tasks: valid tasks.

    Raises:
        Exception: of a task in Python.
    """
    highest = 0
    for q in mechanism.structure.samples:
        motions = motions_of(system, q, mechanism.loop_rank)
        frames = [task for task in tasks if isinstance(task, FrameTask)]
        with_axes = [(task, axes_of(task, mechanism, system)) for task in frames]
        rows, state = [equations(mechanism, system, with_axes, weighted=False)[1]], State(mechanism, q, 1.0)
        rows += [rows_of(task.task, state) for task in tasks if isinstance(task, GivenTask)]
        highest = max(highest, rank(np.vstack(rows) @ motions))
    return highest


def _capped(error: Array) -> Array:
    largest = float(np.abs(error).max(initial=0.0))
    if largest <= 0.5 * ERROR_CAP:
        return error
    direction = error / largest  # first, so that no square overflows
    return error * min(1.0, ERROR_CAP / largest / math.hypot(*direction))
