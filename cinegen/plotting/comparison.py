"""`draw_comparison`: two maps in one picture: what one reaches alone, what both reach, and how a quantity differs."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.plotting.heading import printed, value
from cinegen.plotting.modes import DrawingError
from cinegen.plotting.panel import LABEL, bar, curve, finish, sheet, spans, wrapped
from cinegen.plotting.plane import Plane
from cinegen.plotting.shades import OUT, differing, pretty
from cinegen.plotting.stick import INK
from cinegen.plotting.units import user_scale
from cinegen.workspace.compare import Comparison, Difference, compare
from cinegen.workspace.errors import MapError
from cinegen.workspace.make import open_map
from cinegen.workspace.specification import MapSpecification
from cinegen.workspace.storage.dataset import specification_of
from raff2urdf.errors import did_you_mean

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

Bools = NDArray[np.bool_]

FIRST, SECOND, BOTH = "#0072b2", "#e69f00", "#b7c3cf"
"""What the first map reaches alone, the second alone (Okabe and Ito's blue and orange), and both."""

_PALE = 0.6  # of these colours behind a curve
_BESIDE, _UNDER = 1.2, 0.8  # inches, of what is beside and below axes


def draw_comparison(
    first: xarray.Dataset | str | Path, second: xarray.Dataset | str | Path, quantity: str | None = None,
    *, size: float = 12.0,
) -> Figure:  # fmt: skip
    """Two maps in one picture: what each reaches alone, and both; beside it how a quantity differs where both reach,
    the second less the first. Of maps of more than two axes the middle slice of the first two.

    Args:
        first: a map, or its folder.
        second: another one, over the same coordinates.
        quantity: whose difference is shown; that of sigma_1, or the first that both have, unless given.
        size: width, inches.

    Raises:
        DrawingError: there is no matplotlib.
        MapError: these are no maps; or they can't be compared, see `compare`; or don't both tell that quantity.
    """
    if find_spec("matplotlib") is None:
        raise DrawingError("pictures need matplotlib: install it with `pip install matplotlib`")
    one, other = (open_map(of) if isinstance(of, str | Path) else of for of in (first, second))
    found, spec = compare(one, other), specification_of(one)
    name = _chosen(found, quantity)
    if len(found.region.axes) == 1:
        return _over_one(found, spec, name, size)
    return _over_two(found, spec, name, size)


def _chosen(found: Comparison, name: str | None) -> str | None:
    known = tuple(found.differences)
    if name is None:
        return "sigma_1" if "sigma_1" in known else next(iter(known), None)
    if name not in known:
        raise MapError(f"both maps don't tell '{name}'{did_you_mean(name, known)}")
    return name


def _classes(found: Comparison) -> list[tuple[Bools, str, str]]:
    """Cells, their colour and their name."""
    (one, other), names = found.cells, found.names
    return [(~one & ~other, OUT, "neither"), (one & ~other, FIRST, f"{names[0]} alone"),
            (other & ~one, SECOND, f"{names[1]} alone"), (one & other, BOTH, "both")]  # fmt: skip


def _words(found: Comparison) -> str:
    """How much is reached, in lines."""
    said = [f"{label} {printed(extent)}" for label, extent in found.extents.items()]
    return "\n".join("; ".join(part) for part in (said[:2], said[2:4], said[4:]))


def _over_one(found: Comparison, spec: MapSpecification, name: str | None, size: float) -> Figure:
    (axis,) = found.region.axes
    scale, unit = user_scale(spec.mechanism, axis.name)
    wide, tall = 0.6 * size, 0.3 * size
    figure, body = sheet(wide, tall, " and ".join(found.names), _words(found))
    axes = body.add_subplot()
    for cells, colour, label in _classes(found):
        for first, last in spans(cells):
            axes.axvspan(*(axis.borders[[first, last]] * scale), color=colour, alpha=_PALE, linewidth=0.0, label=label)
    if name is not None:
        difference = found.differences[name]
        curve(axes, axis, scale, difference.values, color=INK, linewidth=1.6)
        axes.axhline(0.0, color=INK, linewidth=0.5)
        words = differing(difference.words, difference.unit, name, difference.values).words
        axes.set_ylabel(wrapped(words, tall - _UNDER, LABEL), fontsize=LABEL)
    axes.set_xlabel(f"{axis.name} ({unit})")
    axes.set_xlim(axis.low * scale, axis.high * scale)
    finish(figure)
    return figure


def _over_two(found: Comparison, spec: MapSpecification, name: str | None, size: float) -> Figure:
    region, cut = found.region, found.region.axes[2:]
    at = {axis.name: float(axis.middles()[axis.count // 2]) for axis in cut}
    middle: Any = (slice(None), slice(None), *(axis.count // 2 for axis in cut))
    here = replace(spec, region=replace(region, axes=region.axes[:2], at={**region.at, **at}))
    plane, panels = Plane(here), 1 if name is None else 2
    wide, tall = plane.paper(size / 2.0)
    words = _words(found)
    if at:
        words += f" in all; at {', '.join(value(here, axis, number) for axis, number in at.items())}"
    if name is not None:
        words += f"\n{pretty(name)}, {found.names[1]} less {found.names[0]}: {_spread(found.differences[name])}"
    figure, body = sheet(wide * panels, tall, " and ".join(found.names), words)
    axes = body.add_subplot(1, panels, 1, projection=plane.projection)
    for cells, colour, label in _classes(found):
        plane.fill(axes, cells[middle], colour, label)
    plane.dress(axes)
    if name is not None:
        difference = found.differences[name]
        values = difference.values[middle]
        look = differing(difference.words, difference.unit, name, values)
        beside = body.add_subplot(1, panels, 2, projection=plane.projection, **plane.sharing(axes))
        plane.fill(beside, np.isnan(values), OUT)
        mesh = plane.shade(beside, values, look)
        plane.levels(beside, values, look)
        plane.dress(beside)
        for panel, said in ((axes, "what is reached"), (beside, f"{pretty(name)}, where both reach")):
            panel.set_title(wrapped(said, wide - _BESIDE, LABEL), fontsize=LABEL, color=INK)
        bar(body, mesh, beside, look, tall - _UNDER)
    finish(figure)
    return figure


def _spread(difference: Difference) -> str:
    least, median, most = (f"{number:+.3g}".replace("-", "−") for number in difference.spread)
    unit = "" if difference.unit == "1" else f" {difference.unit}"
    return f"{least} to {most}{unit}, median {median}{unit}"
