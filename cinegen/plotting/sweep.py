"""`draw_sweep`: how much the variants of a design sweep reach, and how well, over the parameters that vary."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.plotting.modes import DrawingError
from cinegen.plotting.stick import FAINT, INK
from cinegen.workspace.sweep import SweepResult, VariantResult, Variation
from raff2urdf.writer import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

REACH, WORST, MEAN, SUITABLE = "#0072b2", "#d55e00", "#56b4e9", "#009e73"
"""Okabe and Ito's blue, vermillion, sky blue and bluish green."""


def check_drawable(variations: Sequence[Variation]) -> None:
    """Check that one parameter varies, or two, before a sweep is computed for a picture.

    Raises:
        DrawingError: another number of parameters varies.
    """
    _check(sum(variation.count > 1 for variation in variations))


def draw_sweep(result: SweepResult, size: float = 7.0) -> Figure:
    """Draw the extent with its error and the dexterity in the wanted box, over the parameter that varies.

    Where two parameters vary, both are colours over the two. Variants that are not suitable are crossed out: loops
    open, box not wholly reached, or singular.

    Args:
        result: of a sweep.
        size: width, inches.

    Raises:
        DrawingError: neither one parameter varies nor two.
    """
    from matplotlib.figure import Figure

    varied = [heading for heading in result.headings if len({row.values[heading] for row in result.rows}) > 1]
    _check(len(varied))
    flat = len(varied) == 2
    figure = Figure(figsize=(1.5 * size, 0.75 * size) if flat else (size, size), layout="constrained", dpi=150)
    (_surfaces if flat else _lines)(figure, result, varied)
    failing = ", crossed out what fails in the wanted box" if flat else ""
    figure.suptitle(f"Variants of {result.robot}{failing}", fontsize="medium", color=INK)
    return figure


def _check(varied: int) -> None:
    if varied not in (1, 2):
        raise DrawingError(f"a sweep is drawn over one parameter that varies, or two; here {varied} do")


def _lines(figure: Any, result: SweepResult, varied: list[str]) -> None:
    rows = sorted(result.rows, key=lambda row: row.values[varied[0]])
    x = np.array([row.values[varied[0]] for row in rows])
    above, below = figure.subplots(2, 1, sharex=True)
    errors = [row.extent.error if row.extent else np.nan for row in rows]
    above.errorbar(x, _extents(rows), errors, color=REACH, marker="o", markersize=4, capsize=3)
    above.set_ylabel(_reached(result))
    above.set_ylim(bottom=0.0)
    for colour, label, of in ((WORST, "worst", "worst"), (MEAN, "mean", "mean")):
        values = [getattr(row.dexterity.conditioning, of) if row.dexterity else np.nan for row in rows]
        below.plot(x, values, color=colour, marker="o", markersize=4, label=label)
    below.set_ylabel("1/condition in the wanted box")
    below.set_ylim(0.0, 1.0)
    below.set_xlabel(_label(varied[0], result))
    suitable = np.array([row.suitable for row in rows])
    for axes in (above, below):
        marks = {"transform": axes.get_xaxis_transform(), "linestyle": "none", "clip_on": False, "zorder": 5}
        for at, marker, colour, label in (
            (x[~suitable], "x", INK, "fails in the box"), (x[suitable], "o", SUITABLE, "whole box, regular"),
        ):  # fmt: skip
            if len(at):  # else matplotlib would make room for empty lines
                axes.plot(at, np.zeros(len(at)), marker=marker, color=colour, label=label, **marks)
        axes.grid(color=FAINT, alpha=0.25)
    figure.legend(*below.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)


def _surfaces(figure: Any, result: SweepResult, varied: list[str]) -> None:
    across, up = (sorted({row.values[heading] for row in result.rows}) for heading in varied)
    worst = [row.dexterity.conditioning.worst if row.dexterity else np.nan for row in result.rows]
    shown = ((_extents(result.rows), _reached(result)), (np.array(worst), "1/condition in the box, worst"))
    for axes, (values, label) in zip(figure.subplots(1, 2, sharey=True), shown, strict=True):
        grid = np.full((len(up), len(across)), np.nan)
        for row, value in zip(result.rows, values, strict=True):
            k, i = up.index(row.values[varied[1]]), across.index(row.values[varied[0]])
            grid[k, i] = np.fmax(grid[k, i], value)
            if not row.suitable:
                axes.plot(i, k, marker="X", color=INK, markeredgecolor="white", markersize=9)
        image = axes.imshow(grid, origin="lower", aspect="auto", cmap="viridis", vmin=0.0)
        figure.colorbar(image, ax=axes, location="top", label=label)
        axes.set_xticks(range(len(across)), [number(value) for value in across], rotation=45)
        axes.set_yticks(range(len(up)), [number(value) for value in up])
        axes.set_xlabel(_label(varied[0], result))
    figure.axes[0].set_ylabel(_label(varied[1], result))


def _extents(rows: Iterable[VariantResult]) -> Array:
    return np.array([row.extent.value if row.extent else np.nan for row in rows])


def _reached(result: SweepResult) -> str:
    return f"reached ({result.unit.replace('^2', '²').replace('^3', '³')})"


def _label(heading: str, result: SweepResult) -> str:
    """Return a heading with its unit; of parameters that vary together the first stands for all."""
    first, *others = heading.split("+")
    name = first.rpartition(".")[2]
    unit = result.units if name in ("r", "d", "epsilon") else "°" if name in ("theta", "alpha", "gamma") else ""
    return f"{first}{f' and {len(others)} more' if others else ''} ({unit or 'as in the file'})"
