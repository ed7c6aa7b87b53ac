"""A control loop at 1 kHz in a thread of its own, with targets in and states out."""

import time

import numpy as np
import pinocchio as pin

import cinegen
from cinegen.realtime import Tick

PERIOD = 1e-3  # s

delta = cinegen.load("delta4")
solver = cinegen.Solver(delta, PERIOD)
task = solver.add_task("platform")


def follow(tick: Tick) -> pin.SE3:
    """Move to the newest command; return the newest state of the loop."""
    if tick.command is not None:
        task.target.translation = tick.command
    return delta.placement(solver.step().q, "platform")


home = delta.placement(delta.q_home, "platform").translation
with cinegen.Clock(PERIOD) as clock:
    clock.start(follow)
    for frame in range(60):  # one second of a display, or of whatever else the program does
        clock.command = home + np.array([0.002 * frame, 0.0, -0.001 * frame])
        time.sleep(1 / 60)
    x, _, z = clock.state.translation - home
print(f"the platform went {1000 * x:.0f} mm to the side and {-1000 * z:.0f} mm down")

report = clock.report()
print(f"kept its {1000 * report.period:g} ms, with time to spare: {report.busy < 0.5}")
