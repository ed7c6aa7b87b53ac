"""`Plane`: a map of two axes as a picture: colours, level lines, singular curves, the robot at home."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.plotting.loci import TYPE_1, TYPE_2
from cinegen.plotting.shades import Shades
from cinegen.plotting.skeleton import Skeleton
from cinegen.plotting.stick import INK, Pen, paint
from cinegen.plotting.units import user_scale
from cinegen.plotting.view import Projection
from cinegen.singularities.contour import SingularCurve
from cinegen.singularities.singularity import SingularityType
from cinegen.workspace.region import Region
from cinegen.workspace.specification import MapSpecification

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.path import Path

Array = NDArray[np.float64]

ROBOT = "robot"
"""Group of what is drawn of it."""

_TALLEST, _FLATTEST = 1.1, 0.35  # height of a picture's axes over their width
_OBLONG = 0.8  # likewise, where they have different units, or one range is a sliver of the other
_SLIVER = 8.0  # times
_BESIDE, _BELOW = 1.7, 0.95  # inches, for what is beside a picture, and below it
_NARROWEST = 3.2  # inches, that words in a colour bar need
_OVER = 4.0  # where it is drawn, over all else
_GLASS = 0.2  # how much a plate covers
_CASING = 1.5  # points: white around lines
_LIMIT = "#4b525a"  # of a border that is not singular
_JUMP = 0.15  # of the range, from cell to cell: level lines don't go on there
_STEEP = 2.5  # times the steps beside it
_ROUGH = 0.25  # of all cells: where there are more jumps there are no lines at all
_COARSE = 16  # cells along an axis: of fewer there are no lines either
_LIGHT = 0.62  # brightness that ink is better seen on
_LETTERS = 6.5  # points, of levels
_SIDES = ("x", "y", "z")
_ALMOST = 1e-9


class Plane:
    """A specification's two axes as a picture's; m and rad become mm and degrees.

    Args:
        specification: over two axes.

    Attributes:
        scales: what SI values are multiplied by, along each axis.
        units: mm or °.
        alike: whether what is as long is drawn as long.
        round: whether it is all, or nearly all, of a sphere seen from its centre: that is drawn as Hammer's map, whose
            areas are true (E. Hammer, 1892), with the middle of the azimuths in its middle.
    """

    def __init__(self, spec: MapSpecification) -> None:
        self.spec, self.region = spec, spec.region
        self.scales, self.units = zip(*(user_scale(spec.mechanism, name) for name in spec.region.names), strict=True)
        ranges = [axis.high - axis.low for axis in spec.region.axes]
        self.round = _is_round(spec.region)
        aspect = ranges[1] * self.scales[1] / (ranges[0] * self.scales[0])
        self.alike = self.units[0] == self.units[1] and 1.0 / _SLIVER < aspect < _SLIVER
        self._aspect = aspect if self.alike else _OBLONG
        self._middle = np.zeros(2)
        if self.round:  # matplotlib's maps of spheres want rad, azimuths from -pi to pi, and write degrees
            self.scales = (1.0, 1.0)
            self._middle[0] = 0.5 * (spec.region.axes[0].low + spec.region.axes[0].high)

    @property
    def projection(self) -> str:
        """Of matplotlib."""
        return "hammer" if self.round else "rectilinear"

    def tall(self, wide: float) -> float:
        """Height of axes that are so wide, in the same unit."""
        return wide * self._aspect

    def paper(self, width: float) -> tuple[float, float]:
        """Width and height, inches, of a picture with room for a colour bar and a legend."""
        wide = width - _BESIDE
        tall = self.tall(wide)
        fits = min(1.0, _TALLEST * wide / tall)
        return max(fits * wide + _BESIDE, _NARROWEST), max(fits * tall, _FLATTEST * wide) + _BELOW

    def sharing(self, axes: Axes) -> dict[str, Axes]:
        """What makes other axes of the same region go with these; those of a sphere have limits that are fixed."""
        return {} if self.round else {"sharex": axes, "sharey": axes}

    def dress(self, axes: Axes, quiet: bool = False) -> None:
        """Names, units and limits of axes.

        Args:
            axes: with the projection.
            quiet: whether numbers are small, for one of many.
        """
        names = [f"{name} ({unit})" for name, unit in zip(self.region.names, self.units, strict=True)]
        axes.set_xlabel(names[0], fontsize="small" if quiet else None)
        axes.set_ylabel(names[1], fontsize="small" if quiet else None)
        axes.set_facecolor("white")
        axes.tick_params(labelsize="x-small" if quiet else "small", color=INK)
        if self.round:
            axes.grid(color=INK, linewidth=0.3, alpha=0.35)
            axes.set_latitude_grid(30.0)  # type: ignore[attr-defined]
            _meridians(axes, math.degrees(self._middle[0]), 120 if quiet else 60)
            axes.tick_params(labelsize="x-small")
            return
        u, v = self._borders
        axes.set_xlim(u[0], u[-1])
        axes.set_ylim(v[0], v[-1])
        if self.alike:
            axes.set_aspect("equal")
        for axis, name in ((axes.xaxis, self.units[0]), (axes.yaxis, self.units[1])):
            if name == "°":
                _in_degrees(axis)
        for spine in axes.spines.values():
            spine.set_linewidth(0.6)
            spine.set_color(INK)

    # --- colours -------------------------------------------------------------------------------------------------

    def fill(self, axes: Axes, cells: NDArray[np.bool_], colour: str, label: str = "") -> None:
        """Gives cells (m, n) one colour, which is explained below the picture if it has a label."""
        from matplotlib.colors import ListedColormap

        if not cells.any():
            return
        shown = np.where(cells, 1.0, np.nan)
        axes.pcolormesh(*self._borders, shown.T, cmap=ListedColormap([colour]), rasterized=True, zorder=0.5)
        if label:
            axes.plot([], [], marker="s", markersize=7, linestyle="none", color=colour, label=label)

    def shade(self, axes: Axes, values: Array, shades: Shades) -> QuadMesh:
        """Colours cells by values (m, n)."""
        return axes.pcolormesh(
            *self._borders, np.ma.masked_invalid(values).T, cmap=shades.colours, norm=shades.norm, rasterized=True,
            zorder=1.0,
        )  # fmt: skip

    def levels(self, axes: Axes, values: Array, shades: Shades) -> None:
        """Lines of equal value, with it in them. They end where it jumps from cell to cell, as of an arm with motors to
        spare, which reaches neighbours in different ways; and there are none where it does so everywhere."""
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

    @property
    def _borders(self) -> tuple[Array, Array]:
        return self._drawn([axis.borders for axis in self.region.axes])

    def _drawn(self, values: Iterable[Array]) -> tuple[Array, Array]:
        """Where values along both axes are in the picture."""
        u, v = (one * scale - middle for one, scale, middle in zip(values, self.scales, self._middle, strict=True))
        return u, v

    # --- lines ---------------------------------------------------------------------------------------------------

    def curves(self, axes: Axes, curves: Sequence[SingularCurve], width: float = 1.8) -> None:
        """Singular curves, and borders that are not singular."""
        from matplotlib.patheffects import Normal, Stroke

        colours = {SingularityType.TYPE_1: TYPE_1, SingularityType.TYPE_2: TYPE_2}
        names = {SingularityType.TYPE_1: "type 1: motion lost", SingularityType.TYPE_2: "type 2: motion gained"}
        for curve in sorted(curves, key=lambda curve: curve.kind is not SingularityType.NONE):
            singular = curve.kind in colours
            wide = width if singular else 0.55 * width
            style: dict[str, Any] = {"linestyle": "-"}
            if len(curve.points) == 1:
                style = {"linestyle": "none", "marker": ".", "markersize": 2.0 * wide}
            (line,) = axes.plot(
                *self._drawn(curve.points.T), color=colours.get(curve.kind, _LIMIT), linewidth=wide, zorder=3.0,
                label=names.get(curve.kind, "border, not singular"), solid_joinstyle="round", **style,
            )  # fmt: skip
            if singular:
                line.set_path_effects([Stroke(linewidth=wide + _CASING, foreground="white"), Normal()])

    def robot(self, axes: Axes, pen: Pen | None = None) -> bool:
        """The robot at home, where the axes are two of x, y and z and show any of it; whether it was drawn."""
        from matplotlib.lines import Line2D
        from matplotlib.patheffects import Normal, Stroke

        if self.spec.over_joints or not all(name in _SIDES for name in self.region.names):
            return False
        sides = np.eye(3)[[_SIDES.index(name) for name in self.region.names]]
        view = Projection("", np.array([*sides, np.cross(*sides)]) * self.scales[0], np.zeros(3))
        pen = pen or Pen(1.5, 0.8, 3.2)
        there = set(axes.get_children())
        paint(
            axes,
            Skeleton(self.spec.mechanism, self.spec.node).at(self.spec.mechanism.q_home),
            view,
            pen,
        )
        painted = set(axes.get_children()) - there
        if not any(self._shows(artist.get_path()) for artist in painted):  # type: ignore[attr-defined]
            for artist in painted:
                artist.remove()
            return False
        for artist in painted:
            artist.set_gid(ROBOT)
            artist.set_zorder(_OVER + artist.get_zorder())
            if isinstance(artist, Line2D):
                wide = artist.get_linewidth() + _CASING
                artist.set_path_effects([Stroke(linewidth=wide, foreground="white"), Normal()])
            else:  # a plate, through which the map is to be seen
                artist.set_alpha(_GLASS)
        axes.plot([], [], color=INK, marker="o", markerfacecolor="white", markersize=4, label="robot at home")
        return True

    def _shows(self, path: Path) -> bool:
        """Whether any of a line or a plate is within the picture."""
        from matplotlib.transforms import Bbox

        u, v = self._borders
        box = Bbox([[u[0], v[0]], [u[-1], v[-1]]])
        return bool(box.count_contains(path.vertices)) or path.intersects_bbox(box, filled=True)


def _is_round(region: Region) -> bool:
    """Whether a region is more than half of a sphere either way, and no part of it twice."""
    if region.names != ("azimuth", "elevation"):
        return False
    azimuth, elevation = region.axes
    turns, tilts = azimuth.high - azimuth.low, elevation.high - elevation.low
    once = turns < 2.0 * math.pi + _ALMOST and max(-elevation.low, elevation.high) < 0.5 * math.pi + _ALMOST
    return once and turns > math.pi and tilts > 0.5 * math.pi


def _jumps(shown: Array) -> NDArray[np.bool_]:
    """(m, n) cells beside which the next one is of quite another value, all from 0 to 1: further away than what is
    steep, which has steep neighbours."""
    found = np.zeros(shown.shape, dtype=bool)
    for axis in (0, 1):
        steps = np.nan_to_num(np.moveaxis(np.abs(np.diff(shown, axis=axis)), axis, 0))
        around = np.pad(steps, ((1, 1), (0, 0)))
        far = (steps > _JUMP) & (steps > _STEEP * np.maximum(around[:-2], around[2:]))
        turned = np.moveaxis(found, axis, 0)
        turned[1:] |= far
        turned[:-1] |= far
    return found


def _contrasting(shades: Shades, level: float) -> str:
    """White on what is dark, and ink on what is light."""
    red, green, blue, _ = shades.colours(float(shades.norm(level)))
    return "white" if 0.299 * red + 0.587 * green + 0.114 * blue < _LIGHT else INK


def _in_degrees(axis: Any) -> None:
    from matplotlib.ticker import MaxNLocator

    axis.set_major_locator(MaxNLocator(nbins="auto", steps=[1, 1.5, 3, 4.5, 6, 9, 10]))


def _meridians(axes: Any, middle: float, step: int) -> None:
    """Of a map of a sphere, each so many degrees, where its middle is at so many."""
    from matplotlib.ticker import FixedFormatter, FixedLocator

    first, last = math.floor((middle - 180.0) / step + _ALMOST) + 1, math.ceil((middle + 180.0) / step - _ALMOST)
    shown = range(step * first, step * last, step)
    axes.xaxis.set_major_locator(FixedLocator([math.radians(degrees - middle) for degrees in shown]))
    axes.xaxis.set_major_formatter(FixedFormatter([f"{degrees}°".replace("-", "−") for degrees in shown]))
