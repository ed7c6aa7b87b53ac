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
from cinegen.plotting.sheet import BLUE, FAINT, INK, LABEL, ORANGE, VERMILION, finish, graph, label
from raff2urdf.quantities import LENGTH, shown_scale

_WIDE = 7.2  # inches
_BANDS = 20
_SPAN = 8.0  # ratio of values: larger ones are shown on a logarithmic scale
_SAME = 1e-9  # of the region's size
_SIDES = ("before", "after")
_COLOURS = (ORANGE, BLUE)


@dataclass(frozen=True, eq=False)
class RegionField:
    """A quantity at points of a region.

    Attributes:
        heading: its name.
        axes: names of the coordinates.
        targets: (n, axes) m.
        values: (2, n) before and after, in the unit that is shown; NaN where the point is not reached.
        is_maximised: whether larger values are better.
        points: (m, axes) where the optimiser looked, m.
    """

    heading: str
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
    """Draw a quantity before and after: as a curve along a line, as levels over an area; else its sorted values."""
    varying = field.varying
    if is_region and len(varying) in (1, 2):
        return (_line if len(varying) == 1 else _area)(field, varying)
    figure, axes = graph(_WIDE, 2.8)
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
    label(axes, "part of the points that is not better (%)", field.heading, room=2.2)
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
    label(axes, f"{field.axes[k]} ({unit})", field.heading, room=2.2)
    return finish(figure)


def _area(field: RegionField, varying: list[int]) -> Figure:
    targets, (_, unit) = field.targets[:, varying], shown_scale(LENGTH)
    wide, tall = np.ptp(targets, axis=0)
    panel = (_WIDE - 1.6) / 2.0
    figure, both = graph(_WIDE, min(max(panel * tall / wide, 0.9), 5.0) + 0.95, 2)
    known = field.values[np.isfinite(field.values)]
    look, drawn = scaled(field.heading, field.heading, known, _SPAN, far=0.0), None  # one scale for both pictures
    for side, axes in enumerate(both):
        values, worst = field.values[side], field.worst(side)
        drawn = _levels(axes, targets, values, look) or drawn
        _mark(axes, field.points[:, varying], "o", INK, "points of the optimiser")
        text, reached = _SIDES[side], 100.0 * float(np.isfinite(values).mean())
        if worst is not None:
            _mark(axes, targets[[worst]], "X", VERMILION, "worst")
            text += f": at worst {values[worst]:.4g}"
        text += f" ({reached:.0f} % reached)" * (reached < 100.0)
        axes.set_title(text.replace("-", "−"), fontsize=LABEL, color=INK, loc="left")
        axes.set_aspect("equal")
        label(axes, *(f"{field.axes[k]} ({unit})" for k in varying))
    if drawn is not None:
        bar(figure, drawn, both, look, figure.get_figheight())
    return finish(figure)


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
