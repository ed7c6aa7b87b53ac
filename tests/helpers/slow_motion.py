"""A motion of actuated joints in tiny steps, by Newton's method in numpy."""

import numpy as np

import cinegen
from raff2urdf import closure


def walk(mechanism: cinegen.Mechanism, begin: np.ndarray, goal: np.ndarray, steps: int) -> np.ndarray | None:
    """Return (steps + 1, nq) configurations on a straight motion of the actuated joints to a goal; None where there is
    a singularity, or a jump."""
    system, at = mechanism.structure.system, [mechanism.q_index(joint) for joint in mechanism.actuated]
    free = np.ones(mechanism.model.nv, dtype=bool)
    free[[mechanism.v_index(joint) for joint in mechanism.actuated]] = False
    path = [begin, begin]
    for k in range(1, steps + 1):
        start = 2.0 * path[-1] - path[-2]
        start[at] = begin[at] + (goal - begin[at]) * (k / steps)
        closing = closure.close(system, start, free, 20)
        rows = system.evaluate(closing.q)[1][:, free]
        smallest = np.linalg.svd(rows, compute_uv=False)[mechanism.loop_rank - 1]
        if not closing.closed or smallest < 0.01 or np.abs(closing.q - path[-1]).max() > 0.2:
            return None
        path.append(closing.q)
    return np.array(path[1:])
