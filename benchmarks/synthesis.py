"""Evaluations that synthesis takes, against differential evolution of scipy at the same objective.

    python benchmarks/synthesis.py [SEED]

For each task, in one run: what the gradient method evaluates from the file's values until its answer, and what
`scipy.optimize.differential_evolution` evaluates until it is as good to a relative 1e-6, or to a limit. Both evaluate
the same objective at the same targets, those to which the gradient method's exchange led: the evolution is spared the
search for them. A violated constraint costs the evolution its size, times a factor.

`designs` are evaluations of all targets. `configurations` are single targets, which include the finer grids of the
exchange: the work of the gradient method as a whole.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution

from cinegen.design.synthesis import SynthesisProblem, SynthesisTask, task_of
from cinegen.design.synthesis.problem import Goal

sys.path.insert(0, str(Path(__file__).parent.parent / "tests/helpers"))
from orthoglide import orthoglide

ENOUGH = 1e-6  # relative, of the objective
MOST = 20_000  # evaluations
PENALTY = 1e3

ORTHOGLIDE = {
    "parameters": {"link4.d": "250..800mm", "frame20.d": "-100..100mm"},
    "ties": ["link4.d = link9.d = link15.d", "frame20.r = -1*frame20.d", "frame20.d = frame20.epsilon"],
    "reach": dict.fromkeys("xyz", "-100..100mm"),
    "objective": [{"minimise": "size", "of": ["link4.d"]}],
    "constraints": {"singular_values": "0.5..2"},
}
FIVE_BAR = {
    "parameters": {
        "link1.d": "-300..-50mm", "link3.d": "50..300mm", "link2.d": "150..500mm", "link4.d": "150..500mm",
        "link5.d": "200..600mm", "frame20.d": "200..600mm",
    },
    "reach": {"x": "-150..150mm", "y": "300..500mm"},
    "objective": [{"minimise": "condition"}],
    "constraints": {"joint_limits": False},
}  # fmt: skip


class EnoughError(Exception):
    """Differential evolution is as good as the answer."""


def main(seed: int) -> None:
    print(f"{'':<12}{'':>10}{'designs':^31}{'configurations':^35}")
    print(
        f"{'task':<12}{'variables':>10}" + f"{'gradient':>11}{'evolution':>11}{'ratio':>9}" * 2 + "   objective by both"
    )
    with tempfile.TemporaryDirectory() as folder:
        glide = Path(folder) / "orthoglide.raff"
        glide.write_text(orthoglide(), encoding="utf-8")
        for name, source, values in (("five_bar", "five_bar", FIVE_BAR), ("orthoglide", glide, ORTHOGLIDE)):
            task = task_of(values)
            assert isinstance(task, SynthesisTask)
            measure(name, SynthesisProblem(source, task), seed)


def measure(name: str, problem: SynthesisProblem, seed: int) -> None:
    (objective,) = problem.task.objectives
    x = problem.optimised(problem.written, [Goal(objective)])
    designs, configurations, scores = problem.evaluations, problem.configurations, problem.at(x)
    assert problem.violation(scores) < 1e-6
    goal = problem.value(objective, scores)
    problem.begin(problem.written)  # the same targets, from the file's values
    problem.evaluations, best = 0, [np.inf]

    def cost(values: np.ndarray) -> float:
        found = problem.at(values)
        value = -problem.value(objective, found) + PENALTY * problem.violation(found)
        best[0] = min(best[0], value)
        if best[0] <= -goal + ENOUGH * abs(goal) or problem.evaluations >= MOST:
            raise EnoughError
        return value

    bounds = np.stack([problem.low, problem.high], axis=1)
    with contextlib.suppress(EnoughError):
        differential_evolution(cost, bounds, seed=seed, maxiter=100_000, tol=0.0, polish=False)
    other = problem.evaluations
    tried = other * len(problem.points)
    reached = "" if other < MOST else " (not reached)"
    print(
        f"{name:<12}{len(x):>10}{designs:>11}{other:>11}{other / designs:>9.0f}"
        f"{configurations:>11}{tried:>11}{tried / configurations:>9.0f}   "
        f"{problem.scoring.shown(objective, goal):.6g} {problem.scoring.shown(objective, -best[0]):.6g}{reached}",
        flush=True,
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
