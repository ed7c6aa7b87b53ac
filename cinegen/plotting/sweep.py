"""`draw_sweep`: extent and dexterity of the variants of a design sweep, over the parameters that vary."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from cinegen.arrays import Array
from cinegen.plotting.modes import DrawingError
from cinegen.plotting.sheet import BLUE, FAINT, GREEN, INK, LABEL, SKY, VERMILION, finish, label, sheet
from cinegen.user_units import raised
from cinegen.workspace.sweep import SweepResult, VariantResult, Variation
from raff2urdf.raff.writer import number


def check_drawable(variations: Sequence[Variation]) -> None:
    """Check that one parameter varies, or two, before a sweep is computed for a picture.

    Raises:
        DrawingError: another number of parameters varies.
    """
    _check(sum(variation.count > 1 for variation in variations))


def draw_sweep(result: SweepResult, size: float = 7.0, name: str | None = None) -> Figure:
    """Draw the extent with its error and the dexterity in the wanted box, over the parameter that varies.

    Where two parameters vary, both are colours over the two. Variants that are not suitable are crossed out: loops
    open, box not wholly reached, or singular.

    Args:
        result: of a sweep.
        size: width, inches.
        name: of the robot in the title; its own by default.

    Raises:
        DrawingError: neither one parameter varies nor two.
    """
    varied = [heading for heading in result.headings if len({row.values[heading] for row in result.rows}) > 1]
    _check(len(varied))
    flat = len(varied) == 2
    title = f"{name or result.robot}: variants"
    text = f"{len(result.suitable)} of {len(result.rows)} reach the whole wanted box without a singularity"
    figure, body = sheet(1.5 * size, 0.65 * size, title, text) if flat else sheet(size, 0.9 * size, title, text)
    (_surfaces if flat else _lines)(body, result, varied)
    return finish(figure)


def _check(varied: int) -> None:
    if varied not in (1, 2):
        raise DrawingError(f"a sweep is drawn over one parameter that varies, or two; here {varied} do")


def _lines(body: Any, result: SweepResult, varied: list[str]) -> None:
    rows = sorted(result.rows, key=lambda row: row.values[varied[0]])
    x = np.array([row.values[varied[0]] for row in rows])
    above, below = body.subplots(2, 1, sharex=True)
    errors = [row.extent.error if row.extent else np.nan for row in rows]
    above.errorbar(x, _extents(rows), errors, color=BLUE, marker="o", markersize=4, capsize=3)
    above.set_ylim(bottom=0.0)
    for colour, of in ((VERMILION, "worst"), (SKY, "mean")):
        values = [getattr(row.dexterity.conditioning, of) if row.dexterity else np.nan for row in rows]
        below.plot(x, values, color=colour, marker="o", markersize=4, label=of)
    below.set_ylim(0.0, 1.0)
    label(above, y=_reachable(result))
    label(below, _label(varied[0], result), "1/condition in the wanted box")
    suitable = np.array([row.suitable for row in rows])
    for axes in (above, below):
        for at, marker, colour, text in (
            (x[~suitable], "x", INK, "fails in the box"), (x[suitable], "o", GREEN, "whole box, regular"),
        ):  # fmt: skip
            if len(at):  # else matplotlib would make room for empty lines
                axes.plot(at, np.zeros(len(at)), marker=marker, color=colour, label=text, linestyle="none",
                          transform=axes.get_xaxis_transform(), clip_on=False, zorder=5)  # fmt: skip
        axes.grid(color=FAINT, alpha=0.25)


def _surfaces(body: Any, result: SweepResult, varied: list[str]) -> None:
    across, up = (sorted({row.values[heading] for row in result.rows}) for heading in varied)
    worst = [row.dexterity.conditioning.worst if row.dexterity else np.nan for row in result.rows]
    shown = ((_extents(result.rows), _reachable(result)), (np.array(worst), "1/condition in the wanted box, worst"))
    panels = body.subplots(1, 2, sharey=True)
    for axes, (values, text) in zip(panels, shown, strict=True):
        grid = np.full((len(up), len(across)), np.nan)
        for row, value in zip(result.rows, values, strict=True):
            k, i = up.index(row.values[varied[1]]), across.index(row.values[varied[0]])
            grid[k, i] = np.fmax(grid[k, i], value)
            if not row.suitable:
                axes.plot(i, k, marker="X", color=INK, markeredgecolor="white", markersize=9, linestyle="none",
                          label="fails in the wanted box")  # fmt: skip
        image = axes.imshow(grid, origin="lower", aspect="auto", cmap="viridis", vmin=0.0)
        body.colorbar(image, ax=axes, location="top").set_label(text, fontsize=LABEL, color=INK)
        axes.set_xticks(range(len(across)), [number(value) for value in across], rotation=45)
        axes.set_yticks(range(len(up)), [number(value) for value in up])
        label(axes, _label(varied[0], result), _label(varied[1], result) if axes is panels[0] else "")


def _extents(rows: Iterable[VariantResult]) -> Array:
    return np.array([row.extent.value if row.extent else np.nan for row in rows])


def _reachable(result: SweepResult) -> str:
    return f"reachable extent ({raised(result.unit)})"


def _label(heading: str, result: SweepResult) -> str:
    """Return a heading with its unit; of parameters that vary together the first stands for all."""
    first, *others = heading.split("+")
    name = first.rpartition(".")[2]
    unit = result.units if name in ("r", "d", "epsilon") else "°" if name in ("theta", "alpha", "gamma") else ""
    return f"{first}{f' and {len(others)} more' if others else ''} ({unit or 'as in the file'})"
