"""`Designs`: the scores of a task at values of the parameters, continued from the file's."""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path

import numpy as np

from cinegen.arrays import Array, ArrayLike
from cinegen.design.errors import DesignError
from cinegen.design.parameters import Parameters
from cinegen.design.synthesis.home import HomedDocuments
from cinegen.design.synthesis.objectives import Scoring
from cinegen.design.synthesis.reaching import Reached, Reaching
from cinegen.design.synthesis.region import Reach
from cinegen.design.synthesis.scores import Scores
from cinegen.design.synthesis.task import DesignObjective, SynthesisTask, check_free
from raff2urdf import Document
from raff2urdf.errors import counted

FEASIBLE = 1e-6
"""A constraint that is violated by no more, dimensionless, holds."""

_COARSE = 3  # points along each axis
WITHOUT_EFFECT = 1e-10
"""Dimensionless: a parameter that changes less has no effect."""

_LARGEST = math.log(20.0)  # of the region's scale, and of its inverse


class Designs:
    """The designs of a task for a mechanism.

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
        check_free(self.parameters)
        actuated = self.parameters.mechanism.actuated
        variables = [self.parameters.own_variable(name).name for name in actuated]
        further = Parameters(self.parameters.document, [*task.parameters, *variables], **common)  # type: ignore[arg-type]
        self.reaching = Reaching(self.parameters, further, task.reach, task.node)
        self._check_opening()
        self.scoring = Scoring(task, self.reaching)
        scale = [_LARGEST] * task.grows
        self.names = (*self.parameters.names, *["region"] * task.grows)
        self.low = np.append(self.parameters.bounds[:, 0], [-bound for bound in scale])
        self.high = np.append(self.parameters.bounds[:, 1], scale)
        self.written = np.append(self.parameters.values, [0.0] * task.grows)
        self.evaluations = self.configurations = 0
        self.restart()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.parameters.robot.name}: {counted(len(self.names), 'variable')}>"

    def _check_opening(self) -> None:
        mechanism, parameters = self.parameters.mechanism, self.parameters
        evaluation = self.reaching.every.evaluate(q=np.array([mechanism.q_home, *mechanism.random_closed(5)]))
        opening = [name for name in evaluation.opening if name in parameters.names]
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
            every += [self.scoring.objective(objective, scores) for objective in self.task.objectives]
            for rows in every:
                effect = np.maximum(effect, np.abs(rows.slopes).max(axis=(0, 1), initial=0.0) * width)
        idle = [name for name, size in zip(self.names, effect, strict=True) if size <= WITHOUT_EFFECT]
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
        assembly mode of the file's."""
        return self._documents.at(p, self.reaching.home_with(p))

    @cached_property
    def _documents(self) -> HomedDocuments:
        return HomedDocuments(self.parameters, self.task.ties)

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
        name = min(worst, key=lambda constraint: worst[constraint])
        if worst[name] >= -FEASIBLE:
            return ""
        if name == "clearance" and self.scoring.clearance is not None:
            gaps = scores.gaps.values.min(axis=0)
            return f"clearance of {self.scoring.clearance.names[int(np.argmin(gaps))]}"
        return name
