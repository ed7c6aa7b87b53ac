"""Draws pictures of docs/howto again, from the blocks of its pages: `python docs/pictures/howto.py [NAME ...]`.

Those whose blocks have not changed, or that have none, are left as they are, unless they are named. Needs chromium on
PATH, and for the headset `make javascript` once.
"""

import contextlib
import io
import re
import shlex
import sys
import warnings
from contextvars import copy_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from figures import PICTURES, ROBOTS, chromium, save, shot, show, tab_of
from make import draw
from raff_sketch import RaffSketch, paper
from sketch import SHADOW, Sketch
from sources import HOWTO, howto_blocks, mark_in, mark_of

sys.path.append(str(PICTURES.parents[1] / "tests/helpers"))
from headset import Headset

import cinegen
from cinegen.cli import main as command_line
from cinegen.cockpit import Cockpit, SetupFiles
from cinegen.collision import load_scene
from cinegen.design import calibrate, tolerance
from cinegen.page import build_page
from cinegen.planning import plan
from cinegen.plotting import draw_modes, draw_plan
from cinegen.plotting.accuracy import draw_residuals, draw_tolerance
from cinegen.plotting.sheet import BLUE, FAINT, GREEN, INK, ORANGE, VERMILION, finish, label, sheet
from cinegen.session import arrange
from raff2urdf.quantities import show_lengths_in

SIZE = (720, 480)  # pixels


@contextlib.contextmanager
def folder():
    """Work in a folder with a link to robots/, without output, as pages do."""
    with TemporaryDirectory() as name, contextlib.chdir(name), contextlib.redirect_stdout(io.StringIO()):
        Path("robots").symlink_to(ROBOTS, target_is_directory=True)
        yield


def robot(browser, path, file, direction):
    """Draw a robot of a page, its loops closed."""
    (text,) = howto_blocks(path.name)
    with folder():
        Path(file).write_text(text, encoding="utf-8")
        mechanism = cinegen.load(file, loops={"closing_effector": "revolute"} if "closing" in text else None)
    name = Path(file).stem
    draw(browser, path, {name: (mechanism, mechanism.q_home)}, direction, size=SIZE, description=mark(path))


def mark(path):
    """Return the hash of the blocks of a picture."""
    return mark_of(howto_blocks(path.name))


def delta(browser, path):
    """The robot of the page at home, and where its numbers are."""
    (text,) = howto_blocks(path.name)
    with folder():
        Path("my_delta.raff").write_text(text, encoding="utf-8")
        mechanism = cinegen.load("my_delta.raff")
    shoulder, elbow, wrist, end = (
        mechanism.placement(mechanism.q_home, node).translation for node in ("link1", "link2", "link4", "platform")
    )
    centre = np.array([0.0, 0.0, shoulder[2]])
    labels = {}
    for name, first, second in (
        ("base", centre, shoulder),
        ("arm", shoulder, elbow),
        ("forearm", elbow, wrist),
        ("platform", wrist, end),
    ):
        length = 1e3 * np.linalg.norm(second - first)
        assert np.isclose(length, round(length), rtol=1e-9), name
        assert f"d {length:.0f} " in text, name
        labels[f"{name} {length:.0f} mm"] = 0.5 * (first + second)
    robots = {"my_delta": (mechanism, mechanism.q_home)}
    draw(browser, path, robots, (-58.0, 22.0), labels, size=SIZE, description=mark(path))


def linkage(_, path):
    """The four-bar and the coupler curve of the page, with a dot every 30 degrees of the crank."""
    (code,) = howto_blocks(path.name)
    left = {}
    with folder():
        exec(code, left)
    bar = RaffSketch((ROBOTS / "four_bar.raff").read_text(encoding="utf-8"))
    sketch = Sketch()
    paper(sketch, (-100.0, -100.0), (500.0, 400.0))
    bar.draw_plane(sketch)
    joints = {name: bar.pose(number)[0] for name, number in {"A0": 1, "A": 2, "B0": 3, "B": 5}.items()}
    for name, ends, aside in (
        ("crank", ("A0", "A"), (1.0, -1.0, 0.0)),
        ("coupler", ("A", "B"), (0.4, -1.0, 0.0)),
        ("rocker", ("B0", "B"), (1.0, 0.0, 0.0)),
    ):
        sketch.text(0.5 * (joints[ends[0]] + joints[ends[1]]), name, aside, gap=14.0)
    sketch.text(bar.pose(20)[0], "tool", (1.0, 0.3, 0.0), VERMILION, "b", gap=14.0)
    curve = 1e3 * np.column_stack([left["x"], left["y"], np.zeros(len(left["x"]))])
    sketch.line(curve, VERMILION, 3.0, lift=300.0)
    for point in curve[:-1:6]:
        sketch.ball(point, 4.0, VERMILION, 301.0)
    path.write_text(sketch.svg("A four-bar and its coupler curve", mark(path)), encoding="utf-8")


