"""An arm welds a pipe to a tilted plate; then the error of its tool is measured, in distance and angles."""

import numpy as np
import pinocchio as pin

import cinegen
from cinegen.toolpath import Seam

WORK, TRAVEL = np.radians(40.0), np.radians(10.0)  # leans away from the pipe, and points where it goes
GAP, RADIUS = 0.012, 0.06  # m: from the tool to the seam, and the pipe's

plate = pin.SE3(pin.utils.rotate("y", np.radians(-25.0)), np.array([0.6, 0.0, 0.2]))
turns = np.radians(np.arange(180.0, 541.0, 10.0))
points = [plate.act(RADIUS * np.array([np.cos(turn), np.sin(turn), 0.0])) for turn in turns]
normals = [plate.rotation[:, 2]] * len(points)
# Rolled by half a turn about its own axis, the tool gets all around: joint 6 turns by 270 degrees to either side.
seam = Seam(points, normals, GAP, WORK, TRAVEL, speed=0.05, approach=0.03, roll=np.pi)
print(seam)

arm = cinegen.load("rx90")
solver = cinegen.Solver(arm, dt=1 / 240)
tool = solver.add_task("tool")

worst = np.zeros(3)  # m, rad, rad
for tick in range(round(240 * (1.0 + seam.duration))):
    tool.target = seam.target(tick / 240)
    seen = plate.actInv(arm.placement(solver.step().q, "tool"))  # from the pipe's middle, with the plate's z
    axis = seen.rotation[:, 2]
    tip = seen.translation + GAP * axis
    if tick > 240 and tip[2] < 1e-6:  # it has come in the first second, and is on the seam
        along = np.array([-tip[1], tip[0], 0.0]) / np.hypot(tip[0], tip[1])
        across = np.cross(along, axis)
        travel, work = np.arcsin(axis @ along), np.arcsin(across[2] / np.linalg.norm(across))
        off = np.hypot(np.hypot(tip[0], tip[1]) - RADIUS, tip[2])
        worst = np.maximum(worst, np.abs([off, work - WORK, travel - TRAVEL]))
print(f"off the seam by {1e6 * worst[0]:.0f} um at most,", end=" ")
print(f"the work angle by {np.degrees(worst[1]):.2f} degrees, the travel angle by {np.degrees(worst[2]):.2f}")
