"""`SynthesisProblem`: a task for a mechanism as nonlinear programs with exact derivatives.

A worst case is a largest lower bound t: maximise t with t <= f_i(x) at targets i, by SLSQP of scipy. Targets of finer
and finer grids are added where f or a constraint is worse (exchange of points), until none is. Several objectives have
one bound: maximise t with least_k + t span_k <= f_k (A. Pascoletti and P. Serafini, "Scalarizing vector optimization
problems", 1984).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from cinegen.design.synthesis.objectives import Scoring
from cinegen.design.synthesis.reaching import Reached, Reaching
from cinegen.design.synthesis.region import Reach
from cinegen.design.synthesis.scores import ScoreRows, Scores
from cinegen.design.synthesis.task import DesignObjective, SynthesisTask, check_bounds
from raff2urdf import Document

FEASIBLE = 1e-6
"""A constraint that is violated by no more, dimensionless, holds."""

_ROUNDS = 12  # of exchange
_WORSE = 1e-7  # below the bound at targets of the optimiser: the target is added
_ADDED = 4  # targets of one round for each kind
_MOST_BOXES, _LEAST_BOX = 16, 1e-5  # of one program; half-width, of the ranges
_PARTS = (1.0, 0.9, 0.75, 0.5, 0.25, 0.0)  # of the way to a design that has lost targets
_MOST_EVALUATIONS = 150  # of one program
_COARSE = 3  # points along each axis
_FINER = {0: (), 1: (9, 41), 2: (9, 33), 3: (5, 9)}  # by the number of axes along which the region is wide
_FINER_BALLS = {1: (9, 41), 2: (9, 33, 129), 3: (9, 33)}
_LARGEST = math.log(20.0)  # of the region's scale, and of its inverse
_SAME = 1e-9  # m or rad: the home that is written stays; fraction of a range: the bound is met
_WITHOUT_EFFECT = 1e-10  # dimensionless


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


class SynthesisProblem:
    """A task for a mechanism.

    Args:
        source: as for `cinegen.design.Parameters`.
        task: what is wanted.
        robot: name of one robot of a file that holds several.

    Attributes:
        task: as given.
        parameters: the free ones.
        names: of the variables: those of the parameters, and `region`, the logarithm of its scale, where that is an
            objective.
        low, high: (variables,) bounds.
        written: (variables,) the file's values.
        scoring: of its designs.
        points: (count, rows) targets at which the optimiser looks, of the region as given.
        evaluations: designs that were evaluated, each at all targets of the optimiser.
        configurations: that were found, one for each target of each design, those of finer grids too.

    Raises:
        DesignError: the task does not fit the mechanism; a parameter has no effect.
    """

    def __init__(self, source: str | Path | Document, task: SynthesisTask, robot: str | None = None) -> None:
        self.task = task
        common = {"ties": task.ties, "robot": robot}
        self.parameters = Parameters(source, list(task.parameters), bounds=task.parameters, **common)  # type: ignore[arg-type]
        self._check_parameters()
        actuated = self.parameters.mechanism.actuated
        own = [self.parameters.own_variable(name).name for name in actuated]
        further = Parameters(self.parameters.document, [*task.parameters, *own], **common)  # type: ignore[arg-type]
        self.reaching = Reaching(self.parameters, further, task.reach, task.node)
        self._check_opening()
        self.scoring = Scoring(task, self.reaching)
        scale = [_LARGEST] * task.grows
        self.names = (*self.parameters.names, *["region"] * task.grows)
        self.low = np.append(self.parameters.bounds[:, 0], [-one for one in scale])
        self.high = np.append(self.parameters.bounds[:, 1], scale)
        self.written = np.append(self.parameters.values, [0.0] * task.grows)
        self.evaluations = self.configurations = 0
        self.restart()

    def __repr__(self) -> str:
        return f"<SynthesisProblem of {self.parameters.robot.name}: {len(self.names)} variables>"

    def _check_parameters(self) -> None:
        for one in self.parameters.free:
            if one.joint:
                raise DesignError(f"{one.name} is the variable of {one.joint}, which moves: the task can't choose it")
        check_bounds(self.parameters)

    def _check_opening(self) -> None:
        mechanism, parameters = self.parameters.mechanism, self.parameters
        here = self.reaching.every.evaluate(q=np.array([mechanism.q_home, *mechanism.random_closed(5)]))
        opening = [name for name in here.opening if name in parameters.names]
        if opening:
            raise DesignError(
                f"{', '.join(opening)}: a change opens the loops of {mechanism.name}, which can't be assembled then: "
                "leave it out, or tie it to the parameters that must change with it"
            )

    def check_effects(self) -> None:
        """Check that each parameter changes an objective or a constraint at the file's values or somewhere near.

        Raises:
            DesignError: some do not.
        """
        width, effect = self.high - self.low, np.zeros(len(self.names))
        for part in (0.0, 0.03, -0.03):
            x = np.clip(self.written + part * width, self.low, self.high)
            self.begin(x)
            scores = self.at(x)
            every = [*self.scoring.constraints(scores).values()]
            every += [self.scoring.objective(one, scores) for one in self.task.objectives]
            for rows in every:
                effect = np.maximum(effect, np.abs(rows.slopes).max(axis=(0, 1), initial=0.0) * width)
        idle = [name for name, size in zip(self.names, effect, strict=True) if size <= _WITHOUT_EFFECT]
        if idle:
            raise DesignError(
                f"{', '.join(idle)}: without any effect on {self.reaching.node} where the task wants it, on the loops, "
                "the objectives and the constraints: leave it out"
            )

    # --- designs -------------------------------------------------------------------------------------------------

    def restart(self) -> None:
        """Return to the coarse grid of targets."""
        self.points = self.reach.grid(_COARSE)
        self._known: Reached | None = None
        self._cache: tuple[bytes, Scores] | None = None

    @property
    def reach(self) -> Reach:
        """The targets of the node, with orientations from that at home."""
        return self.reaching.reach

    def split(self, x: Array) -> tuple[Array, float]:
        """Return the values of the parameters and the region's scale."""
        n = len(self.parameters)
        return x[:n], math.exp(x[n]) if self.task.grows else 1.0

    def begin(self, x: Array) -> None:
        """Continue from the file's values to others at all targets."""
        p, scale = self.split(x)
        self._known = self.reaching.from_home(p, self.reach.scaled(self.points, scale))
        self._cache = None

    def at(self, x: ArrayLike) -> Scores:
        """Return the scores at the targets of the optimiser, continued from the last design that reached them."""
        values = np.asarray(x, dtype=float)
        key = values.tobytes()
        if self._cache is None or self._cache[0] != key:
            if self._known is None:
                self.begin(values)
            assert self._known is not None
            p, scale = self.split(values)
            reached = self.reaching.continued(self._known, p, self.reach.scaled(self.points, scale))
            self.evaluations += 1
            self.configurations += len(self.points)
            if reached.is_reached.all() or not self._known.is_reached.all():
                self._known = reached
            self._cache = key, self._scored(reached, scale)
        return self._cache[1]

    def _scored(self, reached: Reached, scale: float) -> Scores:
        growth = reached.targets - self.reach.centre if self.task.grows else None
        return self.scoring.at(reached, scale, growth)

    def targets(self, count: int) -> Array:
        """Return targets (n, rows) of a grid over the region as given, `count` along each axis; m and rad."""
        return self.reach.grid(count)

    def quantities_at(self, p: ArrayLike, targets: Array, scale: float = 1.0) -> dict[str, Array]:
        """Return the values (count,) of the pointwise quantities that the task uses, and of singular values, SI; NaN
        where a target is not reached.

        Args:
            p: (parameters,) m and rad.
            targets: (count, rows) of the region as given.
            scale: of the region.
        """
        return self.scoring.pointwise(self.scores_from_home(np.asarray(p, dtype=float), targets, scale))

    def scores_from_home(self, p: Array, targets: Array, scale: float = 1.0) -> Scores:
        """Return the scores at any targets (count, rows) of the region as given, continued from home."""
        return self._scored(self.reaching.from_home(p, self.reach.scaled(targets, scale)), scale)

    def document_with(self, p: Array) -> Document:
        """Return the document with other values of the parameters (count,). Its home is in the
        assembly mode of the file's: closed from the file's numbers, the loops might end in another one."""
        home, every = self.reaching.home_with(p), self._with_homes
        values = every.values.copy()
        values[[every.index(name) for name in self.parameters.names]] = p
        for k, joint in self._homes.items():
            value = home[self.parameters.mechanism.q_index(joint)]
            if abs(value - values[k]) > _SAME:
                values[k] = value
        return every.document_with(values)

    @cached_property
    def _with_homes(self) -> Parameters:
        """The parameters, and the own variables of all joints, whose written values are the home."""
        own = [one.name for one in self.parameters.all if one.joint]
        names, robot = [*self.task.parameters, *own], self.parameters.robot.name
        return Parameters(self.parameters.document, names, self.task.ties, robot=robot)

    @cached_property
    def _homes(self) -> dict[int, str]:
        every, mechanism = self._with_homes, self.parameters.mechanism
        return {k: one.joint for k, one in enumerate(every.free) if one.joint in mechanism.joints}

    def value(self, objective: DesignObjective, scores: Scores) -> float:
        """Return the score of an objective; larger is better."""
        return self.scoring.value(objective, scores)

    def violation(self, scores: Scores) -> float:
        """Return the largest violation of a constraint, dimensionless."""
        least = [float(rows.values.min(initial=0.0)) for rows in self.scoring.constraints(scores).values()]
        return max(0.0, -min(least))

    def violated(self, scores: Scores) -> str:
        """Return the name of the constraint that is violated most; "" where all hold."""
        worst = {name: rows.values.min(initial=0.0) for name, rows in self.scoring.constraints(scores).items()}
        name = min(worst, key=lambda one: worst[one])
        if worst[name] >= -FEASIBLE:
            return ""
        if name == "clearance" and self.scoring.clearance is not None:
            gaps = scores.gaps.values.min(axis=0)
            return f"clearance of {self.scoring.clearance.names[int(np.argmin(gaps))]}"
        return name

    # --- optimisation --------------------------------------------------------------------------------------------

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
            found = self._solution(best[1], goals, radius)
            moved = float(np.abs((found - best[1]) / size).max())
            merit = self._merit(found, goals)
            if merit > best[0]:
                best = merit, found
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
        return min((self.value(one.objective, scores) - one.least) / one.span for one in goals) if goals else 0.0

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
            rows = [(flat(one), 0.0 if goals else 1.0) for one in self.scoring.constraints(scores).values()]
            for goal in goals:
                found = flat(self._aimed(goal, scores))
                rows.append((ScoreRows((found.values - goal.least) / goal.span, found.slopes / goal.span), 1.0))
            values = np.concatenate([one.values - by_t * t for one, by_t in rows])
            slopes = np.concatenate([one.slopes for one, _ in rows]) * size
            by_t = np.concatenate([np.full(len(one.values), -by_t) for one, by_t in rows])
            return values, np.hstack([slopes, by_t[:, None]])

        scores = self.at(x)
        t = self._bound(scores, goals) if goals else -self.violation(scores)
        first = np.append((x - self.low) / size, t)
        box = [*zip((low - self.low) / size, (high - self.low) / size, strict=True), (None, None if goals else 1e-3)]
        upwards = np.append(np.zeros(n), -1.0)
        held = {"type": "ineq", "fun": lambda y: rows_at(y)[0], "jac": lambda y: rows_at(y)[1]}
        options = {"maxiter": 100, "ftol": 1e-12}
        try:
            found = minimize(
                lambda y: -float(y[-1]), first, jac=lambda y: upwards, method="SLSQP", bounds=box, constraints=held,
                options=options,
            )  # fmt: skip
        except _EnoughError as error:
            return error.x
        return values_at(found.x)

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
