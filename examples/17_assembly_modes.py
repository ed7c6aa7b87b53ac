"""A Gough platform is switched on: its legs' lengths are known, its place is not. All that fit, and which it is."""

import numpy as np

import cinegen

robot = cinegen.load("robots/gough.raff")
lengths = [0.96, 1.0, 1.05, 1.05, 1.1, 1.0]  # m, as the encoders say, in the order of robot.actuated

modes = cinegen.assembly_modes(robot, lengths)
print(f"{len(modes)} ways to assemble it, {'and no other' if modes.complete else 'perhaps more'} ({modes.method})")

possible = []
for q, pose in zip(modes, modes.placements("platform"), strict=True):
    x, y, z = 1000 * pose.translation
    tilt = np.degrees(np.arccos(pose.rotation[2, 2]))
    beyond = robot.limits.outside(q)
    if not beyond:
        possible.append(q)
    print(f"    {x:6.1f} {y:6.1f} {z:6.1f} mm, tilted by {tilt:5.1f} degrees:", ", ".join(beyond) or "within limits")

if len(possible) == 1:  # else one more sensor has to tell, as an inclinometer
    solver = cinegen.Solver(robot, dt=1 / 240, q=possible[0])
    hand = solver.add_task("platform")
    hand.target.translation[2] += 0.05  # m, up
    for _ in range(240):
        step = solver.step()
    legs = [step.q[robot.q_index(leg)] - length for leg, length in zip(robot.actuated, lengths, strict=True)]
    print("up by 50 mm, legs move by", " ".join(f"{1000 * leg:.1f}" for leg in legs), "mm:", step.status.name)
