"""The ground below robots that rest on it, and their contact shadows, in the perspective view of a picture."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from cinegen.arrays import Array
from cinegen.plotting.skeleton import Pose
from cinegen.plotting.stick import Pen, hull, paint
from cinegen.plotting.view import Projection

GROUND, SHADOW = "#eef0f3", "#868f9a"
"""Colours of the ground and of contact shadows."""

_AROUND = 1.06  # radius of the ground, relative to what rests on it
_BELOW = 1e-6  # of the size: how far a robot that rests on its base may be below it
_ALPHA = 0.55  # opacity of shadows: the base shows through
_BACK = 1.0  # order of the ground; what is in front of it is from 2 on


@dataclass(frozen=True, eq=False)
class Ground:
    """A horizontal disc at the base of poses that rest on it.

    Attributes:
        height: z in the world, m.
        rim: (n, 3) m, its edge.
    """

    height: float
    rim: Array

    def paint(self, axes: Axes, pose: Pose, view: Projection, width: float) -> None:
        """Draw the disc, and the contact shadow of light from above; a base lies between them.

        Args:
            axes: their unit is the metre.
            pose: a robot that rests on it.
            view: from above.
            width: of the contact shadow of a bar, points.
        """
        rim = Polygon(view.project(self.rim)[0], facecolor=GROUND, edgecolor="none", zorder=_BACK)
        axes.add_artist(rim)
        shadows = [part.points for part in pose.parts if not part.is_base] + [slide.points for slide in pose.slides]
        for points in shadows:
            flat = view.project(np.column_stack([points[:, :2], np.full(len(points), self.height)]))[0]
            if len(points) > 2:
                plate = Polygon(hull(flat), facecolor=SHADOW, edgecolor="none", alpha=_ALPHA, zorder=_BACK + 0.5)
                axes.add_artist(plate)
            elif len(points) == 2:
                bar = Line2D(
                    flat[:, 0], flat[:, 1], color=SHADOW, alpha=_ALPHA, linewidth=width, solid_capstyle="round",
                    zorder=_BACK + 0.5,
                )  # fmt: skip
                axes.add_artist(bar)


def rests_on_base(pose: Pose) -> bool:
    """Return whether no point of a robot is below its base."""
    base = [part.points[:, 2].min() for part in pose.parts if part.is_base]
    low = pose.points[:, 2].min()
    return bool(base) and bool(low >= min(base) - _BELOW * float(np.ptp(pose.points, axis=0).max()))


def ground_of(poses: Iterable[Pose]) -> Ground | None:
    """Return the ground of those poses that rest on their base, one for all; None if none does."""
    resting = [pose for pose in poses if rests_on_base(pose)]
    if not resting:
        return None
    points = np.vstack([pose.points for pose in resting])
    middle = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2.0
    radius = _AROUND * float(np.linalg.norm(points[:, :2] - middle, axis=1).max())
    turns = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
    height = float(points[:, 2].min())
    rim = np.column_stack([middle + radius * np.column_stack([np.cos(turns), np.sin(turns)]), np.full(90, height)])
    return Ground(height, rim)


def bounds(seen: Sequence[Projection], points: Array, ground: Ground | None) -> tuple[Array, Array]:
    """Return the lower left and upper right corners (views, 2) of what views show, m: points (n, 3), and in perspective
    the ground."""
    low, high = np.empty((2, len(seen), 2))
    for k, view in enumerate(seen):
        with_ground = ground if math.isfinite(view.distance) else None
        drawn = points if with_ground is None else np.vstack([points, with_ground.rim])
        flat = view.project(drawn)[0]
        low[k], high[k] = flat.min(axis=0), flat.max(axis=0)
    return low, high


def corners(seen: Sequence[Projection], points: Array, ground: Ground | None, room: float) -> Array:
    """Return the lower left and upper right corner of each view (views, 2, 2), m: all points with a margin, relative to
    their size, and the ground in perspective. All views are equally high, so that they have one scale."""
    low, high = bounds(seen, points, ground)
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    half += 2.0 * room * half.max(axis=1, keepdims=True)
    half[:, 1] = half[:, 1].max()
    return np.stack([middle - half, middle + half], axis=1)


def paint_on_ground(axes: Axes, pose: Pose, view: Projection, limits: Array, ground: Ground | None, pen: Pen) -> None:
    """Draw a robot into axes of a view with these corners (2, 2), and the ground if it rests there."""
    axes.set_axis_off()
    axes.set(xlim=limits[:, 0], ylim=limits[:, 1], aspect="equal")
    if ground is not None and math.isfinite(view.distance) and rests_on_base(pose):
        ground.paint(axes, pose, view, 2.0 * pen.link)
    paint(axes, pose, view, pen)
