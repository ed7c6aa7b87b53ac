"""RAFF texts of mechanisms whose mobility is known.

Most are given by where their joint axes lie in the world (metres; z of a placement is the axis) and become RAFF
through `raff_of`; those that stand in a book by their own parameters are written out.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from elementary import shift as shift
from elementary import turn as turn
from numpy.typing import ArrayLike, NDArray

from raff2urdf import loads
from raff2urdf.raff.document import Document
from raff2urdf.raff.kleinfinger import parameters
from raff2urdf.tree import Cluster, clusters, length_of

Matrix = NDArray[np.float64]

FIXED, PRISMATIC, REVOLUTE, BALL = 0, 1, 2, 3


# --- placements --------------------------------------------------------------------------------------------------


def axis_at(point: ArrayLike, direction: ArrayLike = (0, 0, 1)) -> Matrix:
    """A placement at `point` whose z points along `direction`."""
    z = np.asarray(direction, dtype=float)
    z = z / np.linalg.norm(z)
    aside = np.eye(3)[np.argmin(np.abs(z))]
    y = np.cross(z, aside)
    y /= np.linalg.norm(y)
    m = np.eye(4)
    m[:3, :3] = np.column_stack([np.cross(y, z), y, z])
    m[:3, 3] = point
    return m


# --- RAFF from placements ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Part:
    """A link (or a frame, if `type` is None), where it stands in the world when the mechanism is at home."""

    number: int
    pred: int
    place: Matrix
    type: int | None = REVOLUTE
    more: str = ""


def raff_of(parts: Iterable[Part], *constraints: str, name: str = "mechanism") -> str:
    """RAFF text (mm, degrees) of parts that are given by their placements in the world."""
    world = {0: np.eye(4)}
    lines = [f"RAFF {name}", "robot r {", "  base { }"]
    for part in parts:
        world[part.number] = part.place
        p = parameters(np.linalg.inv(world[part.pred]) @ part.place)
        said = f"theta {math.degrees(p.theta)!r} r {1e3 * p.r!r} d {1e3 * p.d!r}"
        said += f" alpha {math.degrees(p.alpha)!r} gamma {math.degrees(p.gamma)!r} epsilon {1e3 * p.epsilon!r}"
        word = "frame" if part.type is None else "link"
        kind = "" if part.type is None else f"type {part.type}"
        lines.append(f"  {word} {part.number} {{ parameters {{ {said} }} {kind} pred {part.pred} {part.more} }}")
    lines += [f"  constraint {{ {constraint} }}" for constraint in constraints]
    return "\n".join([*lines, "}", ""])


def ring(axes: Sequence[Matrix], cut: int | None = None, rigid: bool = False, off: Matrix | None = None) -> str:
    """One closed loop of revolute joints: joint i joins body i to body i + 1, the last one to the base, body 0.

    Body b is link b. The loop is cut at joint `cut` (the last unless said): as a revolute joint, or `rigid`, with the
    joint kept as one more link that must coincide with its other end. `off` displaces that end.
    """
    n = len(axes)
    cut = n - 1 if cut is None else cut
    forward = [Part(b, b - 1, axes[b - 1]) for b in range(1, cut + 1)]
    backward = [Part(b, (b + 1) % n, axes[b]) for b in range(n - 1, cut, -1)]
    one_end = Part(n + 1, cut, axes[cut], REVOLUTE if rigid else None)
    other_end = Part(n + 2, (cut + 1) % n, axes[cut] if off is None else axes[cut] @ off, None)
    closed = f"link {n + 1} frame {n + 2}" if rigid else f"frame {n + 1} frame {n + 2} type {REVOLUTE}"
    return raff_of([*forward, *backward, one_end, other_end], closed)


# --- planar mechanisms -------------------------------------------------------------------------------------------


def planar(*points: tuple[float, float]) -> list[Matrix]:
    """Parallel axes through points of the plane."""
    return [axis_at((x, y, 0.0)) for x, y in points]


FOUR_BAR_AXES = planar((0.0, 0.0), (0.05, 0.1), (0.4, 0.25), (0.4, 0.0))
PARALLELOGRAM_AXES = planar((0.0, 0.0), (0.1, 0.3), (0.6, 0.3), (0.5, 0.0))
FLAT_PARALLELOGRAM_AXES = planar((0.0, 0.0), (0.3, 0.0), (0.8, 0.0), (0.5, 0.0))


def four_bar(cut: int | None = None, rigid: bool = False) -> str:
    return ring(FOUR_BAR_AXES, cut, rigid)


def parallelogram(cut: int | None = None) -> str:
    return ring(PARALLELOGRAM_AXES, cut)


def polygon(n: int, cut: int | None = None) -> str:
    """A planar n-bar: mobility n - 3."""
    angles = [2.0 * math.pi * i / n + 0.1 * i * i / n for i in range(n)]
    return ring(planar(*[(0.3 * math.cos(a), 0.2 * math.sin(a)) for a in angles]), cut)


def five_bar(cut: int | None = None) -> str:
    return ring(planar((0.0, 0.0), (-0.1, 0.2), (0.1, 0.4), (0.3, 0.2), (0.2, 0.0)), cut)


def parallelogram_with_a_redundant_bar() -> str:
    """Three equal cranks side by side under one coupler: the middle one adds nothing but rows."""
    low, high = planar((0.0, 0.0), (0.5, 0.0), (0.2, 0.0)), planar((0.1, 0.3), (0.6, 0.3), (0.3, 0.3))
    cranks = [Part(1, 0, low[0]), Part(2, 1, high[0]), Part(3, 0, low[1]), Part(4, 0, low[2])]
    ends = [Part(11, 3, high[1], None), Part(12, 2, high[1], None)]
    ends += [Part(21, 4, high[2], None), Part(22, 2, high[2], None)]
    return raff_of([*cranks, *ends], "frame 11 frame 12 type 2", "frame 21 frame 22 type 2")


def planar_3rrr() -> str:
    """A platform on three legs of three revolute joints, all in one plane: mobility 3."""
    parts, constraints = [], []
    for leg in range(3):
        turned = turn("z", 2.0 * math.pi * leg / 3.0)
        shoulder, elbow, wrist = (turned @ axis_at(p) for p in ((0.5, 0.0, 0.0), (0.4, 0.25, 0.0), (0.1, -0.05, 0.0)))
        first = 10 * leg + 1
        parts += [Part(first, 0, shoulder), Part(first + 1, first, elbow)]
        if leg == 0:
            parts.append(Part(3, 2, wrist))  # the platform
        else:
            parts += [Part(first + 2, first + 1, wrist, None), Part(first + 3, 3, wrist, None)]
            constraints.append(f"frame {first + 2} frame {first + 3} type 2")
    return raff_of(parts, *constraints)


def slider_crank(cut: str) -> str:
    """A crank, a rod and a piston that slides along x: cut at the piston's "slide" or at its "pin". Mobility 1."""
    crank, knee, pin = planar((0.0, 0.0), (0.06, 0.08), (0.3, 0.0))
    slide = axis_at((0.3, 0.0, 0.0), (1.0, 0.0, 0.0))
    arm = [Part(1, 0, crank), Part(2, 1, knee)]
    if cut == "slide":
        piston = [Part(3, 2, pin), Part(4, 3, slide, None), Part(5, 0, slide, None)]
        return raff_of([*arm, *piston], f"frame 4 frame 5 type {PRISMATIC}")
    piston = [Part(3, 0, slide, PRISMATIC), Part(4, 2, pin, None), Part(5, 3, pin, None)]
    return raff_of([*arm, *piston], f"frame 4 frame 5 type {REVOLUTE}")


