"""Closed configurations of a design that come nearest to wanted values, by damped Newton steps among closed ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.design.design import Design
from cinegen.design.evaluation import DesignEvaluation
from raff2urdf import closure

Residual = Callable[[DesignEvaluation, Indices], tuple[Array, Array]]

_LARGEST_STEP = 0.3  # rad or characteristic lengths, of all joints in one step
_MOST_STEPS = 40
_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-9, 1e-13, 1e2
_EXACT = 1e-13
_STATIONARY = 1e-7  # gradient of a distance, in which no step comes nearer


def nearest(design: Design, p: Array, q: Array, residual: Residual) -> tuple[Array, Array, Array]:
    """Return the closed configurations (count, nq) nearest to wanted values, what is missing (count, rows), and its
    norm (count,), infinite where the loops can't be closed.

    Args:
        design: with all joints free to move.
        p: (columns,) or (count, columns) values of the parameters, m and rad.
        q: (count, nq) where to begin.
        residual: of evaluations and their indices: what is missing (n, rows), and the motions (n, rows, nv) of the
            wanted values by joints, all dimensionless.
    """
    mechanism = design.mechanism
    integrate = mechanism.structure.system.integrate
    count, q, best = len(q), q.copy(), q.copy()
    size, damping, active = np.full(count, np.inf), np.full(count, _DAMPING), np.arange(count)
    missing, slopes, bases = np.zeros((0, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0, 0))
    for step in range(_MOST_STEPS):
        evaluation = design.evaluate(p if p.ndim == 1 else p[active], q[active])
        lack, columns = residual(evaluation, active)
        null = closed_motions(design, evaluation.jacobians)
        if not step:
            missing, bases = np.zeros((count, lack.shape[1])), np.zeros((count, *null.shape[1:]))
            slopes = np.zeros((count, lack.shape[1], null.shape[2]))
        norm = np.where(evaluation.gap <= closure.CLOSED, np.linalg.norm(lack, axis=1), np.inf)
        better = norm < size[active]
        at = active[better]
        best[at], missing[at], size[at] = evaluation.q[better], lack[better], norm[better]
        slopes[at], bases[at] = columns[better] @ null[better], null[better]
        damping[active] = np.maximum(damping[active] * np.where(better, 0.1, 30.0), _LEAST_DAMPING)
        downhill = np.einsum("cri,cr->ci", slopes[active], missing[active])
        moving = np.linalg.norm(downhill, axis=1) > _STATIONARY * np.linalg.norm(missing[active], axis=1)
        going = moving & (size[active] > _EXACT) & (damping[active] < _MOST_DAMPING)
        active, downhill = active[going], downhill[going]
        if not len(active):
            break
        square = np.swapaxes(slopes[active], 1, 2) @ slopes[active]
        square += damping[active, None, None] * np.eye(square.shape[1])
        motion = (bases[active] @ np.linalg.solve(square, downhill[..., None]))[..., 0]
        largest = np.abs(motion).max(axis=1, initial=0.0)
        motion *= np.minimum(1.0, _LARGEST_STEP / np.maximum(largest, 1e-300))[:, None]
        q[active] = [integrate(a, b) for a, b in zip(best[active], motion, strict=True)]
    return best, missing, size


def closed_motions(design: Design, jacobians: Array) -> Array:
    """Return a basis (count, nv, .) of the motions that keep the loops closed, dimensionless.

    Args:
        design: with all joints free to move.
        jacobians: (count, rows, nv) of the loops, dimensionless.
    """
    if not jacobians.shape[1]:
        return np.broadcast_to(np.eye(jacobians.shape[2]), (len(jacobians), *[jacobians.shape[2]] * 2))
    return np.swapaxes(np.linalg.svd(jacobians, full_matrices=True)[2][:, design.rank :], 1, 2)
