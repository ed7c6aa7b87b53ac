"""How fast a node can move along a direction, and how strongly it can push, with motors that are limited."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from cinegen.study.maps.survey import Survey

Array = NDArray[np.float64]

_SINGULAR = 1e-12


def fastest(jacobians: Array, along: Array, survey: Survey, limits: Array) -> Array:
    """(n,) m/s: the largest speed s with s u = J w, for speeds w of the motors within their limits.

    Nothing else of the node that counts moves meanwhile. With as many motors as that takes there is one w for each s;
    with more, the best is a linear programme (F-T. Cheng, T-H. Chen and Y-Y. Sun, 1994).

    Args:
        jacobians: (n, 6, motors) in the node's own axes, m/s and rad/s.
        along: (n, 3) unit vectors u in these axes.
        survey: which says what of the node counts.
        limits: (motors,) rad/s and m/s.
    """
    rows = sum(survey.counted)
    wanted = np.zeros((len(along), rows))
    wanted[:, :3] = along
    found = np.full(len(along), np.nan)
    good = np.isfinite(jacobians).all(axis=(1, 2)) & np.isfinite(along).all(axis=1)
    if not good.any():
        return found
    matrices, wanted = jacobians[good][:, :rows], wanted[good]
    per_speed = (np.linalg.pinv(matrices, rcond=_SINGULAR) @ wanted[:, :, None])[:, :, 0]
    left = np.abs((matrices @ per_speed[:, :, None])[:, :, 0] - wanted).max(axis=1)
    with np.errstate(divide="ignore"):
        speeds = np.where(left < 1e-6, (limits / np.abs(per_speed)).min(axis=1), 0.0)
    if len(limits) > survey.rank:
        speeds = np.array([_best(*one, limits) if one[2] > 0.0 else 0.0
                           for one in zip(matrices, wanted, speeds, strict=True)])  # fmt: skip
    found[good] = speeds
    return found


def _best(matrix: Array, wanted: Array, least: float, limits: Array) -> float:
    from scipy.optimize import linprog

    found = linprog(
        np.r_[np.zeros(len(limits)), -1.0],
        A_eq=np.c_[matrix, -wanted], b_eq=np.zeros(len(wanted)),
        bounds=[*((-limit, limit) for limit in limits), (0.0, None)], method="highs",
    )  # fmt: skip
    return max(least, float(-found.fun)) if found.success else least


def strongest(jacobians: Array, along: Array, limits: Array) -> Array:
    """(n,) N: the largest force f u that efforts of the motors within their limits hold, |J^T u| f <= limits.

    Infinite where the structure bears it alone.

    Args:
        jacobians: (n, 6, motors) in the node's own axes.
        along: (n, 3) unit vectors u in these axes.
        limits: (motors,) N m and N.
    """
    efforts = np.abs((jacobians[:, :3].transpose(0, 2, 1) @ along[:, :, None])[:, :, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        forces = np.where(efforts > _SINGULAR, limits / efforts, np.inf).min(axis=1)
    return np.where(np.isfinite(efforts).all(axis=1), forces, np.nan)
