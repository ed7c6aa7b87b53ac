"""Six legs between base and platform: their lengths, how these change, and placements with given lengths.

All for many placements at once, as 4x4 matrices, in plain numpy.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from cinegen.arrays import Array, ArrayLike
from cinegen.errors import CinegenError

_NEWTON_STEPS = 12
_DESCENT_STEPS = 40  # of Levenberg and Marquardt
_SMALL = 1e-14  # a step without effect, where points are about 1 apart


class HexapodError(CinegenError):
    """Geometry or leg lengths that have no assembly modes to compute; the message names them."""


def checked_points(name: str, values: ArrayLike) -> Array:
    """Return points as a read-only array (6, 3).

    Raises:
        HexapodError: another shape, or not finite.
    """
    points = np.array(values, dtype=float)
    if points.shape != (6, 3):
        raise HexapodError(f"the {name} must be (6, 3), one point in each row, not {points.shape}")
    if not np.isfinite(points).all():
        raise HexapodError(f"a point of the {name} is not finite")
    points.setflags(write=False)
    return points


def checked_lengths(values: ArrayLike) -> Array:
    """Return leg lengths as an array (6,).

    Raises:
        HexapodError: another shape, or not positive and finite; names the leg.
    """
    lengths = np.array(values, dtype=float)
    if lengths.shape != (6,):
        raise HexapodError(f"lengths must be (6,), one for each leg, not {lengths.shape}")
    for leg in np.flatnonzero(~(np.isfinite(lengths) & (lengths > 0.0)))[:1]:
        raise HexapodError(f"the length of leg {leg + 1} is {lengths[leg]:g}; it must be positive and finite")
    return lengths


def leg_lengths(base: Array, platform: Array, placements: Array) -> Array:
    """Return the leg lengths (..., 6) at placements (..., 4, 4), for points (6, 3) of base and platform."""
    return np.asarray(np.linalg.norm(_legs(base, platform, placements)[0], axis=-1))


def leg_jacobian(base: Array, platform: Array, placements: Array) -> Array:
    """Return the derivative (n, 6, 6) of leg lengths by a motion of the platform: velocity of its origin, then angular
    velocity, in the base's axes."""
    legs, arms = _legs(base, platform, placements)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.nan_to_num(legs / np.linalg.norm(legs, axis=2)[:, :, None])
    return np.concatenate([along, np.cross(arms, along)], axis=2)


def refine(base: Array, platform: Array, lengths: Array, placements: Array, cutoff: ArrayLike) -> tuple[Array, Array]:
    """Apply Newton's method from placements (n, 4, 4) to where legs have given lengths.

    Args:
        base: (6, 3).
        platform: (6, 3).
        lengths: (6,) or (n, 6).
        placements: (n, 4, 4).
        cutoff: (n,) singular values below this part of the largest count as 0: a direction in which a multiple solution
            does not move.

    Returns:
        placements (n, 4, 4) and the length of the last step (n,).
    """
    refined, last = placements.copy(), np.full(len(placements), np.inf)
    for _ in range(_NEWTON_STEPS):
        u, sigma, vt = np.linalg.svd(leg_jacobian(base, platform, refined))
        counts = sigma > np.asarray(cutoff)[:, None] * sigma[:, :1]
        inverse = np.where(counts, 1.0 / np.where(counts, sigma, 1.0), 0.0)
        missing = lengths - leg_lengths(base, platform, refined)
        motion = np.einsum("nji,nj->ni", vt, inverse * np.einsum("nji,nj->ni", u, missing))
        size = np.linalg.norm(motion, axis=1)
        better = size < last
        refined = np.where(better[:, None, None], moved_by(refined, motion), refined)
        last = np.where(better, size, last)
        if not better.any() or (last <= _SMALL).all():
            break
    return refined, last


def nearest(base: Array, platform: Array, lengths: Array, starts: Array) -> Array:
    """Return the placement (4, 4) with the least sum of squared length errors that descent from starts (n, 4, 4)
    reaches: Levenberg and Marquardt's method, then Powell's on the slope."""
    current, damping = starts, np.full(len(starts), 1e-3)
    error = leg_lengths(base, platform, current) - lengths
    for _ in range(_DESCENT_STEPS):
        j = leg_jacobian(base, platform, current)
        square = np.swapaxes(j, 1, 2) @ j + damping[:, None, None] * np.eye(6)
        motion = np.linalg.solve(square, np.swapaxes(j, 1, 2) @ error[:, :, None])[:, :, 0]
        moved = moved_by(current, -np.asarray(motion, dtype=float))
        other = leg_lengths(base, platform, moved) - lengths
        better = (other**2).sum(axis=1) < (error**2).sum(axis=1)
        current = np.where(better[:, None, None], moved, current)
        error = np.where(better[:, None], other, error)
        damping = np.clip(np.where(better, 0.1 * damping, 10.0 * damping), 1e-12, 1e6)
    best = current[[np.argmin((error**2).sum(axis=1))]]

    def slope(motion: Array) -> Array:
        return np.asarray(_slope(base, platform, lengths, moved_by(best, motion[None]))[0])

    further: Array = root(slope, np.zeros(6), tol=_SMALL).x
    better_still = np.linalg.norm(slope(further)) < np.linalg.norm(slope(np.zeros(6)))
    return np.asarray(moved_by(best, further[None])[0] if better_still else best[0])


def _slope(base: Array, platform: Array, lengths: Array, placements: Array) -> Array:
    """Return half the derivatives (n, 6) of the sum of squared length errors."""
    error = leg_lengths(base, platform, placements) - lengths
    return np.asarray(np.einsum("nij,ni->nj", leg_jacobian(base, platform, placements), error))


def moved_by(placements: Array, motion: Array) -> Array:
    """Return placements (n, 4, 4) after motions (n, 6): a shift, then a rotation vector."""
    moved = placements.copy()
    moved[:, :3, :3] = Rotation.from_rotvec(motion[:, 3:]).as_matrix() @ placements[:, :3, :3]
    moved[:, :3, 3] += motion[:, :3]
    return moved


def _legs(base: Array, platform: Array, placements: Array) -> tuple[Array, Array]:
    """Return each leg (..., 6, 3) from base to platform, and the platform points (..., 6, 3) from its origin, in the
    base's axes."""
    arms = platform @ np.swapaxes(placements[..., :3, :3], -1, -2)
    return arms + placements[..., None, :3, 3] - base, arms
