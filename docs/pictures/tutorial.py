"""Drawings of docs/tutorial.md: a function for each, of the robot of its step and of what its Python code left."""

import math

import numpy as np
from figures import chromium, shot, show, tab_of
from raff_sketch import LOOP, cross, paper
from sketch import Sketch

from cinegen.cockpit import Cockpit
from cinegen.plotting.sheet import BLUE, FAINT, INK, VERMILION
from cinegen.session import arrange

_LOW, _HIGH = (-400.0, -60.0), (400.0, 500.0)  # mm, of the paper
_AXIS = 70.0  # mm, length of the axes of frames


def _sheet(high=_HIGH, low=_LOW):
    """Return a sheet of squared paper."""
    sketch = Sketch()
    paper(sketch, low, high)
    return sketch


def joint(robot, _):
    """One link on the base."""
    sketch = _sheet((200.0, 200.0), (-300.0, -60.0))
    robot.draw_plane(sketch, actuated=INK)
    for number in (0, 1):
        robot.frame(sketch, number, 1.3 * _AXIS)
    robot.dimension_d(sketch, 1, -60.0)
    robot.dimension_theta(sketch, 1, 45.0)
    return sketch


def arm(robot, _):
    """Two bars."""
    sketch = _sheet()
    robot.draw_plane(sketch, actuated=INK)
    for number in (0, 1, 2, 5):
        robot.frame(sketch, number, _AXIS)
    robot.dimension_d(sketch, 2, -45.0)
    robot.dimension_d(sketch, 5, -45.0)
    robot.dimension_theta(sketch, 2, 90.0)
    return sketch


def tree(robot, _):
    """Two arms whose ends do not meet."""
    sketch = _sheet()
    robot.draw_plane(sketch, actuated=INK)
    robot.frame(sketch, 0, 45.0)
    robot.dimension_d(sketch, 2, 40.0)
    robot.dimension_d(sketch, 5, 40.0)
    robot.dimension_d(sketch, 3, -70.0)
    robot.dimension_theta(sketch, 3, 50.0)
    robot.dimension_theta(sketch, 4, 60.0)
    ends = robot.pose(5)[0], robot.pose(6)[0]
    for end, name in zip(ends, ("frame 5", "pen"), strict=True):
        sketch.ring(end, 6.0, INK, lift=200.0)
        sketch.text(end, name, end - 0.5 * (ends[0] + ends[1]), gap=12.0)
    sketch.dimension(*ends, f"{np.linalg.norm(ends[0] - ends[1]):.0f} mm", (0.0, 35.0, 0.0))
    return sketch


def loop(robot, _):
    """The closed robot, and what was written."""
    sketch = _sheet()
    robot.draw_plane(sketch, robot.written, ghost=True)
    robot.draw_plane(sketch, actuated=INK)
    robot.frame(sketch, 0, 45.0)
    sketch.text(robot.pose(6)[0], "the pin closes the loop", (0.0, 1.0, 0.0), LOOP, "b", gap=16.0)
    sketch.text(0.5 * (robot.written(2)[0] + robot.written(5)[0]), "as written", (-0.2, 1.0, 0.0), FAINT, gap=26.0)
    return sketch


def limits(robot, _):
    """Actuated joints and their ranges."""
    sketch = _sheet()
    for number, part in robot.parts.items():
        bounds = getattr(part, "limits", None)
        if bounds is None or part.pred:
            continue
        dims = robot.dimensions(number)
        low, high = (math.radians(bound) for bound in bounds)
        x, y = dims.u, np.cross(dims.z_end, dims.u)
        arc = [dims.ends[-1] + 60.0 * (math.cos(t) * x + math.sin(t) * y) for t in np.linspace(low, high, 60)]
        sketch.polygon([dims.ends[-1], *arc], BLUE, lift=-50.0, opacity=0.12)
        sketch.line(arc, BLUE, 1.6, lift=-40.0)
        for bound, end in zip(bounds, (arc[0], arc[-1]), strict=True):
            sketch.text(end, f"{bound:g}°", end - dims.ends[-1], BLUE, gap=6.0)
        sketch.text(dims.ends[-1], part.joint, (0.0, -1.0, 0.0), BLUE, "b", gap=36.0)
    robot.draw_plane(sketch)
    sketch.text(robot.pose(6)[0], "pen", (0.0, 1.0, 0.0), style="b", gap=14.0)
    for number in (2, 4):
        joint = robot.pose(number)[0]
        sketch.text(joint, robot.parts[number].joint, (math.copysign(1.0, joint[0]), 0.2, 0.0), gap=14.0)
    return sketch


