"""Parts of a map's picture: titles, panels, colour bar and legend."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.plotting.plane import Plane
from cinegen.plotting.shades import OUT, Shades
from cinegen.plotting.stick import INK
from cinegen.workspace.cells import CellStatus
from cinegen.workspace.region import GridAxis

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

LABEL = 8.33
"""Font size of labels, points."""

_LARGE, _SMALL = 11.0, 8.5  # points
_LINE = 1.28  # line spacing, font sizes
_AROUND, _PAD = 0.15, 0.07  # inches, around titles and around everything else
_LEFT = 0.01  # of the width, left of titles
_INK = 0.96  # of the width, largest width of titles
_KEY = 0.6  # inches, width of a key in a legend
_COLUMNS = 5  # of a legend, most


def out_of_reach(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Return the cells that were evaluated and are not reachable."""
    return np.asarray(~dataset["reachable"].values & (dataset["status"].values != CellStatus.NOT_EVALUATED))


def spans(cells: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the runs of successive cells as (first, end)."""
    changes = np.flatnonzero(np.diff(np.r_[False, cells, False].astype(int)))
    return [(int(first), int(last)) for first, last in changes.reshape(-1, 2)]


def panel(plane: Plane, axes: Axes, dataset: xarray.Dataset, values: Array, look: Shades) -> Any:
    """Colour a map of two axes; return the object that a colour bar explains."""
    if look.name != "status":
        plane.fill(axes, out_of_reach(dataset), OUT, "out of reach")
    return plane.shade(axes, values, look)


def bar(figure: Any, mesh: Any, axes: Any, look: Shades, tall: float) -> None:
    """Draw a colour bar whose label is wrapped to `tall` inches; none for a single colour."""
    if look.name == "reachable":
        return
    shown = figure.colorbar(mesh, ax=axes, shrink=0.82, aspect=28, pad=0.02, extend=look.extend)
    shown.ax.set_yticks(look.ticks, look.labels or [look.number(tick) for tick in look.ticks])
    shown.ax.minorticks_off()
    shown.ax.tick_params(labelsize="small", color=INK)
    shown.set_label(wrapped(look.words, tall, LABEL), color=INK, fontsize=LABEL)
    shown.outline.set_linewidth(0.5)


def sheet(wide: float, tall: float, first: str, second: str) -> tuple[Figure, Any]:
    """Return a figure with two titles, and the subfigure below them.

    Args:
        wide: width, inches.
        tall: height of the part below the titles, inches.
        first: bold title.
        second: second title.
    """
    from matplotlib.figure import Figure

    first = wrapped(first, _INK * wide, _LARGE, "bold")
    second = wrapped(second, _INK * wide, _SMALL)
    lines = [points * _LINE * (words.count("\n") + 1) for words, points in ((first, _LARGE), (second, _SMALL))]
    figure = Figure(figsize=(wide, tall + sum(lines) / 72.0 + 2.0 * _AROUND), dpi=150)
    figure.set_layout_engine("constrained", h_pad=_PAD)
    figure.suptitle(first, x=_LEFT, ha="left", fontsize=_LARGE, fontweight="bold", color=INK)
    body: Any = figure.subfigures()
    body.suptitle(second, x=_LEFT, ha="left", fontsize=_SMALL, color=INK)
    return figure, body


def wrapped(words: str, room: float, points: float, weight: str = "normal") -> str:
    """Return a text wrapped to lines of at most `room` inches."""
    found: list[str] = []
    for line in words.split("\n"):
        letters, parts = len(line), [line]
        while (wide := max(_inches(part, points, weight) for part in parts)) > room and letters > 1:
            letters = max(1, min(letters - 1, int(letters * room / wide)))
            parts = textwrap.wrap(line, letters) or [""]
        found += parts
    return "\n".join(found)


def _inches(line: str, points: float, weight: str = "normal") -> float:
    """Return the length of a line of text, inches."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    wide, _, _ = text_to_path.get_text_width_height_descent(line, FontProperties(size=points, weight=weight), False)
    return float(wide) / 72.0


def curve(axes: Axes, axis: GridAxis, scale: float, values: Array, **style: Any) -> None:
    """Draw values over one axis as a line, and isolated values as dots."""
    u, there = axis.middles() * scale, np.isfinite(values)
    axes.plot(u, values, **style)
    alone = [first for first, last in spans(there) if last == first + 1]
    if alone:
        axes.plot(u[alone], values[alone], marker=".", linestyle="none", color=style.get("color"))


def finish(figure: Any) -> None:
    """Add the legend, and lay the figure out once before it is drawn: the tick labels of an axis depend on its length,
    which depends on their size."""
    _legend(figure)
    figure.get_layout_engine().execute(figure)


def _legend(figure: Any) -> None:
    named: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    if named:
        room = figure.get_figwidth() - _KEY
        labels = [wrapped(label, room, LABEL) for label in named]
        figure.legend(
            named.values(), labels, loc="outside lower center", ncols=_columns(labels, room), frameon=False,
            fontsize=LABEL,
        )  # fmt: skip


def _columns(labels: list[str], room: float) -> int:
    """Return the number of columns of a legend that fit into `room` inches."""
    wide = [max(_inches(line, LABEL) for line in label.split("\n")) + _KEY for label in labels]
    for columns in range(min(len(labels), _COLUMNS), 1, -1):
        if sum(part.max() for part in np.array_split(np.array(wide), columns)) <= room:
            return columns
    return 1
