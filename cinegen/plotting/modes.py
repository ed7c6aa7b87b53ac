"""`draw_modes`: all assembly modes of a mechanism side by side.

As in figure 5 of J.-P. Merlet, "Symbolic computation for the determination of the minimal direct kinematics polynomial
and the singular configurations of parallel manipulators".
"""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.assembly import AssemblyModes
from cinegen.errors import CinegenError
from cinegen.plotting.skeleton import Pose, Skeleton
from cinegen.plotting.stick import BACK, END, FAINT, FRONT, INK, MOTOR, Pen, paint
from cinegen.plotting.units import rounded, value_text
from cinegen.plotting.view import Projection, views

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_SHAPE = 1.35  # width of a figure over its height, about
_ROOM = 0.06  # of what is drawn, around it
_LARGE, _SMALL = 1.9, 1.25  # inches of a panel's longer side: of few modes, and of forty
_TITLE, _GAP, _MARGIN = 0.38, 0.3, 0.35  # inches: above a mode, between two, around all
_HEAD, _FOOT = 0.8, 0.85  # inches
_LETTERS = 19.0  # of 7 points to an inch, about
_NARROW, _NARROWEST = 2.3, 5.0  # inches: least width of a mode with its text; of all


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
        DrawingError: there is no mode, or no matplotlib.
        UnknownNameError: no such node.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise DrawingError("pictures need matplotlib: install it with `pip install matplotlib`") from None
    if not len(modes):
        raise DrawingError(f"{modes.mechanism.name} has no assembly mode there: nothing can be drawn")
    node = modes.mechanism.end if node is None else node
    skeleton = Skeleton(modes.mechanism, node)
    poses = [skeleton.at(q) for q in modes]
    seen = views(np.vstack([pose.points for pose in poses]), skeleton.plane)
    sheet = _Sheet(seen, poses)
    figure = Figure(figsize=(sheet.width, sheet.height), facecolor="white")
    for k, pose in enumerate(poses):
        for v, view in enumerate(seen):
            left, bottom, wide, high = sheet.panel(k, v)
            corner = left / sheet.width, bottom / sheet.height, wide / sheet.width, high / sheet.height
            axes = figure.add_axes(corner, label=f"mode {k + 1} {view.name}".strip())
            axes.set_axis_off()
            across, upright = sheet.shows(k, v)
            axes.set_xlim(*across)
            axes.set_ylim(*upright)
            paint(axes, pose, view, sheet.pen)
    _Texts(figure, sheet).write(modes, node, name or modes.mechanism.name, poses)
    return figure


