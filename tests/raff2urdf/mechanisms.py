"""RAFF texts of mechanisms whose mobility is known.

Most are given by where their joint axes lie in the world (metres; z of a placement is the axis), see `making`; those
that stand in a paper are those of `robots`.
"""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import making
import numpy as np
from elementary import ROBOTS
from elementary import shift as shift
from elementary import turn as turn
from making import PRISMATIC, REVOLUTE, TOOL, Body, Joint, Mechanism, axis, planar
from numpy.typing import NDArray

from raff2urdf import loads
from raff2urdf.raff.document import Document
from raff2urdf.tree import Cluster, clusters, length_of

Matrix = NDArray[np.float64]


def raff_of(bodies: Iterable[Body], *loops: tuple[int, int, int]) -> str:
    """RAFF text (mm, degrees) of bodies that are given by their placements in the world: all digits, and no tool."""
    bodies = tuple(body for body in bodies if body.number != TOOL)
    return "RAFF mechanism\n" + Mechanism(bodies, loops).text(joint_digits=None, units=None)


def ring(axes: Sequence[Matrix], cut: int = -1, how: str = "joint", off: Matrix | None = None) -> str:
    """The ring of `making`, cut at a joint; `off` displaces the second end of its loop."""
    made = making.ring(axes, None, cut, how)
    end, off = made.loops[0][1], np.eye(4) if off is None else off
    bodies = [replace(body, place=body.place @ off) if body.number == end else body for body in made.bodies]
    return raff_of(bodies, *made.loops)


def side_by_side(*texts: str) -> str:
    """The bodies of several texts on one base: link 1 of the first is link 11, that of the second link 21."""
    inside = [text.split("\n", 3)[3].rsplit("}", 1)[0] for text in texts]
    numbered = [re.sub(r"\b(link|frame|pred) ([1-9])", rf"\1 {i}\2", text) for i, text in enumerate(inside, 1)]
    return "\n".join(["RAFF several", "robot r {", *numbered, "}", ""])


# --- planar mechanisms -------------------------------------------------------------------------------------------

FOUR_BAR_AXES = planar(np.array([(0.0, 0.0), (0.05, 0.1), (0.4, 0.25), (0.4, 0.0)]))


def four_bar(cut: int = -1, how: str = "joint") -> str:
    return ring(FOUR_BAR_AXES, cut, how)


def parallelogram(cranks: int = 2, lean: float | None = None) -> str:
    """Equal cranks under one coupler; all but two add nothing but rows."""
    made = making.parallelograms(np.random.default_rng(0), 1, cranks, lean)
    return raff_of(made.bodies, *made.loops)


def polygon(n: int, cut: int = -1) -> str:
    """A planar n-bar: mobility n - 3."""
    angles = [2.0 * math.pi * i / n + 0.1 * i * i / n for i in range(n)]
    return ring(planar(np.array([(0.3 * math.cos(a), 0.2 * math.sin(a)) for a in angles])), cut)


def planar_3rrr() -> str:
    """A platform on three legs of three revolute joints, all in one plane: mobility 3."""
    points = (0.5, 0.0, 0.0), (0.4, 0.25, 0.0), (0.1, -0.05, 0.0)
    turns = [turn("z", 2.0 * math.pi * leg / 3.0) for leg in range(3)]
    made = making.legged([[Joint(turned @ axis(point)) for point in points] for turned in turns], "joint")
    return raff_of(made.bodies, *made.loops)


def slider_crank(cut: str) -> str:
    """A crank, a rod and a piston that slides along x: cut at the piston's "slide" or at its "pin". Mobility 1."""
    crank, knee, pin = planar(np.array([(0.0, 0.0), (0.06, 0.08), (0.3, 0.0)]))
    slide = axis((0.3, 0.0, 0.0), (1.0, 0.0, 0.0))
    arm = [Body(1, 0, crank), Body(2, 1, knee)]
    if cut == "slide":
        return raff_of([*arm, Body(3, 2, pin), Body(4, 3, slide, None), Body(5, 0, slide, None)], (4, 5, PRISMATIC))
    return raff_of([*arm, Body(3, 0, slide, PRISMATIC), Body(4, 2, pin, None), Body(5, 3, pin, None)], (4, 5, REVOLUTE))


