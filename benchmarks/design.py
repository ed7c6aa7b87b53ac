"""What other values of a robot's parameters cost, on one core: closing loops, derivatives, Monte Carlo.

    python benchmarks/design.py [ROBOT...]

All lengths and angles vary by about 0.05 mm and 0.005 degrees. CPU time, the least of several rounds; microseconds for
one set of values. `loaded` edits the document and builds the mechanism again. The last column is the derivative of the
node's Jacobian by all parameters, for one of them, as a multiple of `closed`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cinegen.design import Design, Parameters, tolerance

ROBOTS = Path(__file__).parent.parent / "robots"
COUNT, ROUNDS = 2000, 3
HEADINGS = ("parameters", "loaded us", "closed us", "dX/dp us", "dJ/dp / closed", "Monte Carlo 1e5 s")


def main() -> None:
    print(f"{'':<12}" + "".join(f"{name:>19}" for name in HEADINGS))
    for name in sys.argv[1:] or ["arm7", "five_bar", "delta4", "gough"]:
        print(f"{name:<12}" + "".join(f"{value:>19,.6g}" for value in row(ROBOTS / f"{name}.raff")))


def row(path: Path) -> list[float]:
    """Return the figures of one robot."""
    parameters = Parameters(path)
    design = Design(parameters)
    here, node = design.evaluate(), design.mechanism.end
    sizes = np.where([parameters.all[parameters.find(one)].unit == "m" for one in design.names], 5e-5, 1e-4)
    sizes[[design.names.index(one) for one in here.opening]] = 0.0
    errors = np.random.default_rng(0).normal(size=(COUNT, len(sizes))) * sizes
    values, starts = design.values + errors, here.q[0] + errors @ here.joint_derivative[0].T
    loaded = seconds(lambda: parameters.mechanism_with(values[0]))
    closed = seconds(lambda: design.evaluate(values, starts, derivatives=False, near=True)) / COUNT
    moved = seconds(lambda: design.evaluate(values[:200], starts[:200]).pose_derivative(node)) / 200
    bent = seconds(lambda: design.evaluate(values[:20], starts[:20]).amplification_derivative(node)) / 20
    sigma = {"*": "0.05mm", "*.*": "0.005deg"}
    drawn = seconds(lambda: tolerance(path, sigma, samples=100_000))
    return [len(sizes), 1e6 * loaded, 1e6 * closed, 1e6 * moved, bent / len(sizes) / closed, drawn]


def seconds(call: Callable[[], object]) -> float:
    """Return the CPU time of a call, s."""
    found = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        call()
        found.append(time.process_time() - begin)
    return min(found)


if __name__ == "__main__":
    main()
