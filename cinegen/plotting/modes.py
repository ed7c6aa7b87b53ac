"""`draw_modes`: all assembly modes of a mechanism side by side.

As in figure 5 of J.-P. Merlet, "Symbolic computation for the determination of the minimal direct kinematics polynomial
and the singular configurations of parallel manipulators".
"""

from __future__ import annotations

import math
import textwrap
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from cinegen.assembly import AssemblyModes
from cinegen.errors import CinegenError
from cinegen.model.motion_plane import motion_plane
from cinegen.plotting.ground import corners, ground_of, paint_on_ground
from cinegen.plotting.sheet import FAINT, INK, explain, new_figure
from cinegen.plotting.skeleton import Skeleton
from cinegen.plotting.stick import ACTUATED, BACK, END, FRONT, Pen
from cinegen.plotting.view import views
from cinegen.user_units import length_digits, rounded, value_text
from raff2urdf.errors import counted
from raff2urdf.quantities import LENGTH, shown_scale

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
    mechanism, count = modes.mechanism, len(modes)
    if not count:
        raise DrawingError(f"{mechanism.name} has no assembly mode there: nothing can be drawn")
    node = mechanism.end if node is None else node
    skeleton = Skeleton(mechanism, node)
    poses = [skeleton.at(q) for q in modes]
    seen = views(np.vstack([pose.points for pose in poses]), motion_plane(mechanism))
    ground = ground_of(poses) if len(seen) > 1 else None  # a planar mechanism is seen from above
    limits = corners(seen, np.vstack([pose.points for pose in poses]), ground, _ROOM)
    longest = float(np.interp(count, (8, 40), (_LARGE, _SMALL))) * (1.6 if len(seen) == 1 else 1.0)
    scale = longest / float(np.ptp(limits, axis=1).max())  # inches for a metre
    sizes = scale * np.ptp(limits, axis=1)
    wide, tall = max(float(sizes[:, 0].sum()), _NARROW), float(sizes[:, 1].max())
    columns = min(count, max(1, round(math.sqrt(_SHAPE * count * (tall + _TITLE + _GAP) / (wide + _GAP)))))
    rows, across = -(-count // columns), columns * (wide + _GAP) - _GAP
    width = max(across, _NARROWEST) + 2.0 * _MARGIN
    height = rows * (tall + _TITLE + _GAP) - _GAP + _HEAD + _FOOT
    figure = new_figure(figsize=(width, height), facecolor="white")
    grid = figure.add_gridspec(
        rows, columns, left=_MARGIN / width, right=(_MARGIN + across) / width, bottom=_FOOT / height,
        top=1.0 - (_HEAD + _TITLE) / height, wspace=_GAP / wide, hspace=(_TITLE + _GAP) / tall,
    )  # fmt: skip
    pen = Pen() if longest > 1.5 else Pen(1.0, 0.7, 2.0)
    for k, pose in enumerate(poses):
        panels = grid[k].subgridspec(1, len(seen), width_ratios=sizes[:, 0], wspace=0.0)
        for j, view in enumerate(seen):
            axes = figure.add_subplot(panels[j], label=f"mode {k + 1} {view.name}".strip())
            paint_on_ground(axes, pose, view, limits[j], ground, pen)
            if k < columns and len(seen) > 1:
                axes.set_title(view.name, color=FAINT, fontsize=6.5)
    _write(figure, [grid[k].get_position(figure) for k in range(count)], modes, node, name or mechanism.name)
    marks = [(ACTUATED, "actuated joint", "o"), (END, node, "o")]
    if any(part.normal is not None and not part.is_base for part in poses[0].parts):
        marks += [(FRONT, "side that is up at home", "s"), (BACK, "its other side", "s")]
    explain(figure, marks, scale, _MARGIN, 0.5, 7.0)
    return figure


def _write(figure: Figure, blocks: list[Bbox], modes: AssemblyModes, node: str, name: str) -> None:
    """Write the titles; above each mode its number, the position of the node and a note; how the modes were found."""
    put = partial(figure.text, transform=figure.dpi_scale_trans)  # inches
    length, unit = shown_scale(LENGTH)
    (width, height), mechanism, count = figure.get_size_inches(), modes.mechanism, len(modes)
    wide = width - 2.0 * _MARGIN
    title = f"{name}: {counted(count, 'assembly mode')}"
    put(_MARGIN, height - 0.34, title, color=INK, fontsize=13, weight="bold")
    joints = zip(mechanism.actuated, modes.actuated, strict=True)
    values = ", ".join(f"{joint} {value_text(mechanism, joint, value)}" for joint, value in joints)
    values = textwrap.shorten(values, int(wide * _LETTERS * 7.0 / 8.0), placeholder=" ...")
    put(_MARGIN, height - 0.56, values, color=FAINT, fontsize=8)
    written = zip(blocks, modes, modes.placements(node), modes.coincident, strict=True)
    for k, (block, q, placement, times) in enumerate(written):
        left, above, right = block.x0 * width, block.y1 * height + 0.26, block.x1 * width
        digits = length_digits() - (2 if np.abs(placement.translation).max() >= 0.1 else 1)
        position = "   ".join(f"{rounded(length * value, digits):.{digits}f}" for value in placement.translation)
        notes = [f"×{times}"] * (times > 1) + ["outside limits"] * bool(mechanism.limits.outside(q))
        put(left, above, str(k + 1), color=INK, fontsize=10, weight="bold")
        put(left + 0.28, above, f"{position} {unit}", color=FAINT, fontsize=7)
        put(right, above, ", ".join(notes), color=END, fontsize=7, ha="right")
    claim = "All there are" + ", with probability one" * modes.almost_surely if modes.complete else "There may be more"
    sentence = f"{claim}: {modes.method}"
    if max(modes.coincident) > 1:
        sentence = "×2: two solutions coincide. " + sentence
    put(_MARGIN, 0.42, "\n".join(textwrap.wrap(sentence, int(wide * _LETTERS))[:2]), color=FAINT, fontsize=7, va="top")
