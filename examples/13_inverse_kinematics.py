"""Inverse kinematics: the leg lengths of a Gough platform, poses it can't reach, and all configurations of an arm."""

import numpy as np
import pinocchio as pin

import cinegen

platform = cinegen.load("gough")
home = platform.placement(platform.q_home, "platform")

for tilt in (0, 10, 20, 30, 40, 50):
    target = home.copy()
    target.rotation = home.rotation @ pin.utils.rotate("x", np.radians(tilt))
    reached = cinegen.inverse_kinematics(platform, {"platform": target})
    legs = [1000 * reached.q[platform.q_index(leg)] for leg in platform.actuated]
    if reached:
        print(f"tilted by {tilt} degrees, legs of", " ".join(f"{leg:.0f}" for leg in legs), "mm")
    else:
        print(f"not by {tilt} degrees: {', '.join(reached.saturated)} are as long or short as they can be")

arm = cinegen.load("rx90")
solutions = cinegen.inverse_kinematics(arm, {"tool": arm.placement(arm.q_home, "tool")}, all=True)
print(f"{solutions}: {solutions.method}")
for q in solutions:
    print(" ".join(f"{np.degrees(q[arm.q_index(joint)]):8.2f}" for joint in arm.actuated))
