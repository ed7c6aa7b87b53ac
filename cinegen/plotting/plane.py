"""A map as a picture: of one axis (`Line`) bands and a curve; of two (`Plane`) colours, level lines and the robot."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patheffects import Normal, Stroke
from matplotlib.transforms import Bbox

from cinegen.arrays import Array, Bools
from cinegen.plotting.shades import Shades
from cinegen.plotting.sheet import INK, LABEL, UNDER, label, wrapped
from cinegen.plotting.skeleton import Skeleton
from cinegen.plotting.stick import Pen, paint
from cinegen.plotting.view import Projection, parallel
from cinegen.user_units import user_scale
from cinegen.workspace.region import Region
from cinegen.workspace.specification import MapSpecification

ROBOT = "robot"
"""Group of the artists of the robot."""

_TALLEST, _FLATTEST = 1.1, 0.35  # height of a picture's axes over their width
_OBLONG = 0.8  # likewise, where they have different units, or one range is a sliver of the other
_SLIVER = 8.0  # times
_RIGHT, _BELOW = 1.7, 0.95  # inches, for the colour bar, and below a picture
_NARROWEST = 3.2  # inches, that texts in a colour bar need
_OVER = 4.0  # drawing order of the robot
_OPACITY = 0.2  # of a plate
_CASING = 1.5  # points: white around lines
_JUMP = 0.15  # of the range, from cell to cell: level lines end there
_STEEP = 2.5  # times the steps next to it
_ROUGH = 0.25  # of all cells: where there are more jumps there are no lines at all
_COARSE = 16  # cells along an axis: of fewer there are no lines either
_LIGHT = 0.62  # brightness on which ink is more legible than white
_LETTERS = 6.5  # points, of levels
_SIDES = ("x", "y", "z")
_ALMOST = 1e-9


class Line:
    """The axis of a specification as the horizontal axis of a picture, m or degrees.

    Args:
        spec: over one axis.
    """

    def __init__(self, spec: MapSpecification) -> None:
        (self._axis,) = spec.region.axes
        self._scale, self._unit = user_scale(spec.mechanism, self._axis.name)

    def fill(self, axes: Axes, cells: Bools, colour: str, text: str, alpha: float = 1.0) -> None:
        """Fill the bands of cells (n,) with a colour that the legend explains by a text."""
        for first, last in _runs(cells):
            ends = self._axis.borders[[first, last]] * self._scale
            axes.axvspan(*ends, color=colour, alpha=alpha, linewidth=0.0, label=text)

    def curve(self, axes: Axes, values: Array, **style: Any) -> None:
        """Draw values (n,) as a line, and isolated values as dots."""
        u = self._axis.middles() * self._scale
        axes.plot(u, values, linewidth=1.6, **style)
        alone = [first for first, last in _runs(np.isfinite(values)) if last == first + 1]
        if alone:
            axes.plot(u[alone], values[alone], marker=".", linestyle="none", color=style["color"])

    def dress(self, axes: Axes, text: str, room: float) -> None:
        """Set the labels and the limits of axes; `text` is the vertical label, wrapped to `room` inches."""
        label(axes, f"{self._axis.name} ({self._unit})", text, room=room)
        axes.set_xlim(self._axis.low * self._scale, self._axis.high * self._scale)
        axes.spines[["top", "right"]].set_visible(False)


class Plane:
    """The two axes of a specification as those of a picture; angles in degrees.

    Args:
        spec: over two axes.

    Attributes:
        scales: factors from SI values, along each axis.
        units: m or °.
        alike: whether equal lengths are drawn equally long.
        round: whether it is all, or nearly all, of a sphere seen from its centre, which is drawn in Hammer's equal-area
            projection (E. Hammer, 1892), with the middle of the azimuths in its middle.
        projection: name of matplotlib's projection.
        aspect: height over width.
    """

    def __init__(self, spec: MapSpecification) -> None:
        self.spec, self.region = spec, spec.region
        self.scales, self.units = zip(*(user_scale(spec.mechanism, name) for name in spec.region.names), strict=True)
        ranges = [axis.high - axis.low for axis in spec.region.axes]
        self.round = _is_round(spec.region)
        self.projection = "hammer" if self.round else "rectilinear"
        aspect = ranges[1] * self.scales[1] / (ranges[0] * self.scales[0])
        self.alike = self.units[0] == self.units[1] and 1.0 / _SLIVER < aspect < _SLIVER
        self.aspect = aspect if self.alike else _OBLONG
        self._middle = np.zeros(2)
        if self.round:  # matplotlib's projections of spheres take rad, azimuths from -pi to pi, and write degrees
            self.scales = (1.0, 1.0)
            self._middle[0] = 0.5 * (spec.region.axes[0].low + spec.region.axes[0].high)

    def paper(self, width: float) -> tuple[float, float]:
        """Return width and height, inches, of a picture with room for a colour bar and a legend."""
        wide = width - _RIGHT
        fits = min(1.0, _TALLEST / self.aspect)
        return max(fits * wide + _RIGHT, _NARROWEST), max(fits * self.aspect, _FLATTEST) * wide + _BELOW

    def sharing(self, axes: Axes) -> dict[str, Axes]:
        """Return the arguments for other axes that share the limits; those of a sphere are fixed."""
        return {} if self.round else {"sharex": axes, "sharey": axes}

    def dress(self, axes: Any, quiet: bool = False) -> None:
        """Set the labels, units and limits of axes.

        Args:
            axes: with the projection.
            quiet: whether numbers are small, for one of many.
        """
        names = (f"{name} ({unit})" for name, unit in zip(self.region.names, self.units, strict=True))
        label(axes, *names, size="small" if quiet else "medium")
        axes.set_facecolor("white")
        if quiet or self.round:
            axes.tick_params(labelsize="x-small")
        if self.round:
            axes.grid(color=INK, linewidth=0.3, alpha=0.35)
            axes.set_latitude_grid(30.0)
            _meridians(axes, math.degrees(self._middle[0]), 120 if quiet else 60)
            return
        u, v = self._borders
        axes.set_xlim(u[0], u[-1])
        axes.set_ylim(v[0], v[-1])
        if self.alike:
            axes.set_aspect("equal")
        for axis, unit in zip((axes.xaxis, axes.yaxis), self.units, strict=True):
            if unit == "°":
                axis.get_major_locator().set_params(steps=[1, 1.5, 3, 4.5, 6, 9, 10])
        axes.spines[:].set(linewidth=0.6, color=INK)

    # --- colours -------------------------------------------------------------------------------------------------

    def fill(self, axes: Axes, cells: Bools, colour: str, text: str = "") -> None:
        """Fill cells (m, n) with one colour, which the legend explains by a text, if there is one."""
        if not cells.any():
            return
        shown = np.where(cells, 1.0, np.nan)
        axes.pcolormesh(*self._borders, shown.T, cmap=ListedColormap([colour]), rasterized=True, zorder=0.5)
        if text:
            axes.plot([], [], marker="s", markersize=7, linestyle="none", color=colour, label=text)

    def shade(self, axes: Axes, values: Array, shades: Shades) -> QuadMesh:
        """Colour cells by values (m, n)."""
        return axes.pcolormesh(
            *self._borders, np.ma.masked_invalid(values).T, cmap=shades.colours, norm=shades.norm, rasterized=True,
            zorder=1.0,
        )  # fmt: skip

    def levels(self, axes: Axes, values: Array, shades: Shades) -> None:
        """Draw lines of equal values (m, n), with the value in them.

        They end where the values jump from cell to cell, as those of an arm with redundant joints, which reaches
        neighbours differently; and there are none where many do.
        """
        if not len(shades.levels) or min(values.shape) < _COARSE:
            return
        shown = np.ma.filled(shades.norm(np.ma.masked_invalid(values)), np.nan)
        jumps = _jumps(shown)
        if jumps.sum() > _ROUGH * np.isfinite(shown).sum():
            return
        u, v = self._drawn([axis.middles() for axis in self.region.axes])
        inks = [_contrasting(shades, level) for level in shades.levels]
        lines = axes.contour(
            u, v, np.ma.masked_invalid(np.where(jumps, np.nan, values)).T, levels=shades.levels, colors=inks,
            linewidths=0.7, linestyles="solid", zorder=1.5,
        )  # fmt: skip
        if not self.round:
            axes.clabel(lines, fontsize=_LETTERS, fmt=shades.number, inline_spacing=3)

    def points(self, points: Array) -> Array:
        """Return points (n, 2), m and rad, in the picture."""
        return np.column_stack(self._drawn(points.T))

    @property
    def _borders(self) -> tuple[Array, Array]:
        return self._drawn([axis.borders for axis in self.region.axes])

    def _drawn(self, values: Iterable[Array]) -> tuple[Array, Array]:
        """Return values along both axes in the picture."""
        u, v = (value * scale - middle for value, scale, middle in zip(values, self.scales, self._middle, strict=True))
        return u, v

    # --- robot ---------------------------------------------------------------------------------------------------

    def robot(self, axes: Axes) -> None:
        """Draw the robot at home, where the axes are two of x, y and z and show any of it."""
        spec = self.spec
        if spec.over_joints or not all(name in _SIDES for name in self.region.names):
            return
        view = parallel("", *np.eye(3)[[_SIDES.index(name) for name in self.region.names]])
        view = Projection("", view.axes * self.scales[0], view.centre)
        before = set(axes.get_children())
        paint(axes, Skeleton(spec.mechanism, spec.node).at(spec.mechanism.q_home), view, Pen(1.5, 0.8, 3.2))
        painted: list[Any] = [artist for artist in axes.get_children() if artist not in before]
        u, v = self._borders
        box, paths = Bbox.from_extents(u[0], v[0], u[-1], v[-1]), [artist.get_path() for artist in painted]
        if not any(box.count_contains(path.vertices) or path.intersects_bbox(box, filled=True) for path in paths):
            for artist in painted:
                artist.remove()
            return
        for artist in painted:
            artist.set(gid=ROBOT, zorder=_OVER + artist.get_zorder())
            if isinstance(artist, Line2D):
                wide = artist.get_linewidth() + _CASING
                artist.set_path_effects([Stroke(linewidth=wide, foreground="white"), Normal()])
            else:  # a plate, through which the map is visible
                artist.set_alpha(_OPACITY)
        axes.plot([], [], color=INK, marker="o", markerfacecolor="white", markersize=4, label="robot at home")


def bar(figure: Any, mesh: Any, axes: Any, look: Shades, tall: float) -> None:
    """Draw a colour bar whose label is wrapped to the height of axes, of `tall` inches with theirs; none for a single
    colour."""
    if look.name == "reachable":
        return
    shown = figure.colorbar(mesh, ax=axes, shrink=0.82, aspect=28, pad=0.02, extend=look.extend)
    shown.ax.set_yticks(look.ticks, look.labels or [look.number(tick) for tick in look.ticks])
    shown.ax.minorticks_off()
    shown.ax.tick_params(labelsize="small", color=INK)
    shown.set_label(wrapped(look.text, tall - UNDER, LABEL), color=INK, fontsize=LABEL)
    shown.outline.set_linewidth(0.5)


def _runs(cells: Bools) -> list[tuple[int, int]]:
    """Return the runs of successive cells (n,) as (first, end)."""
    changes = np.flatnonzero(np.diff(np.r_[False, cells, False].astype(int)))
    return [(int(first), int(last)) for first, last in changes.reshape(-1, 2)]


def _is_round(region: Region) -> bool:
    """Return whether a region is more than half of a sphere either way, and no part of it twice."""
    if region.names != ("azimuth", "elevation"):
        return False
    azimuth, elevation = region.axes
    around, upwards = azimuth.high - azimuth.low, elevation.high - elevation.low
    once = around < 2.0 * math.pi + _ALMOST and max(-elevation.low, elevation.high) < 0.5 * math.pi + _ALMOST
    return once and around > math.pi and upwards > 0.5 * math.pi


def _jumps(shown: Array) -> Bools:
    """Return (m, n) the cells with a neighbour of quite another value, all from 0 to 1: further away than in a steep
    part, where the next steps are steep too."""
    jumps = np.zeros(shown.shape, dtype=bool)
    for axis in (0, 1):
        steps = np.nan_to_num(np.moveaxis(np.abs(np.diff(shown, axis=axis)), axis, 0))
        around = np.pad(steps, ((1, 1), (0, 0)))
        far = (steps > _JUMP) & (steps > _STEEP * np.maximum(around[:-2], around[2:]))
        along = np.moveaxis(jumps, axis, 0)
        along[1:] |= far
        along[:-1] |= far
    return jumps


def _contrasting(shades: Shades, level: float) -> str:
    """Return white for a dark colour, and ink for a light one."""
    red, green, blue, _ = shades.colours(float(shades.norm(level)))
    return "white" if 0.299 * red + 0.587 * green + 0.114 * blue < _LIGHT else INK


def _meridians(axes: Any, middle: float, step: int) -> None:
    """Draw the meridians of a sphere at multiples of `step` degrees; that of `middle` is in the middle."""
    first, last = math.floor((middle - 180.0) / step + _ALMOST) + 1, math.ceil((middle + 180.0) / step - _ALMOST)
    shown = np.arange(step * first, step * last, step)
    axes.set_xticks(np.radians(shown - middle), [f"{degrees}°".replace("-", "−") for degrees in shown])
