"""The statuses of a tick: an arm is dragged along, out of its reach, against a joint limit, and not at all."""

import numpy as np
import pinocchio as pin

import cinegen

arm = cinegen.load("planar_3r")  # its links are 0.9 m long together
solver = cinegen.Solver(arm, dt=1 / 240)
task = solver.add_task("tool", rotation=0)


def drag(x: float, y: float) -> None:
    """Drag the tool to a position (m) for three seconds, and print the status."""
    task.target = pin.SE3(task.target.rotation, np.array([x, y, 0.0]))
    for _ in range(720):
        step = solver.step()
    print(f"dragged to {x:.2f} {y:.2f}, {step.errors[0][0]:.3f} m off: {step.status.name}", *step.saturated)
    print(f"    ({step.status.value})")


drag(0.4, 0.5)
drag(1.5, 0.0)
drag(0.4, -0.5)
drag(-0.89, 0.05)
drag(float("nan"), 0.0)
solver.remove_task(task)
print(f"without a task: {solver.step().status.name}")
