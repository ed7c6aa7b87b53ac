"""`draw_modes`: all assembly modes of a mechanism side by side.

As in figure 5 of J.-P. Merlet, "Symbolic computation for the determination of the minimal direct kinematics polynomial
and the singular configurations of parallel manipulators".
"""

from __future__ import annotations

import math
import textwrap
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cinegen.assembly import AssemblyModes
from cinegen.errors import CinegenError
from cinegen.model.motion_plane import motion_plane
from cinegen.plotting.sheet import FAINT, INK
from cinegen.plotting.skeleton import Pose, Skeleton
from cinegen.plotting.stick import ACTUATED, BACK, END, FRONT, Pen, paint
from cinegen.plotting.units import rounded, value_text
from cinegen.plotting.view import Projection, views

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_SHAPE = 1.35  # width of a figure over its height, about
_ROOM = 0.06  # around the drawing, relative to its size
_LARGE, _SMALL = 1.9, 1.25  # inches: longer side of a panel of few modes, and of forty
_TITLE, _GAP, _MARGIN = 0.38, 0.3, 0.35  # inches: above a mode, between two, around all
_HEAD, _FOOT = 0.8, 0.85  # inches
_LETTERS = 19.0  # of 7 points to an inch, about
_NARROW, _NARROWEST = 2.3, 5.0  # inches: minimum width of a mode with its text; of all


class DrawingError(CinegenError):
    """A picture that can't be drawn; the message names the reason."""


def draw_modes(modes: AssemblyModes, node: str | None = None, name: str | None = None) -> Figure:
    """Draw all modes side by side, each in perspective, from the top and from the side; in one view if all parts move
    in a plane. All have the same scale. The colour of a plate shows whether the side that is up at home is visible.

    Args:
        modes: at least one.
        node: whose position is written, and marked; the mechanism's end by default.
        name: of the robot in the title; its own by default.

    Returns:
        a matplotlib figure with one axes for each mode and view, mode by mode: `figure.savefig("modes.png")`.

    Raises:
        DrawingError: there is no mode.
        UnknownNameError: no such node.
    """
    from matplotlib.figure import Figure

    mechanism = modes.mechanism
    if not len(modes):
        raise DrawingError(f"{mechanism.name} has no assembly mode there: nothing can be drawn")
    node = mechanism.end if node is None else node
    skeleton = Skeleton(mechanism, node)
    poses = [skeleton.at(q) for q in modes]
    sheet = _Sheet(views(np.vstack([pose.points for pose in poses]), motion_plane(mechanism)), poses)
    figure = Figure(figsize=(sheet.width, sheet.height), facecolor="white")
    for k, pose in enumerate(poses):
        for view, box, (low, high) in zip(sheet.views, sheet.panels(k), sheet.limits, strict=True):
            corner, size = box / (sheet.width, sheet.height)
            axes = figure.add_axes((*corner, *size), label=f"mode {k + 1} {view.name}".strip())
            axes.set_axis_off()
            axes.set_xlim(low[0], high[0])
            axes.set_ylim(low[1], high[1])
            paint(axes, pose, view, sheet.pen)
    _write(figure, sheet, modes, node, name or mechanism.name)
    _explain(figure, sheet, node, poses[0])
    return figure


