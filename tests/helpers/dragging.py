"""Drag a mechanism about and measure how well its constraints hold."""

import numpy as np
import pinocchio as pin

import cinegen

DT = 1 / 60


def dragged(mechanism: cinegen.Mechanism, ticks: int = 300, seed: int = 0) -> tuple[float, float]:
    """Return the largest closure residual (rad or lengths) of a drag, and how far any joint came (rad or m).

    The end is dragged along random configurations that it can reach, so that no target is out of reach.
    """
    solver = cinegen.Solver(mechanism, DT)
    reach = [mechanism.placement(q, mechanism.end) for q in mechanism.random_closed(8, seed)]
    task = solver.add_task(mechanism.end, reach[0], 3, 3)
    worst, farthest = 0.0, 0.0
    for i in range(ticks):
        if i % 30 == 0:
            task.target = reach[(i // 30) % len(reach)]
        step = solver.step()
        worst = max(worst, step.closure, mechanism.closure(step.q))
        farthest = max(farthest, float(np.abs(pin.difference(mechanism.model, mechanism.q_home, step.q)).max()))
    return worst, farthest
