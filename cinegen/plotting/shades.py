"""`Shades`: colours, range and contour levels by which a map's quantity is shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cinegen.workspace.cells import CellStatus
from cinegen.workspace.errors import MapError
from cinegen.workspace.quantities import QUANTITIES
from raff2urdf.errors import did_you_mean

if TYPE_CHECKING:
    import xarray
    from matplotlib.colors import Colormap, Normalize

Array = NDArray[np.float64]

OUT = "#e9ebee"
"""Colour of unreachable cells."""

REACHED = "#7fa8c9"
"""Colour of reachable cells without another quantity."""

_LOGARITHMIC = ("condition", "force")
_SPAN = 4.0  # ratio of values: smaller ones are shown on a linear scale
_MOST = 0.99  # of all values: those beyond are shown as one
_FAR = 0.4  # of the largest: if all values are above, colours don't begin at 0
_DARKEST = 0.12  # of viridis: lines must be visible on it
_KINDS = {
    CellStatus.NOT_EVALUATED: "#ffffff",
    CellStatus.REACHABLE: "#56b4e9",
    CellStatus.REACHABLE_BY_SEARCH: "#0072b2",
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
        words: description and unit.
        colours: a matplotlib colormap.
        norm: from values to it.
        levels: drawn as lines; none for classes.
        ticks: values with a label.
        labels: of the ticks; none if the numbers are the labels.
        extend: sides on which values exceed the range, as for matplotlib's colour bars.
    """

    name: str
    words: str
    colours: Colormap
    norm: Normalize
    levels: Array
    ticks: Array
    labels: tuple[str, ...] = ()
    extend: str = "neither"

    @property
    def logarithmic(self) -> bool:
        """True for a logarithmic scale."""
        from matplotlib.colors import LogNorm

        return isinstance(self.norm, LogNorm)

    def number(self, value: float) -> str:
        """Return a level as a short text, with as many digits as distinguish all ticks."""
        apart = (n for n in range(_DIGITS, 17) if len({f"{tick:.{n}g}" for tick in self.ticks}) == len(self.ticks))
        return f"{value:.{next(apart, 17)}g}".replace("-", "−")


def chosen(dataset: xarray.Dataset, name: str | None) -> str:
    """A quantity's name: as given, or what is most worth a look.

    Raises:
        MapError: the map does not tell it.
    """
    known = [key for key in (*QUANTITIES, "reachable", "status") if key in dataset]
    if name is None:
        return "sigma_1" if "sigma_1" in known else "status"
    if name not in known:
        raise MapError(f"this map tells no '{name}'{did_you_mean(name, known)}")
    return name


def values_of(dataset: xarray.Dataset, name: str) -> Array:
    """A quantity in a map's cells, in the order of its axes; not a number where there is none to be shown: out of
    reach, or infinite."""
    values = dataset[name].values.astype(float)
    if name == "status":
        return values
    reached = dataset["reachable"].values
    return np.where(reached & np.isfinite(values), values, np.nan)


def shades(dataset: xarray.Dataset, name: str, values: Array) -> Shades:
    """Return shades for a quantity of a map.

    Args:
        dataset: the map.
        name: of the quantity.
        values: all that are to be shown, see `values_of`.
    """
    told = dataset[name].attrs
    words = _worded(name, str(told.get("long_name", name)), str(told.get("units", "1")))
    if name == "status":
        return _kinds(name, words, values)
    if name == "reachable":
        return _classes(name, words, [REACHED], ["reached"], np.ones(1))
    known = values[np.isfinite(values)]
    if name == "solutions":
        return _counts(name, words, known)
    return _continuous(name, words, known)


def differing(words: str, unit: str, name: str, values: Array) -> Shades:
    """Return shades for the difference of a quantity: white is none."""
    import matplotlib
    from matplotlib.colors import Normalize

    known = np.abs(values[np.isfinite(values)])
    most = float(np.quantile(known, _MOST)) if known.size else 0.0
    most = most or float(known.max(initial=0.0)) or 1.0
    ticks = _straight(-most, most)
    extend = "both" if known.size and known.max() > most * (1.0 + _ALMOST) else "neither"
    return Shades(name, _worded(f"difference of {name}", words, unit), matplotlib.colormaps["PuOr"],
                  Normalize(-most, most), ticks[np.abs(ticks) > _ALMOST * most], ticks, extend=extend)  # fmt: skip


