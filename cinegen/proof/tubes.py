"""Tubes about X(eps) over many boxes at a time: equations 3 to 5 of docs/proof.md."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.proof.equations import Change, Equations, Point

SURE = 0.98
"""Part of a bound that is used: the rest is a margin for the checker."""

_ROUNDS = 4  # radii of a tube that are tried, 0 first
_WIDER = 1.25, 2.0  # times the radius that would just do; with tolerances, where tubes must meet for all robots
_NEARER = 3  # times that z + E y takes the place of y, then
TINY = 1e-11
"""rad and characteristic lengths: smallest radius."""


class Tubes(NamedTuple):
    """Tubes of boxes.

    Attributes:
        x: (boxes, unknowns) configurations at the centres, dimensionless.
        centre: (boxes, parameters) poses there, m and rad.
        along: (boxes, unknowns + parameters, eta) their change by eps, and by its products.
        y: (boxes, unknowns) radius about X(eps) in which there is one configuration, where it is
        regular: (boxes,) proved.
        near: (boxes, unknowns) radius in which that is.
        at: equations at the centres.
        change: over all configurations that are so near.
        axes: (boxes,) the eps to which most of the residual is owed.
    """

    x: Array
    centre: Array
    along: Array
    y: Array
    regular: Bools
    near: Array
    at: Point
    change: Change
    axes: Array

    def some(self, boxes: Sequence[int]) -> Tubes:
        """Return those of some boxes."""
        x, centre, along, y, regular, near, at, change, axes = self
        parts = Point(*(m[boxes] for m in at)), Change(*(m[boxes] for m in change))
        return Tubes(x[boxes], centre[boxes], along[boxes], y[boxes], regular[boxes], near[boxes], *parts, axes[boxes])


def tubes(equations: Equations, x: Array, inverse: Array, centre: Array, radius: Array) -> Tubes:
    """Return the tubes of boxes.

    Args:
        equations: as many as there are unknowns.
        x: (boxes, unknowns) dimensionless configurations at the centres.
        inverse: (boxes, unknowns, unknowns) C.
        centre: (boxes, parameters) m and rad.
        radius: (boxes, parameters) of the boxes.
    """
    at = equations.at(x, centre)
    along = _along(equations, x, centre, radius, inverse, at)
    y, regular = np.zeros(x.shape), np.zeros(len(x), dtype=bool)
    for k in range(_ROUNDS):
        change = equations.change(x, centre, along, y)
        z, defect, cubes = _residual(equations, at, change, inverse, along)
        near = z + (defect @ y[..., None])[..., 0]
        regular = np.asarray((near < SURE * y).all(axis=1) & (y < 1.0).all(axis=1))
        better = _WIDER[equations.has_radii] * solved(defect, z) + TINY
        usable = ~regular & (better > 0.0).all(axis=1) & (better < 1.0).all(axis=1)
        if k == _ROUNDS - 1 or not usable.any():
            break
        y = np.where(usable[:, None], better, y)
    axes = np.argmax(_owed(cubes, near, centre.shape[1]), axis=1)
    for _ in range(_NEARER):
        near = np.where(regular[:, None], z + (defect @ near[..., None])[..., 0], y)
    change = change.nearer(np.max(near / np.maximum(y, TINY), axis=1))
    return Tubes(x, centre, along, y, regular, near, at, change, axes)


def determinants(equations: Equations, at: Point, change: Change) -> tuple[Array, Bools]:
    """Return the determinant (boxes,) of the locked joints' matrix at the centre, and whether it has the same sign in
    all of the box: no singularity of type 2."""
    rows, locked = equations.rows, equations.locked
    if len(rows) != len(locked):  # actuated redundantly
        return np.zeros(len(at.residual)), np.zeros(len(at.residual), dtype=bool)
    middle, unsure = (at.jacobian[:, k][:, rows][..., locked] for k in range(2))
    left = inverses(middle)
    rest = unsure + (change.bent + change.apart)[:, rows][..., locked]
    rest = np.abs(left @ middle - np.eye(len(rows))) + np.abs(left) @ rest
    slopes = np.moveaxis(left[:, None] @ change.whole[:, :, rows][..., locked], 1, 0)
    n = len(equations.over)
    total = _preconditioned(slopes[:n], rest + np.abs(slopes[n:]).sum(axis=0))
    weights = solved(total, np.ones(total.shape[:2]))
    lesser = (total @ weights[..., None])[..., 0] < SURE * weights
    return np.linalg.det(middle), np.asarray(lesser.all(axis=1) & (weights > 0.0).all(axis=1))


def _along(equations: Equations, x: Array, centre: Array, radius: Array, inverse: Array, at: Point) -> Array:
    """Return how X and P (boxes, unknowns + parameters, .) change by eps and by its products."""
    rows, count, n = equations.rows, x.shape[1], centre.shape[1]
    slopes = -(inverse @ at.jacobian[:, 0, rows, count : count + n]) * radius[:, None, :]
    along = np.concatenate([slopes, radius[..., None] * np.eye(n)], axis=1)
    return _curved(inverse[:, None] @ equations.change(x, centre, along, 0.0 * x).by[:, :, rows], along)


def _residual(
    equations: Equations, at: Point, change: Change, inverse: Array, along: Array
) -> tuple[Array, Array, dict[tuple[int, ...], Array]]:
    """Return z (boxes, unknowns) and E (boxes, unknowns, unknowns), and C F by the products of three eps.

    Args:
        equations: as many as there are unknowns.
        at: at the centres.
        change: over the boxes.
        inverse: C.
        along: (boxes, unknowns + parameters, n + n (n + 1) / 2) of X and P, by eps and its products.
    """
    rows, count, n = equations.rows, inverse.shape[1], along.shape[1] - inverse.shape[1]
    width, size, spread = count + n, np.abs(inverse), np.abs(along).sum(axis=-1)[..., None]
    jacobian, unsure = at.jacobian[:, 0, rows, :width], at.jacobian[:, 1, rows, :width]
    bent, apart = change.bent[:, rows, :width], change.apart[:, rows, :width]
    by, third = (inverse[:, None] @ m[:, :, rows, :width] for m in (change.by, change.sharper / 3.0))
    cubes = _cubes(by[:, :n] @ along[:, None, :, n:], third @ along[:, None, :, :n])
    z = size @ (at.residual[:, 1, rows, None] + (unsure + bent / 3.0) @ spread)
    z += np.abs(inverse @ at.residual[:, 0, rows, None])
    z = z[..., 0] + np.abs(inverse @ jacobian @ along[..., :n]).sum(axis=-1) + sum(map(np.abs, cubes.values()))
    curved = np.abs(along[..., n:]).sum(axis=-1)[..., None]
    constant = np.abs(inverse @ jacobian[..., :count] - np.eye(count)) + size @ unsure[..., :count]
    z += ((0.5 * np.abs(by[:, n:]) + np.abs(third)).sum(axis=1) @ curved + constant @ curved[:, :count])[..., 0]
    by[:, n:] += 3.0 * third
    return z, constant + np.abs(by[..., :count]).sum(axis=1) + size @ (bent + apart)[..., :count], cubes


def _curved(by: Array, along: Array) -> Array:
    """Return how X and P change by eps_j and by eps_j eps_k, j <= k, so that the second derivative of C F vanishes.

    Args:
        by: (boxes, n, unknowns, columns) C G.
        along: (boxes, unknowns + parameters, n) S and diag(r).
    """
    n = along.shape[2]
    second = by[..., : along.shape[1]] @ along[:, None]  # (boxes, j, unknowns, k)
    j, k = np.triu_indices(n)
    products = -0.5 * (second[:, j, :, k] + second[:, k, :, j]) * np.where(j == k, 0.5, 1.0)[:, None, None]
    products = np.moveaxis(products, 0, -1)
    return np.concatenate([along, np.concatenate([products, np.zeros((len(by), n, len(j)))], axis=1)], axis=2)


def _cubes(by: Array, third: Array) -> dict[tuple[int, ...], Array]:
    """Return what is multiplied with eps_a eps_b eps_c (boxes, unknowns), a <= b <= c.

    Args:
        by: (boxes, n, unknowns, products) by eps, and by their products.
        third: (boxes, products, unknowns, n) by products, and by eps.
    """
    cubes: dict[tuple[int, ...], Array] = {}
    for q, pair in enumerate(zip(*np.triu_indices(by.shape[1]), strict=True)):
        for a in range(by.shape[1]):
            key = tuple(sorted((a, *map(int, pair))))
            cubes[key] = cubes.get(key, 0.0) + by[:, a, :, q] + third[:, q, :, a]
    return cubes


def _owed(cubes: dict[tuple[int, ...], Array], size: Array, n: int) -> Array:
    """Return how much of a residual is owed to each eps (boxes, n), in sizes (boxes, unknowns) of the tube."""
    owed = np.zeros((len(size), n))
    for key, values in cubes.items():
        for k in key:
            owed[:, k] += np.sum(np.abs(values) / np.maximum(size, TINY), axis=1)
    return owed


def _preconditioned(slopes: Array, rest: Array) -> Array:
    """Return E for the preconditioner C - sum_j eps_j C W_j C, where C W = 1 + sum_j eps_j `slopes`_j +- `rest`."""
    whole = rest + np.abs(slopes).sum(axis=0) @ rest
    for j, first in enumerate(slopes):
        whole = whole + np.abs(first @ first)
        for second in slopes[:j]:
            whole = whole + np.abs(first @ second + second @ first)
    return np.asarray(whole)


def inverses(matrices: Array) -> Array:
    """Return inverses; NaN where there is none."""
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full(matrices.shape, np.nan)
        return np.concatenate([inverses(matrix[None]) for matrix in matrices])


def solved(defect: Array, right: Array) -> Array:
    """Return (1 - E)^-1 (boxes, n, n) times vectors (boxes, n): all positive only if E is small."""
    return np.asarray((inverses(np.eye(defect.shape[-1]) - defect) @ right[..., None])[..., 0])
