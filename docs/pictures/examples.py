"""Draws the pictures of examples/ again, from what each example leaves: `python docs/pictures/examples.py [NAME ...]`.

Needs chromium on PATH, and gcc. Examples that have none here show a picture of another page: docs/site/examples.toml.
"""

import contextlib
import io
import runpy
import sys
from types import SimpleNamespace

import numpy as np
from figures import PICTURES, ROBOTS, chromium, save
from make import draw
from meshcat import Visualizer
from meshcat.geometry import Sphere

import cinegen
from cinegen.cockpit.graphic_file import material
from cinegen.plotting import draw_designs
from cinegen.plotting.proof import draw_proof
from cinegen.plotting.sheet import BLUE, GREEN, INK, ORANGE, finish, label, sheet
from cinegen.plotting.sweep import draw_sweep

SIZE = (720, 480)  # pixels
ABOVE, FLAT, ARM = (-58.0, 22.0), (-72.0, 48.0), (-40.0, 22.0)  # degrees: azimuth and elevation of the camera
_DOT, _PATH = 0.009, 0x0072B2  # radius of the dots of a path, m, and their colour


def dots(points):
    """Return what adds a path to the scene: points (n, 3), m."""

    def add(page):
        for k, point in enumerate(points):
            node = Visualizer(window=page)[f"/meshcat/cinegen/path/{k}"]
            node.set_object(Sphere(_DOT), material(_PATH))
            at = np.eye(4)
            at[:3, 3] = point
            node.set_transform(at)

    return add


def singular_values(left):
    """Singular values while a delta moves down, as the example prints them."""
    solver = cinegen.Solver(left["delta"], dt=1 / 240)
    task, rows = solver.add_task("platform", rotation=0), []
    for _ in range(840):
        task.target.translation -= [0.0, 0.0, 0.005]  # m
        step = solver.step()
        rows.append([*step.singular_values, step.loop_singular_values[-1]])
    figure, body = sheet(6.0, 3.4, "A delta robot moves down", "singular values, until its arms are nearly stretched")
    axes, rows, down = body.subplots(), np.array(rows), 0.005 * np.arange(1, 841)
    for column, colour in zip(rows.T[:3], (BLUE, GREEN, ORANGE), strict=True):
        axes.plot(down, column, color=colour)
    axes.plot(down, rows[:, 3], "--", color=INK, label="smallest of the loops")
    axes.plot([], [], color=BLUE, label="of the task")
    label(axes, "distance (m)", "singular value")
    axes.set_ylim(bottom=0.0)
    finish(figure)
    return figure


def clock(left):
    """Commands of a program at 60 Hz, and how the loop at 1 kHz follows them."""
    left["task"].target.translation = left["home"]
    for _ in range(2000):
        left["solver"].step()
    commanded, reached = [], []
    for tick in range(100):
        frame = 60 * tick // 1000
        command = left["home"] + np.array([0.002 * frame, 0.0, -0.001 * frame])
        commanded.append(command[0])
        reached.append(left["follow"](SimpleNamespace(command=command)).translation[0])
    figure, body = sheet(6.0, 3.4, "A control loop at 1 kHz", "commands come at 60 Hz; the robot moves on in each tick")
    axes = body.subplots()
    axes.step(np.arange(100), 1e3 * np.array(commanded), color=ORANGE, where="post", label="command")
    axes.plot(np.arange(1, 101), 1e3 * np.array(reached), color=BLUE, label="platform")
    label(axes, "time (ms)", "x (mm)")
    finish(figure)
    return figure


def steps(left):
    """Positions of three stepper motors over time, counted in steps."""
    figure, body = sheet(6.0, 3.4, "Steps of a delta robot", "its platform moves by 0.6 m in 1 s")
    axes = body.subplots()
    for i, (name, colour) in enumerate(zip(left["delta"].actuated, (BLUE, ORANGE, GREEN), strict=True)):
        mine = left["motors"] == i
        dash = "--" if i == 2 else "-"  # it moves as the one before does
        axes.step(left["times"][mine], left["ways"][mine].cumsum(), dash, color=colour, label=name)
    label(axes, "time (s)", "steps")
    finish(figure)
    return figure


