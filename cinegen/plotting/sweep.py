"""What a design sweep found: how much is reached, and how well, over the parameter that varies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.plotting.modes import DrawingError
from cinegen.plotting.stick import FAINT, INK
from cinegen.workspace.sweep import Row, Table, Variation
from raff2urdf.writer import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

REACH, WORST, MEAN, GOOD = "#0072b2", "#d55e00", "#56b4e9", "#009e73"
"""Okabe and Ito's blue, vermillion, sky blue and bluish green."""


def check_drawable(variations: Sequence[Variation]) -> None:
    """Whether there is a picture of what varies so, to be known before all of it is computed.

    Raises:
        DrawingError: neither one parameter varies nor two.
    """
    _check(sum(variation.count > 1 for variation in variations))


def draw_table(table: Table, size: float = 7.0) -> Figure:
    """A picture: extent with its error and dexterity in the wanted box, over the parameter; where two parameters vary,
    both as colours over the two. Variants that fail are crossed out: loops open, box not wholly reached, or singular.

    Args:
        table: what was found.
        size: width, inches.

    Raises:
        DrawingError: neither one parameter varies nor two.
    """
    from matplotlib.figure import Figure

    varied = [heading for heading in table.headings if len({row.values[heading] for row in table.rows}) > 1]
    _check(len(varied))
    flat = len(varied) == 2
    figure = Figure(figsize=(1.5 * size, 0.75 * size) if flat else (size, size), layout="constrained", dpi=150)
    (_surfaces if flat else _lines)(figure, table, varied)
    failing = ", crossed out what fails in the wanted box" if flat else ""
    figure.suptitle(f"Variants of {table.robot}{failing}", fontsize="medium", color=INK)
    return figure


def _check(varied: int) -> None:
    if varied not in (1, 2):
        raise DrawingError(f"a picture is of one parameter that varies, or of two; here {varied} do")


def _lines(figure: Any, table: Table, varied: list[str]) -> None:
    rows = sorted(table.rows, key=lambda row: row.values[varied[0]])
    x = np.array([row.values[varied[0]] for row in rows])
    above, below = figure.subplots(2, 1, sharex=True)
    errors = [row.extent.error if row.extent else np.nan for row in rows]
    above.errorbar(x, _extents(rows), errors, color=REACH, marker="o", markersize=4, capsize=3)
    above.set_ylabel(f"reached ({_raised(table.unit)})")
    above.set_ylim(bottom=0.0)
    for colour, words, of in ((WORST, "at worst", "worst"), (MEAN, "on average", "mean")):
        values = [getattr(row.dexterity.conditioning, of) if row.dexterity else np.nan for row in rows]
        below.plot(x, values, color=colour, marker="o", markersize=4, label=words)
    below.set_ylabel("1/condition in the wanted box")
    below.set_ylim(0.0, 1.0)
    below.set_xlabel(_named(varied[0], table))
    bad = [value for row, value in zip(rows, x, strict=True) if not row.good]
    good = [value for row, value in zip(rows, x, strict=True) if row.good]
    for axes in (above, below):
        marks = {"transform": axes.get_xaxis_transform(), "linestyle": "none", "clip_on": False, "zorder": 5}
        for at, marker, colour, words in ((bad, "x", INK, "fails in the box"), (good, "o", GOOD, "all of it, regular")):
            if at:  # what is empty is as large as all in matplotlib's eyes, and the axes would make room for it
                axes.plot(at, [0.0] * len(at), marker=marker, color=colour, label=words, **marks)
        axes.grid(color=FAINT, alpha=0.25)
    figure.legend(*below.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)


def _surfaces(figure: Any, table: Table, varied: list[str]) -> None:
    across, up = (sorted({row.values[heading] for row in table.rows}) for heading in varied)
    worst = [row.dexterity.conditioning.worst if row.dexterity else np.nan for row in table.rows]
    shown = (
        (_extents(table.rows), f"reached ({_raised(table.unit)})"),
        (np.array(worst), "1/condition in the box, at worst"),
    )
    for axes, (values, words) in zip(figure.subplots(1, 2, sharey=True), shown, strict=True):
        grid = np.full((len(up), len(across)), np.nan)
        for row, value in zip(table.rows, values, strict=True):
            k, i = up.index(row.values[varied[1]]), across.index(row.values[varied[0]])
            grid[k, i] = np.fmax(grid[k, i], value)
            if not row.good:
                axes.plot(i, k, marker="X", color=INK, markeredgecolor="white", markersize=9)
        image = axes.imshow(grid, origin="lower", aspect="auto", cmap="viridis", vmin=0.0)
        figure.colorbar(image, ax=axes, location="top", label=words)
        axes.set_xticks(range(len(across)), [number(value) for value in across], rotation=45)
        axes.set_yticks(range(len(up)), [number(value) for value in up])
        axes.set_xlabel(_named(varied[0], table))
    figure.axes[0].set_ylabel(_named(varied[1], table))


def _extents(rows: Iterable[Row]) -> Array:
    return np.array([row.extent.value if row.extent else np.nan for row in rows])


def _short(heading: str) -> str:
    """Of parameters that vary together the first stands for all."""
    first, *others = heading.split("+")
    return f"{first} and {len(others)} more" if others else first


def _named(heading: str, table: Table) -> str:
    """With its unit."""
    name = heading.split("+")[0].rpartition(".")[2]
    unit = {"theta": "°", "alpha": "°", "gamma": "°", "r": table.units, "d": table.units, "epsilon": table.units}
    return f"{_short(heading)} ({unit.get(name, 'as in the file')})"


def _raised(unit: str) -> str:
    return unit.replace("^2", "²").replace("^3", "³")