def obstacle():
    """The path around the obstacle of the page."""
    (scene,) = howto_blocks("howto_obstacles.png")
    with folder():
        Path("bench.toml").write_text(scene, encoding="utf-8")
        return draw_plan(plan(load_scene("bench.toml"), planner="vortex"))


def exported():
    """Actuated joints over time, in both files of the page."""
    code, console = howto_blocks("howto_export.png")
    with folder():
        exec(code, {})
        for command in re.findall(r"^\$ cinegen (.+)$", console, flags=re.MULTILINE):
            command_line(shlex.split(command))
        tables = [np.genfromtxt(name, delimiter=",", names=True) for name in ("run.csv", "fast.csv")]
    figure, body = sheet(6.0, 3.4, "A circle of a delta robot", "actuated joints; dashed: as fast as the limits permit")
    axes = body.subplots()
    for name, colour in zip(tables[0].dtype.names[1:], (BLUE, ORANGE, GREEN), strict=True):
        for table, style in zip(tables, ("-", "--"), strict=True):
            axes.plot(table["time"], np.degrees(table[name]), style, color=colour, label=name if style == "-" else None)
    label(axes, "time (s)", "angle (degrees)")
    finish(figure)
    return figure


def own_task():
    """The distance of the page's task, which is set three times, and the errors of an elbow that comes second."""
    (code,) = howto_blocks("howto_own_task.png")
    left = {}
    with folder():
        exec(code, left)
    solver, task = left["solver"], left["task"]
    elbow = solver.add_task("link5", rotation=0, priority=1)
    elbow.target.translation[2] += 0.1
    wanted, reached, second = [], [], []
    for distance in (0.45, 0.5, 0.4):
        task.distance = distance
        for _ in range(60):
            step = solver.step()
            wanted.append(distance)
            reached.append(distance + task.error(solver.state)[0])
            second.append(step.errors[1][0])
    figure, body = sheet(
        6.0, 3.4, "A distance first, a place of the elbow second", "a task in Python, and one of priority 1"
    )
    axes, time = body.subplots(), 0.01 * np.arange(len(wanted))
    axes.plot(time, 1e3 * np.array(wanted), "--", color=FAINT, label="wanted")
    axes.plot(time, 1e3 * np.array(reached), color=BLUE, label="distance")
    axes.plot(time, 1e3 * np.array(second), color=ORANGE, label="error of the elbow")
    label(axes, "time (s)", "mm")
    finish(figure)
    return figure


def modes():
    """All assembly modes of the Gough platform, for the leg lengths at home."""
    show_lengths_in("mm")
    return draw_modes(cinegen.assembly_modes(cinegen.load(ROBOTS / "gough.raff")), name="gough")


def residuals():
    """The measurements of the page, before and after the calibration."""
    (table,) = howto_blocks("howto_calibrate.png")
    show_lengths_in("mm")
    with folder():
        Path("measured.csv").write_text(table, encoding="utf-8")
        return draw_residuals(calibrate(ROBOTS / "five_bar.raff", "measured.csv", names=["link*.d"]), name="five_bar")


def contributors():
    """What contributes to the errors of a delta robot whose three encoders have errors, by the command of the page."""
    show_lengths_in("mm")
    delta = cinegen.load(ROBOTS / "delta4.raff")
    sigma = {"link*.d": "0.05mm", "*.alpha": "0.01deg"}
    return draw_tolerance(tolerance("delta4", sigma, encoder=dict.fromkeys(delta.actuated, "0.01deg")), name="delta4")


def web_page(browser, path):
    """Draw a page without a server, whose robot is dragged."""
    tab = tab_of(browser, 1000, 600)
    with TemporaryDirectory() as folder:
        html, delta = Path(folder, "delta.html"), cinegen.load(ROBOTS / "delta4.raff")
        html.write_text(build_page(arrange({"delta4": delta}), "Our delta robot"), "utf-8")
        show(tab, html.as_uri())
        tab.evaluate("cockpit.select('delta4', 'platform')")
        tab.wait_for_timeout(2000)
        shot(tab).save(path, quality=82, method=6)


