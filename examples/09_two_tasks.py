"""Two tasks at once: the tool of a seven-joint arm keeps its pose while its elbow is dragged aside."""

import cinegen

arm = cinegen.load("arm7")
solver = cinegen.Solver(arm, dt=1 / 240)
tool = solver.add_task("tool")
tool.weight = 100.0  # where both can't be had, the tool counts more
elbow = solver.add_task("link4", rotation=0)
start = elbow.target.translation.copy()
for tick in range(480):
    elbow.target.translation += [0.0, 0.001, 0.0]  # m
    step = solver.step()
    if tick % 120 == 119:
        moved = arm.placement(step.q, "link4").translation - start
        metres, radians = step.errors[0]  # in the order the tasks were made
        print(f"elbow moved by {1000 * moved[1]:.0f} mm, tool off by {1000 * metres:.2f} mm and {radians:.5f} rad")

solver.remove_task(elbow)
step = solver.step()
print(f"let go: {step.status.name}, {len(solver.tasks)} task holds")
