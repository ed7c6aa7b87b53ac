"""Drawing of a skeleton in one view: parts as lines and plates, prismatic joints, joint centres; the farthest first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull, QhullError

from cinegen.arrays import Array
from cinegen.plotting.sheet import BLUE, FAINT, INK, ORANGE, SKY, VERMILION
from cinegen.plotting.skeleton import Pose
from cinegen.plotting.view import Projection

BASE, BODY = "#c9ced4", "#dfe3e8"
FRONT, BACK = SKY, ORANGE
"""Colours of a plate: the side that is up at home, and its other side."""
ACTUATED, END = BLUE, VERMILION

_CYLINDER = 0.55  # part of a prismatic joint's length that is drawn thick


@dataclass(frozen=True)
class Pen:
    """Thickness of lines, points.

    Attributes:
        link: of a part between two joints.
        edge: of a plate.
        dot: across a joint.
    """

    link: float = 1.3
    edge: float = 0.9
    dot: float = 2.6


def paint(axes: Axes, pose: Pose, view: Projection, pen: Pen | None = None) -> None:
    """Draw a skeleton into axes whose unit is the metre; leave their limits as they are."""
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

    lift = 0.02 * float(np.ptp(view.project(pose.points)[1])) + 1e-9  # joints are in front of what they join
    for part in pose.parts:
        if len(part.points) < 2:
            continue
        if len(part.points) == 2 and not part.is_base:
            line(part.points, INK, pen.link)
        else:
            flat, near = view.project(part.points)
            colour, edge, alpha = BODY, INK, 0.85
            if part.is_base:
                colour, edge, alpha = BASE, FAINT, 0.6
            elif part.normal is not None:
                colour = FRONT if view.shows_front(part.points.mean(axis=0), part.normal) else BACK
            plate = Polygon(
                hull(flat), facecolor=colour, edgecolor=edge, alpha=alpha, linewidth=pen.edge, joinstyle="round"
            )
            painted.append((float(near.mean()), plate))
        dots(part.points[int(part.is_stalk) :], "white", INK, pen.dot, lift)
    for slide in pose.slides:
        first, last = slide.points
        half = first + _CYLINDER * (last - first)
        line(np.array([half, last]), INK, pen.link)
        line(np.array([first, half]), ACTUATED if slide.actuated else FAINT, 2.0 * pen.link)
        dots(slide.points, "white", INK, pen.dot, lift)
    dots(pose.actuated, ACTUATED, ACTUATED, 1.3 * pen.dot, 1.5 * lift)
    dots(pose.end[None], END, END, pen.dot, 2.0 * lift)
    for rank, (_, artist) in enumerate(sorted(painted, key=lambda pair: pair[0])):
        artist.set_zorder(2.0 + 1e-3 * rank)
        axes.add_artist(artist)


def hull(points: Array) -> Array:
    """Return the corners (k, 2) of the convex hull of points (n, 2), counter-clockwise; of points on a line, such as
    those of a plate that is seen on its edge, both ends."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return np.asarray(points[np.lexsort(points.T)[[0, -1]]])
