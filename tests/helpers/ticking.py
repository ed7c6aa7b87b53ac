"""Many ticks of a solver in one line."""

import cinegen
from cinegen.ik import Step


def ticked(solver: cinegen.Solver, count: int) -> Step:
    """Return the last of some steps."""
    for _ in range(count):
        step = solver.step()
    return step
