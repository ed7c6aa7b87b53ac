"""Time of the torques of actuated joints: one configuration at a time from Python, and many in one call.

    python benchmarks/forces.py [ROBOT...]

CPU time in microseconds, the least of several rounds, and its ratio to what Pinocchio's rnea takes on the tree alone:

    rnea      Pinocchio, of the tree with its loops open
    torques   InverseDynamics.torques at rest
    moving    the same with velocities and accelerations of the actuated joints, completed
    many      InverseDynamics.torques_of, for each of 5000 configurations
    loads     InverseDynamics.set_loads, with another payload
    forces    cinegen.forces with an InverseDynamics that is kept: reactions, and what is determined
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from bench import cpu_time, robots

import cinegen
from cinegen.dynamics.forces import forces_at

ROUNDS, MANY = 7, 5000


def microseconds(call: Callable[[], object], count: int) -> float:
    return 1e6 * cpu_time(call, ROUNDS, count)


def main() -> None:
    headings = (("joints", 7), ("rnea", 8), ("torques", 9), ("ratio", 7), ("moving", 8), ("many", 7), ("a second", 10))
    print(f"{'us':<12}" + "".join(f"{name:>{width}}" for name, width in (*headings, ("loads", 7), ("forces", 8))))
    for name, mechanism in robots("arm7", "five_bar", "delta4", "gough", "tssm", "sr400"):
        measure(name, mechanism)


def measure(name: str, mechanism: cinegen.Mechanism) -> None:
    payload = cinegen.Payload(mechanism.end, 2.0, (0.0, 0.0, 0.05))
    dynamics, q = cinegen.InverseDynamics(mechanism, [payload], massless=True), mechanism.q_home
    model, data, still = dynamics.tree.model, dynamics.tree.data, np.zeros(mechanism.model.nv)
    rates = dict.fromkeys(mechanism.actuated, 0.5)
    many = np.tile(q, (MANY, 1))
    rnea = microseconds(lambda: pin.rnea(model, data, q, still, still), 2000)
    torques = microseconds(lambda: dynamics.torques(q), 2000)
    moving = microseconds(lambda: dynamics.torques(q, rates, rates), 1000)
    each = microseconds(lambda: dynamics.torques_of(many), 1) / MANY
    loads = microseconds(lambda: dynamics.set_loads([payload]), 100)
    whole = microseconds(lambda: forces_at(dynamics, q), 20)
    print(
        f"{name:<12}{model.njoints - 1:>7}{rnea:>8.1f}{torques:>9.1f}{torques / rnea:>7.1f}{moving:>8.1f}{each:>7.2f}"
        f"{1e6 / each:>10.0f}{loads:>7.0f}{whole:>8.0f}"
    )


if __name__ == "__main__":
    main()
