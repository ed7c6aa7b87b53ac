"""Robots before and after a synthesis, in views of one scale, with the region that they reach."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from cinegen.arrays import Array
from cinegen.design.synthesis import Reach
from cinegen.errors import CinegenError
from cinegen.model import Mechanism
from cinegen.model.motion_plane import motion_plane
from cinegen.plotting.ground import corners, ground_of, paint_on_ground
from cinegen.plotting.sheet import GREEN, INK, LABEL, explain, new_figure
from cinegen.plotting.skeleton import Pose, Skeleton
from cinegen.plotting.stick import ACTUATED, END, Pen, hull
from cinegen.plotting.synthesis.page import drawing
from cinegen.plotting.view import Projection, views
from cinegen.singularities.slice import POSE, Coordinates

_WIDE = 7.2  # inches
_TALLEST = 3.6  # inches, of a row
_ROOM = 0.07  # around the drawing, relative to its size
_FOOT, _HEAD, _LEFT = 0.3, 0.3, 0.05  # inches
_GRID = 9  # points along each axis of a region


def moved_to(mechanism: Mechanism, node: str, rows: list[int], target: Array) -> Array | None:
    """Return the configuration (nq,) with a node at a target, continued from home along a straight line; None if it
    does not get there.

    Args:
        mechanism: any.
        node: that is moved.
        rows: components of its twist in the world that are wanted: coordinates, then the orientation at home or none.
        target: (coordinates,) m.
    """
    names = [POSE[row] for row in rows if row < 3]
    try:
        return Coordinates(mechanism, names, node).from_home(dict(zip(names, target.tolist(), strict=True)))
    except (CinegenError, np.linalg.LinAlgError):
        return None


def draw_designs(
    designs: Mapping[str, Mechanism], reach: Reach, node: str = "", targets: Array | None = None
) -> Figure:
    """Draw robots that do one task, side by side, or one above the other if they move in space. All views have one
    scale. Each has its node in the middle of the region, or at the point nearest to the middle; or is drawn at home, as
    its title states, if it does not get there on a straight line.

    Args:
        designs: one or more, by the titles above them.
        reach: what is reached.
        node: that reaches; the mechanisms' end unless given.
        targets: (n, axes) points whose hull is drawn, m; a grid over `reach` unless given.
    """
    with drawing():
        return _draw(designs, reach, node or next(iter(designs.values())).end, targets)


def _draw(designs: Mapping[str, Mechanism], reach: Reach, node: str, targets: Array | None) -> Figure:
    target, poses, titles = reach.middle[: len(reach.axes)], list[Pose](), list[str]()
    for title, mechanism in designs.items():
        q = moved_to(mechanism, node, reach.rows, target)
        titles.append(title if q is not None else f"{title} (at home)")
        poses.append(Skeleton(mechanism, node).at(mechanism.q_home if q is None else q))
    targets = reach.grid(_GRID) if targets is None else targets
    region = np.tile(poses[0].end, (len(targets), 1))
    for k, axis in enumerate(reach.axes):
        region[:, "xyz".index(axis)] = targets[:, k]
    filled = not len(reach.given)
    points = np.vstack([region, *(pose.points for pose in poses)])
    seen = views(points, motion_plane(next(iter(designs.values()))))
    ground = ground_of(poses) if len(seen) > 1 else None  # a planar mechanism is seen from above
    limits = corners(seen, points, ground, _ROOM)
    sizes, planar = np.ptp(limits, axis=1), len(seen) == 1
    columns, rows = (np.tile(sizes[:, 0], len(poses)), 1) if planar else (sizes[:, 0], len(poses))
    scale = min((_WIDE - _LEFT) / columns.sum(), _TALLEST / sizes[0, 1])  # inches for a metre
    tall = rows * (scale * sizes[0, 1] + _HEAD) + _FOOT
    figure = new_figure(figsize=(_WIDE, tall))
    used = scale * columns.sum()
    grid = figure.add_gridspec(
        rows, len(columns), width_ratios=columns, left=_LEFT / _WIDE, right=(_LEFT + used) / _WIDE, bottom=_FOOT / tall,
        top=1.0 - _HEAD / tall, wspace=0.0, hspace=_HEAD / (scale * sizes[0, 1]),
    )  # fmt: skip
    for k, (name, pose) in enumerate(zip(titles, poses, strict=True)):
        for j, view in enumerate(seen):
            axes = figure.add_subplot(grid[0, k] if planar else grid[k, j])
            paint_on_ground(axes, pose, view, limits[j], ground, Pen(1.6, 0.9, 3.2))
            _draw_region(axes, view, region, filled)
            title = ": ".join(text for text in (name if j == 0 else "", view.name) if text)
            axes.set_title(title, fontsize=LABEL, color=INK, loc="left")
    marks = [(ACTUATED, "actuated joint", "o"), (END, f"node {node}", "o"), (GREEN, "to reach", "s")]
    explain(figure, marks, scale, 0.1, 0.05, LABEL)
    return figure


def _draw_region(axes: Any, view: Projection, region: Array, filled: bool) -> None:
    """Draw the points to reach into axes whose unit is the metre."""
    flat = view.project(region)[0]
    if filled and np.linalg.matrix_rank(flat - flat[0], tol=1e-9) == 2:
        axes.add_patch(Polygon(hull(flat), facecolor=GREEN, alpha=0.22, linewidth=0.0, zorder=1.0))
        axes.add_patch(Polygon(hull(flat), facecolor="none", edgecolor=GREEN, linewidth=1.0, zorder=1.1))
    else:
        axes.plot(*flat.T, "+", color=GREEN, markersize=6.0, zorder=4.0)
