"""How fast a node can move along a direction, and how strongly it can push, with motors that are limited."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SINGULAR = 1e-12


def fastest(jacobians: Array, along: Array, limits: Array) -> Array:
    """Return (n,) the largest u . J w in m/s, for speeds w of the motors within their limits.

    It is the largest component of the node's velocity along u: the node may move sideways and rotate meanwhile. NaN
    where motors don't determine the velocity.

    Args:
        jacobians: (n, 6, motors) in the node's own axes, m/s and rad/s.
        along: (n, 3) unit vectors u in these axes.
        limits: (motors,) rad/s and m/s.
    """
    return _by_motors(jacobians, along) @ limits


def strongest(jacobians: Array, along: Array, limits: Array) -> Array:
    """Return (n,) the largest f in N for which efforts of the motors within their limits hold f u, |J^T u| f <= limits.

    Infinite where the structure bears it alone; NaN where motors don't determine the node's velocity.

    Args:
        jacobians: (n, 6, motors) in the node's own axes.
        along: (n, 3) unit vectors u in these axes.
        limits: (motors,) N m and N.
    """
    efforts = _by_motors(jacobians, along)
    with np.errstate(divide="ignore", invalid="ignore"):
        forces = np.where(efforts > _SINGULAR, limits / efforts, np.inf).min(axis=1)
    return np.where(np.isfinite(efforts).all(axis=1), forces, np.nan)


def _by_motors(jacobians: Array, along: Array) -> Array:
    """Return |J^T u| (n, motors); NaN in each row that is not finite."""
    with np.errstate(invalid="ignore"):
        found = np.abs((jacobians[:, :3].transpose(0, 2, 1) @ along[:, :, None])[:, :, 0])
    return np.where(np.isfinite(found).all(axis=1, keepdims=True), found, np.nan)
