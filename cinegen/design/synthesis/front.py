"""Pareto fronts of several objectives.

The ends are the best designs of each objective alone. From reference points on the plane through them, evenly spread
(I. Das and J. E. Dennis, "Normal-boundary intersection", SIAM J. Optimization 8, 1998), all objectives are improved
together as far as possible. What another design dominates is left out.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from cinegen.arrays import Array
from cinegen.design.errors import DesignError
from cinegen.design.synthesis.designs import FEASIBLE
from cinegen.design.synthesis.problem import Goal, SynthesisProblem
from cinegen.errors import CinegenError

_SPAN = 1e-9  # of a score: below, both ends are the same


def front_of(
    problem: SynthesisProblem,
    starts: list[Array],
    known: list[list[float]],
    keep: Callable[[list[list[float]]], object],
    report: Callable[[str, int, int], object],
) -> list[Array]:
    """Return the variables of designs of which none dominates another, in the order of the first objective.

    Args:
        problem: with several objectives.
        starts: (variables,) of feasible designs, the best first; they compete, too.
        known: designs that an interrupted run had finished.
        keep: called with all finished designs after each.
        report: called with what is done, and how many designs of how many.

    Raises:
        DesignError: no design but the starts' was found for any objective.
    """
    objectives = problem.task.objectives
    done = [np.array(x) for x in known]

    def scores_of(x: Array) -> Array:
        problem.begin(x)
        scores = problem.at(x)
        if problem.violation(scores) > FEASIBLE:
            return np.full(len(objectives), -np.inf)
        return np.array([problem.value(objective, scores) for objective in objectives])

    def add(start: Array, goals: list[Goal]) -> None:
        problem.restart()
        try:
            design = problem.optimised(start, goals)
        except (CinegenError, np.linalg.LinAlgError):
            design = start  # it competes with the others as it is
        done.append(design)
        keep([x.tolist() for x in done])

    total = max(len(objectives), problem.task.front)
    weights = _weights(len(objectives), total)
    total = len(objectives) + len(weights)
    for k in range(len(done), len(objectives)):
        report("Pareto front: ends", k, total)
        problem.restart()
        candidates = [*starts, *done]
        best = max(candidates, key=lambda x: scores_of(x)[k])
        add(best, [Goal(objectives[k])])
    problem.restart()
    ends = np.array([scores_of(x) for x in done[: len(objectives)]])
    if not np.isfinite(ends).all():
        raise DesignError("the best designs of single objectives do not keep all constraints: give more starts")
    span = np.ptp(ends, axis=0)
    if (span > _SPAN).all():
        for k in range(len(done), total):
            report("Pareto front", k, total)
            weight = weights[k - len(objectives)]
            problem.restart()
            plane = weight @ ends
            near = max(done, key=lambda x: float(((scores_of(x) - plane) / span).min()))
            add(near, [Goal(*goal) for goal in zip(objectives, plane.tolist(), span.tolist(), strict=True)])
    problem.restart()
    candidates = [*done, *starts]
    scores = np.array([scores_of(x) for x in candidates])
    kept: list[int] = []
    for i in np.argsort(-scores[:, 0], kind="stable"):
        row = scores[i]
        if np.isfinite(row).all() and not _is_dominated(row, scores) and not _is_among(row, scores[kept]):
            kept.append(int(i))
    return [candidates[i] for i in kept]


def _weights(objectives: int, count: int) -> list[Array]:
    """Return the weights of reference points of a simplex lattice (I. Das and J. E. Dennis, "Normal-boundary
    intersection", SIAM Journal on Optimization 8(3), 1998), evenly thinned out to `count` with its ends, which are left
    out."""
    parts = next(n for n in itertools.count(1) if math.comb(n + objectives - 1, objectives - 1) >= count)
    lattice = itertools.product(range(parts, -1, -1), repeat=objectives)
    inner = [np.array(row) / parts for row in lattice if sum(row) == parts and max(row) < parts]
    return [inner[i] for i in np.linspace(0, len(inner) - 1, max(count - objectives, 0)).round().astype(int)]


def _is_dominated(row: Array, others: Array) -> bool:
    """Return whether another design is as good in all objectives and better in one, beyond rounding."""
    slack = 1e-7 * np.maximum(np.abs(row), 1e-3)
    as_good = (others >= row - slack).all(axis=1)
    return bool((as_good & (others > row + slack).any(axis=1)).any())


def _is_among(row: Array, others: Array) -> bool:
    return bool(len(others) and (np.abs(others - row).max(axis=1) < 1e-6 * np.maximum(np.abs(row).max(), 1e-3)).any())


def knee(scores: Array) -> int:
    """Return the index of the design whose scores (n, objectives) are nearest to the best of all objectives, each
    divided by its range."""
    span = np.ptp(scores, axis=0)
    lack = (scores.max(axis=0) - scores) / np.where(span > 0.0, span, 1.0)
    return int(np.argmin(np.linalg.norm(lack, axis=1)))
