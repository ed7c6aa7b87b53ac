"""Objectives and constraints of a task at points to reach, with their derivatives by the parameters.

All are written so that larger is better and continuous where a point is lost: at a point that is not reached the
singular values count as minus its distance, and beyond a singularity they are negative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.design.errors import DesignError
from cinegen.design.synthesis.reaching import Reached, Reaching
from cinegen.design.synthesis.task import DesignObjective, Task

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of a design at `count` points, and their derivatives by the parameters; larger is better.

    Attributes:
        reached: configurations.
        sigma: (count, 3) smallest singular value, inverse of the largest, and their product: the inverse of the
            condition number.
        by_p: (count, 3, parameters) its derivative.
        margins: (count, 2 limited joints) distance to the limits, rad or characteristic lengths.
        margins_by_p: (count, 2 limited joints, parameters).
    """

    reached: Reached
    sigma: Array
    by_p: Array
    margins: Array
    margins_by_p: Array


_INDEX = {"sigma_1": 0, "sigma_max": 1, "condition": 2}


class Scoring:
    """Scores of the designs of a task.

    Args:
        task: as read.
        reaching: of its node.

    Raises:
        DesignError: `size` names what is no length.
    """

    def __init__(self, task: Task, reaching: Reaching) -> None:
        self.task, self.reaching = task, reaching
        mechanism, limits = reaching.mechanism, reaching.mechanism.limits
        named = [(mechanism.q_index(j), mechanism.v_index(j)) for j in mechanism.joints if j in limits]
        kept = [(q, v) for q, v in named if np.isfinite(limits.lower[q]) or np.isfinite(limits.upper[q])]
        self._limited = np.array(kept if task.joint_limits else [], dtype=int).reshape(-1, 2)
        self._lower, self._upper = (bounds[self._limited[:, 0]] for bounds in (limits.lower, limits.upper))
        self._units = np.array(
            [reaching.length if mechanism.is_prismatic(mechanism.columns[v]) else 1.0 for v in self._limited[:, 1]]
        )
        self.objectives = task.objectives
        wanted = [one.of for one in task.objectives if one.of] + ([] if task.size is None else [task.size[0]])
        self._lengths = {of: self._of(of) for of in wanted}

    def _of(self, patterns: tuple[str, ...]) -> list[int]:
        parameters = self.reaching.parameters
        found = parameters.matching(patterns)
        for i in found:
            if parameters.all[i].unit != "m":
                raise DesignError(f"size: {parameters.all[i].name} is an angle: name lengths, such as link2.d")
        return found

    # --- at points -----------------------------------------------------------------------------------------------

    def at(self, reached: Reached) -> Scores:
        """Return the scores at configurations of a design."""
        reaching = self.reaching
        p, count = reached.p, len(reached.q)
        here = reaching.evaluate(p, reached.q)
        follow = reaching.follow(here)
        s, by_columns = here.singular_values(
            reaching.node,
            slice(None) if reaching.reach.keeps_orientation else slice(0, 3),
            reaching.length,
        )
        last = reaching.rank - 1
        by_p = by_columns[:, :, reaching.free] + by_columns[:, :, reaching.own] @ follow
        side = reaching.side(here)[:, None]
        least, inverse = s[:, last] * side[:, 0], side[:, 0] / s[:, 0]
        d_least, d_inverse = by_p[:, last] * side, -side * by_p[:, 0] / s[:, :1] ** 2
        sigma = np.stack([least, inverse, s[:, last] * inverse], axis=1)
        product = d_inverse * s[:, last, None] + by_p[:, last] * inverse[:, None]
        derivative = np.stack([d_least, d_inverse, product], axis=1)
        lost = np.flatnonzero(~reached.is_reached)
        if len(lost):
            sigma[lost] = -reached.distance[lost, None]
            derivative[lost] = -self._distance_by_p(reached, lost)[:, None]
        q, v = self._limited.T
        values, moved = reached.q[:, q], here.joint_derivative[:, :, reaching.free]
        moved = moved + here.joint_derivative[:, :, reaching.own] @ follow
        moved[:, [reaching.mechanism.v_index(name) for name in reaching.design.fixed]] = follow
        both = np.hstack([values - self._lower, self._upper - values]) / np.tile(self._units, 2)
        slopes = np.concatenate([moved[:, v], -moved[:, v]], axis=1) / np.tile(self._units, 2)[:, None]
        kept = np.isfinite(both).all(axis=0) if count else np.zeros(both.shape[1], dtype=bool)
        return Scores(reached, sigma, derivative, both[:, kept], slopes[:, kept])

    def _distance_by_p(self, reached: Reached, lost: NDArray[np.intp]) -> Array:
        reaching = self.reaching
        here = reaching.every.evaluate(reached.p, reached.q[lost])
        weights = reaching._weights
        moved = here.pose_derivative(reaching.node, "world")[:, reaching.rows] * weights[:, None]
        unit = reached.error[lost] * weights / reached.distance[lost, None]
        return np.asarray(-np.einsum("cr,crp->cp", unit, moved))

    # --- of all points -------------------------------------------------------------------------------------------

    def constraints(self, scores: Scores) -> tuple[Array, Array]:
        """Return what must not be negative (m,), and its derivative (m, parameters)."""
        low, high = self.task.singular_values
        values = [scores.sigma[:, 0] - low, scores.sigma[:, 1] - 1.0 / high, scores.margins.ravel()]
        slopes = [scores.by_p[:, 0], scores.by_p[:, 1], scores.margins_by_p.reshape(-1, scores.by_p.shape[2])]
        if self.task.size is not None:
            of, most = self.task.size
            size, by_p = self.size(scores.reached.p, of)
            values.append(np.array([most - size]) / self.reaching.length)
            slopes.append(-by_p[None] / self.reaching.length)
        return np.concatenate(values), np.concatenate(slopes)

    def points(self, objective: DesignObjective, scores: Scores) -> tuple[Array, Array]:
        """Return the score (count,) or (1,) of an objective, whose least (or mean) counts, with derivatives."""
        if objective.quantity == "size":
            value, slope = self.size(scores.reached.p, objective.of)
            return np.array([-value / self.reaching.length]), -slope[None] / self.reaching.length
        k = _INDEX[objective.quantity]
        return scores.sigma[:, k], scores.by_p[:, k]

    def size(self, p: Array, of: tuple[str, ...]) -> tuple[float, Array]:
        """Return the sum of the absolute values of lengths, m, and its derivative (parameters,)."""
        parameters, own = self.reaching.parameters, self._lengths[of]
        values = parameters.full(p)[own]
        return float(np.abs(values).sum()), np.asarray(np.sign(values) @ parameters.ties.matrix[own])

    def shown(self, objective: DesignObjective, score: float) -> float:
        """Return the value of an objective by its score: m for sizes, else dimensionless."""
        if objective.quantity == "size":
            return -score * self.reaching.length
        if objective.quantity == "sigma_1":
            return score
        return 1.0 / score if score > 0.0 else float("inf")
