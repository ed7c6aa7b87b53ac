"""Results of syntheses with the problem that evaluates them: quantities over the region, for reports."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from cinegen.design import Synthesis, synthesize
from cinegen.design.synthesis import SynthesisProblem, task_of


def evaluated(source, values) -> Synthesis:
    """Return a synthesis with a `problem`."""
    found = synthesize(source, values)
    problem = SynthesisProblem(source, task_of(values))

    def quantities_at(p, targets):
        scores = problem.scoring.at(problem.reaching.from_home(np.array(p), targets))
        reached = scores.reached.is_reached & (scores.sigma[:, 0] > 0.0)
        least, inverse, product = np.where(reached[:, None], scores.sigma, np.nan).T
        return {"sigma_1": least, "sigma_max": 1.0 / inverse, "condition": 1.0 / product}

    own = SimpleNamespace(
        points=problem.points, scoring=problem.scoring, targets=problem.task.reach.grid, quantities_at=quantities_at
    )
    object.__setattr__(found, "problem", own)  # the result is frozen
    return found
