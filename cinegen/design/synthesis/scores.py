"""Scores of a design: what its objectives and bounds are computed from."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.design.synthesis.reaching import Reached
from cinegen.design.torques_at_rest import holding_torques

if TYPE_CHECKING:
    from cinegen.design.synthesis.objectives import Scoring


class ScoreRows(NamedTuple):
    """Scores (n, k) of n targets, or of none (1, k), and their derivatives (n, k, variables)."""

    values: Array
    slopes: Array


class Scores:
    """Scores of a design at `count` targets, and their derivatives by the variables; larger is better.

    Attributes:
        reached: configurations.
        p: (parameters,) values, m and rad.
        scale: of the region.
    """

    def __init__(self, scoring: Scoring, reached: Reached, scale: float, growth: Array | None) -> None:
        self._scoring, self.reached, self.p, self.scale = scoring, reached, reached.p, scale
        reaching = scoring.reaching
        self._reaching = reaching
        self.evaluation = reaching.evaluate(reached.p, reached.q)
        self.follow = reaching.follow(self.evaluation, growth)
        self._growth = growth

    def __len__(self) -> int:
        return len(self.reached.q)

    @property
    def variables(self) -> int:
        """Number of variables."""
        return int(self.follow.shape[2])

    def total(self, by_columns: Array) -> Array:
        """Return derivatives (count, ..., variables) at targets of what depends on the columns (count, ..., columns) of
        the design with the actuated joints' own variables."""
        reaching = self._reaching
        rows = by_columns[..., reaching.actuated]
        total = (rows.reshape(len(rows), -1, rows.shape[-1]) @ self.follow).reshape(*rows.shape[:-1], self.variables)
        total[..., : len(reaching.free)] += by_columns[..., reaching.free]
        return np.asarray(total)

    @cached_property
    def sigma(self) -> ScoreRows:
        """(count, 3): smallest singular value, inverse of the largest, and their product: the inverse of the condition
        number."""
        reaching, reached = self._reaching, self.reached
        rows = slice(None) if reaching.reach.is_oriented else slice(0, 3)
        s, by_columns = self.evaluation.singular_values(reaching.node, rows, reaching.length)
        last = reaching.rank - 1
        by = self.total(by_columns)
        side = reaching.side(self.evaluation)[:, None]
        least, inverse = s[:, last] * side[:, 0], side[:, 0] / s[:, 0]
        d_least, d_inverse = by[:, last] * side, -side * by[:, 0] / s[:, :1] ** 2
        values = np.stack([least, inverse, s[:, last] * inverse], axis=1)
        product = d_inverse * s[:, last, None] + by[:, last] * inverse[:, None]
        slopes = np.stack([d_least, d_inverse, product], axis=1)
        lost = np.flatnonzero(~reached.is_reached)
        if len(lost):
            values[lost] = -reached.distance[lost, None]
            slopes[lost] = -self._distance_slopes(lost)[:, None]
        return ScoreRows(values, slopes)

    def _distance_slopes(self, lost: Indices) -> Array:
        reaching, reached = self._reaching, self.reached
        evaluation = reaching.every.evaluate(reached.p, reached.q[lost])
        moved = evaluation.pose_derivative(reaching.node, "world")[:, reaching.rows] * reaching.weights[:, None]
        unit = reached.error[lost] * reaching.weights / reached.distance[lost, None]
        slopes = -np.einsum("cr,crp->cp", unit, moved)
        if self._growth is not None:
            grown = np.einsum("cr,cr->c", unit, self._growth[lost] * reaching.weights)
            slopes = np.hstack([slopes, grown[:, None]])
        return np.asarray(slopes)

    @cached_property
    def moved(self) -> Array:
        """(count, nv, variables) derivative of the configuration at targets, rad and m."""
        motion = self.total(self.evaluation.joint_derivative)
        mechanism = self._reaching.mechanism
        motion[:, [mechanism.v_index(name) for name in self._reaching.design.fixed]] = self.follow
        return motion

    @cached_property
    def margins(self) -> ScoreRows:
        """(count, 2 limited joints) distance to the limits, rad or characteristic lengths."""
        scoring = self._scoring
        q, v = scoring.limited.T
        values, units = self.reached.q[:, q], np.tile(scoring.units, 2)
        both = np.hstack([values - scoring.lower, scoring.upper - values]) / units
        slopes = np.concatenate([self.moved[:, v], -self.moved[:, v]], axis=1) / units[:, None]
        kept = np.isfinite(both).all(axis=0)
        return ScoreRows(both[:, kept], slopes[:, kept])

    @cached_property
    def torques(self) -> ScoreRows:
        """(count, actuated) torques or forces at rest, N m or N, or parts of their limits."""
        scoring = self._scoring
        masses = scoring.masses_at(self.p)
        values, by_columns = holding_torques(self.evaluation, scoring.wrenches, scoring.gravity, masses=masses)
        return ScoreRows(values / scoring.torque_units, self.total(by_columns) / scoring.torque_units[:, None])

    @cached_property
    def accuracy(self) -> ScoreRows:
        """(count, 1) root mean square deviation of the node's position, m."""
        errors = self._scoring.errors
        assert errors is not None
        values, slopes = errors.at(self.p, self.reached.q, self.moved)
        return ScoreRows(values[:, None], slopes[:, None])

    @cached_property
    def gaps(self) -> ScoreRows:
        """(count, pairs) distances between bars, and from obstacles, less the least that is wanted, as parts of it."""
        clearance = self._scoring.clearance
        assert clearance is not None
        values, by_columns = clearance.at(self.evaluation, self.p, self._reaching.free)
        return ScoreRows(values / clearance.least - 1.0, self.total(by_columns) / clearance.least)
