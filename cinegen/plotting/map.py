"""`draw_map`: a map as a picture: a curve over one axis, colours over two, slices and a solid over three."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.plotting.heading import given, heading, size_words, value
from cinegen.plotting.loci import TYPE_1
from cinegen.plotting.panel import LABEL, bar, curve, finish, out_of_reach, panel, sheet, spans, wrapped
from cinegen.plotting.plane import Plane
from cinegen.plotting.shades import OUT, chosen, shades, values_of
from cinegen.plotting.solid import paint_solid
from cinegen.plotting.stick import INK
from cinegen.plotting.units import user_scale
from cinegen.workspace.extent import extent
from cinegen.workspace.loci import loci
from cinegen.workspace.maps import open_map
from cinegen.workspace.specification import MapSpecification, map_slice, specification_of

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_SLICES = 6
_RIGHT, _GAP = 0.5, 0.06  # of the width: for the slices, and between them and the solid
_HEIGHT = 0.48  # of a picture over one axis, over its width
_LOW, _UNDER = 0.35, 0.8  # of the width: height of a picture over three axes; inches: what is below axes


def draw_map(
    of: xarray.Dataset | str | Path,
    quantity: str | None = None,
    *,
    curves: bool = True,
    robot: bool = True,
    name: str | None = None,
    size: float = 7.0,
) -> Figure:
    """Draw a map, in mm and degrees.

    Over one axis a curve. Over two, colours with lines of equal value, singular curves of type 1 and 2, other borders
    of what is reached, and the robot at home where the axes are two of x, y and z; directions seen from a centre as
    Hammer's map of the sphere. Over three, slices and a view of the border; over more, the middle slice of the first
    two.

    Args:
        of: a map, or its folder.
        quantity: what is shown: of `QUANTITIES`, or reachable, or status; sigma_1, else the status, unless given.
        curves: whether to find singular curves, which takes seconds.
        robot: whether to draw the robot.
        name: of the robot in the title; its own unless given.
        size: width, inches; half as much again over three axes.

    Raises:
        MapError: it is not a map, or does not have that quantity.
    """
    dataset = open_map(of) if isinstance(of, str | Path) else of
    spec = specification_of(dataset)
    picture = _Picture(
        dataset, spec, chosen(dataset, quantity), curves, robot, name, size, size_words(spec, extent(dataset))
    )
    axes = spec.region.axes
    if len(axes) == 1:
        return picture.over_one()
    if len(axes) == 3:
        return picture.over_three()
    if len(axes) > 3:
        part, there = map_slice(dataset, spec, {axis.name: axis.count // 2 for axis in axes[2:]})
        picture = replace(picture, dataset=part, spec=there, text=f"middle slice; in all {picture.text}")
    return picture.over_two()


@dataclass(frozen=True)
class _Picture:
    """What is drawn; the text is about how much is reached."""

    dataset: xarray.Dataset
    spec: MapSpecification
    shown: str
    lines: bool
    robot: bool
    name: str | None
    size: float
    text: str

    def _sheet(self, wide: float, tall: float) -> tuple[Figure, Any]:
        return sheet(wide, tall, heading(self.spec, self.name), given(self.spec, self.text))

    def _curves(self, plane: Plane, axes: Axes, dataset: xarray.Dataset, width: float) -> None:
        if self.lines and min(plane.spec.region.shape) > 1:
            plane.curves(axes, loci(dataset, plane.spec), width)

    def over_one(self) -> Figure:
        tall = _HEIGHT * self.size
        figure, body = self._sheet(self.size, tall)
        axes = body.add_subplot()
        (axis,) = self.spec.region.axes
        scale, unit = user_scale(self.spec.mechanism, axis.name)
        values = values_of(self.dataset, self.shown)
        look = shades(self.dataset, self.shown, values)
        for first, last in spans(out_of_reach(self.dataset)):
            axes.axvspan(*(axis.borders[[first, last]] * scale), color=OUT, linewidth=0.0, label="out of reach")
        style: dict[str, Any] = {"drawstyle": "steps-mid"} if look.labels else {}
        curve(axes, axis, scale, values, color=TYPE_1, linewidth=1.6, **style)
        if look.labels:
            axes.set_yticks(np.unique(values[np.isfinite(values)]), look.labels)
        elif look.logarithmic:
            axes.set_yscale("log")
        axes.set_xlabel(f"{axis.name} ({unit})")
        axes.set_ylabel(wrapped(look.words, tall - _UNDER, LABEL), fontsize=LABEL)
        axes.set_xlim(axis.low * scale, axis.high * scale)
        axes.spines[["top", "right"]].set_visible(False)
        finish(figure)
        return figure

    def over_two(self) -> Figure:
        dataset = self.dataset.transpose(*self.spec.region.names, ...)
        plane = Plane(self.spec)
        wide, tall = plane.paper(self.size)
        figure, body = self._sheet(wide, tall)
        axes = body.add_subplot(projection=plane.projection)
        values = values_of(dataset, self.shown)
        look = shades(dataset, self.shown, values)
        mesh = panel(plane, axes, dataset, values, look)
        plane.levels(axes, values, look)
        self._curves(plane, axes, dataset, 1.8)
        if self.robot:
            plane.robot(axes)
        plane.dress(axes)
        bar(body, mesh, axes, look, tall - _UNDER)
        finish(figure)
        return figure

    def over_three(self) -> Figure:
        """Draw the border of what is reached on the left, slices along the last axis on the right."""
        dataset, size = self.dataset.transpose(*self.spec.region.names, ...), 1.5 * self.size
        across = self.spec.region.axes[2]
        values, reached = values_of(dataset, self.shown), dataset["reachable"].values
        look = shades(dataset, self.shown, values)
        numbers = _layers(reached)
        rows = 1 if len(numbers) < 3 else 2
        columns = -(-len(numbers) // rows)
        slices = [map_slice(dataset, self.spec, {across.name: number}) for number in numbers]
        tall = max(Plane(slices[0][1]).tall(size * _RIGHT / columns) * rows + _UNDER, _LOW * size)
        figure, body = self._sheet(size, tall)
        left, right = body.subfigures(1, 2, wspace=_GAP, width_ratios=(1.0, 1.5))
        paint_solid(left.add_subplot(projection="3d"), self.spec, reached, values, look)
        mesh: Any = None
        shared: dict[str, Axes] = {}
        for k, (number, (part, there)) in enumerate(zip(numbers, slices, strict=True)):
            plane = Plane(there)
            axes = right.add_subplot(rows, columns, k + 1, projection=plane.projection, **shared)
            shared = plane.sharing(axes)
            mesh = panel(plane, axes, part, values[:, :, number], look)
            self._curves(plane, axes, part, 1.2)
            plane.dress(axes, quiet=True)
            axes.label_outer()
            axes.set_title(value(there, across.name, there.region.at[across.name]), fontsize="small", color=INK)
        bar(right, mesh, right.axes, look, tall - _UNDER)
        finish(figure)
        return figure


def _layers(reached: NDArray[np.bool_]) -> list[int]:
    """Return cells of the last axis for slices: evenly over those where anything is reached."""
    layers = np.flatnonzero(reached.any(axis=(0, 1)))
    if not len(layers):
        layers = np.arange(reached.shape[2])
    numbers = (np.arange(_SLICES) + 0.5) * len(layers) / _SLICES
    return [int(layers[k]) for k in np.unique(numbers.astype(int))]
