"""How fast a node can move along a direction, and how strongly it can push, with motors that are limited."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from cinegen.study.maps.survey import Survey

Array = NDArray[np.float64]

_SINGULAR = 1e-12
_OUTSIDE = 1e-6  # m/s for each m/s: what the motors can't do of it
_NEARLY = 1e-9  # part of the largest singular value: below it facets have no size
_FACETS = 100  # pairs of these that are looked at


def fastest(jacobians: Array, along: Array, survey: Survey, limits: Array) -> Array:
    """(n,) m/s: the largest speed s with s u = J w, for speeds w of the motors within their limits.

    Nothing else of the node that counts moves meanwhile. With as many motors as that takes there is one w for each s.
    With more, all velocities that limits allow are a zonotope, and the nearest of its facets along u is the answer
    (S. Bouchard, C. Gosselin and B. Moore, "On the ability of a cable-driven robot to generate a prescribed set of
    wrenches", 2010); at singularities and where there are many facets, a linear programme.

    Args:
        jacobians: (n, 6, motors) in the node's own axes, m/s and rad/s.
        along: (n, 3) unit vectors u in these axes.
        survey: which says what of the node counts.
        limits: (motors,) rad/s and m/s.
    """
    rows, rank = sum(survey.counted), survey.rank
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
        speeds = np.where(left < _OUTSIDE, (limits / np.abs(per_speed)).min(axis=1), 0.0)
    spans, values, _ = np.linalg.svd(matrices, full_matrices=False)
    inside = left < _OUTSIDE
    regular = inside & (values[:, rank - 1] > _NEARLY * values[:, 0])
    if len(limits) > rank:
        if math.comb(len(limits), rank - 1) > _FACETS:
            regular[:] = False
        axes = spans[regular, :, :rank].transpose(0, 2, 1)
        speeds[regular] = _to_facets(axes @ matrices[regular], (axes @ wanted[regular, :, None])[:, :, 0], limits)
    for k in np.flatnonzero(inside & ~regular):
        speeds[k] = _best(matrices[k], wanted[k], speeds[k], limits)
    found[good] = speeds
    return found


def _to_facets(matrices: Array, wanted: Array, limits: Array) -> Array:
    """(n,) how far the zonotopes of matrices (n, rank, motors), of full rank, go along directions (n, rank).

    A facet is parallel to rank - 1 of the columns.
    """
    rank, count = matrices.shape[1:]
    nearest = np.full(len(matrices), np.inf)
    for columns in combinations(range(count), rank - 1):
        normals = np.linalg.svd(matrices[:, :, columns])[0][:, :, -1] if rank > 1 else np.ones((len(matrices), 1))
        widths = np.abs((normals[:, None] @ matrices)[:, 0]) @ limits
        towards = np.abs((normals * wanted).sum(axis=1))
        with np.errstate(divide="ignore", invalid="ignore"):
            nearest = np.fmin(nearest, np.where(towards > _SINGULAR, widths / towards, np.inf))
    return nearest


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
