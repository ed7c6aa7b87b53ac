"""`RaffSketch`: the robot of a RAFF text, and its parts as a `Sketch` draws them. Positions are in mm."""

import math
from collections import namedtuple
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from sketch import rotated, unit

import cinegen
import raff2urdf
from cinegen.plotting.sheet import BLUE, FAINT, GREEN, INK, ORANGE, SKY
from raff2urdf.raff.document import JointType
from raff2urdf.raff.kleinfinger import Kleinfinger, transform

BASE, LOOP = "#c9ced4", "#cc79a7"
COLOURS = SKY, ORANGE, GREEN, BLUE
"""Colours of the branches."""
_SAME = 1e-6  # mm

Dimensions = namedtuple("Dimensions", "origin x z u ends z_end x_end")
"""Where the parameters of a part are: origin, x and z of its parent; u, the x axis after gamma and alpha; the four
points from the parent's origin to the part's; z and x of the part."""


class RaffSketch:
    """A robot.

    Args:
        text: RAFF text in mm with one robot.

    Attributes:
        parts: links and frames by number.
        mechanism: as cinegen loads it.
        q: configuration that is drawn, (nq,); home at first.
    """

    def __init__(self, text):
        (robot,) = raff2urdf.loads(text).robots
        self.parts = {part.number: part for part in robot.parts}
        self.loops, self.couplings = robot.loops, robot.couplings
        with TemporaryDirectory() as folder:
            path = Path(folder, "robot.raff")
            path.write_text(text, encoding="utf-8")
            self.mechanism = cinegen.load(path)
        self.q = self.mechanism.q_home
        self._names = {0: "base", **{number: part.node for number, part in self.parts.items()}}

    def pose(self, number):
        """Return the origin (3,) mm, and the axes (3, 3) as columns, of a node at q."""
        placement = self.mechanism.placement(self.q, self._names[number])
        return 1e3 * placement.translation, np.array(placement.rotation)

    def written(self, number):
        """Return the same by the numbers of the file, before loops are closed."""
        matrix = np.eye(4)
        while number:
            p = self.parts[number].parameters
            angles = {name: math.radians(getattr(p, name)) for name in ("gamma", "alpha", "theta")}
            matrix = transform(Kleinfinger(epsilon=p.epsilon, d=p.d, r=p.r, **angles)) @ matrix
            number = self.parts[number].pred
        return matrix[:3, 3], matrix[:3, :3]

    def dimensions(self, number, pose=None):
        """Return where the parameters of a part are."""
        pose = pose or self.pose
        part = self.parts[number]
        (origin, parent), (end, child) = pose(part.pred), pose(number)
        p = part.parameters
        u = rotated(parent[:, 0], parent[:, 2], math.radians(p.gamma))
        first = origin + p.epsilon * parent[:, 2]
        second = first + p.d * u
        return Dimensions(origin, parent[:, 0], parent[:, 2], u, (origin, first, second, end), child[:, 2], child[:, 0])

    def bars(self, number, pose=None):
        """Return the ends of the bars along a part's parameters, each longer than nothing."""
        ends = self.dimensions(number, pose).ends
        return [(a, b) for a, b in pairwise(ends) if np.linalg.norm(b - a) > _SAME]

    def colour(self, number):
        """Return the colour of a body: that of its branch; the base is grey."""
        if number == 0:
            return BASE
        roots = [n for n, part in self.parts.items() if part.pred == 0]
        while self.parts[number].pred:
            number = self.parts[number].pred
        return COLOURS[roots.index(number) % len(COLOURS)]

    def is_actuated(self, number):
        """Return whether the joint of a link is actuated."""
        return getattr(self.parts[number], "joint", None) in self.mechanism.actuated

    # --- what all drawings of a plane have ---------------------------------------------------------------------------

    def draw_plane(self, sketch, pose=None, ghost=False, actuated=BLUE):
        """Draw a robot in the plane of x and y: bars, hinges, of which actuated ones have a colour, pins of loops."""
        for k, (number, part) in enumerate(self.parts.items()):
            if part.pred:
                for start, end in self.bars(number, pose):
                    sketch.bar(start, end, self.colour(part.pred), lift=k, ghost=ghost)
            if ghost or getattr(part, "type", None) is not JointType.REVOLUTE:
                continue
            end = self.dimensions(number, pose).ends[-1]
            if part.pred == 0:
                sketch.foot(end, -1.0)
            sketch.ball(end, 8.5, actuated if self.is_actuated(number) else INK, 100.0)
        for loop in self.loops if not ghost else ():
            sketch.ball((pose or self.pose)(loop.first)[0], 9.5, LOOP, 101.0)

    def dimension_d(self, sketch, number, offset, pose=None):
        """Dimension d of a part, aside by an offset (mm) to the left of its direction."""
        dims = self.dimensions(number, pose)
        first, second = dims.ends[1:3]
        aside = offset * np.cross(dims.z, dims.u)
        sketch.dimension(first, second, f"d = {self.parts[number].parameters.d:g}".replace("-", "−"), aside)

    def dimension_theta(self, sketch, number, radius, pose=None, value=None):
        """Dimension theta of a part at its joint."""
        dims = self.dimensions(number, pose)
        value = self.parts[number].parameters.theta if value is None else value
        text = f"θ = {value:.4g}°".replace("-", "−")
        sketch.angle(dims.ends[-1], dims.z_end, dims.u, math.radians(value), radius, text)

    def frame(self, sketch, number, size, name=None, pose=None, **style):
        """Draw the axes of a node."""
        origin, axes = (pose or self.pose)(number)
        sketch.frame(origin, axes, size, f"{number}" if name is None else name, lift=500.0, **style)


def cross(sketch, point, size, colour=INK):
    """Draw a cross in the plane of x and y."""
    for way in ((1.0, 1.0, 0.0), (1.0, -1.0, 0.0)):
        step = size * unit(way)
        sketch.line([np.asarray(point) - step, np.asarray(point) + step], colour, 2.2, lift=2e4)


def paper(sketch, low, high, step=100.0):
    """Draw the plane of x and y as squared paper."""
    sketch.ground(low, high, -1.0, step)
    corner = np.array([*(np.ceil(np.array(high) / step) * step), 0.0])
    corner[1] = np.floor(low[1] / step) * step
    sketch.dimension(corner - (step, 0.0, 0.0), corner, f"{step:g} mm", (0.0, -0.12 * step, 0.0))


__all__ = ["COLOURS", "FAINT", "LOOP", "RaffSketch", "cross", "paper"]
