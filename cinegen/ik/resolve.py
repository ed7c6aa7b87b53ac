"""The linear algebra of one tick, lexicographic: loops exactly, joint limits exactly, tasks as well as possible.

Everything is without unit. This is the plain statement of the mathematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.damping import damping
from cinegen.ik.thresholds import RESTING

Array = NDArray[np.float64]

_TOUCH = 1e-12  # rad: a step that ends this little beyond a bound ends on it


@dataclass(frozen=True, slots=True)
class Resolution:
    """Attributes:
    step: (nv,) the joint step.
    sigma: singular values of the tasks on the motions that the loops leave, largest first.
    loop_sigma: singular values of the loops, as many as their generic rank.
    frozen: columns whose bound holds the step back; they end on it.
    """

    step: Array
    sigma: Array
    loop_sigma: Array
    frozen: tuple[int, ...]


def free_motions(loops: Array, rank: int) -> tuple[Array, Array]:
    """(nv, nv - rank) orthonormal basis of the motions that keep all loops closed, and the loops' singular values.

    The width is the generic mobility: near a type 2 singularity, where the loops lose a rank, it does not flicker.
    """
    if rank == 0:
        return np.eye(loops.shape[1]), np.zeros(0)
    _, sigma, vt = np.linalg.svd(loops, full_matrices=True)
    return vt[rank:].T, sigma[:rank]


def resolve(loops: Array, rank: int, tasks: Array, task_rank: int, error: Array, low: Array, high: Array) -> Resolution:
    """The step that does most for the tasks while every loop stays closed and every joint within its bounds.

    In the coordinates y of the free motions V, with the SVD A = tasks V = U S W^T, the step minimises

        |A y - error|^2 + sum_i damping_i (w_i . y)^2    subject to    low <= V y <= high,

    with no damping at all where singular values are large, and `RESTING` for motions that no task asks for. With
    x_i = h_i (w_i . y), h_i^2 = s_i^2 + damping_i, that is the point x of a polyhedron that is nearest to
    b_i = (s_i / h_i) u_i . error. A joint frozen on its bound is
    let go again as soon as that helps.

    Args:
        loops: (rows, nv) Jacobian of the loops.
        rank: its generic rank.
        tasks: (k, nv) Jacobian of all tasks, weighted.
        task_rank: the generic rank of the tasks on the free motions.
        error: (k,) what they want.
        low: (nv,) lowest step of each joint, at most 0.
        high: (nv,) highest, at least 0.
    """
    motions, loop_sigma = free_motions(loops, rank)
    width = motions.shape[1]
    if width == 0 or len(error) == 0:
        return Resolution(np.zeros(len(low)), np.zeros(0), loop_sigma, ())
    u, sigma, wt = np.linalg.svd(tasks @ motions, full_matrices=True)
    sigmas, along = np.zeros(width), np.zeros(width)  # motions that no task asks for have singular value 0
    used = min(len(sigma), width)
    sigmas[:used], along[:used] = sigma[:used], (u.T @ error)[:used]
    squared = sigmas**2 + damping(sigmas, float(np.linalg.norm(error)))
    squared[task_rank:] = RESTING  # what no task asks for stays still, unless a limit needs it
    scale = np.sqrt(squared)
    wanted = sigmas / scale * along
    joints = motions @ wt.T / scale  # (nv, width): what x does to the joints
    x, frozen = _nearest(wanted, joints, low, high)
    step = joints @ x
    return Resolution(step * _within(step, low, high), sigma, loop_sigma, frozen)


def _nearest(wanted: Array, joints: Array, low: Array, high: Array) -> tuple[Array, tuple[int, ...]]:
    """The point x nearest to `wanted` with low <= joints x <= high, and the joints whose bounds it is held by.

    Least distance programming by non-negative least squares (C. L. Lawson and R. J. Hanson, "Solving least squares
    problems", 1974, chapter 23).
    """
    step = joints @ wanted
    if (step <= high + _TOUCH).all() and (step >= low - _TOUCH).all():
        return wanted, ()
    upper, lower = np.flatnonzero(np.isfinite(high)), np.flatnonzero(np.isfinite(low))
    owner = np.concatenate([upper, lower])
    sides = np.concatenate([-joints[upper], joints[lower]])  # sides (x - wanted) >= least
    least = np.concatenate([step[upper] - high[upper], low[lower] - step[lower]])
    target = np.zeros(len(wanted) + 1)
    target[-1] = 1.0
    try:
        from scipy.optimize import nnls  # slow to import, and no tick comes here

        multipliers, _ = nnls(np.vstack([sides.T, least]), target)
    except RuntimeError:  # too many iterations: no step is a safe one
        return np.zeros_like(wanted), tuple(sorted({int(j) for j in owner[least > 0.0]}))
    held = np.flatnonzero(multipliers > 0.0)
    # the same point again, from the bounds that hold it: to rounding
    move = np.linalg.lstsq(sides[held], least[held], rcond=1e-10)[0]
    return wanted + move, tuple(sorted({int(j) for j in owner[held]}))


def _within(step: Array, low: Array, high: Array) -> float:
    """The largest part of the step, from 0 to 1, that stays within all bounds (to `_TOUCH`)."""
    up = step > high + _TOUCH
    down = step < low - _TOUCH
    parts = np.concatenate([high[up] / step[up], low[down] / step[down]])
    return float(min(1.0, parts.min(initial=1.0)))
