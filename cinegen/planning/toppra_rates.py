"""TOPP-RA with toppra, which must be installed: the fastest rates along a curve within limits of quantities that are
linear in the growth and in the square of the rate, and of viscous friction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from toppra.algorithm import TOPPRA
from toppra.constraint import LinearConstraint

from cinegen.arrays import Array

_EQUAL = 1e-9  # by which torques times their weight may exceed limits: an equation has two sides
_TIGHTER = (0.0, 1e-6, 1e-5, 1e-4)
"""Fractions by which limits are tightened, each by another part of it, where toppra finds no motion: its linear
programmes of two variables fail by rounding where several bounds are equal."""
_LINEARISED = 8  # times that viscous friction is linearised, at most
_FASTER = 1.0 - 1e-4  # a motion that is no faster than this part of the last one is the last
_SLOWEST = 1e-6  # rate near which friction is linearised, of the usual one
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


class LimitedQuantities(NamedTuple):
    """Accelerations and torques, relative to their limits, at the beginning, in the middle and at the end of each
    interval: `first * growth + second * rate**2 + drag * rate + constant`, between -`weights` and `weights`.

    Attributes:
        first: (3, n - 1, m).
        second: (3, n - 1, m).
        drag: (3, n - 1, m).
        constant: (3, n - 1, m).
        weights: (3, n - 1, m), from 0 to 1.
    """

    first: Array
    second: Array
    drag: Array
    constant: Array
    weights: Array


def fastest_rates(
    quantities: LimitedQuantities, s: Array, most: Array, moves_at_ends: Sequence[bool], dof: int
) -> Array | None:
    """Return the fastest rates (n,) from rest to rest; None if there is no motion within the limits.

    Viscous friction is linearised near the rates of the last motion, until that is no longer faster.

    Args:
        quantities: what is limited.
        s: (n,) parameters.
        most: (n,) largest rates.
        moves_at_ends: whether the curve moves at its beginning and at its end; where it is at rest, the rate is not 0.
        dof: degrees of freedom of the curve.
    """
    _, second, drag, constant, weights = quantities
    caps = np.maximum(_at_points(most), _SLOWEST)
    ends = [
        0.0 if moves else _rate_at_end(second[at] / weights[at], constant[at] / weights[at], limit)
        for moves, at, limit in zip(moves_at_ends, ((0, 0), (2, -1)), (most[0], most[-1]), strict=True)
    ]
    with np.errstate(divide="ignore", invalid="ignore"):  # rates that friction allows at constant speed
        steady = np.where(drag != 0.0, (weights - np.abs(constant)) / np.abs(drag), np.inf).min(axis=2, keepdims=True)
    near, fastest, seconds = np.clip(steady, _SLOWEST, caps), None, np.inf
    for _ in range(_LINEARISED if drag.any() else 1):
        rates = _searched(quantities, s, most, near, ends, dof)
        took = np.inf if rates is None else float((np.diff(s) / (rates[1:] + rates[:-1])).sum())
        if rates is None or took >= _FASTER * seconds:
            break
        fastest, seconds, near = rates, took, np.clip(_at_points(rates), _SLOWEST, caps)
    return fastest


class _Limits(LinearConstraint):  # type: ignore[misc]
    """Limits of quantities, and of the rate itself.

    Viscous friction is not linear in the square x of the rate. In the direction in which it resists, the rate is
    replaced by its tangent (x / r + r) / 2 at a rate r near to it, which is more; in the other one by x / cap, which is
    less.

    Args:
        quantities: what is limited.
        s: (n,) parameters.
        most: (n,) largest rates.
        near: (3, n - 1, 1) rates r.
        tighter: see `_TIGHTER`.
        dof: degrees of freedom of the curve.
    """

    def __init__(
        self, quantities: LimitedQuantities, s: Array, most: Array, near: Array, tighter: float, dof: int
    ) -> None:
        super().__init__()
        first, second, drag, constant, weights = quantities
        self._dof, self._room = dof, np.hstack(list(weights))
        self._squares = np.column_stack([np.zeros(len(s)), most**2])
        self.identical = bool((self._room == 1.0).all())
        parts = np.modf(_GOLDEN * np.arange(self._room.size).reshape(self._room.shape))[0]
        more = np.where(self._room < 1.0, 1.0, 1.0 + tighter * parts)  # near singularities they are equations
        step, caps = np.diff(s)[:, None], np.maximum(_at_points(most), _SLOWEST)
        self._sides = []
        for sign in (1.0, -1.0) if drag.any() else (1.0,):
            resists, helps = np.maximum(sign * drag, 0.0), np.minimum(sign * drag, 0.0)
            by_square = second + sign * (resists / (2.0 * near) + helps / caps)
            fixed = constant + sign * 0.5 * resists * near
            by_growth = [first[k] + k * step * by_square[k] for k in range(3)]
            self._sides.append([more * np.hstack(list(term)) for term in (by_growth, by_square, fixed)])

    def get_dof(self) -> int:
        return self._dof

    def compute_constraint_params(self, path: Any, gridpoints: Array, *_: Any) -> tuple[Any, ...]:
        """Return toppra's a, b, c, F, g, no bounds of u, and bounds of x: F (a u + b x + c) <= g at each of n points,
        for the growth u and the square x of the rate.

        a, b and c are (n, k): the quantities at the beginning, in the middle and at the end of the interval behind a
        point, side by side (the last interval again for the last point). F is [1; -1] (2 k, k), for limits on both
        sides; with viscous friction, a, b and c have other columns for each side, and F is diag(1, -1).
        """
        terms = [np.hstack(sides) for sides in zip(*self._sides, strict=True)]
        terms = [np.vstack([term, term[-1:]]) for term in terms]
        width = self._room.shape[1]
        both = np.vstack([np.eye(width), -np.eye(width)])
        if len(self._sides) == 2:
            both = np.diag(np.repeat([1.0, -1.0], width))
        if self.identical:
            return (*terms, both, np.ones(2 * width), None, self._squares)
        most = np.vstack([self._room, self._room[-1:]]) + _EQUAL
        return (*terms, np.tile(both, (len(self._squares), 1, 1)), np.hstack([most, most]), None, self._squares)


class _Path:
    """A path as TOPP-RA takes it: the interval of its parameter, and its size."""

    def __init__(self, s: Array, dof: int) -> None:
        self.path_interval, self.dof = s[[0, -1]], dof


def _searched(
    quantities: LimitedQuantities, s: Array, most: Array, near: Array, ends: Sequence[float], dof: int
) -> Array | None:
    """Return the rates (n,) that TOPP-RA finds at the parameters s (n,); None if there are none.

    Args:
        quantities: what is limited.
        s: (n,) parameters.
        most: (n,) largest rates.
        near: (3, n - 1, 1) rates near which friction is linear.
        ends: desired rates at both ends.
        dof: degrees of freedom of the curve.
    """
    for tighter in _TIGHTER:
        limits = [_Limits(quantities, s, most, near, tighter, dof)]
        search = TOPPRA(
            limits, _Path(s, dof), gridpoints=s, solver_wrapper="seidel", parametrizer="ParametrizeConstAccel"
        )
        for scale in (1.0, 0.5, 0.0):
            _, rates, _ = search.compute_parameterization(scale * ends[0], scale * ends[1])
            if rates is not None and np.isfinite(rates).all() and (rates[1:] + rates[:-1] > 0.0).all():
                return np.asarray(rates)
    return None


def _at_points(rates: Array) -> Array:
    """Return rates (3, n - 1, 1) at the beginning, in the middle and at the end of each interval, for those at its ends
    (n,)."""
    squares = rates**2
    return np.sqrt([squares[:-1], 0.5 * (squares[:-1] + squares[1:]), squares[1:]])[..., None]


def _rate_at_end(by_square: Array, fixed: Array, most: float) -> float:
    """Return the largest rate at an end of a curve that is itself at rest there.

    Args:
        by_square: what accelerations and torques, relative to their limits, gain with the square of the rate.
        fixed: what they are without it.
        most: limit of the rate.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = np.where(by_square != 0.0, (1.0 - np.sign(by_square) * fixed) / np.abs(by_square), np.inf)
    return 0.99 * min(most, float(np.sqrt(max(squares.min(initial=np.inf), 0.0))))
