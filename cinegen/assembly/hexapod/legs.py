"""The legs of real platforms: how long they are, how that changes, and poses at which they are as long as they should.

All for many poses at once, as 4x4 matrices; this knows nothing of Study's coordinates.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STEPS = 12  # of Newton
_DESCENTS = 40  # of Levenberg and Marquardt
_APART = 1e-5  # for a derivative
_SMALL = 1e-14  # a step that changes nothing, where points are about 1 apart


def lengths(base: Array, platform: Array, placements: Array) -> Array:
    """(n, 6) at placements (n, 4, 4)."""
    return np.asarray(np.linalg.norm(_rods(base, platform, placements)[0], axis=2))


def jacobian(base: Array, platform: Array, placements: Array) -> Array:
    """(n, 6, 6) lengths by a motion of the platform: a velocity of its origin, then a rotation, in the base's axes."""
    rods, arms = _rods(base, platform, placements)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.nan_to_num(rods / np.linalg.norm(rods, axis=2)[:, :, None])
    return np.concatenate([along, np.cross(arms, along)], axis=2)


def refine(base: Array, platform: Array, asked: Array, placements: Array, least: Array) -> tuple[Array, Array]:
    """Newton's method from placements (n, 4, 4) to where legs are as long as asked (6,).

    Args:
        base: (6, 3).
        platform: (6, 3).
        asked: (6,) lengths.
        placements: (n, 4, 4).
        least: (n,) singular values below this part of the largest count as 0: a direction in which a multiple solution
            does not move.

    Returns:
        placements (n, 4, 4) and the length of the last step (n,).
    """
    here, last = placements.copy(), np.full(len(placements), np.inf)
    for _ in range(_STEPS):
        u, sigma, vt = np.linalg.svd(jacobian(base, platform, here))
        counts = sigma > least[:, None] * sigma[:, :1]
        inverse = np.where(counts, 1.0 / np.where(counts, sigma, 1.0), 0.0)
        missing = asked - lengths(base, platform, here)
        motion = np.einsum("nji,nj->ni", vt, inverse * np.einsum("nji,nj->ni", u, missing))
        size = np.linalg.norm(motion, axis=1)
        better = size < last
        if not better.any():
            break
        here = np.where(better[:, None, None], moved(here, motion), here)
        last = np.where(better, size, last)
        if (last <= _SMALL).all():
            break
    return here, last


def nearest(base: Array, platform: Array, asked: Array, placements: Array) -> Array:
    """(4, 4) the pose with the smallest sum of squares of what legs miss, found by going down from each of these."""
    here = placements
    damping = np.full(len(here), 1e-3)
    miss = lengths(base, platform, here) - asked
    cost = (miss**2).sum(axis=1)
    for _ in range(_DESCENTS):
        j = jacobian(base, platform, here)
        square = np.swapaxes(j, 1, 2) @ j + damping[:, None, None] * np.eye(6)
        motion = np.linalg.solve(square, np.swapaxes(j, 1, 2) @ miss[:, :, None])[:, :, 0]
        there = moved(here, -np.asarray(motion, dtype=float))
        its = lengths(base, platform, there) - asked
        better = (its**2).sum(axis=1) < cost
        here = np.where(better[:, None, None], there, here)
        miss = np.where(better[:, None], its, miss)
        cost = (miss**2).sum(axis=1)
        damping = np.clip(np.where(better, 0.1 * damping, 10.0 * damping), 1e-12, 1e6)
    best = here[[np.argmin(cost)]]
    # where much is missing these steps come near only slowly: the last way is Newton's, to where the slope is 0
    slope = _slope(base, platform, asked, best)[0]
    for _ in range(_STEPS):
        around = moved(np.repeat(best, 12, axis=0), _APART * np.vstack([np.eye(6), -np.eye(6)]))
        slopes = _slope(base, platform, asked, around)
        curvature = (slopes[:6] - slopes[6:]).T / (2.0 * _APART)
        there = moved(best, -np.linalg.lstsq(curvature, slope, rcond=None)[0][None])
        its = _slope(base, platform, asked, there)[0]
        if not np.linalg.norm(its) < np.linalg.norm(slope):
            break
        best, slope = there, its
    return np.asarray(best[0])


def _slope(base: Array, platform: Array, asked: Array, placements: Array) -> Array:
    """(n, 6) half the derivatives of the sum of squares."""
    missing = lengths(base, platform, placements) - asked
    return np.asarray(np.einsum("nij,ni->nj", jacobian(base, platform, placements), missing))


def moved(placements: Array, motion: Array) -> Array:
    """(n, 4, 4) after motions (n, 6), by Rodrigues' formula."""
    turn = motion[:, 3:]
    angle = np.linalg.norm(turn, axis=1)[:, None, None]
    cross = np.zeros((len(turn), 3, 3))
    cross[:, [2, 0, 1], [1, 2, 0]], cross[:, [1, 2, 0], [2, 0, 1]] = turn, -turn
    rotation = np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(0.5 * angle / np.pi) ** 2 * cross @ cross
    found = placements.copy()
    found[:, :3, :3] = rotation @ placements[:, :3, :3]
    found[:, :3, 3] += motion[:, :3]
    return found


def _rods(base: Array, platform: Array, placements: Array) -> tuple[Array, Array]:
    """(n, 6, 3) each leg from base to platform, and (n, 6, 3) the platform's points from its origin, in base's axes."""
    arms = platform @ np.swapaxes(placements[:, :3, :3], 1, 2)
    return arms + placements[:, None, :3, 3] - base, arms
