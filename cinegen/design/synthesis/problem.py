"""`SynthesisProblem`: a task for a mechanism as nonlinear programs with exact derivatives.

A worst case is a largest lower bound t: maximise t with t <= f_i(x) at targets i, by SLSQP of scipy. Targets of finer
and finer grids are added where f or a constraint is worse (exchange of points), until none is. Several objectives have
one bound: maximise t with least_k + t span_k <= f_k (A. Pascoletti and P. Serafini, "Scalarizing vector optimization
problems", 1984).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array
from cinegen.design.synthesis.designs import FEASIBLE, Designs
from cinegen.design.synthesis.reaching import Reached
from cinegen.design.synthesis.scores import ScoreRows, Scores
from cinegen.design.synthesis.task import DesignObjective

_ROUNDS = 12  # of exchange
_WORSE = 1e-7  # below the bound at targets of the optimiser: the target is added
_ADDED = 4  # targets of one round for each kind
_MOST_BOXES, _LEAST_BOX = 16, 1e-5  # of one program; half-width, of the ranges
_PARTS = (1.0, 0.9, 0.75, 0.5, 0.25, 0.0)  # of the way to a design that has lost targets
_MOST_EVALUATIONS = 150  # of one program
_FINER = {0: (), 1: (9, 41), 2: (9, 33), 3: (5, 9)}  # by the number of axes along which the region is wide
_FINER_BALLS = {1: (9, 41), 2: (9, 33, 129), 3: (9, 33)}
_SAME = 1e-9  # fraction of a range: the bound is met


class _EnoughError(Exception):
    """A program takes too many evaluations: at a kink, where no step is short enough."""

    def __init__(self, x: Array) -> None:
        super().__init__()
        self.x = x


class Goal(NamedTuple):
    """An objective whose score is to exceed `least` by t `span`."""

    objective: DesignObjective
    least: float = 0.0
    span: float = 1.0


class SynthesisProblem(Designs):
    """Nonlinear programs for a task; see `Designs`."""

    def optimised(self, x: Array, goals: Sequence[Goal]) -> Array:
        """Return the best values near others at all points of the grids: targets are added until none is worse.

        Args:
            x: (variables,) where to begin.
            goals: what is optimised.
        """
        self.begin(x)
        if self.violation(self.at(x)) > FEASIBLE:
            x = self._program(x, ())
            if not self.at(x).reached.is_reached.all():
                return x  # what comes nearest
        grids, rounds = iter(self.grids), 0
        grid = next(grids, None)
        anchor, x = x, self._program(x, goals)
        while grid is not None and rounds < _ROUNDS:
            if self._exchange(x, goals, grid):
                x = self._program(self._pulled_back(anchor, x), goals)
                rounds += 1
            else:
                grid = next(grids, None)
        return x

    def _pulled_back(self, anchor: Array, x: Array) -> Array:
        """Return the design between a good one and another, as near to this as all targets are reached and no
        singularity lies before them."""
        for part in _PARTS:
            between = anchor + part * (x - anchor)
            if part < 1.0:
                self.begin(between)
            scores = self.at(between)
            if scores.reached.is_reached.all() and (scores.sigma.values > 0.0).all():
                return between
        return x

    @cached_property
    def grids(self) -> list[Array]:
        """Targets (n, rows) of the finer grids."""
        if len(self.reach.given):
            return []
        finer = _FINER_BALLS if self.reach.radius else _FINER
        return [self.reach.grid(count) for count in finer[self.reach.varying]]

    def _program(self, x: Array, goals: Sequence[Goal]) -> Array:
        """Return the solution of the program at the present targets; without goals, the least violation.

        Far steps may lose targets, from where no gradient leads back. A solution that is no better is tried again
        within a smaller box around the best design; a box whose side holds a better one back moves there and grows.
        """
        size, radius = self._size, 1.0
        best = self._merit(x, goals), x
        for _ in range(_MOST_BOXES):
            solution = self._solution(best[1], goals, radius)
            moved = float(np.abs((solution - best[1]) / size).max())
            merit = self._merit(solution, goals)
            if merit > best[0]:
                best = merit, solution
                if radius == 1.0 or moved < 0.99 * radius:
                    break
                radius = min(1.0, 2.0 * radius)
            else:
                radius /= 8.0
                if moved < _LEAST_BOX or radius < _LEAST_BOX:
                    break
        self.at(best[1])
        return best[1]

    def _merit(self, x: Array, goals: Sequence[Goal]) -> tuple[float, float]:
        """Return what is larger for a better design: first less violation, then the bound t of the goals."""
        scores = self.at(x)
        violation = self.violation(scores)
        return -violation if violation > FEASIBLE or not goals else 0.0, self._bound(scores, goals)

    def _bound(self, scores: Scores, goals: Sequence[Goal]) -> float:
        return min((self.value(goal.objective, scores) - goal.least) / goal.span for goal in goals) if goals else 0.0

    @property
    def _size(self) -> Array:
        width = self.high - self.low
        return np.where(width > 0.0, width, 1.0)

    def _solution(self, x: Array, goals: Sequence[Goal], radius: float) -> Array:
        """Return the solution within a box around a design, whose half-width is a fraction of the ranges."""
        from scipy.optimize import minimize

        size, n = self._size, len(x)
        low, high = np.maximum(self.low, x - radius * size), np.minimum(self.high, x + radius * size)

        def values_at(y: Array) -> Array:
            x = np.clip(self.low + y[:n] * size, low, high)
            for bound in (self.low, self.high):
                x = np.where(np.abs(x - bound) <= _SAME * size, bound, x)
            return np.asarray(x)

        last = self.evaluations + _MOST_EVALUATIONS

        def rows_at(y: Array) -> tuple[Array, Array]:
            if self.evaluations > last:
                raise _EnoughError(values_at(y))
            scores, t = self.at(values_at(y)), float(y[-1])
            rows = [(flat(limit), 0.0 if goals else 1.0) for limit in self.scoring.constraints(scores).values()]
            for goal in goals:
                aimed = flat(self._aimed(goal, scores))
                rows.append((ScoreRows((aimed.values - goal.least) / goal.span, aimed.slopes / goal.span), 1.0))
            values = np.concatenate([part.values - by_t * t for part, by_t in rows])
            slopes = np.concatenate([part.slopes for part, _ in rows]) * size
            by_t = np.concatenate([np.full(len(part.values), -by_t) for part, by_t in rows])
            return values, np.hstack([slopes, by_t[:, None]])

        scores = self.at(x)
        t = self._bound(scores, goals) if goals else -self.violation(scores)
        first = np.append((x - self.low) / size, t)
        box = [*zip((low - self.low) / size, (high - self.low) / size, strict=True), (None, None if goals else 1e-3)]
        upwards = np.append(np.zeros(n), -1.0)
        held = {"type": "ineq", "fun": lambda y: rows_at(y)[0], "jac": lambda y: rows_at(y)[1]}
        options = {"maxiter": 100, "ftol": 1e-12}
        try:
            optimum = minimize(
                lambda y: -float(y[-1]), first, jac=lambda y: upwards, method="SLSQP", bounds=box, constraints=held,
                options=options,
            )  # fmt: skip
        except _EnoughError as error:
            return error.x
        return values_at(optimum.x)

    def _aimed(self, goal: Goal, scores: Scores) -> ScoreRows:
        """Return the score of a goal: at all targets, or its mean."""
        rows = self.scoring.objective(goal.objective, scores)
        if goal.objective.over == "mean":
            return ScoreRows(rows.values.mean(keepdims=True), rows.slopes.mean(axis=(0, 1), keepdims=True))
        return rows

    def _exchange(self, x: Array, goals: Sequence[Goal], grid: Array) -> bool:
        """Add the targets of a grid where an objective or a constraint is worse; return whether there are any."""
        p, scale = self.split(x)
        present = self.at(x)
        fine = self._scored(self._from_nearest(present.reached, p, self.reach.scaled(grid, scale)), scale)
        self.configurations += len(grid)
        bars = [
            (column, 0.0)
            for rows in self.scoring.constraints(fine).values()
            if len(rows.values) == len(grid)
            for column in rows.values.T
        ]
        for goal in goals:
            rows = self.scoring.objective(goal.objective, fine)
            if goal.objective.over == "worst" and len(rows.values) == len(grid):
                bars.append((rows.values.min(axis=1), self.value(goal.objective, present)))
        added: set[int] = set()
        for values, bar in bars:
            order = np.argsort(values)[:_ADDED]
            added.update(int(i) for i in order[values[order] < bar - _WORSE])
        new = [grid[i] for i in sorted(added) if (np.abs(self.points - grid[i]).max(1) > 1e-12).all()]
        if not new:
            return False
        self.points = np.vstack([self.points, new])
        self._known = self._from_nearest(present.reached, p, self.reach.scaled(self.points, scale))
        self._cache = None
        return True

    def _from_nearest(self, known: Reached, p: Array, targets: Array) -> Reached:
        nearest = np.argmin(np.linalg.norm(targets[:, None] - known.targets[None], axis=2), axis=1)
        start = replace(
            known, targets=known.targets[nearest], q=known.q[nearest], error=known.error[nearest],
            distance=known.distance[nearest],
        )  # fmt: skip
        return self.reaching.continued(start, p, targets)


def flat(rows: ScoreRows) -> ScoreRows:
    """Return rows (n, k) of targets as one list (n k,)."""
    return ScoreRows(rows.values.ravel(), rows.slopes.reshape(-1, rows.slopes.shape[-1]))
