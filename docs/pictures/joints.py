"""Drawings of docs/joints.md: robots in space at home, with their parameters dimensioned."""

import math
from functools import partial

import numpy as np
from raff_sketch import LOOP
from sketch import Sketch, rotated, shade, unit

from cinegen.plotting.sheet import FAINT, INK, VERMILION
from raff2urdf.raff.document import CompoundKind, JointType

_SIZE = 15.0  # mm, radius of a hinge
_FRAME = 62.0  # mm, length of the axes of frames
_ARC = 48.0  # mm, radius of angles
_HIGH = {"high": (250.0, 150.0), "low": (-100.0, -100.0), "eye": (-115.0, 24.0)}  # the view of a robot that stands


def _space(robot, high=(250.0, 200.0), low=(-50.0, -50.0), eye=(-62.0, 28.0), frame=True):
    """Return a drawing with the ground, and the robot on it."""
    sketch = Sketch(*eye)
    sketch.ground(low, high, 0.0, 50.0)
    corner, x, y = np.array([high[0], low[1], 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    if abs(sketch.right @ x) > abs(sketch.right @ y):
        sketch.dimension(corner - 50.0 * x, corner, "50 mm", -14.0 * y)
    else:
        sketch.dimension(corner + 50.0 * y, corner, "50 mm", 14.0 * x)
    for number, part in robot.parts.items():
        for start, end in robot.bars(number):
            # The rod of a slide moves with its link; every other bar belongs to the parent.
            rod = getattr(part, "type", None) is JointType.PRISMATIC and np.allclose(end, robot.pose(number)[0])
            owner = number if rod else part.pred
            sketch.bar(start, end, robot.colour(owner), 11.0 if owner else 8.0, lift=-20.0 if not owner else 0.0)
            if max(start[2], end[2]) > 1.0:
                sketch.shadow(start, end, 0.0)
        if hasattr(part, "type"):
            _joint(sketch, robot, number)
    for loop in robot.loops:
        origin, axes = robot.pose(loop.first)
        sketch.cylinder(origin, axes[:, 2], 0.8 * _SIZE, 2.6 * _SIZE, LOOP, 30.0)
    if frame:
        robot.frame(sketch, 0, _FRAME)
    return sketch


def _joint(sketch, robot, number):
    part, dims = robot.parts[number], robot.dimensions(number)
    origin, axes = robot.pose(number)
    z, colour = dims.z_end, INK
    if part.compound is CompoundKind.BALL:
        sketch.ball(origin, 14.0, colour, 20.0)
    elif part.compound is CompoundKind.UNIVERSAL:
        z = axes[:, 1]  # its second axis, which moves with the link
        first = robot.dimensions(number).z
        for way in (first, z):
            sketch.cylinder(origin, way, 0.55 * _SIZE, 3.4 * _SIZE, colour, 10.0)
        sketch.ball(origin, 9.0, colour, 20.0)
    elif part.type is JointType.REVOLUTE:
        sketch.cylinder(origin, z, _SIZE, 2.2 * _SIZE, colour, 10.0)
    elif part.type is JointType.PRISMATIC:
        sides = 2.0 * np.array([1.0, 1.0, 1.5]) * _SIZE
        sketch.box(origin, axes, sides, robot.colour(number), 10.0)
        sketch.box(dims.ends[2], axes, 0.9 * sides, colour, -5.0)


def _axis(sketch, robot, number, length=95.0, text=""):
    """Draw the axis of a joint as a dash-dotted line through both sides of it."""
    dims = robot.dimensions(number)
    middle = 0.5 * (dims.ends[2] + dims.ends[3])
    half = length + 0.5 * np.linalg.norm(dims.ends[3] - dims.ends[2])
    ends = middle - half * dims.z_end, middle + half * dims.z_end
    if abs(dims.z_end[2]) > 0.99:
        ends = np.array([*middle[:2], 0.0]), ends[1]
    sketch.line(ends, VERMILION, 1.5, "12 4 2 4", lift=-1.0)
    if text:
        sketch.text(ends[1], text, dims.z_end, VERMILION, "i")


def _tool(sketch, robot, number):
    sketch.ball(robot.pose(number)[0], 7.0, robot.colour(number), 5.0)
    sketch.text(robot.pose(number)[0], robot.parts[number].name or f"frame {number}", (0.0, 0.0, 1.0), FAINT, gap=10.0)


def dimension_all(sketch, robot, number, radius=_ARC, tilt=1.3, aside=26.0):
    """Dimension all parameters of a part that are not 0."""
    part, dims = robot.parts[number], robot.dimensions(number)
    p, (origin, first, second, end) = part.parameters, dims.ends
    if p.gamma:
        _turn(sketch, origin, dims.z, dims.x, p.gamma, 1.5 * radius, "γ")
    if p.epsilon:
        sketch.dimension(origin, first, f"ε = {p.epsilon:g}", -aside * _across(sketch, dims.z))
    if p.alpha:
        _turn(sketch, second, dims.u, dims.z, p.alpha, tilt * radius, "α")
    if p.d:
        sketch.dimension(first, second, f"d = {p.d:g}", -aside * dims.z, -dims.z)
    if p.r:
        sketch.dimension(second, end, f"r = {p.r:g}", aside * _across(sketch, dims.z_end))
    if p.theta:
        _turn(sketch, end, dims.z_end, dims.u, p.theta, radius, "θ")


def _across(sketch, direction):
    """Return the direction (3,) at right angles to one and to the eye, to the right in the picture."""
    across = unit(np.cross(sketch.eye, direction))
    return across if across @ sketch.right > 0.0 else -across


def _turn(sketch, centre, axis, begin, degrees, radius, letter):
    text = f"{letter} = {degrees:g}°".replace("-", "−")
    sketch.angle(centre, axis, begin, math.radians(degrees), radius, text)


def _arm(robot, _, numbers, tool, axes=(), frames=(), space=None, **arcs):
    """Return a drawing of a chain: the parameters of parts, axes of joints (number, length, text), frames, the tool."""
    sketch = _space(robot, **(space or {"high": (350.0, 150.0)}))
    for number in numbers:
        dimension_all(sketch, robot, number, **arcs)
    for number, length, text in axes:
        _axis(sketch, robot, number, length, text)
    for number in frames:
        robot.frame(sketch, number, _FRAME)
    _tool(sketch, robot, tool)
    return sketch


def any_axis(robot, _):
    """All six parameters."""
    space = {"high": (200.0, 250.0), "eye": (-22.0, 24.0)}
    sketch = _arm(robot, _, [1], 2, [(1, 130.0, "axis of joint1")], [1], space)
    dims = robot.dimensions(1)
    sketch.line([dims.origin, dims.origin + 150.0 * dims.z], FAINT, 1.2, "2 4")
    return sketch


def universal(robot, _):
    """A bar on a universal joint."""
    sketch = _arm(robot, _, [1], 2, space=_HIGH, radius=60.0)
    origin, axes = robot.pose(1)
    for direction, text in ((np.array([0.0, 0.0, 1.0]), "first axis, z"), (axes[:, 1], "second axis, y")):
        ends = (origin - 100.0 * direction, origin + 100.0 * direction)
        sketch.line(ends, VERMILION, 1.5, "12 4 2 4", lift=-1.0)
        sketch.text(ends[1], text, direction, VERMILION, "i")
    return sketch


def gear(robot, _):
    """Two wheels that mesh."""
    sketch = _space(robot, (250.0, 150.0), (-150.0, -150.0), (-62.0, 38.0), frame=False)
    (coupling,) = robot.couplings
    distance, ratio = robot.parts[2].parameters.d, -coupling.drives[0].numbers[0]
    large = distance * ratio / (1.0 + ratio)
    for number, radius, teeth, phase in ((1, large, 24, 0.0), (2, distance - large, 12, math.pi / 12.0)):
        _wheel(sketch, robot.pose(number), radius, teeth, phase, robot.colour(number))
        _axis(sketch, robot, number, 40.0, f"axis {number}")
        sketch.cylinder(robot.pose(number)[0], (0.0, 0.0, 1.0), 0.7 * _SIZE, 1.5 * _SIZE, INK, 70.0)
    dimension_all(sketch, robot, 2)
    return sketch


def _wheel(sketch, pose, radius, teeth, phase, colour):
    """Draw a toothed wheel; its first tooth is at an angle (rad) from x, which is marked."""
    origin, axes = pose
    angles = phase + (np.arange(4 * teeth) - 1.5) * (0.5 * math.pi / teeth)
    heights = np.where(np.isin(np.arange(4 * teeth) % 4, (1, 2)), 4.0, -4.0)
    arms = [rotated(axes[:, 0], axes[:, 2], angle) for angle in angles]
    ring = [origin + (radius + tall) * arm for tall, arm in zip(heights, arms, strict=True)]
    for corner, other, arm in zip(ring, [*ring[1:], ring[0]], arms, strict=True):
        if arm @ sketch.eye > 0.0:
            low = 14.0 * axes[:, 2]
            sketch.polygon([corner, other, other - low, corner - low], shade(colour, 0.7))
    sketch.polygon(ring, colour, shade(colour, 0.7), 40.0)
    sketch.line([origin, origin + 0.8 * radius * axes[:, 0]], INK, 2.0, lift=60.0)


def loop(robot, _):
    """A linkage of four bars; also a parallelogram."""
    sketch = _space(robot, (300.0, 200.0), (-100.0, -50.0), (-75.0, 48.0))
    for number in (2, 3, 4, 5):
        p, dims = robot.parts[number].parameters, robot.dimensions(number)
        if number != 3:
            aside = 30.0 * np.cross(dims.z, dims.u) * (-1.0 if number > 3 else 1.0)
            sketch.dimension(*dims.ends[1:3], f"d = {p.d:g}", aside)
    origin, _ = robot.pose(4)
    sketch.text(origin, "the pin that closes the loop", (0.0, 0.0, 1.0), LOOP, "b", gap=40.0)
    return sketch


def slider(robot, _):
    """A crank, a rod and a slider."""
    sketch = _space(robot, (350.0, 150.0), (-100.0, -50.0), (-75.0, 42.0))
    for number in (2, 4):
        p, dims = robot.parts[number].parameters, robot.dimensions(number)
        sketch.dimension(*dims.ends[1:3], f"d = {p.d:g}", 30.0 * np.cross(dims.z, dims.u))
    _axis(sketch, robot, 3, 75.0, "axis 3")
    robot.frame(sketch, 5, _FRAME)
    return sketch


DRAWINGS = {
    f"joints_{name}": draw
    for name, draw in {
        "any": any_axis,
        "hinge": partial(_arm, numbers=[1], tool=2, axes=[(1, 105.0, "axis")], frames=[1]),
        "parallel": partial(_arm, numbers=[1, 2], tool=3, axes=[(1, 70.0, "axis 1"), (2, 70.0, "axis 2")]),
        "right_angle": partial(
            _arm, numbers=[1, 2], tool=3, axes=[(1, 125.0, "axis 1"), (2, 125.0, "axis 2")], space=_HIGH, radius=50.0,
            tilt=2.2,
        ),
        "slide": partial(_arm, numbers=[1], tool=2, axes=[(1, 105.0, "axis")], frames=[1], radius=40.0),
        "ball": partial(_arm, numbers=[1], tool=2, frames=[1]),
        "universal": universal,
        "gear": gear,
        "loop": loop,
        "parallelogram": loop,
        "slider": slider,
        "telescope": partial(
            _arm, numbers=[1, 2], tool=3, axes=[(2, 75.0, "axis")], space={"high": (400.0, 150.0)}, radius=40.0
        ),
    }.items()
}  # fmt: skip
"""What draws each of them."""
