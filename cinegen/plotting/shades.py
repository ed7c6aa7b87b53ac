"""`Shades`: colours, range and contour levels of a map's quantity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, LogNorm, Normalize
from matplotlib.ticker import LogLocator, MaxNLocator

from cinegen.arrays import Array
from cinegen.plotting.sheet import BLUE, SKY
from cinegen.workspace.cells import CellStatus
from cinegen.workspace.errors import MapError
from cinegen.workspace.quantities import QUANTITIES
from raff2urdf.errors import did_you_mean

if TYPE_CHECKING:
    import xarray

OUT = "#e9ebee"
"""Colour of unreachable cells."""

REACHABLE = "#7fa8c9"
"""Colour of reachable cells without another quantity."""

_LOGARITHMIC = ("condition", "force")
_SPAN = 4.0  # ratio of values: smaller ones are shown on a linear scale
_MOST = 0.99  # of all values: larger ones have the colour of this one
_FAR = 0.4  # of the largest: if all values are above, colours don't begin at 0
_DARKEST = 0.12  # of viridis: lines must be visible on it
_STATUSES = {
    CellStatus.NOT_EVALUATED: "#ffffff",
    CellStatus.REACHABLE: SKY,
    CellStatus.REACHABLE_BY_SEARCH: BLUE,
    CellStatus.UNREACHABLE_PROVED: OUT,
    CellStatus.UNREACHABLE_NOT_FOUND: "#d3d7dc",
    CellStatus.LOOPS_OPEN: "#d9cbb8",
    CellStatus.BEYOND_LIMITS: "#c4b3cf",
}
_ALMOST = 1e-9
_DIGITS = 3


@dataclass(frozen=True, eq=False)
class Shades:
    """Colours, range and levels of a quantity.

    Attributes:
        name: of the quantity.
        text: description and unit.
        colours: a matplotlib colormap.
        norm: from values to it.
        levels: drawn as lines; none for classes.
        ticks: values with a label.
        labels: of the ticks; none if the numbers are the labels.
        extend: sides on which values exceed the range, as for matplotlib's colour bars.
    """

    name: str
    text: str
    colours: Colormap
    norm: Normalize
    levels: Array
    ticks: Array
    labels: tuple[str, ...] = ()
    extend: str = "neither"

    @property
    def logarithmic(self) -> bool:
        """True for a logarithmic scale."""
        return isinstance(self.norm, LogNorm)

    def number(self, value: float) -> str:
        """Return a level as a short text, with as many digits as distinguish all ticks."""
        apart = (n for n in range(_DIGITS, 17) if len({f"{tick:.{n}g}" for tick in self.ticks}) == len(self.ticks))
        return f"{value:.{next(apart, 17)}g}".replace("-", "−")


def chosen(dataset: xarray.Dataset, name: str | None) -> str:
    """Return the name of the quantity to show: as given, or else sigma_1 or the status.

    Raises:
        MapError: the map does not have it.
    """
    known = [key for key in (*QUANTITIES, "reachable", "status") if key in dataset]
    if name is None:
        return "sigma_1" if "sigma_1" in known else "status"
    if name not in known:
        raise MapError(f"this map has no quantity '{name}'{did_you_mean(name, known)}")
    return name


def values_of(dataset: xarray.Dataset, name: str) -> Array:
    """Return a quantity in a map's cells, in the order of its axes; NaN where it is out of reach or infinite."""
    values = dataset[name].values.astype(float)
    if name == "status":
        return values
    return np.where(dataset["reachable"].values & np.isfinite(values), values, np.nan)


def shades(dataset: xarray.Dataset, name: str, values: Array) -> Shades:
    """Return shades for a quantity of a map.

    Args:
        dataset: the map.
        name: of the quantity.
        values: all that are to be shown, see `values_of`.
    """
    attributes = dataset[name].attrs
    text = _described(name, str(attributes.get("long_name", name)), str(attributes.get("units", "1")))
    known = values[np.isfinite(values)]
    viridis = matplotlib.colormaps["viridis"]
    if name == "status":
        present = [status for status in CellStatus if (values == status).any()]
        labels = [status.label.replace(" (", "\n(") for status in present]
        return _classes(name, text, [_STATUSES[status] for status in present], labels, np.array(present, float))
    if name == "reachable":
        return _classes(name, text, [REACHABLE], ["reachable"], np.ones(1))
    if name == "solutions":
        numbers = np.unique(known) if known.size else np.ones(1)
        colours = viridis(np.linspace(_DARKEST, 1.0, len(numbers)))
        return _classes(name, text, list(colours), [f"{number:.0f}" for number in numbers], numbers)
    return scaled(name, text, known, _SPAN if name in _LOGARITHMIC else np.inf)