def saved_file(browser, path):
    """Draw the errors of a file that was saved, over the robot before."""
    tab = tab_of(browser, 1000, 600)
    with folder():
        file, text = Path("four_bar.raff"), (ROBOTS / "four_bar.raff").read_text(encoding="utf-8")
        file.write_text(text, encoding="utf-8")
        setup, files = SetupFiles.of(lambda: arrange({"four_bar": cinegen.load(file)}))
        with Cockpit(setup, port=8460, own_process=False, files=files) as cockpit:
            show(tab, cockpit.url)
            file.write_text(text.replace("d 360.0", "d 36O.0").replace("parameters { d 240.0", "paramters { d 240.0"))
            tab.wait_for_selector("#file-problem:not([hidden])", timeout=120_000)
            tab.wait_for_timeout(500)
            shot(tab).save(path, quality=82, method=6)


def headset(browser, path):
    """What an emulated headset shows while its right hand drags a platform."""
    tab = tab_of(browser, 1280, 640)
    worn = Headset(tab)
    setup = arrange({"delta4": cinegen.load(ROBOTS / "delta4.raff")}, follow=None)
    with Cockpit(setup, port=8460, own_process=False) as cockpit:
        show(tab, cockpit.url)
        worn.enter()
        worn.put("left", (-0.13, 1.22, -0.75))
        worn.put("right", (0.15, 1.35, -0.3))
        worn.aim("right", "delta4", "platform")
        worn.press("right", 1.0)
        worn.put("right", (0.22, 1.38, -0.3))
        worn.frames(30)
        shot(tab).crop((160, 46, 1120, 602)).save(path, quality=82, method=6)


def mouse(_, path):
    """A 3D mouse and its axes, as a user sees them."""
    sketch = Sketch(-72.0, 26.0)
    sketch.ground((-100.0, -100.0), (150.0, 150.0), 0.0, 50.0)
    turns = np.linspace(0.0, 2.0 * np.pi, 60)
    circle = np.column_stack([np.cos(turns), np.sin(turns), 0.0 * turns])
    for radius, aside in ((50.0, 6.0), (38.0, 24.0)):
        sketch.polygon(radius * circle + (1.4 * aside, aside, 0.0), SHADOW, lift=-1e6, opacity=0.12)
    sketch.cylinder((0.0, 0.0, 7.0), (0.0, 0.0, 1.0), 42.0, 14.0, FAINT)
    sketch.cylinder((0.0, 0.0, 34.0), (0.0, 0.0, 1.0), 30.0, 34.0, INK, 100.0)
    sketch.frame((0.0, 0.0, 51.0), np.eye(3), 95.0, width=3.0, lift=500.0)
    sketch.text((95.0, 0.0, 51.0), "to the right", (0.0, 0.0, -1.0), gap=16.0)
    sketch.text((0.0, 95.0, 51.0), "away from you", (1.0, 0.0, 0.0), gap=24.0)
    sketch.text((0.0, 0.0, 146.0), "up", (1.0, 0.0, 0.0), gap=16.0)
    sketch.text((0.0, -100.0, 0.0), "you are here", (0.0, 0.0, -1.0))
    path.write_text(sketch.svg("A 3D mouse and its axes", tallest=380.0), encoding="utf-8")


FIGURES = {
    "howto_accuracy.png": contributors,
    "howto_all_solutions.png": modes,
    "howto_calibrate.png": residuals,
    "howto_export.png": exported,
    "howto_obstacles.png": obstacle,
    "howto_own_task.png": own_task,
}
"""Functions that make a matplotlib figure."""

DRAWINGS = {
    "howto_from_cad.webp": lambda browser, path: robot(browser, path, "planar.urdf", (-72.0, 48.0)),
    "howto_headset.webp": headset,
    "howto_linkage.svg": linkage,
    "howto_my_delta.webp": delta,
    "howto_spacemouse.svg": mouse,
    "howto_urdf_with_loops.webp": lambda browser, path: robot(browser, path, "linkage.urdf", (-75.0, 18.0)),
    "howto_web_page.webp": web_page,
    "saved_file.webp": saved_file,
}
"""Functions that write a picture, with a browser."""


def stale(path):
    """Return whether a picture is not of the blocks that its page shows now."""
    return path.name in HOWTO and not (path.exists() and mark_in(path.read_bytes()) == mark(path))


def main():
    """Draw those that the command line names, or those whose blocks have changed."""
    warnings.simplefilter("ignore", cinegen.CinegenWarning)  # files name a serial port that is not here
    with chromium() as browser:
        for path in (PICTURES / name for name in (*FIGURES, *DRAWINGS)):
            if path.stem not in sys.argv[1:] and (sys.argv[1:] or not stale(path)):
                continue
            if path.name in FIGURES:
                save(path.stem, copy_context().run(FIGURES[path.name]), mark(path) if path.name in HOWTO else "")
            else:
                DRAWINGS[path.name](browser, path)


if __name__ == "__main__":
    main()
