"""`draw_comparison`: the parts that each of two maps reaches, and both, and the difference of a quantity."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from cinegen.arrays import Bools
from cinegen.plotting.plane import Line, Plane, bar
from cinegen.plotting.shades import OUT, differing, pretty
from cinegen.plotting.sheet import BLUE, INK, LABEL, ORANGE, UNDER, finish, sheet, wrapped
from cinegen.user_units import coordinate_text, extent_text
from cinegen.workspace.comparison import Comparison, compare
from cinegen.workspace.errors import MapError
from cinegen.workspace.maps import open_map
from cinegen.workspace.specification import MapSpecification, specification_of
from raff2urdf.errors import did_you_mean

if TYPE_CHECKING:
    import xarray

FIRST, SECOND, BOTH = BLUE, ORANGE, "#b7c3cf"
"""Colours of the cells that only the first map reaches, only the second, and both."""

_PALE = 0.6  # of these colours behind a curve
_MARGIN = 1.2  # inches, to the left and right of axes


def draw_comparison(
    first: xarray.Dataset | str | Path, second: xarray.Dataset | str | Path, quantity: str | None = None,
    *, size: float = 12.0,
) -> Figure:  # fmt: skip
    """Draw the parts that each of two maps reaches, and both; next to it the difference of a quantity where both reach,
    second minus first. Of maps over more than two axes the middle slice of the first two.

    Args:
        first: a map, or its folder.
        second: another one, over the same coordinates.
        quantity: the quantity whose difference is shown; sigma_1, or the first that both have, unless given.
        size: width, inches.

    Raises:
        MapError: they are not maps; or can't be compared, see `compare`; or one does not have that quantity.
    """
    first, second = (open_map(of) if isinstance(of, str | Path) else of for of in (first, second))
    compared, spec = compare(first, second), specification_of(first)
    known = tuple(compared.differences)
    if quantity is None:
        quantity = "sigma_1" if "sigma_1" in known else next(iter(known), None)
    elif quantity not in known:
        raise MapError(f"the maps don't both have '{quantity}'{did_you_mean(quantity, known)}")
    figure = (_over_one if len(compared.region.axes) == 1 else _over_two)(compared, spec, quantity, size)
    return finish(figure)


def _classes(compared: Comparison) -> list[tuple[Bools, str, str]]:
    """Return cells, their colour and their label."""
    (first, second), names = compared.cells, compared.names
    return [(~first & ~second, OUT, "neither"), (first & ~second, FIRST, f"only {names[0]}"),
            (second & ~first, SECOND, f"only {names[1]}"), (first & second, BOTH, "both")]  # fmt: skip


def _extents(compared: Comparison) -> str:
    """Return the extents, in lines."""
    texts = [f"{label} {extent_text(extent)}" for label, extent in compared.extents.items()]
    return "\n".join("; ".join(part) for part in (texts[:2], texts[2:4], texts[4:]))


def _over_one(compared: Comparison, spec: MapSpecification, name: str | None, size: float) -> Figure:
    """Draw maps over one axis: cells as coloured bands, and the difference of a quantity, if any, as a curve on them.

    Args:
        compared: the maps.
        spec: of the first one: its axis is shown where both are.
        name: of the quantity.
        size: width of a figure over two axes, inches; this one is narrower.
    """
    line, tall, text = Line(replace(spec, region=compared.region)), 0.3 * size, ""
    figure, body = sheet(0.6 * size, tall, " and ".join(compared.names), _extents(compared))
    axes = body.add_subplot()
    for cells, colour, title in _classes(compared):
        line.fill(axes, cells, colour, title, _PALE)
    if name is not None:
        difference = compared.differences[name]
        line.curve(axes, difference.values, color=INK)
        axes.axhline(0.0, color=INK, linewidth=0.5)
        text = differing(difference.description, difference.unit, name, difference.values).text
    line.dress(axes, text, tall - UNDER)
    return figure


def _over_two(compared: Comparison, spec: MapSpecification, name: str | None, size: float) -> Figure:
    region, cut = compared.region, compared.region.axes[2:]
    at = {axis.name: float(axis.middles()[axis.count // 2]) for axis in cut}
    middle: Any = (slice(None), slice(None), *(axis.count // 2 for axis in cut))
    plane = Plane(replace(spec, region=replace(region, axes=region.axes[:2], at={**region.at, **at})))
    wide, tall = plane.paper(size / 2.0)
    text, panels = _extents(compared), 1 if name is None else 2
    if at:
        text += f" in all; at {', '.join(coordinate_text(spec.mechanism, *pair) for pair in at.items())}"
    if name is not None:
        difference = compared.differences[name]
        text += f"\n{pretty(name)}, {compared.names[1]} minus {compared.names[0]}: {difference.text.replace('-', '−')}"
    figure, body = sheet(wide * panels, tall, " and ".join(compared.names), text)
    axes = body.add_subplot(1, panels, 1, projection=plane.projection)
    for cells, colour, title in _classes(compared):
        plane.fill(axes, cells[middle], colour, title)
    plane.dress(axes)
    if name is not None:
        values = difference.values[middle]
        look = differing(difference.description, difference.unit, name, values)
        right = body.add_subplot(1, panels, 2, projection=plane.projection, **plane.sharing(axes))
        plane.fill(right, np.isnan(values), OUT)
        mesh = plane.shade(right, values, look)
        plane.levels(right, values, look)
        plane.dress(right)
        for panel, title in ((axes, "reachable part"), (right, f"{pretty(name)}, where both reach")):
            panel.set_title(wrapped(title, wide - _MARGIN, LABEL), fontsize=LABEL, color=INK)
        bar(body, mesh, right, look, tall)
    return figure