def actuated(left):
    """Actuated joints of the compiled loop over time."""
    delta, q = left["delta"], left["q"]
    figure, body = sheet(6.0, 3.4, "A delta robot in compiled C", "actuated joints: a spiral for 2 s, then a circle")
    axes = body.subplots()
    for name, colour in zip(delta.actuated, (BLUE, ORANGE, GREEN), strict=True):
        axes.plot(1e-3 * np.arange(len(q)), np.degrees(q[:, delta.q_index(name)]), color=colour, label=name)
    label(axes, "time (s)", "angle (degrees)")
    finish(figure)
    return figure


def tilted(left):
    """A Gough platform that is tilted by the largest angle that its legs permit."""
    target = left["home"].copy()
    target.rotation = left["home"].rotation @ left["pin"].utils.rotate("x", np.radians(30.0))
    return cinegen.inverse_kinematics(left["platform"], {"platform": target}).q


def engine(left):
    """A slider-crank, read again from its text: the files that the example wrote are gone, with their meshes."""
    left["engine"] = cinegen.load(left["TEXT"].lstrip())
    return "engine", left["engine"].q_home, FLAT


VIEWS = {
    "01_load_and_close": lambda left: ("delta", left["torn"], ABOVE),
    "03_forward_kinematics": lambda left: ("delta", left["q"], ABOVE),
    "04_write_a_robot": engine,
    "07_static_page": lambda left: ("gough", left["solver"].q, ABOVE),
    "09_two_tasks": lambda left: ("arm", left["step"].q, ARM),
    "10_limits_and_statuses": lambda left: ("arm", left["solver"].q, FLAT),
    "12_redundancy": lambda left: ("arm", left["solver"].q, ARM),
    "13_inverse_kinematics": lambda left: ("platform", tilted(left), ABOVE),
    "14_to_mujoco_and_back": lambda left: ("delta", left["q"], ABOVE),
    "15_robots_of_others": lambda left: ("cassie", left["cassie"].q_home, ARM),
    "16_weld_along_a_seam": lambda left: ("arm", left["solver"].q, (35.0, 40.0), dots(np.array(left["points"]))),
    "17_assembly_modes": lambda left: ("robot", left["modes"][1], ABOVE),
}
"""The robot, by its name in the example, its configuration, the direction of the camera, and what else is shown."""

FIGURES = {
    "06_singular_values_along_a_path": singular_values,
    "11_clock": clock,
    "20_design_of_a_delta": lambda left: draw_sweep(left["table"]),
    "26_firmware_of_a_delta": actuated,
    "27_steps_of_a_delta": steps,
    "28_five_bar_for_a_rectangle": lambda left: draw_designs(left["robots"], left["found"]["other bars"].task.reach),
    "29_prove_workspaces": lambda left: draw_proof(left["larger"], name="five_bar"),
}
"""Functions that make a matplotlib figure."""


def left_by(name):
    """Return the names that an example leaves."""
    path = ROBOTS.parent / "examples" / f"{name}.py"
    with contextlib.redirect_stdout(io.StringIO()), contextlib.chdir(ROBOTS.parent):
        return runpy.run_path(str(path), run_name="__main__")


def main():
    """Draw those that the command line names, or all."""
    with chromium() as browser:
        for name in sys.argv[1:] or [*VIEWS, *FIGURES]:
            left = left_by(name)
            if name in FIGURES:
                save(f"example_{name}", FIGURES[name](left))
                continue
            robot, q, direction, *add = VIEWS[name](left)
            path = PICTURES / f"example_{name}.webp"
            draw(browser, path, {robot: (left[robot], q)}, direction, size=SIZE, add=add[0] if add else None)


if __name__ == "__main__":
    main()
