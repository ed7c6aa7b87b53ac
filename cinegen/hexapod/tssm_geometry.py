"""Geometry of a platform of three points on six legs: circles of its points, and checks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, ArrayLike, Integers
from cinegen.hexapod.legs import HexapodError

THIN = 1e-9  # of their size: points in a line, or coincident


class PlatformCircles(NamedTuple):
    """Circles on which two legs of known lengths leave the platform points, the largest first, for m sets of lengths.

    Equations 7 and 8: a point is at centre + radius (cos p e + sin p f).

    Attributes:
        centre: (m, 3, 3).
        e: (m, 3, 3) unit vectors; e = u x f, with u from the base point of the leg with the lower number to the other.
        f: (m, 3, 3) unit vectors: `TSSM.up` as far as it is normal to u.
        radius: (m, 3).
        point: (m, 3) which platform point is on it.
    """

    centre: Array
    e: Array
    f: Array
    radius: Array
    point: Integers


def dot(x: Array, y: Array) -> Array:
    """Return scalar products (...,) of vectors (..., 3)."""
    return np.asarray((x * y).sum(axis=-1))


def points_of(platform: Array, placements: Array) -> Array:
    """Return the platform points (n, 3, 3) in the base frame."""
    return np.asarray(platform @ np.swapaxes(placements[:, :3, :3], 1, 2) + placements[:, None, :3, 3])


def normal_part(up: Array, u: Array) -> Array:
    """Return a unit vector normal to u, along `up` as far as possible."""
    f = up - (up @ u) * u
    if np.linalg.norm(f) < 1e-3:
        other = np.eye(3)[np.argmin(np.abs(u))]
        f = other - (other @ u) * u
    return np.asarray(f / np.linalg.norm(f))


def checked_legs(values: ArrayLike) -> Integers:
    """Return the number of the platform's point of each leg (6,), two legs for each point.

    Raises:
        HexapodError: it is another distribution.
    """
    legs = np.array(values)
    if legs.shape != (6,) or sorted(legs.tolist()) != [0, 0, 1, 1, 2, 2]:
        raise HexapodError(f"legs are {values!r}; give the platform point of each of six, and 0, 1 and 2 twice each")
    legs = legs.astype(np.int64)
    legs.setflags(write=False)
    return legs


def check_geometry(base: Array, platform: Array, legs: Integers) -> None:
    """Check that no points coincide that must differ.

    Raises:
        HexapodError: they do.
    """
    size = float(np.abs(platform - platform.mean(axis=0)).max())
    for i, j in ((0, 1), (0, 2), (1, 2)):
        if np.linalg.norm(platform[j] - platform[i]) <= THIN * size:
            raise HexapodError(f"platform points {i} and {j} are the same: move one of them")
    if np.linalg.svd(platform - platform.mean(axis=0), compute_uv=False)[1] <= THIN * size:
        raise HexapodError("the platform points lie in a line, about which it can rotate: move one out of it")
    sigma = np.linalg.svd(base - base.mean(axis=0), compute_uv=False)
    for point in range(3):
        first, second = np.flatnonzero(legs == point)
        if np.linalg.norm(base[second] - base[first]) <= THIN * sigma[0]:
            raise HexapodError(
                f"legs {first + 1} and {second + 1}, both to platform point {point}, begin at the same base point: "
                "move one of them"
            )
    if sigma[1] <= THIN * sigma[0]:
        raise HexapodError("the base points lie in a line, about which the platform can rotate: move one out of it")