def pretty(name: str) -> str:
    """Return a quantity's name for paper."""
    return name.replace("sigma_1", "σ₁").replace("sigma_2", "σ₂").replace("_", " ")


def _worded(name: str, words: str, unit: str) -> str:
    shown = "" if unit == "1" else f" ({unit.replace('s-1', 's⁻¹')})"
    said = words.partition(":")[0]
    return f"{said}{shown}" if said.startswith(name) else f"{pretty(name)}{shown}: {said}"


def _kinds(name: str, words: str, values: Array) -> Shades:
    there = [status for status in CellStatus if (values == status).any()]
    labels = [status.label.replace(" (", "\n(") for status in there]
    return _classes(name, words, [_KINDS[status] for status in there], labels, np.array(there, float))


def _counts(name: str, words: str, known: Array) -> Shades:
    import matplotlib

    numbers = np.unique(known) if known.size else np.ones(1)
    colours = matplotlib.colormaps["viridis"](np.linspace(_DARKEST, 1.0, len(numbers)))
    return _classes(name, words, list(colours), [f"{number:.0f}" for number in numbers], numbers)


def _classes(name: str, words: str, colours: list[object], labels: list[str], numbers: Array) -> Shades:
    """Return shades with a colour for each number."""
    from matplotlib.colors import BoundaryNorm, ListedColormap

    between = 0.5 * (numbers[1:] + numbers[:-1])
    borders = np.r_[numbers[0] - 0.5, between, numbers[-1] + 0.5]
    ticks = 0.5 * (borders[1:] + borders[:-1])
    return Shades(name, words, ListedColormap(colours), BoundaryNorm(borders, len(numbers)),  # type: ignore[arg-type]
                  np.zeros(0), ticks, tuple(labels))  # fmt: skip


def _continuous(name: str, words: str, known: Array) -> Shades:
    import matplotlib
    from matplotlib.colors import ListedColormap, LogNorm, Normalize

    colours = ListedColormap(matplotlib.colormaps["viridis"](np.linspace(_DARKEST, 1.0, 256)), "viridis")
    least, most = (float(known.min()), float(np.quantile(known, _MOST))) if known.size else (0.0, 1.0)
    largest = float(known.max()) if known.size else 1.0
    extend = "max" if largest > most * (1.0 + _ALMOST) + _ALMOST else "neither"
    if largest <= 1.3 * most:
        most, extend = largest, "neither"
    if name in _LOGARITHMIC and least > 0.0 and most > _SPAN * least:
        ticks = _steps(least, most)
        return Shades(name, words, colours, LogNorm(least, most), ticks, ticks, extend=extend)
    low = least if least > _FAR * most else min(least, 0.0)
    if most - low <= _ALMOST * abs(most):
        most = low + max(abs(low), 1.0) * 1e-3
    ticks = _straight(low, most)
    return Shades(name, words, colours, Normalize(low, most), ticks[(ticks > low) & (ticks < most)], ticks,
                  extend=extend)  # fmt: skip


def _straight(low: float, high: float) -> Array:
    """Return round numbers in a range."""
    from matplotlib.ticker import MaxNLocator

    ticks = np.asarray(MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(low, high))
    room = _ALMOST * (high - low)
    return ticks[(ticks >= low - room) & (ticks <= high + room)]


def _steps(low: float, high: float) -> Array:
    """Return 1, 2, 5, 10, ... in a range; 1, 10, 100, ... in a long one."""
    first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
    parts = (1.0, 2.0, 5.0) if last - first <= 3 else (1.0,)
    ticks = np.array([part * 10.0**power for power in range(first, last + 1) for part in parts])
    return ticks[(ticks >= low) & (ticks <= high)]
