"""Robots before and after a synthesis, in views of one scale, with the region that they reach."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.design.synthesis import Reach
from cinegen.errors import CinegenError
from cinegen.model import Mechanism
from cinegen.model.motion_plane import motion_plane
from cinegen.plotting.ground import bounds, ground_of, rests_on_base
from cinegen.plotting.sheet import GREEN, INK, LABEL, new_figure, round_length
from cinegen.plotting.skeleton import Pose, Skeleton
from cinegen.plotting.stick import ACTUATED, END, Pen, hull, paint
from cinegen.plotting.synthesis.page import drawing
from cinegen.plotting.view import Projection, views
from raff2urdf.quantities import LENGTH, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_WIDE = 7.2  # inches
_TALLEST = 3.6  # inches, of a row
_ROOM = 0.07  # around the drawing, relative to its size
_FOOT, _HEAD, _LEFT = 0.3, 0.3, 0.05  # inches
_STEPS, _NEWTON = 40, 8
_REACHED = 1e-9  # characteristic lengths and rad
_RANK = 1e-9
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
    q, coordinates = mechanism.q_home, [row for row in rows if row < 3]
    home = mechanism.placement(q, node)
    begin = home.translation[coordinates]
    weights = np.repeat([1.0 / mechanism.length, 1.0], 3)[rows]
    try:
        for part in np.linspace(0.0, 1.0, _STEPS + 1)[1:]:
            for _ in range(_NEWTON):
                now = mechanism.placement(q, node)
                missing = begin + part * (target - begin) - now.translation[coordinates]
                if len(rows) > len(coordinates):
                    missing = np.append(missing, pin.log3(home.rotation @ now.rotation.T))
                if np.linalg.norm(missing * weights) < _REACHED:
                    break
                world = np.kron(np.eye(2), now.rotation) @ mechanism.jacobian(q, node)
                loops = mechanism.loop_jacobian(q)
                wanted = np.append(np.zeros(len(loops)), missing * weights)
                matrix = np.vstack([loops, world[rows] * weights[:, None]]) * mechanism.scale
                step = np.linalg.pinv(matrix, rcond=_RANK) @ wanted
                q = mechanism.close(mechanism.integrate(q, step * mechanism.scale))
            else:
                return None
    except (CinegenError, np.linalg.LinAlgError):
        return None
    return np.asarray(q)


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
    low, high = bounds(seen, points, ground)
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    half += 2.0 * _ROOM * half.max(axis=1, keepdims=True)
    half[:, 1] = half[:, 1].max()
    planar = len(seen) == 1
    columns = np.tile(half[:, 0], len(poses) if planar else 1)
    scale = min((_WIDE - _LEFT) / (2.0 * columns.sum()), _TALLEST / (2.0 * half[0, 1]))  # inches for a metre
    rows = 1 if planar else len(poses)
    tall = rows * (2.0 * scale * half[0, 1] + _HEAD) + _FOOT
    figure = new_figure(figsize=(_WIDE, tall))
    used = 2.0 * scale * columns.sum()
    grid = figure.add_gridspec(
        rows, len(columns), width_ratios=columns, left=_LEFT / _WIDE, right=(_LEFT + used) / _WIDE, bottom=_FOOT / tall,
        top=1.0 - _HEAD / tall, wspace=0.0, hspace=_HEAD / (2.0 * scale * half[0, 1]),
    )  # fmt: skip
    for k, (name, pose) in enumerate(zip(titles, poses, strict=True)):
        for j, view in enumerate(seen):
            axes = figure.add_subplot(grid[0, k] if planar else grid[k, j])
            axes.set_axis_off()
            (left, below), (right, above) = middle[j] - half[j], middle[j] + half[j]
            axes.set(xlim=(left, right), ylim=(below, above), aspect="equal")
            if ground is not None and math.isfinite(view.distance) and rests_on_base(pose):
                ground.paint(axes, pose, view, 3.2)
            _draw_region(axes, view, region, filled)
            paint(axes, pose, view, Pen(1.6, 0.9, 3.2))
            title = ": ".join(text for text in (name if j == 0 else "", view.name) if text)
            axes.set_title(title, fontsize=LABEL, color=INK, loc="left")
    _legend(figure, scale, poses[0], node)
    return figure


def _draw_region(axes: Any, view: Projection, region: Array, filled: bool) -> None:
    """Draw the points to reach into axes whose unit is the metre."""
    from matplotlib.patches import Polygon

    flat = view.project(region)[0]
    if filled and np.linalg.matrix_rank(flat - flat[0], tol=1e-9) == 2:
        axes.add_patch(Polygon(hull(flat), facecolor=GREEN, alpha=0.22, linewidth=0.0, zorder=1.0))
        axes.add_patch(Polygon(hull(flat), facecolor="none", edgecolor=GREEN, linewidth=1.0, zorder=1.1))
    else:
        axes.plot(*flat.T, "+", color=GREEN, markersize=6.0, zorder=4.0)


def _legend(figure: Figure, scale: float, pose: Pose, node: str) -> None:
    """Add what colours mean, and the length of a bar (scale: inches for a metre)."""
    from matplotlib.lines import Line2D

    wide = figure.get_figwidth()
    marks = [(ACTUATED, "actuated joint", "o"), (END, f"node {node}", "o"), (GREEN, "to reach", "s")]
    dots = [
        Line2D([], [], color=colour, label=text, marker=marker, markersize=4.5, linestyle="none")
        for colour, text, marker in marks
    ]
    figure.legend(
        handles=dots, loc="lower left", bbox_to_anchor=(0.0, 0.0), ncols=len(dots), frameon=False, fontsize=LABEL,
        labelcolor=INK, handletextpad=0.1, columnspacing=1.2,
    )  # fmt: skip
    length = round_length(1.0 / scale)
    right = wide - 0.1
    inches = figure.dpi_scale_trans
    figure.add_artist(Line2D([right - length * scale, right], [0.08, 0.08], color=INK, linewidth=1.5, transform=inches))
    figure.text(
        right - length * scale / 2.0, 0.12, shown(length, LENGTH), color=INK, fontsize=LABEL, ha="center",
        transform=inches,
    )  # fmt: skip