def truss() -> str:
    """A triangle: three bars on three hinges. Mobility 0."""
    return ring(planar((0.0, 0.0), (0.2, 0.4), (0.5, 0.0)))


# --- spatial mechanisms ------------------------------------------------------------------------------------------


def delta(forearm: float = 3500.0) -> str:
    """The paper's MiniDelta (figure 5), completed: a 3-RUU delta, mobility 3.

    Base radius 1500, upper arm 2000, shoulder at 0, elbow at 211.21 are the figure's; forearm L and platform radius
    p are tied by p = 3500 + L cos(211.21). Each arm: shoulder, then two joints at the elbow, two at the wrist; link 5
    is the platform. Arms 2 and 3 end in a fixed link that coincides with it.
    """
    radius = 3500.0 + forearm * math.cos(math.radians(211.21))
    lines = ["RAFF MiniDelta", "robot r1 {", "base { }"]
    for arm, gamma in enumerate((0, 120, 240)):
        n = (1, 6, 12)[arm]
        lines += [
            f"link {n} {{ parameters {{ gamma {gamma} alpha 90 d 1500 theta 0 }} type 2 pred 0 limits {{ -85 80 }} }}",
            f"link {n + 1} {{ parameters {{ d 2000 theta 211.21 }} type 2 pred {n} limits {{ 185 355 }} }}",
            f"link {n + 2} {{ parameters {{ alpha 90 }} type 2 pred {n + 1} }}",
            f"link {n + 3} {{ parameters {{ d {forearm!r} }} type 2 pred {n + 2} }}",
            f"link {n + 4} {{ parameters {{ alpha -90 theta {360 - 211.21!r} }} type 2 pred {n + 3} }}",
        ]
        if arm:  # to the platform's centre, and out again to where the first arm holds it
            centre, end = 20 + arm, (5, 11, 17)[arm]
            lines += [
                f"frame {centre} {{ parameters {{ d {-radius!r} alpha -90 }} pred {n + 4} }}",
                f"link {end} {{ parameters {{ gamma {-gamma} alpha 90 d {radius!r} }} type 0 pred {centre} }}",
                f"constraint {{ link 5 link {end} }}",
            ]
    lines += [f'frame 20 {{ name "tool" parameters {{ d {-radius!r} alpha -90 }} pred 5 }}', "}", ""]
    return "\n".join(lines)