class _Sheet:
    """The layout of the paper, inches from its lower left corner. Modes fill rows.

    Attributes:
        views: of each mode.
        limits: (views, 2, 2) lower left and upper right corner of each view, m.
        scale: inches for a metre.
        pen: for the skeletons.
        columns: number of modes in a row.
        width, height: of the paper.
    """

    def __init__(self, seen: tuple[Projection, ...], poses: list[Pose]) -> None:
        self.views, count = seen, len(poses)
        self.limits = np.array([_bounds(view, poses) for view in seen])
        size = np.ptp(self.limits, axis=1)
        longest = _LARGE + (_SMALL - _LARGE) * min(1.0, max(0.0, (count - 8) / 32))
        if len(seen) == 1:
            longest *= 1.6
        self.scale = longest / float(size.max())
        self.pen = Pen() if longest > 1.5 else Pen(1.0, 0.7, 2.0)
        self._sizes = self.scale * size
        self._block = max(float(self._sizes[:, 0].sum()), _NARROW)
        self._tall = float(self._sizes[:, 1].max()) + _TITLE + _GAP
        wide = self._block + _GAP
        self.columns = min(count, max(1, round(math.sqrt(_SHAPE * count * self._tall / wide))))
        self.width = max(self.columns * wide - _GAP, _NARROWEST) + 2.0 * _MARGIN
        self.height = -(-count // self.columns) * self._tall - _GAP + _HEAD + _FOOT

    def block(self, k: int) -> tuple[float, float, float]:
        """Return left, top and right of a mode."""
        row, column = divmod(k, self.columns)
        left = _MARGIN + column * (self._block + _GAP)
        return left, self.height - _HEAD - row * self._tall, left + self._block

    def panels(self, k: int) -> Array:
        """Return (views, 2, 2) lower left corner and size of the views of a mode, which are centred vertically."""
        left, top, right = self.block(k)
        spare = right - left - float(self._sizes[:, 0].sum())
        x = left + spare / 2.0 + np.cumsum(self._sizes[:, 0]) - self._sizes[:, 0]
        y = top - (self._tall - _GAP + _TITLE) / 2.0 - self._sizes[:, 1] / 2.0
        return np.stack([np.column_stack([x, y]), self._sizes], axis=1)


def _bounds(view: Projection, poses: list[Pose]) -> Array:
    """Return the lower left and upper right corner (2, 2) of all poses in a view, with a margin, m."""
    flat = np.vstack([view.project(pose.points)[0] for pose in poses])
    low, high = flat.min(axis=0), flat.max(axis=0)
    room = _ROOM * float((high - low).max())
    return np.array([low - room, high + room])


def _write(figure: Figure, sheet: _Sheet, modes: AssemblyModes, node: str, name: str) -> None:
    """Write the titles; above each mode its number, the position of the node and a note; how the modes were found."""
    put = partial(figure.text, transform=figure.dpi_scale_trans)  # inches
    mechanism, count, wide = modes.mechanism, len(modes), sheet.width - 2.0 * _MARGIN
    title = f"{name}: {count} assembly mode{'s' * (count != 1)}"
    put(_MARGIN, sheet.height - 0.34, title, color=INK, fontsize=13, weight="bold")
    joints = zip(mechanism.actuated, modes.actuated, strict=True)
    values = ", ".join(f"{joint} {value_text(mechanism, joint, value)}" for joint, value in joints)
    values = textwrap.shorten(values, int(wide * _LETTERS * 7.0 / 8.0), placeholder=" ...")
    put(_MARGIN, sheet.height - 0.56, values, color=FAINT, fontsize=8)
    for k, (q, placement, times) in enumerate(zip(modes, modes.placements(node), modes.coincident, strict=True)):
        left, top, right = sheet.block(k)
        digits = 1 if np.abs(placement.translation).max() >= 0.1 else 2
        position = "   ".join(f"{rounded(1e3 * value, digits):.{digits}f}" for value in placement.translation)
        notes = [f"×{times}"] * (times > 1) + ["outside limits"] * bool(mechanism.limits.outside(q))
        put(left, top - 0.12, str(k + 1), color=INK, fontsize=10, weight="bold")
        put(left + 0.28, top - 0.12, f"{position} mm", color=FAINT, fontsize=7)
        put(right, top - 0.12, ", ".join(notes), color=END, fontsize=7, ha="right")
        if k < sheet.columns and len(sheet.views) > 1:
            for view, ((x, _), (size, _)) in zip(sheet.views, sheet.panels(k), strict=True):
                put(x + size / 2.0, top - 0.29, view.name, color=FAINT, fontsize=6.5, ha="center")
    found = ("All there are: " if modes.complete else "There may be more: ") + modes.method
    if max(modes.coincident) > 1:
        found = "×2: two solutions coincide. " + found
    for line, text in enumerate(textwrap.wrap(found, int(wide * _LETTERS))[:2]):
        put(_MARGIN, 0.32 - 0.13 * line, text, color=FAINT, fontsize=7)


def _explain(figure: Figure, sheet: _Sheet, node: str, pose: Pose) -> None:
    """Add the legend and the scale."""
    from matplotlib.lines import Line2D

    inches = figure.dpi_scale_trans
    marks = [(ACTUATED, "actuated joint", "o"), (END, node, "o")]
    if any(part.normal is not None and not part.is_base for part in pose.parts):
        marks += [(FRONT, "side that is up at home", "s"), (BACK, "its other side", "s")]
    x = _MARGIN
    for colour, text, marker in marks:
        dot = Line2D(
            [x + 0.05], [0.595], color=colour, marker=marker, markersize=4.5, linestyle="none", transform=inches
        )
        figure.add_artist(dot)
        figure.text(x + 0.16, 0.56, text, color=INK, fontsize=7, transform=inches)
        x += 0.4 + len(text) / _LETTERS
    right, length = sheet.width - _MARGIN, _round_length(0.8 / sheet.scale)
    wide = length * sheet.scale
    figure.add_artist(Line2D([right - wide, right], [0.55, 0.55], color=INK, linewidth=1.5, transform=inches))
    figure.text(right - wide / 2, 0.6, f"{1e3 * length:g} mm", color=INK, fontsize=7, ha="center", transform=inches)


def _round_length(metres: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is not longer."""
    power = 10.0 ** math.floor(math.log10(metres))
    return next(step * power for step in (5.0, 2.0, 1.0) if step * power <= metres * (1.0 + 1e-9))
