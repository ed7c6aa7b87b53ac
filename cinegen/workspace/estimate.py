"""`estimate`: how long a map will take, and how large it will be, before it is begun."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from itertools import product

from cinegen.workspace.quantities import QUANTITIES
from cinegen.workspace.specification import MapSpecification
from cinegen.workspace.work import Surveyor

_CELLS = 200  # of a piece that is tried
_PIECES = 5


@dataclass(frozen=True)
class Estimate:
    """Of a map.

    Attributes:
        cells: how many.
        seconds: of one core.
        size: bytes on disk, before they are compressed.
    """

    cells: int
    seconds: float
    size: float

    def words(self, cores: int = 1) -> str:
        """In words, for so many cores."""
        return (
            f"{self.cells:.3g} cells take about {_time(self.seconds / cores)} on {cores} core{'s' * (cores != 1)}, "
            f"and up to {_size(self.size)}"
        )


def estimate(spec: MapSpecification, maps: int = 1) -> Estimate:
    """Tries a few small pieces, evenly through the region; takes about a second.

    Args:
        specification: of a map.
        maps: how many of them.
    """
    region, surveyor = spec.region, Surveyor(spec)
    side = max(1, round(_CELLS ** (1.0 / len(region.axes))))
    tried, spent = 0, 0.0
    places = list(product((0.5, 0.15, 0.85), repeat=len(region.axes)))
    step = max(1, len(places) // _PIECES)
    for place in places[::step][:_PIECES]:
        piece = []
        for part, count in zip(place, region.shape, strict=True):
            first = min(int(part * count), max(count - side, 0))
            piece.append(slice(first, min(first + side, count)))
        begin = time.perf_counter()
        surveyor.values(tuple(piece))
        spent += time.perf_counter() - begin
        tried += math.prod(s.stop - s.start for s in piece)
    cells = maps * region.size
    return Estimate(cells, spent / tried * cells, bytes_of_cell(spec) * cells)


def bytes_of_cell(spec: MapSpecification) -> float:
    """Before they are compressed."""
    import numpy as np

    own = sum(np.dtype(QUANTITIES[name].dtype).itemsize for name in spec.quantities)
    return float(own + 8 * spec.mechanism.model.nq + 2)


def _time(seconds: float) -> str:
    for unit, length in (("years", 3.156e7), ("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 2.0 * length:
            return f"{seconds / length:,.0f} {unit}"
    return f"{seconds:.0f} s"


def _size(size: float) -> str:
    for unit, bytes_ in (("PB", 1e15), ("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if size >= bytes_:
            return f"{size / bytes_:,.0f} {unit}"
    return f"{size / 1e3:,.0f} kB"
