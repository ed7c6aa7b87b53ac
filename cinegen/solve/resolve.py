"""The linear algebra of one tick, lexicographic: loops exactly, joint limits exactly, pulls as well as possible.

Everything is without unit. This is the plain statement of the mathematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.solve.damping import damped_solution

Array = NDArray[np.float64]

_TOUCH = 1e-12  # rad: a step that ends this little beyond a bound ends on it
_HELD = 1e-9  # a joint that the free motions move less than this can't be steered by them


@dataclass(frozen=True, slots=True)
class Resolution:
    """Attributes:
    step: (nv,) the joint step.
    sigma: singular values of the pulls on the motions that the loops leave, largest first.
    loop_sigma: singular values of the loops, as many as their generic rank.
    frozen: columns that end their step on a bound.
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


def resolve(loops: Array, rank: int, pulls: Array, error: Array, low: Array, high: Array) -> Resolution:
    """The step that does most for the pulls while every loop stays closed and every joint within its bounds.

    Joints that would go beyond a bound are frozen, one after the other, so that they end on it; the rest is solved
    again in what that leaves. What can't be had that way is had by a shorter step along the same line.

    Args:
        loops: (rows, nv) Jacobian of the loops.
        rank: its generic rank.
        pulls: (k, nv) Jacobian of all pulls, weighted.
        error: (k,) what they want.
        low: (nv,) lowest step of each joint, at most 0.
        high: (nv,) highest, at least 0.
    """
    motions, loop_sigma = free_motions(loops, rank)
    reduced = pulls @ motions
    frozen = [int(j) for j in np.flatnonzero(low == high)]
    bounds = [float(low[j]) for j in frozen]
    first_sigma: Array | None = None
    while True:
        begin, rest = _held(motions, frozen, np.array(bounds))
        y, sigma = damped_solution(reduced @ rest, error - reduced @ begin)
        first_sigma = sigma if first_sigma is None else first_sigma
        step = motions @ (begin + rest @ y)
        beyond = np.maximum(step - high, low - step)
        beyond[frozen] = 0.0
        worst = int(np.argmax(beyond)) if len(beyond) else 0
        if not len(beyond) or beyond[worst] <= _TOUCH or rest.shape[1] == 0:
            break
        frozen.append(worst)
        bounds.append(float(high[worst] if step[worst] > 0.0 else low[worst]))
    return Resolution(step * _within(step, low, high), first_sigma, loop_sigma, tuple(frozen))


def _held(motions: Array, frozen: list[int], bounds: Array) -> tuple[Array, Array]:
    """In the coordinates of `motions`: the least one that brings the frozen joints to their bounds, and a basis of
    those that leave them alone."""
    width = motions.shape[1]
    if not frozen:
        return np.zeros(width), np.eye(width)
    u, sigma, vt = np.linalg.svd(motions[frozen], full_matrices=True)
    rank = int(np.count_nonzero(sigma > _HELD))
    return vt[:rank].T @ ((u.T @ bounds)[:rank] / sigma[:rank]), vt[rank:].T


def _within(step: Array, low: Array, high: Array) -> float:
    """The largest part of the step, from 0 to 1, that stays within all bounds (to `_TOUCH`)."""
    up = step > high + _TOUCH
    down = step < low - _TOUCH
    parts = np.concatenate([high[up] / step[up], low[down] / step[down]])
    return float(min(1.0, parts.min(initial=1.0)))
