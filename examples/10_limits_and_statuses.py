"""What a tick says: an arm is pulled along, out of its reach, against a joint limit, and by no hand at all."""

import numpy as np
import pinocchio as pin

import cinegen

arm = cinegen.load("robots/planar_3r.raff")  # its links are 0.9 m long together
solver = cinegen.Solver(arm, dt=1 / 240)
hand = solver.pull("tool", rotation=0)


def pull_to(x: float, y: float) -> None:
    """Pulls the tool to a place (m) for three seconds and says what became of it."""
    hand.target = pin.SE3(hand.target.rotation, np.array([x, y, 0.0]))
    for _ in range(720):
        step = solver.step()
    print(f"pulled to {x:.2f} {y:.2f}, {step.errors[0][0]:.3f} m off: {step.status.name}", *step.saturated)
    print(f"    ({step.status.value})")


pull_to(0.4, 0.5)
pull_to(1.5, 0.0)
pull_to(0.4, -0.5)
pull_to(-0.89, 0.05)
pull_to(float("nan"), 0.0)
solver.release(hand)
print(f"let go: {solver.step().status.name}")
