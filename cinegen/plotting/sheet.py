"""The style of all pictures: colours; the sheet with its titles, legend and labels, none of them cut off."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.textpath import text_to_path

from raff2urdf.quantities import LENGTH, shown

INK, FAINT = "#2b3036", "#6b7178"
"""Colours of lines and texts; both are legible on white (contrast 13 and 4.9; WCAG 2.2 asks for 4.5)."""

BLUE, SKY, ORANGE, VERMILION, GREEN = "#0072b2", "#56b4e9", "#e69f00", "#d55e00", "#009e73"
"""Colours that colour-blind people distinguish (M. Okabe and K. Ito, "Color universal design", 2002)."""

LABEL = 8.33
"""Font size of labels, points."""

UNDER = 0.8
"""Height below axes for their labels and the legend, inches."""

_LARGE, _SMALL = 11.0, 8.5  # points
_LINE = 1.28  # line spacing, font sizes
_AROUND, _PAD = 0.15, 0.07  # inches, around titles and around everything else
_LEFT = 0.01  # of the width, left of titles
_INK = 0.96  # of the width, largest width of titles
_KEY = 0.6  # inches, width of a key in a legend
_COLUMNS = 6  # of a legend, most


class _PlainFigure(Figure):
    """A figure without formulas of its own."""

    def draw(self, renderer: Any) -> None:
        _without_formulas(self)
        super().draw(renderer)


def new_figure(**settings: Any) -> Figure:
    """Return an empty figure whose texts are shown as they are: to matplotlib, `$` would begin a formula.

    Args:
        settings: of `matplotlib.figure.Figure`.
    """
    return _PlainFigure(**settings)


def _without_formulas(figure: Any) -> None:
    """Show all texts as they are, but for the powers that matplotlib writes at logarithmic scales."""
    axes = [axis for panel in figure.axes for axis in (panel.xaxis, panel.yaxis) if axis.get_scale() == "log"]
    powers = {text for axis in axes for text in axis.get_ticklabels(which="both")}
    for text in set(figure.findobj(Text)) - powers:
        text.set_parse_math(False)


def sheet(wide: float, tall: float, first: str, second: str) -> tuple[Figure, Any]:
    """Return a figure with two titles, and the subfigure below them.

    Args:
        wide: width, inches.
        tall: height of the part below the titles, inches.
        first: bold title.
        second: second title.
    """
    first = wrapped(first, _INK * wide, _LARGE, "bold")
    second = wrapped(second, _INK * wide, _SMALL)
    lines = [points * _LINE * (text.count("\n") + 1) for text, points in ((first, _LARGE), (second, _SMALL))]
    figure = new_figure(figsize=(wide, tall + sum(lines) / 72.0 + 2.0 * _AROUND), dpi=150)
    figure.set_layout_engine("constrained", h_pad=_PAD)
    figure.suptitle(first, x=_LEFT, ha="left", fontsize=_LARGE, fontweight="bold", color=INK)
    body: Any = figure.subfigures()
    body.suptitle(second, x=_LEFT, ha="left", fontsize=_SMALL, color=INK)
    return figure, body


def label(axes: Any, x: str = "", y: str = "", *, room: float = np.inf, size: float | str = LABEL) -> None:
    """Label axes; the label of the vertical one is wrapped to `room` inches."""
    axes.set_xlabel(x, fontsize=size, color=INK)
    axes.set_ylabel(wrapped(y, room, LABEL), fontsize=size, color=INK)
    axes.tick_params(labelsize="small", color=INK)


def graph(wide: float, tall: float, columns: int = 1) -> tuple[Figure, Any]:
    """Return a figure without titles (inches), and its axes: side by side if there are several columns."""
    figure = new_figure(figsize=(wide, tall), dpi=150, layout="constrained")
    return figure, figure.subplots(1, columns)


def explain(
    figure: Figure, marks: Iterable[tuple[str, str, str]], scale: float, margin: float, below: float, size: float
) -> None:
    """Add what marks mean, at the lower left, and a bar of a round length at the lower right.

    Args:
        figure: in which all views have one scale.
        marks: colour, text and marker of each.
        scale: inches for a metre.
        margin: inches, to the left and right.
        below: inches.
        size: of the font, points.
    """
    (width, height), inches = figure.get_size_inches(), figure.dpi_scale_trans
    dots = [
        Line2D([], [], color=colour, label=text, marker=marker, markersize=4.5, linestyle="none")
        for colour, text, marker in marks
    ]
    figure.legend(
        handles=dots, loc="lower left", bbox_to_anchor=(margin / width, below / height), ncols=len(dots), frameon=False,
        fontsize=size, labelcolor=INK, borderpad=0.0, borderaxespad=0.0, handletextpad=0.0, columnspacing=1.0,
    )  # fmt: skip
    right, length, level = width - margin, round_length(0.8 / scale), below + 0.05
    bar = [right - length * scale, right]
    figure.add_artist(Line2D(bar, [level, level], color=INK, linewidth=1.5, transform=inches))
    text = shown(length, LENGTH)
    figure.text(sum(bar) / 2.0, level + 0.05, text, color=INK, fontsize=size, ha="center", transform=inches)


def finish(figure: Figure) -> Figure:
    """Add the legend, and lay the figure out once before it is drawn: the tick labels of an axis depend on its length,
    which depends on their size. Return the figure."""
    named: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, text in zip(*axes.get_legend_handles_labels(), strict=True):
            named.setdefault(text, handle)
    if named:
        room = figure.get_figwidth() - _KEY
        labels = [wrapped(text, room, LABEL) for text in named]
        figure.legend(
            named.values(), labels, loc="outside lower center", ncols=_columns(labels, room), frameon=False,
            fontsize=LABEL,
        )  # fmt: skip
    _without_formulas(figure)
    layout: Any = figure.get_layout_engine()
    layout.execute(figure)
    return figure


def round_length(metres: float) -> float:
    """Return the largest 1, 2 or 5 times a power of ten that is not longer."""
    power = 10.0 ** math.floor(math.log10(metres))
    return next(step * power for step in (5.0, 2.0, 1.0) if step * power <= metres * (1.0 + 1e-9))


def wrapped(text: str, room: float, points: float, weight: str = "normal") -> str:
    """Return a text wrapped to lines of at most `room` inches."""
    lines: list[str] = []
    for line in text.split("\n"):
        letters, parts = len(line), [line]
        while (wide := max(_inches(part, points, weight) for part in parts)) > room and letters > 1:
            letters = max(1, min(letters - 1, int(letters * room / wide)))
            parts = textwrap.wrap(line, letters) or [""]
        lines += parts
    return "\n".join(lines)


def _inches(line: str, points: float, weight: str = "normal") -> float:
    """Return the length of a line of text, inches."""
    wide, _, _ = text_to_path.get_text_width_height_descent(line, FontProperties(size=points, weight=weight), False)
    return float(wide) / 72.0


def _columns(labels: list[str], room: float) -> int:
    """Return the number of columns of a legend that fit into `room` inches."""
    wide = [max(_inches(line, LABEL) for line in text.split("\n")) + _KEY for text in labels]
    for columns in range(min(len(labels), _COLUMNS), 1, -1):
        if sum(part.max() for part in np.array_split(np.array(wide), columns)) <= room:
            return columns
    return 1
