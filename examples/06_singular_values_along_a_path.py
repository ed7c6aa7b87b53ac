"""Singular values along a path: a delta robot moves straight down, until its arms are nearly stretched."""

import cinegen

delta = cinegen.load("delta4")
solver = cinegen.Solver(delta, dt=1 / 240)
task = solver.add_task("platform", rotation=0)
for tick in range(1, 841):
    task.target.translation -= [0.0, 0.0, 0.005]  # m
    step = solver.step()
    if tick % 120 == 0:
        # Of the tasks, all three: a direction is lost where one vanishes (type 1 singularity). Of the loops, the
        # smallest: a direction is gained where it vanishes (type 2).
        tasks = " ".join(f"{sigma:.3f}" for sigma in step.singular_values)
        loops = f"{step.loop_singular_values[-1]:.3f}"
        behind = f"{1000 * step.errors[0][0]:.1f} mm behind"
        print(f"{tick * 0.005:.1f} m down: tasks {tasks}, loops {loops}, {step.status.name}, {behind}")
