"""What a map's panel has: its colours, a bar that explains them, a title, a legend."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.study.drawing.plane import Plane
from cinegen.study.drawing.shades import OUT, Shades
from cinegen.study.drawing.stick import INK
from cinegen.study.maps.settled import How

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_LARGE, _SMALL = 11.0, 8.5  # points
_LINE = 1.28  # from one line to the next, letters' heights
_COLUMNS = 5  # of a legend


def out_of_reach(dataset: xarray.Dataset) -> NDArray[np.bool_]:
    """Cells of which that is known."""
    return np.asarray(~dataset["reachable"].values & (dataset["settled"].values != How.NOT_YET))


def spans(cells: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """From where to where cells follow each other."""
    changes = np.flatnonzero(np.diff(np.r_[False, cells, False].astype(int)))
    return [(int(first), int(last)) for first, last in changes.reshape(-1, 2)]


def panel(plane: Plane, axes: Axes, dataset: xarray.Dataset, values: Array, look: Shades) -> Any:
    """Colours a map of two axes, and returns what a colour bar is of."""
    if look.name != "settled":
        plane.fill(axes, out_of_reach(dataset), OUT, "out of reach")
    return plane.shade(axes, values, look)


def bar(figure: Any, mesh: Any, axes: Any, look: Shades) -> None:
    """A colour bar; none where there is one colour."""
    if look.name == "reachable":
        return
    shown = figure.colorbar(mesh, ax=axes, shrink=0.82, aspect=28, pad=0.02, extend=look.extend)
    shown.ax.set_yticks(look.ticks, look.labels or [look.number(tick) for tick in look.ticks])
    shown.ax.minorticks_off()
    shown.ax.tick_params(labelsize="small", color=INK)
    shown.set_label(look.words, color=INK, fontsize="small")
    shown.outline.set_linewidth(0.5)


def title(axes: Axes, first: str, second: str) -> None:
    """Two of different weight above axes, from their left side on."""
    lines = second.count("\n") + 1
    axes.annotate(
        second, (0.0, 1.0), (0.0, 5.0), xycoords="axes fraction", textcoords="offset points", va="bottom",
        fontsize=_SMALL, color=INK,
    )  # fmt: skip
    axes.set_title(first, loc="left", fontsize=_LARGE, fontweight="bold", color=INK, pad=8.0 + _LINE * _SMALL * lines)


def legend(figure: Any) -> None:
    """What lines and colours are, below all."""
    named: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    if named:
        columns = min(len(named), _COLUMNS)
        figure.legend(
            named.values(), named.keys(), loc="outside lower center", ncols=columns, frameon=False, fontsize="small"
        )
