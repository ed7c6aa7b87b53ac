"""The equations of one tick in plain numpy: what the kernels compute, as it reads in the papers.

Slow, and the standard that the kernels are held against; and where something is counted once, such as a rank.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik.pull import Pull
from cinegen.ik.resolve import free_motions
from cinegen.ik.thresholds import ERROR_CAP
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.model import Mechanism
from raff2urdf.closure import rank

Array = NDArray[np.float64]


def axes_of(pull: Pull, mechanism: Mechanism, system: ClosedLoops) -> Array:
    """(3, 3) whose axes a pull holds, in the world; Pinocchio's placements must be up to date in the system's data."""
    if pull.axes == "target":
        return np.asarray(pull.target.rotation)
    if pull.axes == "world":
        return np.eye(3)
    frame = mechanism.frame_id(pull.axes)
    return np.asarray(pin.updateFramePlacement(mechanism.model, system.data, frame).rotation)


def equations(mechanism: Mechanism, system: ClosedLoops, pulls: Sequence[tuple[Pull, Array]]) -> tuple[Array, Array]:
    """Of all pulls after poses together, without unit: what is left to do (capped, weighted), and the rows that do it.

    Args:
        mechanism: which is pulled.
        system: whose `evaluate` has left Pinocchio's Jacobians where they are asked for.
        pulls: that make sense, each with its axes in the world (3, 3).

    Returns:
        (rows,) and (rows, nv).
    """
    model, data, length = mechanism.model, system.data, system.length
    errors, rows = [np.zeros(0)], [np.zeros((0, model.nv))]
    heaviest = max((pull.weight for pull, _ in pulls), default=1.0)  # only the weights' proportions matter
    for pull, axes in pulls:
        placement = pin.updateFramePlacement(model, data, pull.frame) * pull.at
        jacobian = np.zeros((6, model.nv))
        if model.nv:
            of_node = pin.getFrameJacobian(model, data, pull.frame, pin.ReferenceFrame.LOCAL).reshape(6, -1)
            jacobian[:] = pull.at.toActionMatrixInverse() @ of_node
        error, row = pull.equations(placement, jacobian * system.scale, axes)
        straight, turn = error[: pull.translation] / length, error[pull.translation :]
        weight = pull.weight / heaviest
        errors += [weight * _capped(straight), weight * _capped(turn)]
        rows.append(weight * units(pull, length)[:, None] * row)
    return np.concatenate(errors), np.vstack(rows)


def units(pull: Pull, length: float) -> Array:
    """(rows,) what takes the unit from each equation of a pull: the characteristic length (m) counts as 1."""
    return np.where(np.arange(pull.rows) < pull.translation, 1.0 / length, 1.0)


def pull_rank(mechanism: Mechanism, system: ClosedLoops, pulls: Sequence[Pull], moving: slice) -> int:
    """The generic rank of all pulls: a planar mechanism never moves along z, and is not singular for that.

    Args:
        mechanism: which is pulled.
        system: scratch.
        pulls: that make sense.
        moving: columns that may move.
    """
    highest = 0
    for q in mechanism.samples:
        _, loops = system.evaluate(q)
        motions, _ = free_motions(loops[:, moving], mechanism.loop_rank)
        with_axes = [(pull, axes_of(pull, mechanism, system)) for pull in pulls]
        highest = max(highest, rank(equations(mechanism, system, with_axes)[1][:, moving] @ motions))
    return highest


def _capped(error: Array) -> Array:
    largest = float(np.abs(error).max(initial=0.0))
    if largest <= 0.5 * ERROR_CAP:
        return error
    direction = error / largest  # first, so that no square overflows
    return error * min(1.0, ERROR_CAP / largest / math.hypot(*direction))
