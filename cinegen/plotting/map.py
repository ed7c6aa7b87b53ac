"""`draw_map`: a map as a picture: a curve over one axis, colours over two, slices and a solid over three."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cinegen.arrays import Array, Bools
from cinegen.plotting.loci import TYPE_1, paint_curves
from cinegen.plotting.plane import Line, Plane, bar
from cinegen.plotting.shades import OUT, Shades, chosen, shades, values_of
from cinegen.plotting.sheet import INK, UNDER, finish, sheet
from cinegen.plotting.solid import paint_solid
from cinegen.singularities.slice import POSE
from cinegen.user_units import coordinate_text, extent_text
from cinegen.workspace.cells import CellStatus
from cinegen.workspace.extent import extent
from cinegen.workspace.loci import loci
from cinegen.workspace.maps import open_map
from cinegen.workspace.region import SPHERICAL
from cinegen.workspace.specification import MapSpecification, map_slice, specification_of

if TYPE_CHECKING:
    import xarray

_SLICES = 6
_RIGHT, _GAP = 0.5, 0.06  # of the width: for the slices, and between them and the solid
_HEIGHT = 0.48  # of a picture over one axis, over its width
_ROTATIONS = {0: "any orientation", 2: "direction of its z given", 3: "orientation given"}
_LOW = 0.35  # height of a picture over three axes, over its width


def draw_map(
    of: xarray.Dataset | str | Path,
    quantity: str | None = None,
    *,
    curves: bool = True,
    robot: bool = True,
    name: str | None = None,
    size: float = 7.0,
) -> Figure:
    """Draw a map, in m and degrees.

    Over one axis a curve. Over two, colours with lines of equal value, singular curves of type 1 and 2, other borders
    of the reachable part, and the robot at home where the axes are two of x, y and z; directions seen from a centre in
    Hammer's projection of the sphere. Over three, slices and a view of the border; over more, the middle slice of the
    first two.

    Args:
        of: a map, or its folder.
        quantity: the quantity that is shown: of `QUANTITIES`, or reachable, or status; sigma_1, else the status, unless
            given.
        curves: whether to find singular curves, which takes seconds.
        robot: whether to draw the robot.
        name: of the robot in the title; its own unless given.
        size: width, inches; half as much again over three axes.

    Raises:
        MapError: it is not a map, or does not have that quantity.
    """
    dataset = open_map(of) if isinstance(of, str | Path) else of
    spec = specification_of(dataset)
    text = f"{'possible' if spec.over_joints else 'reached'}: {extent_text(extent(dataset))}"
    axes = spec.region.axes
    if len(axes) > 3:
        dataset, spec = map_slice(dataset, spec, {axis.name: axis.count // 2 for axis in axes[2:]})
        text = f"middle slice; in all {text}"
    shown = chosen(dataset, quantity)
    dataset = dataset.transpose(*spec.region.names, ...)
    values = values_of(dataset, shown)
    picture = _Picture(dataset, spec, values, shades(dataset, shown, values), curves, robot)
    first, second = _heading(spec, name), _fixed(spec, text)
    figure = (picture.over_one, picture.over_two, picture.over_three)[len(spec.region.axes) - 1](size, first, second)
    return finish(figure)


@dataclass(frozen=True)
class _Picture:
    """A map of one to three axes, the values that are shown, and how they are shown."""

    dataset: xarray.Dataset
    spec: MapSpecification
    values: Array
    look: Shades
    lines: bool
    robot: bool

    def over_one(self, size: float, *titles: str) -> Figure:
        """Draw a map over one axis as a curve, in steps if its values have names, on the bands that are out of reach;
        `size` is the width, inches."""
        tall, look, line = _HEIGHT * size, self.look, Line(self.spec)
        figure, body = sheet(size, tall, *titles)
        axes = body.add_subplot()
        line.fill(axes, _out_of_reach(self.dataset), OUT, "out of reach")
        style: dict[str, Any] = {"drawstyle": "steps-mid"} if look.labels else {}
        line.curve(axes, self.values, color=TYPE_1, **style)
        if look.labels:
            axes.set_yticks(np.unique(self.values[np.isfinite(self.values)]), look.labels)
        elif look.logarithmic:
            axes.set_yscale("log")
        line.dress(axes, look.text, tall - UNDER)
        return figure

    def over_two(self, size: float, *titles: str) -> Figure:
        plane = Plane(self.spec)
        wide, tall = plane.paper(size)
        figure, body = sheet(wide, tall, *titles)
        axes = body.add_subplot(projection=plane.projection)
        mesh = self._panel(plane, axes, self.dataset, self.values, 1.8)
        plane.levels(axes, self.values, self.look)
        if self.robot:
            plane.robot(axes)
        plane.dress(axes)
        bar(body, mesh, axes, self.look, tall)
        return figure

    def over_three(self, size: float, *titles: str) -> Figure:
        """Draw the border of the reachable part on the left, slices along the last axis on the right."""
        across, size = self.spec.region.axes[2], 1.5 * size
        reached = self.dataset["reachable"].values
        numbers = _layers(reached)
        rows = 1 if len(numbers) < 3 else 2
        columns = -(-len(numbers) // rows)
        slices = [map_slice(self.dataset, self.spec, {across.name: number}) for number in numbers]
        tall = max(Plane(slices[0][1]).aspect * size * _RIGHT / columns * rows + UNDER, _LOW * size)
        figure, body = sheet(size, tall, *titles)
        left, right = body.subfigures(1, 2, wspace=_GAP, width_ratios=(1.0, 1.5))
        paint_solid(left.add_subplot(projection="3d"), self.spec, reached, self.values, self.look)
        mesh: Any = None
        shared: dict[str, Axes] = {}
        for k, (number, (part, cut)) in enumerate(zip(numbers, slices, strict=True)):
            plane = Plane(cut)
            axes = right.add_subplot(rows, columns, k + 1, projection=plane.projection, **shared)
            shared = plane.sharing(axes)
            mesh = self._panel(plane, axes, part, self.values[:, :, number], 1.2)
            plane.dress(axes, quiet=True)
            axes.label_outer()
            title = coordinate_text(cut.mechanism, across.name, cut.region.at[across.name])
            axes.set_title(title, fontsize="small", color=INK)
        bar(right, mesh, right.axes, self.look, tall)
        return figure

    def _panel(self, plane: Plane, axes: Axes, dataset: xarray.Dataset, values: Array, width: float) -> Any:
        """Draw a map of two axes with its curves; return the object that a colour bar explains."""
        if self.look.name != "status":
            plane.fill(axes, _out_of_reach(dataset), OUT, "out of reach")
        if self.lines and min(plane.region.shape) > 1:
            paint_curves(axes, loci(dataset, plane.spec), plane.points, width)
        return plane.shade(axes, values, self.look)


def _out_of_reach(dataset: xarray.Dataset) -> Bools:
    """Return the cells that were evaluated and are not reachable."""
    return np.asarray(~dataset["reachable"].values & (dataset["status"].values != CellStatus.NOT_EVALUATED))


def _layers(reached: Bools) -> list[int]:
    """Return cells of the last axis for slices: evenly over those where anything is reached."""
    layers = np.flatnonzero(reached.any(axis=(0, 1)))
    if not len(layers):
        layers = np.arange(reached.shape[2])
    numbers = (np.arange(_SLICES) + 0.5) * len(layers) / _SLICES
    return [int(layers[k]) for k in np.unique(numbers.astype(int))]


def _heading(spec: MapSpecification, name: str | None = None) -> str:
    """Return the first title: robot and subject."""
    robot = name or spec.mechanism.name
    return f"{robot}: over {', '.join(spec.region.names)}" if spec.over_joints else f"{robot}: reach of {spec.node}"


def _fixed(spec: MapSpecification, text: str) -> str:
    """Return the fixed coordinates, followed by a text."""
    region = spec.region
    parts = [coordinate_text(spec.mechanism, *pair) for pair in region.at.items()]
    if any(name in SPHERICAL for name in (*region.names, *region.at)):
        centre = zip("xyz", region.centre or (0.0,) * 3, strict=True)
        parts.append(f"seen from {', '.join(coordinate_text(spec.mechanism, *pair) for pair in centre)}")
    if not spec.over_joints and not (spec.rotation == 3 and any(name in POSE[3:] for name in region.at)):
        parts.append(_ROTATIONS[spec.rotation])
    if not spec.limits:
        parts.append("joint limits left out")
    return "; ".join([*parts, text])