def gough_stewart() -> str:
    """6-UPS: a platform on six legs, each a universal joint, a slide and a ball. Mobility 6."""
    parts, constraints = [], []
    top = np.eye(4)
    for leg in range(6):
        around = 2.0 * math.pi * (leg // 2) / 3.0
        low, high = around + (-0.3, 0.3)[leg % 2], around + (-0.8, 0.8)[leg % 2]
        foot = np.array([0.6 * math.cos(low), 0.6 * math.sin(low), 0.0])
        head = np.array([0.3 * math.cos(high), 0.3 * math.sin(high), 0.5])
        along = head - foot
        first, second = np.cross(along, (0.0, 0.0, 1.0)), np.cross(along, np.cross(along, (0.0, 0.0, 1.0)))
        n = 10 * leg + 1
        parts += [Part(n, 0, axis_at(foot, second)), Part(n + 1, n, axis_at(foot, first))]
        parts += [Part(n + 2, n + 1, axis_at(head, along), PRISMATIC)]
        if leg == 0:  # this ball is three revolute joints, and the last of their links the platform
            parts += [Part(4, 3, axis_at(head, (1, 0, 0))), Part(5, 4, axis_at(head, (0, 1, 0)))]
            top[:3, 3] = head
            parts += [Part(6, 5, top)]
        else:
            parts += [Part(n + 3, n + 2, axis_at(head), None), Part(n + 4, 6, axis_at(head), None)]
            constraints.append(f"frame {n + 3} frame {n + 4} type {BALL}")
    return raff_of(parts, *constraints)


def sarrus(cut: int | None = None, rigid: bool = False) -> str:
    """Two pairs of hinged plates at right angles, that lift a platform straight up. Mobility 1; Kutzbach says 0."""
    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    axes = [axis_at(p, x) for p in ((0.0, 0.5, 0.0), (0.0, 0.9, 0.5), (0.0, 0.5, 1.0))]
    axes += [axis_at(p, y) for p in ((0.5, 0.0, 1.0), (0.9, 0.0, 0.5), (0.5, 0.0, 0.0))]
    return ring(axes, cut, rigid)


def bennett(theta: float = 70.0) -> str:
    """Bennett's skew four-bar, with the twists 40 and 100 degrees. Mobility 1; Kutzbach says -2.

    G. T. Bennett, "A new mechanism", Engineering 76, 1903: a / sin(alpha) = b / sin(beta), opposite angles add up to
    360 degrees, and tan(theta1 / 2) tan(theta2 / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2).
    """
    alpha, beta = math.radians(40.0), math.radians(100.0)
    a, b = 300.0 * math.sin(alpha), 300.0 * math.sin(beta)
    ratio = math.sin((beta + alpha) / 2.0) / math.sin((beta - alpha) / 2.0)
    other = math.degrees(2.0 * math.atan(ratio / math.tan(math.radians(theta) / 2.0)))
    return f"""RAFF Bennett
robot r {{
  base {{ }}
  link 1 {{ parameters {{ alpha 100 d {b!r} theta {theta!r} }} type 2 pred 0 }}
  link 2 {{ parameters {{ alpha 40 d {a!r} theta {other!r} }} type 2 pred 1 }}
  link 3 {{ parameters {{ alpha 100 d {b!r} theta {360 - theta!r} }} type 2 pred 2 }}
  frame 4 {{ parameters {{ alpha 40 d {a!r} }} pred 3 }}
  constraint {{ base frame 4 type 2 }}
}}
"""


def skew_four_bar() -> str:
    """Four revolute joints on skew axes, a bit off what would meet, cut rigidly: six rows on four joints."""
    axes = [axis_at((0, 0, 0), (0, 0.1, 1)), axis_at((0.1, 0.3, 0), (0.2, 0, 1))]
    axes += [axis_at((0.5, 0.3, 0.1), (0, 0.3, 1)), axis_at((0.5, 0, 0), (0.3, 0.1, 1))]
    return ring(axes, rigid=True, off=shift("x", 0.004) @ turn("y", 0.02))


def serial(n: int) -> str:
    """n links in a row, revolute and prismatic in turn: mobility n."""
    links = [
        f"  link {i} {{ parameters {{ d 100 alpha {90 * (i % 2)} r 10 }} type {1 + i % 2} pred {i - 1} }}"
        for i in range(1, n + 1)
    ]
    return "\n".join(["RAFF serial", "robot r {", "  base { }", *links, "}", ""])


KNOWN = {
    "serial arm of 1": (serial(1), 1),
    "serial arm of 7": (serial(7), 7),
    "truss": (truss(), 0),
    "four-bar": (four_bar(), 1),
    "four-bar, closed rigidly": (four_bar(rigid=True), 1),
    "slider-crank, cut at the slide": (slider_crank("slide"), 1),
    "slider-crank, cut at the pin": (slider_crank("pin"), 1),
    "five-bar": (five_bar(2), 2),
    "seven-bar": (polygon(7), 4),
    "parallelogram": (parallelogram(), 1),
    "flat parallelogram": (ring(FLAT_PARALLELOGRAM_AXES), 1),
    "parallelogram with a redundant bar": (parallelogram_with_a_redundant_bar(), 1),
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
