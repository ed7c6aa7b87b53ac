"""Cells a second of a map's quantities that come from loads and elasticity, on one core.

    python benchmarks/map_loads.py [ROBOT...]

Maps over the actuated joints, about home; CPU time, the least of several rounds. The first column is that of the cells
alone, which the others contain: their configurations and `sigma_1`.
"""

from __future__ import annotations

from bench import cpu_time, robots

import cinegen
from cinegen.workspace import GridAxis, MapSpecification, Region
from cinegen.workspace.evaluator import ChunkEvaluator

CELLS, ROUNDS = 20_000, 3
NAMES = ("sigma_1", "torque", "payload", "reaction_force", "stiffness", "frequency")


def main() -> None:
    print(f"{'cells a second':<16}" + "".join(f"{name:>16}" for name in NAMES))
    for name, mechanism in robots("arm7", "five_bar", "delta4", "gough"):
        print(f"{name:<16}" + "".join(f"{rate(mechanism, quantity):>16,.0f}" for quantity in NAMES))


def rate(mechanism: cinegen.Mechanism, quantity: str) -> float:
    """Return the cells of a quantity a second."""
    for column in mechanism.actuated:  # torque and payload need limits
        mechanism.model.upperEffortLimit[mechanism.v_index(column)] = 500.0
    home = {name: float(mechanism.q_home[mechanism.q_index(name)]) for name in mechanism.actuated}
    side = round(CELLS ** (1.0 / min(3, len(home))))
    axes = tuple(GridAxis(name, at - 0.05, at + 0.05, side) for name, at in list(home.items())[:3])
    options = {"reaction": mechanism.joints[1]} if quantity == "reaction_force" else {}
    springs = dict.fromkeys(home, 1e5) if quantity in ("stiffness", "frequency") else {}
    spec = MapSpecification(mechanism, Region(axes), (quantity,), limits=False, stiffness=springs, **options)
    evaluator, whole = ChunkEvaluator(spec), tuple(slice(0, axis.count) for axis in axes)
    evaluator.values(tuple(slice(0, 2) for _ in axes))
    return spec.region.size / cpu_time(lambda: evaluator.values(whole), ROUNDS)


if __name__ == "__main__":
    main()
