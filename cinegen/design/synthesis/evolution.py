"""Starts of a synthesis by an evolution: NSGA-II of pymoo.

K. Deb, A. Pratap, S. Agarwal and T. Meyarivan, "A fast and elitist multiobjective genetic algorithm: NSGA-II", IEEE
Trans. Evolutionary Computation 6, 2002. It searches the whole range of the parameters at the coarse grid of targets;
the gradient method then improves what it found.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cinegen.arrays import Array
from cinegen.design.synthesis.problem import SynthesisProblem
from cinegen.errors import CinegenError
from raff2urdf.command.extras import needs

_IMPOSSIBLE = 1e3  # violation of a design that can't be evaluated
_APART = 1e-3  # of the ranges: designs that are nearer are one start


def evolved(
    problem: SynthesisProblem, count: int, report: Callable[[str, int, int], object], seed: int = 1
) -> list[Array]:
    """Return the variables of the best designs that an evolution found, apart from each other: at most `count`, those
    that keep all constraints and are best in an objective first.

    Args:
        problem: whose population and generations are used.
        count: number of designs.
        report: called with what is done, and how many generations of how many.
        seed: of the random numbers.

    Raises:
        MissingExtraError: pymoo is not installed.
    """
    with needs("design", 'search = { method = "evolution" }'):
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.problem import Problem
    task = problem.task
    problem.restart()

    def judged(x: Array) -> tuple[Array, float]:
        try:
            scores = problem.at(x)
            values = np.array([problem.value(objective, scores) for objective in task.objectives])
            violation = problem.violation(scores)
        except (CinegenError, np.linalg.LinAlgError):
            return np.zeros(len(task.objectives)), _IMPOSSIBLE
        if not np.isfinite(values).all() or not np.isfinite(violation):
            return np.zeros(len(task.objectives)), _IMPOSSIBLE
        return values, violation

    class Designs(Problem):  # type: ignore[misc]
        def _evaluate(self, x: Array, out: dict[str, Any], *_: Any, **__: Any) -> None:
            judgements = [judged(row) for row in x]
            out["F"] = np.array([-values for values, _ in judgements])
            out["G"] = np.array([[violation] for _, violation in judgements])

    bounds = {"xl": problem.low, "xu": problem.high}
    designs = Designs(n_var=len(problem.low), n_obj=len(task.objectives), n_ieq_constr=1, **bounds)
    first = problem.low + np.random.default_rng(seed).random((task.population, len(problem.low))) * (
        problem.high - problem.low
    )
    first[0] = problem.written
    search = NSGA2(pop_size=task.population, sampling=first)
    search.setup(designs, termination=("n_gen", task.generations), seed=seed, verbose=False)
    while search.has_next():
        report("evolution", search.n_iter - 1 if search.n_iter else 0, task.generations)
        search.next()
    everyone = search.pop
    x, values, violation = everyone.get("X"), everyone.get("F"), everyone.get("G")[:, 0]
    order = np.lexsort((values[:, 0], np.maximum(violation, 0.0)))
    if len(task.objectives) > 1:  # the best of each objective first
        ends = [int(np.lexsort((values[:, k], np.maximum(violation, 0.0)))[0]) for k in range(len(task.objectives))]
        order = np.array([*dict.fromkeys([*ends, *order.tolist()])])
    chosen: list[Array] = []
    width = np.where(problem.high > problem.low, problem.high - problem.low, 1.0)
    for i in order:
        if all(np.abs((x[i] - other) / width).max() > _APART for other in chosen):
            chosen.append(np.asarray(x[i], dtype=float))
        if len(chosen) == count:
            break
    return chosen