# --- spatial mechanisms ------------------------------------------------------------------------------------------


def delta() -> str:
    """The paper's MiniDelta (figure 5) as it is in `robots`, without graphics: a 3-RUU delta, mobility 3."""
    return re.sub('path ".*"|filename {[^}]*}', "", (ROBOTS / "delta4.raff").read_text(encoding="utf-8"))


def gough_stewart() -> str:
    """6-UPS: a platform on six legs, each a universal joint, a slide and a ball. Mobility 6."""
    made = making.platform(np.random.default_rng(0), ["UPS"] * 6, "joint")
    return raff_of(made.bodies, *made.loops)


def sarrus(cut: int = -1, how: str = "joint") -> str:
    """Two pairs of hinged plates that lift a platform straight up. Mobility 1; Kutzbach says 0."""
    return ring(making.sarrus(np.random.default_rng(0)), cut, how)


def bennett() -> str:
    """Bennett's skew four-bar. Mobility 1; Kutzbach says -2."""
    return ring(making.bennett(np.random.default_rng(0)))


def skew_four_bar() -> str:
    """Four revolute joints on skew axes, a bit off what would meet, cut rigidly: six rows on four joints."""
    axes = [axis((0, 0, 0), (0, 0.1, 1)), axis((0.1, 0.3, 0), (0.2, 0, 1))]
    axes += [axis((0.5, 0.3, 0.1), (0, 0.3, 1)), axis((0.5, 0, 0), (0.3, 0.1, 1))]
    return ring(axes, how="rigid", off=shift("x", 0.004) @ turn("y", 0.02))


def serial(n: int) -> str:
    """n links in a row, revolute and prismatic in turn: mobility n."""
    link = "link {} {{ parameters {{ d 100 alpha {} r 10 }} type {} pred {} }}"
    links = [link.format(i, 90 * (i % 2), 1 + i % 2, i - 1) for i in range(1, n + 1)]
    return "\n".join(["RAFF serial", "robot r {", "  base { }", *links, "}", ""])


KNOWN = {
    "serial arm of 1": (serial(1), 1),
    "serial arm of 7": (serial(7), 7),
    "truss": (polygon(3), 0),
    "four-bar": (four_bar(), 1),
    "four-bar, closed rigidly": (four_bar(how="rigid"), 1),
    "slider-crank, cut at the slide": (slider_crank("slide"), 1),
    "slider-crank, cut at the pin": (slider_crank("pin"), 1),
    "five-bar": (polygon(5, 2), 2),
    "seven-bar": (polygon(7), 4),
    "parallelogram": (parallelogram(), 1),
    "flat parallelogram": (parallelogram(lean=0.0), 1),
    "parallelogram with a redundant bar": (parallelogram(3), 1),
    "planar 3-RRR": (planar_3rrr(), 3),
    "delta": (delta(), 3),
    "6-UPS": (gough_stewart(), 6),
    "Sarrus": (sarrus(), 1),
    "Bennett": (bennett(), 1),
}
"""RAFF text and mobility, by name."""

CLOSED_CHAINS = [name for name, (text, _) in KNOWN.items() if "constraint" in text]


# --- what the tests do with them ---------------------------------------------------------------------------------


def clusters_of(document: Document) -> list[Cluster]:
    """The first robot's loops as systems of equations, as the converter makes them."""
    robot = document.robot()
    kinds = {i: loop.kind for i, loop in enumerate(robot.loops)}
    return list(clusters(document, robot, kinds, length_of(document, robot, kinds)))


def cluster_of(text: str) -> Cluster:
    """The only cluster of loops in a RAFF text."""
    (cluster,) = clusters_of(loads(text))
    return cluster


class Circles:
    """Two circles of radius 1, as equations: a point of one is on the other. They count how often they are asked."""

    def __init__(self, apart: float) -> None:
        self.apart, self.evaluations = apart, 0

    def evaluate(self, q: Matrix) -> tuple[Matrix, Matrix]:
        self.evaluations += 1
        (a, b), (c, d) = np.cos(q), np.sin(q)
        return np.array([a + b - self.apart, c - d]), np.array([[-c, -d], [a, -b]])

    def integrate(self, q: Matrix, step: Matrix) -> Matrix:
        return q + step
