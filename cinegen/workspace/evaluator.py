"""`ChunkEvaluator`: all values of the cells of a chunk; and an estimate of the time that a map takes."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.batch import BatchEvaluator
from cinegen.singularities.ball_joints import balls
from cinegen.singularities.crossing import of_passive_joints
from cinegen.workspace.by_actuated_joints import ByActuatedJoints
from cinegen.workspace.by_pose import ByPose
from cinegen.workspace.cells import Cells, CellStatus
from cinegen.workspace.loads import LIMITED, REACTIONS
from cinegen.workspace.quantities import QUANTITIES
from cinegen.workspace.specification import MapSpecification
from raff2urdf.errors import counted

Values = NDArray[Any]

_LEAN = {"solutions", "sigma_1", "sigma_2", "margin", "solid_angle", "clearance", "frequency", *LIMITED, *REACTIONS}
"""Quantities that need neither placements, nor Jacobians, nor more than one singular value."""

_REACHABLE = [int(status) for status in CellStatus if status.reachable]
_TRIED = 200  # cells of a chunk that is tried for an estimate
_TRIALS = 5
_SIZES = ("B", "KiB", "MiB", "GiB", "TiB", "PiB")
_UNITS = (("years", 3.156e7), ("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0))


class ChunkEvaluator:
    """Evaluates chunks of a map; the values of a chunk do not depend on what was evaluated before.

    Args:
        spec: specification of the map.
    """

    def __init__(self, spec: MapSpecification) -> None:
        self.spec = spec
        threes = balls(spec.mechanism) if spec.mechanism.loops else ()
        lean = _LEAN.issuperset(spec.quantities) and (
            "sigma_1" not in spec.quantities or spec.rank == min(sum(spec.counted), spec.dof)
        )
        batch = BatchEvaluator(spec.mechanism, spec.node, *spec.counted, threes, "sigma_2" in spec.quantities, not lean)
        self._by = (ByActuatedJoints if spec.over_joints else ByPose)(spec, batch)

    def values(self, chunk: tuple[slice, ...]) -> dict[str, Values]:
        """Return the values (n, ...) of a chunk's cells by the name of each array, the last axis fastest."""
        cells = self._by.cells(chunk)
        if "sigma_2" in self.spec.quantities:
            self._complete_sigma_2(cells)
        reachable = np.isin(cells.status, _REACHABLE)
        arrays: dict[str, Values] = {}
        for name in self.spec.quantities:
            arrays[name] = QUANTITIES[name].of(cells)
            if name != "solutions":
                arrays[name][~reachable] = np.nan
        return {**arrays, "configuration": cells.evaluations.q, "reachable": reachable, "status": cells.status}

    def _complete_sigma_2(self, cells: Cells) -> None:
        """Compute sigma_2 where the batch evaluator can't: axes of a ball joint in a plane, dependent columns, a node
        that nothing controls."""
        q, sigma = cells.evaluations.q, cells.evaluations.passive_sigma
        if self.spec.is_uncontrolled:
            sigma[np.isfinite(q[:, 0])] = 0.0
        left = np.flatnonzero(np.isfinite(q[:, 0]) & ~np.isfinite(sigma))
        if len(left):
            rows = of_passive_joints(self.spec.mechanism)
            sigma[left] = [rows.sigma(rows.of(q[k])[None])[0] for k in left]


@dataclass(frozen=True)
class Estimate:
    """Cost of a map.

    Attributes:
        cells: number of cells.
        seconds: time on one core, s.
        size: bytes on disk before compression.
    """

    cells: int
    seconds: float
    size: float

    def text(self, cores: int = 1) -> str:
        """Return the estimate for people, for some number of cores."""
        on = counted(cores, "core")
        seconds = self.seconds / cores
        unit, length = next((pair for pair in _UNITS if seconds >= 2.0 * pair[1]), ("s", 1.0))
        power = min(max(0, int(math.log2(max(1.0, self.size / 0.9)) // 10)), len(_SIZES) - 1)
        size = f"{self.size / 2 ** (10 * power):.{2 if power else 0}f} {_SIZES[power]}"
        return f"{self.cells:.3g} cells take about {seconds / length:,.0f} {unit} on {on}, and up to {size}"


def estimate(spec: MapSpecification, maps: int = 1) -> Estimate:
    """Estimate the cost of some maps by a few small chunks, evenly in the region. Takes about a second.

    Args:
        spec: specification of a map.
        maps: number of such maps.
    """
    region, evaluator = spec.region, ChunkEvaluator(spec)
    side = max(1, round(_TRIED ** (1.0 / len(region.axes))))
    parts = list(product((0.5, 0.15, 0.85), repeat=len(region.axes)))
    tried, begin = 0, time.perf_counter()
    for part in parts[:: max(1, len(parts) // _TRIALS)][:_TRIALS]:
        first = [min(int(x * count), max(count - side, 0)) for x, count in zip(part, region.shape, strict=True)]
        chunk = tuple(slice(k, min(k + side, count)) for k, count in zip(first, region.shape, strict=True))
        evaluator.values(chunk)
        tried += math.prod(cells.stop - cells.start for cells in chunk)
    cells = maps * region.size
    of_quantities = sum(np.dtype(QUANTITIES[name].dtype).itemsize for name in spec.quantities)
    size = float(of_quantities + 8 * spec.mechanism.model.nq + 2)  # bytes of a cell
    return Estimate(cells, (time.perf_counter() - begin) / tried * cells, size * cells)
