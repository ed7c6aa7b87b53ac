"""What a tick says: an arm is pulled along, out of its reach, against a joint limit, and by no hand at all."""

import numpy as np
import pinocchio as pin

import cinegen

arm = cinegen.load("planar_3r")  # its links are 0.9 m long together
solver = cinegen.Solver(arm, dt=1 / 240)
hand = solver.add_task("tool", rotation=0)


def task(x: float, y: float) -> None:
    """Tasks the tool to a place (m) for three seconds and says what became of it."""
    hand.target = pin.SE3(hand.target.rotation, np.array([x, y, 0.0]))
    for _ in range(720):
        step = solver.step()
    print(f"pulled to {x:.2f} {y:.2f}, {step.errors[0][0]:.3f} m off: {step.status.name}", *step.saturated)
    print(f"    ({step.status.value})")


task(0.4, 0.5)
task(1.5, 0.0)
task(0.4, -0.5)
task(-0.89, 0.05)
task(float("nan"), 0.0)
solver.remove_task(hand)
print(f"let go: {solver.step().status.name}")
