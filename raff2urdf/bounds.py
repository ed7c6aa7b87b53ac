"""Limits of joints, kept while loops are closed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from raff2urdf.arrays import Array, Indices

UNLIMITED = 1e9
"""Value of a limit that a URDF requires but the robot does not have (rad/s, m/s, N, N m; m for a prismatic joint)."""

STEP_CAP = 0.6
"""rad, or characteristic lengths: a longer step leaves the range of its linearisation."""

_PINNED = 2e-15  # rad or lengths: joints that limits leave less than this don't move


class JointBounds(NamedTuple):
    """Limits of the joints whose configuration is one number.

    Attributes:
        at: (n,) their indices in q.
        columns: (n,) their indices in a step.
        lower: (n,) least values, rad and m; -inf where there is none.
        upper: (n,) greatest values; inf where there is none.
        scale: (n,) size of one dimensionless step.
    """

    at: Indices
    columns: Indices
    lower: Array
    upper: Array
    scale: Array

    def clipped(self, q: Array) -> Array:
        """Return the configuration (nq,) within the limits that is nearest to q."""
        inside = q.copy()
        inside[self.at] = np.clip(q[self.at], self.lower, self.upper)
        return inside

    def contain(self, q: Array) -> bool:
        """Return whether no joint of q (nq,) is beyond its limits."""
        return bool(np.all((q[self.at] >= self.lower) & (q[self.at] <= self.upper)))

    def distance(self, q: Array, other: Array) -> float:
        """Return the distance of two configurations (nq,), dimensionless."""
        return float(np.linalg.norm((q[self.at] - other[self.at]) / self.scale))

    def samples(self, q: Array, count: int) -> Iterator[Array]:
        """Yield configurations (nq,) within the limits: their middles, and random ones; joints without two limits are
        about where they are in q."""
        rng, sample = np.random.default_rng(0), self.clipped(q)
        values = sample[self.at]
        low = np.where(np.isfinite(self.lower), self.lower, np.minimum(values, self.upper) - self.scale)
        high = np.where(np.isfinite(self.upper), self.upper, np.maximum(values, self.lower) + self.scale)
        for part in (np.full(len(low), 0.5), *rng.uniform(size=(count, len(low)))):
            sample[self.at] = low + part * (high - low)
            yield sample.copy()

    def step(self, jacobian: Array, c: Array, damping: float, q: Array) -> Array:
        """Return the step (nv,) within the limits, no component beyond `STEP_CAP`, that minimises
        |jacobian step + c|^2 + damping |step|^2."""
        from scipy.optimize import lsq_linear  # takes a third of a second to import

        count = jacobian.shape[1]
        low, high = np.full(count, -STEP_CAP), np.full(count, STEP_CAP)
        low[self.columns] = np.clip((self.lower - q[self.at]) / self.scale, -STEP_CAP, 0.0)
        high[self.columns] = np.clip((self.upper - q[self.at]) / self.scale, 0.0, STEP_CAP)
        step, free = np.zeros(count), high - low > _PINNED
        if free.any():
            matrix = np.vstack([jacobian[:, free], math.sqrt(damping) * np.eye(int(free.sum()))])
            right = np.concatenate([-c, np.zeros(len(matrix) - len(c))])
            step[free] = lsq_linear(matrix, right, (low[free], high[free]), method="bvls", tol=1e-14).x
        return step
