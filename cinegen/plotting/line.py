"""`Line`: a map of one axis as a picture: bands of cells, and values as a curve."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cinegen.plotting.sheet import label
from cinegen.plotting.units import user_scale
from cinegen.workspace.specification import MapSpecification

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]


class Line:
    """The axis of a specification as the horizontal axis of a picture, mm or degrees.

    Args:
        spec: over one axis.
    """

    def __init__(self, spec: MapSpecification) -> None:
        (self._axis,) = spec.region.axes
        self._scale, self._unit = user_scale(spec.mechanism, self._axis.name)

    def fill(self, axes: Axes, cells: NDArray[np.bool_], colour: str, text: str, alpha: float = 1.0) -> None:
        """Fill the bands of cells (n,) with a colour that the legend explains by a text."""
        for first, last in _runs(cells):
            ends = self._axis.borders[[first, last]] * self._scale
            axes.axvspan(*ends, color=colour, alpha=alpha, linewidth=0.0, label=text)

    def curve(self, axes: Axes, values: Array, **style: Any) -> None:
        """Draw values (n,) as a line, and isolated values as dots."""
        u = self._axis.middles() * self._scale
        axes.plot(u, values, linewidth=1.6, **style)
        alone = [first for first, last in _runs(np.isfinite(values)) if last == first + 1]
        if alone:
            axes.plot(u[alone], values[alone], marker=".", linestyle="none", color=style["color"])

    def dress(self, axes: Axes, text: str, room: float) -> None:
        """Set the labels and the limits of axes; `text` is the vertical label, wrapped to `room` inches."""
        label(axes, f"{self._axis.name} ({self._unit})", text, room=room)
        axes.set_xlim(self._axis.low * self._scale, self._axis.high * self._scale)
        axes.spines[["top", "right"]].set_visible(False)


def _runs(cells: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the runs of successive cells (n,) as (first, end)."""
    changes = np.flatnonzero(np.diff(np.r_[False, cells, False].astype(int)))
    return [(int(first), int(last)) for first, last in changes.reshape(-1, 2)]