def scaled(name: str, text: str, known: Array, span: float, far: float = _FAR) -> Shades:
    """Return shades for finite values.

    Args:
        name: of the quantity.
        text: description and unit.
        known: (n,) all that are to be shown.
        span: ratio of values: those of a larger one are shown on a logarithmic scale.
        far: part of the largest: if all values are above it, colours don't begin at 0.
    """
    shown = ListedColormap(matplotlib.colormaps["viridis"](np.linspace(_DARKEST, 1.0, 256)), "viridis")
    least, most, largest = 0.0, 1.0, 1.0
    if known.size:
        least, most, largest = float(known.min()), float(np.quantile(known, _MOST)), float(known.max())
    if largest <= 1.3 * most:
        most = largest
    extend = "max" if largest > most * (1.0 + _ALMOST) + _ALMOST else "neither"
    if least > 0.0 and most > span * least:
        ticks = _logarithmic_ticks(least, most)
        return Shades(name, text, shown, LogNorm(least, most), ticks, ticks, extend=extend)
    low = least if least > far * most else min(least, 0.0)
    if most - low <= _ALMOST * abs(most):
        most = low + max(abs(low), 1.0) * 1e-3
    ticks = _linear_ticks(low, most)
    levels = ticks[(ticks > low) & (ticks < most)]
    return Shades(name, text, shown, Normalize(low, most), levels, ticks, extend=extend)


def differing(text: str, unit: str, name: str, values: Array) -> Shades:
    """Return shades for the difference of a quantity: white is none."""
    known = np.abs(values[np.isfinite(values)])
    most = float(np.quantile(known, _MOST)) if known.size else 0.0
    most = most or float(known.max(initial=0.0)) or 1.0
    ticks = _linear_ticks(-most, most)
    extend = "both" if known.size and known.max() > most * (1.0 + _ALMOST) else "neither"
    text = _described(f"difference of {name}", text, unit)
    levels = ticks[np.abs(ticks) > _ALMOST * most]
    return Shades(name, text, matplotlib.colormaps["PuOr"], Normalize(-most, most), levels, ticks, extend=extend)


def pretty(name: str) -> str:
    """Return a quantity's name for paper."""
    return name.replace("sigma_1", "σ₁").replace("sigma_2", "σ₂").replace("_", " ")


def _described(name: str, text: str, unit: str) -> str:
    shown = "" if unit == "1" else f" ({unit.replace('s-1', 's⁻¹')})"
    short = text.partition(":")[0]
    return f"{short}{shown}" if short.startswith(name) else f"{pretty(name)}{shown}: {short}"


def _classes(name: str, text: str, colours: list[Any], labels: list[str], numbers: Array) -> Shades:
    """Return shades with a colour for each number."""
    between = 0.5 * (numbers[1:] + numbers[:-1])
    borders = np.r_[numbers[0] - 0.5, between, numbers[-1] + 0.5]
    ticks = 0.5 * (borders[1:] + borders[:-1])
    norm = BoundaryNorm(borders, len(numbers))
    return Shades(name, text, ListedColormap(colours), norm, np.zeros(0), ticks, tuple(labels))


def _linear_ticks(low: float, high: float) -> Array:
    """Return round numbers in a range."""
    ticks = np.asarray(MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(low, high))
    room = _ALMOST * (high - low)
    return ticks[(ticks >= low - room) & (ticks <= high + room)]


def _logarithmic_ticks(low: float, high: float) -> Array:
    """Return 1, 2, 5, 10, ... in a range; 1, 10, 100, ... in a long one."""
    ticks = np.asarray(
        LogLocator(subs=(1.0, 2.0, 5.0) if high < 1000.0 * low else (1.0,), numticks=20).tick_values(low, high)
    )
    return ticks[(ticks >= low) & (ticks <= high)]
