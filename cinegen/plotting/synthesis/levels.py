"""Pictures of a quantity over the region that a robot reaches, before and after a synthesis, in one scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from cinegen.arrays import Array
from cinegen.plotting.plane import bar
from cinegen.plotting.shades import OUT, Shades, scaled
from cinegen.plotting.sheet import BLUE, FAINT, INK, LABEL, ORANGE, VERMILION, finish, graph, label, new_figure
from cinegen.plotting.synthesis.wording import heading_of
from raff2urdf.quantities import LENGTH, shown_scale

_WIDE, _TALL = 7.2, 7.2  # inches: width of pictures, and height of those of volumes
_BANDS = 20
_SPAN = 8.0  # ratio of values: larger ones are shown on a logarithmic scale
_SAME = 1e-9  # of the region's size
_BARS = 16  # points that are drawn as bars; more are drawn as curves
_SIDES = ("before", "after")
_COLOURS = (ORANGE, BLUE)


@dataclass(frozen=True, eq=False)
class RegionField:
    """A quantity at points of a region.

    Attributes:
        quantity: its name.
        axes: names of the coordinates.
        targets: (n, axes) m.
        values: (2, n) before and after, in the unit that is shown; NaN where the point is not reached.
        is_maximised: whether larger values are better.
        points: (m, axes) where the optimiser looked, m.
    """

    quantity: str
    axes: tuple[str, ...]
    targets: Array
    values: Array
    is_maximised: bool
    points: Array

    @property
    def varying(self) -> list[int]:
        """The coordinates that are not the same everywhere."""
        wide = np.ptp(self.targets, axis=0)
        return [int(k) for k in np.flatnonzero(wide > _SAME * wide.max(initial=0.0)) if wide[k] > 0.0]

    def worst(self, side: int) -> int | None:
        """Return the index of the worst value before (0) or after (1); None where none is known."""
        values = self.values[side]
        if not np.isfinite(values).any():
            return None
        return int(np.nanargmin(values) if self.is_maximised else np.nanargmax(values))


def draw_field(field: RegionField, is_region: bool) -> Figure:
    """Draw a quantity before and after: as bars for a few points, as a curve along a line, as levels over an area, and
    as levels in three planes with the sorted values for a volume.

    Args:
        field: the quantity.
        is_region: whether the points are samples of a region; else they are all points of the task.
    """
    varying = field.varying
    if not is_region:
        return _bars(field) if len(field.targets) <= _BARS else _sorted(field)
    if len(varying) <= 1:
        return _line(field, varying) if varying else _bars(field)
    return _area(field) if len(varying) == 2 else _volume(field)


def _bars(field: RegionField) -> Figure:
    figure, axes = graph(_WIDE, 2.6)
    at = np.arange(1, len(field.targets) + 1)
    for side, (name, colour) in enumerate(zip(_SIDES, _COLOURS, strict=True)):
        values = field.values[side]
        axes.bar(at + 0.4 * (side - 0.5), np.nan_to_num(values), 0.38, color=colour, label=name)
        for x in at[np.isnan(values)]:
            axes.annotate("not reached", (x + 0.4 * (side - 0.5), 0.0), rotation=90, fontsize=LABEL, color=INK,
                          ha="center", va="bottom")  # fmt: skip
    axes.set_xticks(at)
    axes.grid(axis="y", color=FAINT, alpha=0.25)
    axes.set_axisbelow(True)
    label(axes, "point", heading_of(field.quantity), room=2.2)
    return finish(figure)


def _line(field: RegionField, varying: list[int]) -> Figure:
    figure, axes = graph(_WIDE, 2.8)
    scale, unit = shown_scale(LENGTH)
    k = varying[0]
    order = np.argsort(field.targets[:, k])
    x = scale * field.targets[order, k]
    for side, (name, colour) in enumerate(zip(_SIDES, _COLOURS, strict=True)):
        axes.plot(x, field.values[side][order], color=colour, label=name)
    at = scale * field.points[:, k]
    axes.plot(at, np.zeros(len(at)), "|", color=INK, transform=axes.get_xaxis_transform(), markersize=8.0,
              label="points of the optimiser", clip_on=False)  # fmt: skip
    axes.grid(color=FAINT, alpha=0.25)
    label(axes, f"{field.axes[k]} ({unit})", heading_of(field.quantity), room=2.2)
    return finish(figure)


def _sorted(field: RegionField) -> Figure:
    figure, axes = graph(_WIDE, 2.8)
    _draw_sorted(axes, field, "points")
    return finish(figure)


def _draw_sorted(axes: Any, field: RegionField, of: str) -> None:
    """Draw the values from the worst to the best over the share of points that are not better."""
    for side, (name, colour) in enumerate(zip(_SIDES, _COLOURS, strict=True)):
        values = field.values[side]
        known = np.sort(values[np.isfinite(values)])[:: 1 if field.is_maximised else -1]
        missing = len(values) - len(known)
        if len(known):
            share = 100.0 * (missing + np.arange(1, len(known) + 1)) / len(values)
            text = f"{name} ({100.0 * missing / len(values):.0f} % not reached)" if missing else name
            axes.step(share, known, where="pre", color=colour, label=text)
    axes.set_xlim(0.0, 100.0)
    axes.grid(color=FAINT, alpha=0.25)
    label(axes, f"part of the {of} that is not better (%)", heading_of(field.quantity), room=2.2)


def _area(field: RegionField) -> Figure:
    first, second = field.varying
    targets = field.targets[:, [first, second]]
    wide, tall = np.ptp(targets, axis=0)
    panel = (_WIDE - 1.6) / 2.0
    figure, both = graph(_WIDE, min(max(panel * tall / wide, 0.9), 5.0) + 0.95, 2)
    look, drawn = _look(field), None
    for side, axes in enumerate(both):
        drawn = _levels(axes, targets, field.values[side], look) or drawn
        _mark(axes, field.points[:, [first, second]], "o", INK, "points of the optimiser")
        worst = field.worst(side)
        if worst is not None:
            _mark(axes, targets[[worst]], "X", VERMILION, "worst")
        _frame(axes, field, side, (first, second), "", worst)
    if drawn is not None:
        bar(figure, drawn, both, look, figure.get_figheight())
    return finish(figure)


def _volume(field: RegionField) -> Figure:
    figure = new_figure(figsize=(_WIDE, _TALL), dpi=150, layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=[2.0, 1.0])
    above, below = parts
    panels = above.subplots(2, 3, squeeze=False)
    look, drawn = _look(field), None
    scale, unit = shown_scale(LENGTH)
    for j, k in enumerate(field.varying[:3]):
        across = [i for i in field.varying[:3] if i != k]
        levels = np.unique(np.round(field.targets[:, k], 12))
        middle = levels[len(levels) // 2]
        inside = np.abs(field.targets[:, k] - middle) < 1e-9
        for side in (0, 1):
            axes = panels[side, j]
            drawn = _levels(axes, field.targets[inside][:, across], field.values[side][inside], look) or drawn
            plane = f"{field.axes[k]} = {scale * middle + 0.0:.4g} {unit}".replace("-", "−")
            _frame(axes, field, side, (across[0], across[1]), plane, None)
    if drawn is not None:
        bar(above, drawn, panels, look, _TALL * 2.0 / 3.0)
    _draw_sorted(below.subplots(), field, "region")
    return finish(figure)


# --- parts of pictures -------------------------------------------------------------------------------------------


def _look(field: RegionField) -> Shades:
    """Return one scale for both pictures."""
    return scaled(field.quantity, heading_of(field.quantity), field.values[np.isfinite(field.values)], _SPAN, far=0.0)


def _levels(axes: Any, targets: Array, values: Array, look: Shades) -> Any:
    """Fill the area between points (n, 2) with the colours of levels, and return these; what is not reached is grey."""
    scale, _ = shown_scale(LENGTH)
    axes.set_facecolor(OUT)
    if len(targets) < 3 or np.linalg.matrix_rank(targets - targets[0], tol=1e-12) < 2:
        return None
    triangles = Triangulation(*(scale * targets).T)
    unknown = ~np.isfinite(values)
    triangles.set_mask(unknown[triangles.triangles].any(axis=1))
    if triangles.mask is None or triangles.mask.all():
        return None
    norm: Any = look.norm
    if look.logarithmic:
        levels = np.geomspace(norm.vmin, norm.vmax, _BANDS + 1)
    else:
        levels = np.asarray(MaxNLocator(_BANDS, steps=[1, 2, 2.5, 5, 10]).tick_values(norm.vmin, norm.vmax))
    filled, style = np.where(unknown, norm.vmin, values), {"levels": levels, "norm": norm}
    drawn = axes.tricontourf(triangles, filled, cmap=look.colours, extend=look.extend, **style)
    axes.tricontour(triangles, filled, colors="white", linewidths=0.4, alpha=0.6, **style)
    return drawn


def _mark(axes: Any, at: Array, marker: str, colour: str, text: str) -> None:
    scale, _ = shown_scale(LENGTH)
    size = 4.5 if marker == "o" else 8.0
    axes.plot(*(scale * at).T, marker, color=colour, markeredgecolor="white", markeredgewidth=0.7, markersize=size,
              label=text, clip_on=False, zorder=5.0)  # fmt: skip


def _frame(axes: Any, field: RegionField, side: int, across: tuple[int, int], plane: str, worst: int | None) -> None:
    _, unit = shown_scale(LENGTH)
    reached = float(np.isfinite(field.values[side]).mean())
    text = _SIDES[side] + (f", {plane}" if plane else "")
    if worst is not None:
        text += f": at worst {field.values[side][worst]:.4g}"
    if reached < 1.0 and not plane:
        text += f" ({100.0 * reached:.0f} % reached)"
    axes.set_title(text.replace("-", "−"), fontsize=LABEL, color=INK, loc="left")
    axes.set_aspect("equal")
    label(axes, f"{field.axes[across[0]]} ({unit})", f"{field.axes[across[1]]} ({unit})")
