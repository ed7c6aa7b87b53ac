"""A skeleton painted in one view: parts as lines and plates, jacks, joints; what is far away first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cinegen.plotting.skeleton import Pose
from cinegen.plotting.view import Projection

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

INK, FAINT = "#2b3036", "#8b929a"
BASE, BODY = "#c9ced4", "#dfe3e8"
FRONT, BACK = "#56b4e9", "#e69f00"
"""Of a plate: the side that is up at home, and its other side (Okabe and Ito's sky blue and orange)."""
MOTOR, END = "#0072b2", "#d55e00"

_JACK = 0.55  # part of a jack's length that is its thick half


@dataclass(frozen=True)
class Pen:
    """How thick lines are, points.

    Attributes:
        link: of a part between two joints.
        edge: of a plate.
        dot: across a joint.
    """

    link: float = 1.3
    edge: float = 0.9
    dot: float = 2.6


def paint(axes: Axes, pose: Pose, view: Projection, pen: Pen | None = None) -> None:
    """Paints a skeleton into axes whose unit is the metre; leaves their limits as they are."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

    pen = pen or Pen()
    painted: list[tuple[float, Artist]] = []

    def line(points: Array, colour: str, width: float) -> None:
        flat, near = view.project(points)
        artist = Line2D(flat[:, 0], flat[:, 1], color=colour, linewidth=width, solid_capstyle="round")
        painted.append((float(near.mean()), artist))

    def dots(points: Array, face: str, edge: str, size: float, lift: float) -> None:
        for (x, y), near in zip(*view.project(points), strict=True):
            artist = Line2D(
                [x], [y], marker="o", markersize=size, markerfacecolor=face, markeredgecolor=edge,
                markeredgewidth=0.5 * pen.edge, linestyle="none",
            )  # fmt: skip
            painted.append((float(near) + lift, artist))

    everywhere = view.project(pose.points)[1]
    lift = 0.02 * float(np.ptp(everywhere)) + 1e-9  # joints stand before what they join
    for part in pose.parts:
        if len(part.points) == 2 and not part.is_base:
            line(part.points, INK, pen.link)
        elif len(part.points) > 1:
            flat, near = view.project(part.points)
            if part.is_base:
                colour = BASE
            elif part.normal is None:
                colour = BODY
            else:
                colour = FRONT if view.shows_front(part.points.mean(axis=0), part.normal) else BACK
            faint = part.is_base
            plate = Polygon(
                outline(flat), facecolor=colour, edgecolor=FAINT if faint else INK, alpha=0.6 if faint else 0.85,
                linewidth=pen.edge, joinstyle="round",
            )  # fmt: skip
            painted.append((float(near.mean()), plate))
        if len(part.points) > 1:
            dots(part.points[int(part.is_stalk) :], "white", INK, pen.dot, lift)
    for slide in pose.slides:
        first, last = slide.points
        half = first + _JACK * (last - first)
        line(np.array([half, last]), INK, pen.link)
        line(np.array([first, half]), MOTOR if slide.motor else FAINT, 2.0 * pen.link)
        dots(slide.points, "white", INK, pen.dot, lift)
    dots(pose.motors, MOTOR, MOTOR, 1.3 * pen.dot, 1.5 * lift)
    dots(pose.end[None], END, END, pen.dot, 2.0 * lift)
    for rank, (_, artist) in enumerate(sorted(painted, key=lambda one: one[0])):
        artist.set_zorder(2.0 + 1e-3 * rank)
        axes.add_artist(artist)


def outline(points: Array) -> Array:
    """(k, 2) the corners of the convex hull of points (n, 2), in turn; Andrew's monotone chain, so that points on a
    line, as a plate seen on its edge, are no exception."""
    ordered = sorted(map(tuple, points))
    if len(ordered) < 3:
        return np.array(ordered)

    def half(way: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        kept: list[tuple[float, ...]] = []
        for point in way:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], point) <= 0.0:
                kept.pop()
            kept.append(point)
        return kept[:-1]

    return np.array(half(ordered) + half(ordered[::-1]))


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    """Positive where a, b, c turn left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
