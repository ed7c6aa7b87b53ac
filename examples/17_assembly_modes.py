"""A Gough platform is switched on: its leg lengths are known, its pose is not. List all that fit, and select one."""

import numpy as np

import cinegen

robot = cinegen.load("gough")
lengths = [0.96, 1.0, 1.05, 1.05, 1.1, 1.0]  # m, from the encoders, in the order of robot.actuated

modes = cinegen.assembly_modes(robot, lengths)
print(f"{len(modes)} assembly modes, {'and no other' if modes.proved else 'perhaps more'} ({modes.method})")

possible = []
for q, pose in zip(modes, modes.placements("platform"), strict=True):
    x, y, z = 1000 * pose.translation
    tilt = np.degrees(np.arccos(pose.rotation[2, 2]))
    beyond = robot.limits.outside(q)
    if not beyond:
        possible.append(q)
    print(f"    {x:6.1f} {y:6.1f} {z:6.1f} mm, tilted by {tilt:5.1f} degrees:", ", ".join(beyond) or "within limits")

if len(possible) == 1:  # else one more sensor is needed, such as an inclinometer
    solver = cinegen.Solver(robot, dt=1 / 240, q=possible[0])
    task = solver.add_task("platform")
    task.target.translation[2] += 0.05  # m, up
    for _ in range(240):
        step = solver.step()
    legs = [step.q[robot.q_index(leg)] - length for leg, length in zip(robot.actuated, lengths, strict=True)]
    print("50 mm upwards, legs move by", " ".join(f"{1000 * leg:.1f}" for leg in legs), "mm:", step.status.name)