def page(robot, _):
    """The page of `cinegen drive`, without its last line, which shows how fast the machine is."""
    setup = arrange({robot.mechanism.name: robot.mechanism}, follow="circle")
    with chromium() as browser, Cockpit(setup, port=7860) as cockpit:
        tab = tab_of(browser, 1080, 720)
        show(tab, cockpit.url)
        tab.wait_for_timeout(5000)
        return shot(tab).crop((0, 0, 1080, 692))


def move(robot, page):
    """From home to the target."""
    sketch = _sheet()
    start = robot.pose(6)[0]
    robot.draw_plane(sketch, ghost=True)
    robot.q = page["solver"].q
    robot.draw_plane(sketch)
    end = robot.pose(6)[0]
    sketch.line([start, end], VERMILION, 2.2, "7 5", lift=300.0, arrows=">")
    sketch.text(start, "home", (0.0, 1.0, 0.0), FAINT, gap=8.0)
    sketch.text(end, "(0.1, 0.35) m", (1.0, 0.4, 0.0), VERMILION, "b", gap=14.0)
    return sketch


def figure(robot, page):
    """The curve that the pen drew."""
    sketch = _sheet()
    robot.q = page["step"].q
    robot.draw_plane(sketch)
    curve = 1e3 * np.column_stack([np.array(page["drawn"]), np.zeros(len(page["drawn"]))])
    sketch.line(curve[::4], VERMILION, 3.0, lift=300.0)
    return sketch


def limit(robot, page):
    """A target out of reach."""
    sketch = _sheet((400.0, 600.0))
    robot.q = page["step"].q
    robot.draw_plane(sketch)
    pen, target = robot.pose(6)[0], 1e3 * page["pen"].target.translation
    sketch.line([pen, target], VERMILION, 1.6, "4 5", lift=300.0)
    cross(sketch, target, 9.0, VERMILION)
    sketch.text(target, "target", (1.0, 0.0, 0.0), VERMILION, "b", gap=14.0)
    sketch.text(pen, "pen", (1.0, 0.0, 0.0), style="b", gap=16.0)
    joint = robot.pose(2)[0]
    sketch.ring(joint, 16.0, VERMILION, lift=300.0)
    angle = math.degrees(robot.q[robot.mechanism.q_index("joint2")])
    sketch.text(joint, f"joint2 at its limit, {angle:.0f}°".replace("-", "−"), (-1.0, 0.3, 0.0), VERMILION, gap=22.0)
    return sketch


def forward(robot, page):
    """Actuated joints as given."""
    sketch = _sheet()
    robot.draw_plane(sketch, ghost=True)
    robot.q = page["q"]
    robot.draw_plane(sketch)
    for number in (1, 3):
        value = robot.q[robot.mechanism.q_index(robot.parts[number].joint)]
        robot.dimension_theta(sketch, number, 50.0, value=math.degrees(value))
    pen = robot.pose(6)[0]
    sketch.text(pen, "pen ({:.4f}, {:.4f}) m".format(*1e-3 * pen[:2]), (0.3, 1.0, 0.0), style="b", gap=16.0)
    return sketch


DRAWINGS = {
    f"tutorial_{draw.__name__}": draw for draw in (joint, arm, tree, loop, limits, page, move, figure, limit, forward)
}
"""What draws each of them: a sketch, or an image."""
