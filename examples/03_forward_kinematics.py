"""Forward kinematics of a parallel robot: set the actuated joints, close the loops, read the pose of the platform."""

import math

import cinegen

delta = cinegen.load("delta4")
q = delta.q_home
for degrees in range(0, -50, -10):
    actuated = {
        "joint1": math.radians(degrees + 5.0),
        "joint6": math.radians(degrees),
        "joint12": math.radians(degrees),
    }
    # Locked joints keep their values. The same angles fit several configurations (assembly
    # modes): the one near the configuration before is found.
    q = delta.close(delta.configuration(actuated, q), locked=delta.actuated)
    x, y, z = delta.placement(q, "platform").translation
    print(f"arms at {degrees + 5:3d}, {degrees:3d}, {degrees:3d} degrees: platform at {x:.4f} {y:z.4f} {z:.4f} m")
