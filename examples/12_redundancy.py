"""Redundancy: the tool of a seven-joint arm keeps its pose while an objective moves the elbow."""

import math

import cinegen
from cinegen.ik import LimitMargin, Manipulability, Objective, Posture, State

arm = cinegen.load("arm7")
solver = cinegen.Solver(arm, dt=1 / 240)
tool = solver.add_task("tool")
home = arm.placement(arm.q_home, "link4").translation


class Lift:
    """An objective of one's own: the elbow goes up."""

    def velocity(self, state: State):
        """Return joint velocities, rad/s, in the direction that raises it fastest."""
        up = state.mechanism.placement(state.q, "link4").rotation[2]  # the world's z, seen from the elbow
        return 20.0 * up @ state.mechanism.jacobian(state.q, "link4")[:3]


def serve(*objectives: Objective) -> None:
    """Five seconds with some objectives."""
    solver.objectives = objectives
    for _ in range(1200):
        step = solver.step()
    x, y, z = 1000 * (arm.placement(step.q, "link4").translation - home)
    print(" and ".join(type(objective).__name__ for objective in objectives))
    print(f"    elbow moved by {x:.0f} {y:.0f} {z:.0f} mm, tool off by {1e9 * step.errors[0][0]:.0f} nm")
    print(f"    manipulability {math.prod(step.singular_values):.4f}")


serve(Manipulability())  # away from singularities
serve(Manipulability(), LimitMargin(0.4, rate=5.0))  # rates say how much each counts
serve(Posture(rate=2.0))  # home again
serve(Lift())
