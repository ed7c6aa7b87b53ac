"""What other values of a robot's parameters cost, on one core: closing loops, derivatives, Monte Carlo.

    python benchmarks/design.py [ROBOT...]

All lengths and angles vary by about 0.05 mm and 0.005 degrees. CPU time, the least of several rounds; microseconds for
one set of values. `loaded` edits the document and builds the mechanism again. The last column is the derivative of the
node's Jacobian by all parameters, for one of them, as a multiple of `closed`.
"""

from __future__ import annotations

import numpy as np
from bench import cpu_time, robots

from cinegen.design import Design, Parameters, tolerance

COUNT, ROUNDS = 2000, 3
HEADINGS = ("parameters", "loaded us", "closed us", "dX/dp us", "dJ/dp / closed", "Monte Carlo 1e5 s")


def main() -> None:
    print(f"{'':<12}" + "".join(f"{name:>19}" for name in HEADINGS))
    for name, _ in robots("arm7", "five_bar", "delta4", "gough"):
        print(f"{name:<12}" + "".join(f"{value:>19,.6g}" for value in row(name)))


def row(name: str) -> list[float]:
    """Return the figures of one robot."""
    parameters = Parameters(name)
    design = Design(parameters)
    evaluation, node = design.evaluate(), design.mechanism.end
    sizes = np.where([parameters.all[parameters.find(parameter)].unit == "m" for parameter in design.names], 5e-5, 1e-4)
    sizes[[design.names.index(parameter) for parameter in evaluation.opening]] = 0.0
    errors = np.random.default_rng(0).normal(size=(COUNT, len(sizes))) * sizes
    values, starts = design.values + errors, evaluation.q[0] + errors @ evaluation.joint_derivative[0].T
    loaded = cpu_time(lambda: parameters.mechanism_with(values[0]), ROUNDS)
    closed = cpu_time(lambda: design.evaluate(values, starts, derivatives=False, near=True), ROUNDS) / COUNT
    moved = cpu_time(lambda: design.evaluate(values[:200], starts[:200]).pose_derivative(node), ROUNDS) / 200
    bent = cpu_time(lambda: design.evaluate(values[:20], starts[:20]).amplification_derivative(node), ROUNDS) / 20
    sigma = {"*": "0.05mm", "*.*": "0.005deg"}
    drawn = cpu_time(lambda: tolerance(name, sigma, samples=100_000), ROUNDS)
    return [len(sizes), 1e6 * loaded, 1e6 * closed, 1e6 * moved, bent / len(sizes) / closed, drawn]


if __name__ == "__main__":
    main()
