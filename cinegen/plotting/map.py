"""`draw_map`: a map as a picture: a curve over one axis, colours over two, slices and a surface of three."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.plotting.heading import given, heading, size_words, value
from cinegen.plotting.loci import TYPE_1
from cinegen.plotting.modes import DrawingError
from cinegen.plotting.panel import LABEL, bar, curve, finish, out_of_reach, panel, sheet, spans, wrapped
from cinegen.plotting.plane import Plane
from cinegen.plotting.shades import OUT, chosen, shades, values_of
from cinegen.plotting.solid import paint_solid
from cinegen.plotting.stick import INK
from cinegen.plotting.units import user_scale
from cinegen.workspace.extent import extent
from cinegen.workspace.loci import loci
from cinegen.workspace.make import open_map
from cinegen.workspace.specification import MapSpecification
from cinegen.workspace.storage.dataset import held, specification_of

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_SLICES = 6
_RIGHT, _GAP = 0.5, 0.06  # of the width: for the slices, and between them and the solid
_LINE = 0.48  # height of a picture of one axis over its width
_LOW, _UNDER = 0.35, 0.8  # of the width; inches: what a picture of three axes needs in height, and what is below axes


def draw_map(
    of: xarray.Dataset | str | Path,
    quantity: str | None = None,
    *,
    curves: bool = True,
    robot: bool = True,
    name: str | None = None,
    size: float = 7.0,
) -> Figure:
    """A map as a picture; mm and degrees.

    Over one axis a curve. Over two, colours with lines of equal value, singular curves of type 1 and 2, other borders
    of what is reached, and the robot at home where the axes are two of x, y and z; directions seen from a centre as
    Hammer's map of the sphere. Over three, slices and a view of the border; over more, the middle slice of the first
    two.

    Args:
        of: a map, or its folder.
        quantity: what is shown: of `QUANTITIES`, or reachable, or settled; sigma_1, else how cells were settled, unless
            given.
        curves: whether singular curves are looked for, which takes seconds.
        robot: whether the robot is drawn.
        name: of the robot in the title; its own unless given.
        size: width, inches; of three axes half as much again.

    Raises:
        DrawingError: there is no matplotlib.
        MapError: this is no map; or it does not tell that quantity.
    """
    if find_spec("matplotlib") is None:
        raise DrawingError("pictures need matplotlib: install it with `pip install matplotlib`")
    dataset = open_map(of) if isinstance(of, str | Path) else of
    spec = specification_of(dataset)
    shown = chosen(dataset, quantity)
    words = size_words(spec, extent(dataset))
    match len(spec.region.axes):
        case 1:
            return _of_one(dataset, spec, shown, name, size, words)
        case 2:
            return _of_two(dataset, spec, shown, curves, robot, name, size, words)
        case 3:
            return _of_three(dataset, spec, shown, curves, name, 1.5 * size, words)
    part, there = held(dataset, spec, {axis.name: axis.count // 2 for axis in spec.region.axes[2:]})
    return _of_two(part, there, shown, curves, robot, name, size, f"middle slice; in all {words}")


# --- one axis ----------------------------------------------------------------------------------------------------


def _of_one(
    dataset: xarray.Dataset, spec: MapSpecification, shown: str, name: str | None, size: float, words: str
) -> Figure:
    tall = _LINE * size
    figure, body = sheet(size, tall, heading(spec, name), given(spec, words))
    axes = body.add_subplot()
    (axis,) = spec.region.axes
    scale, unit = user_scale(spec.mechanism, axis.name)
    values = values_of(dataset, shown)
    look = shades(dataset, shown, values)
    for first, last in spans(out_of_reach(dataset)):
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


# --- two axes ----------------------------------------------------------------------------------------------------


def _of_two(
    dataset: xarray.Dataset, spec: MapSpecification, shown: str, lines: bool, robot: bool, name: str | None,
    size: float, words: str,
) -> Figure:  # fmt: skip
    dataset = dataset.transpose(*spec.region.names, ...)
    plane = Plane(spec)
    wide, tall = plane.paper(size)
    figure, body = sheet(wide, tall, heading(spec, name), given(spec, words))
    axes = body.add_subplot(projection=plane.projection)
    values = values_of(dataset, shown)
    look = shades(dataset, shown, values)
    mesh = panel(plane, axes, dataset, values, look)
    plane.levels(axes, values, look)
    if lines and min(spec.region.shape) > 1:
        plane.curves(axes, loci(dataset, spec))
    if robot:
        plane.robot(axes)
    plane.dress(axes)
    bar(body, mesh, axes, look, tall - _UNDER)
    finish(figure)
    return figure


# --- three axes --------------------------------------------------------------------------------------------------


def _of_three(
    dataset: xarray.Dataset,
    spec: MapSpecification,
    shown: str,
    lines: bool,
    name: str | None,
    size: float,
    words: str,
) -> Figure:
    """The border of what is reached on the left, slices along the last axis on the right."""
    dataset = dataset.transpose(*spec.region.names, ...)
    across = spec.region.axes[2]
    values = values_of(dataset, shown)
    look = shades(dataset, shown, values)
    numbers = _layers(dataset["reachable"].values)
    rows = 1 if len(numbers) < 3 else 2
    columns = -(-len(numbers) // rows)
    planes = [held(dataset, spec, {across.name: number}) for number in numbers]
    tall = max(Plane(planes[0][1]).tall(size * _RIGHT / columns) * rows + _UNDER, _LOW * size)
    figure, body = sheet(size, tall, heading(spec, name), given(spec, words))
    left, right = body.subfigures(1, 2, wspace=_GAP, width_ratios=(1.0, 1.5))
    paint_solid(left.add_subplot(projection="3d"), spec, dataset["reachable"].values, values, look)
    mesh: Any = None
    shared: dict[str, Axes] = {}
    for k, (number, (part, there)) in enumerate(zip(numbers, planes, strict=True)):
        plane = Plane(there)
        axes = right.add_subplot(rows, columns, k + 1, projection=plane.projection, **shared)
        shared = plane.sharing(axes)
        mesh = panel(plane, axes, part, values[:, :, number], look)
        if lines and min(there.region.shape) > 1:
            plane.curves(axes, loci(part, there), 1.2)
        plane.dress(axes, quiet=True)
        axes.label_outer()
        axes.set_title(value(there, across.name, there.region.at[across.name]), fontsize="small", color=INK)
    bar(right, mesh, right.axes, look, tall - _UNDER)
    finish(figure)
    return figure


def _layers(reached: NDArray[np.bool_]) -> list[int]:
    """Cells of the last axis that slices are shown of: evenly over those where anything is reached."""
    there = np.flatnonzero(reached.any(axis=(0, 1)))
    if not len(there):
        there = np.arange(reached.shape[2])
    places = (np.arange(_SLICES) + 0.5) * len(there) / _SLICES
    return [int(there[k]) for k in np.unique(places.astype(int))]