class _Sheet:
    """The layout of the paper, inches from its lower left corner.

    Modes fill rows; each view has one width in all of them, and a row is as high as its modes need.

    Attributes:
        views: of each mode.
        scale: inches for a metre.
        pen: for the skeletons.
        columns: number of modes in a row.
        width, height: of the paper.
    """

    def __init__(self, seen: tuple[Projection, ...], poses: list[Pose]) -> None:
        self.views, count = seen, len(poses)
        low, high = np.array([_bounds(view, poses) for view in seen]).transpose(1, 0, 2)
        size = high - low
        longest = _LARGE + (_SMALL - _LARGE) * min(1.0, max(0.0, (count - 8) / 32))
        if len(seen) == 1:
            longest *= 1.6
        self.scale = longest / float(size.max())
        self.pen = Pen() if longest > 1.5 else Pen(1.0, 0.7, 2.0)
        self._block = max(float(size[:, 0].sum()) * self.scale, _NARROW)
        wide, tall = self._block + _GAP, float(size[:, 1].max()) * self.scale + _TITLE + _GAP
        self.columns = min(count, max(1, round(math.sqrt(_SHAPE * count * tall / wide))))
        self._across = np.stack([low[:, 0], high[:, 0]], axis=1)
        rows = [poses[k : k + self.columns] for k in range(0, count, self.columns)]
        self._upright = [np.array([_bounds(view, row) for view in seen])[:, :, 1] for row in rows]
        self._rows = [self.scale * float(np.ptp(upright, axis=1).max()) + _TITLE for upright in self._upright]
        self.width = max(self.columns * wide - _GAP, _NARROWEST) + 2.0 * _MARGIN
        self.height = sum(self._rows) + _GAP * (len(rows) - 1) + _HEAD + _FOOT

    def block(self, k: int) -> tuple[float, float, float]:
        """Return left, top and right of a mode."""
        row, column = divmod(k, self.columns)
        left = _MARGIN + column * (self._block + _GAP)
        return left, self.height - _HEAD - sum(self._rows[:row]) - row * _GAP, left + self._block

    def panel(self, k: int, v: int) -> tuple[float, float, float, float]:
        """Return left, bottom, width and height of a view of a mode; the views of a row are centred vertically."""
        left, top, right = self.block(k)
        sizes = self.scale * np.ptp(self._across, axis=1)
        wide, high = float(sizes[v]), self.scale * float(np.ptp(self._upright[k // self.columns][v]))
        spare = right - left - float(sizes.sum())
        middle = top - _TITLE - (self._rows[k // self.columns] - _TITLE) / 2.0
        return left + spare / 2.0 + float(sizes[:v].sum()), middle - high / 2.0, wide, high

    def shows(self, k: int, v: int) -> tuple[Array, Array]:
        """Return the range that a view of a mode shows, m: left and right; lower and upper."""
        return self._across[v], self._upright[k // self.columns][v]


def _bounds(view: Projection, poses: list[Pose]) -> Array:
    """Return the lower left and upper right corner (2, 2) of some poses in a view, with a margin, m."""
    flat = np.vstack([view.project(pose.points)[0] for pose in poses])
    low, high = flat.min(axis=0), flat.max(axis=0)
    room = _ROOM * float((high - low).max())
    return np.array([low - room, high + room])


class _Texts:
    """The texts on the paper."""

    def __init__(self, figure: Figure, sheet: _Sheet) -> None:
        self._figure, self._sheet = figure, sheet

    def write(self, modes: AssemblyModes, node: str, name: str, poses: list[Pose]) -> None:
        """Write all texts."""
        sheet, mechanism, count = self._sheet, modes.mechanism, len(modes)
        right, top = sheet.width - _MARGIN, sheet.height
        self._put(f"{name}: {count} assembly mode{'s' * (count != 1)}", _MARGIN, top - 0.34, INK, 13.0, weight="bold")
        joints = zip(mechanism.actuated, modes.actuated, strict=True)
        values = ", ".join(f"{joint} {value_text(mechanism, joint, value)}" for joint, value in joints)
        self._put(_cut(values, right - _MARGIN), _MARGIN, top - 0.56, FAINT, 8.0)
        for k, note in enumerate(_notes(modes)):
            self._above(k, modes.placements(node)[k].translation, note)
        found = ("All there are: " if modes.complete else "There may be more: ") + modes.method
        if max(modes.coincident) > 1:
            found = "×2: two solutions coincide. " + found
        for line, text in enumerate(textwrap.wrap(found, int((right - _MARGIN) * _LETTERS))[:2]):
            self._put(text, _MARGIN, 0.32 - 0.13 * line, FAINT, 7.0)
        marks = [(MOTOR, "actuated joint", "o"), (END, node, "o")]
        if any(part.normal is not None and not part.is_base for part in poses[0].parts):
            marks += [(FRONT, "side that is up at home", "s"), (BACK, "its other side", "s")]
        x = _MARGIN
        for colour, text, marker in marks:
            self._line([x + 0.05], 0.595, color=colour, marker=marker, markersize=4.5, linestyle="none")
            self._put(text, x + 0.16, 0.56, INK, 7.0)
            x += 0.4 + len(text) / _LETTERS
        length = _round_length(0.8 / sheet.scale)
        self._line([right - length * sheet.scale, right], 0.55, color=INK, linewidth=1.5)
        self._put(f"{1e3 * length:g} mm", right - length * sheet.scale / 2.0, 0.6, INK, 7.0, ha="center")

    def _above(self, k: int, position: Array, note: str) -> None:
        """Write a mode's number, the position of its end and a note above it; above the first row the views' names."""
        sheet = self._sheet
        left, top, right = sheet.block(k)
        digits = 1 if np.abs(position).max() >= 0.1 else 2
        x, y, z = (f"{rounded(1e3 * value, digits):.{digits}f}" for value in position)
        self._put(str(k + 1), left, top - 0.12, INK, 10.0, weight="bold")
        self._put(f"{x}   {y}   {z} mm", left + 0.28, top - 0.12, FAINT, 7.0)
        self._put(note, right, top - 0.12, END, 7.0, ha="right")
        if k < sheet.columns and len(sheet.views) > 1:
            for v, view in enumerate(sheet.views):
                begin, _, wide, _ = sheet.panel(k, v)
                self._put(view.name, begin + wide / 2.0, top - 0.29, FAINT, 6.5, ha="center")

    def _put(self, text: str, x: float, y: float, colour: str, size: float, **options: Any) -> None:
        across, up = x / self._sheet.width, y / self._sheet.height
        self._figure.text(across, up, text, color=colour, fontsize=size, **options)

    def _line(self, x: list[float], y: float, **options: Any) -> None:
        from matplotlib.lines import Line2D

        across, up = [one / self._sheet.width for one in x], [y / self._sheet.height] * len(x)
        self._figure.add_artist(Line2D(across, up, transform=self._figure.transFigure, **options))


def _notes(modes: AssemblyModes) -> list[str]:
    """Return a note on each mode: coinciding solutions, joint limits."""
    notes = []
    for q, count in zip(modes, modes.coincident, strict=True):
        coincident = [f"×{count}"] if count > 1 else []
        notes.append(", ".join(coincident + (["outside limits"] if modes.mechanism.limits.outside(q) else [])))
    return notes


def _cut(text: str, inches: float) -> str:
    """Return as much of a line of 8 points as fits."""
    most = int(inches * _LETTERS * 7.0 / 8.0)
    return text if len(text) <= most else text[: most - 5].rpartition(",")[0] + ", ..."


def _round_length(metres: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is not longer."""
    power = 10.0 ** math.floor(math.log10(metres))
    return next(step * power for step in (5.0, 2.0, 1.0) if step * power <= metres * (1.0 + 1e-9))
