"""Forward kinematics of a parallel robot: set the motors, close the loops, read where the platform is."""

import math

import cinegen

delta = cinegen.load("delta4")
q = delta.q_home
for degrees in range(0, -50, -10):
    motors = {"joint1": math.radians(degrees + 5.0), "joint6": math.radians(degrees), "joint12": math.radians(degrees)}
    # Locked joints keep the values they are given. The same motor angles fit several postures of the bars (assembly
    # modes): the one near the posture before is found.
    q = delta.close(delta.configuration(motors, q), locked=delta.actuated)
    x, y, z = delta.placement(q, "platform").translation
    print(f"arms at {degrees + 5:3d}, {degrees:3d}, {degrees:3d} degrees: platform at {x:.4f} {y:z.4f} {z:.4f} m")
