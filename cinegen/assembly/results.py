"""`AssemblyModes`: all configurations in which a mechanism can be assembled, and what is known of their number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.hexapod import SolutionCounts
from cinegen.html import table
from cinegen.model import Mechanism

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NearestConfiguration:
    """The configuration nearest to a closed one, where the mechanism can't be assembled.

    Attributes:
        q: (nq,) with the actuated joints at the values asked for.
        gap: the largest loop residual there, rad and characteristic lengths.
        message: what is missing where.
    """

    q: Array
    gap: float
    message: str


@dataclass(frozen=True, eq=False, repr=False)
class AssemblyModes(Sequence[Array]):
    """All real closed configurations q (nq,) for values of the actuated joints; a sequence, nearest to home first.

    Attributes:
        mechanism: that is assembled.
        actuated: (actuated,) the values, in `mechanism.actuated` order, rad and m.
        configurations: the modes, each closed to 1e-12.
        coincident: of each mode how many solutions coincide in it: 1, unless the values are singular (type 2).
        complete: whether it is proved that these are all: by elimination, or by as many solutions as a theorem allows.
        method: how they were computed, and why they are all, or what is missing or not excluded: a sentence.
        counts: what became of all complex solutions.
        closest: if there is no mode, the nearest configuration.
        trace_test: whether nothing is missing on the curves of configurations that were met from home and from random
            starts: the trace test closed, and no path was lost. That excludes neither other curves nor branches on
            which the mechanism moves freely. None if no trace test was needed.
    """

    mechanism: Mechanism
    actuated: Array
    configurations: tuple[Array, ...]
    coincident: tuple[int, ...]
    complete: bool
    method: str
    counts: SolutionCounts
    closest: NearestConfiguration | None = None
    trace_test: bool | None = None

    @overload
    def __getitem__(self, index: int) -> Array: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Array, ...]: ...
    def __getitem__(self, index: int | slice) -> Array | tuple[Array, ...]:
        return self.configurations[index]

    def __len__(self) -> int:
        return len(self.configurations)

    def __repr__(self) -> str:
        worth = "proved to be all" if self.complete else "not proved to be all"
        return f"<{len(self)} assembly mode{'s' * (len(self) != 1)} of {self.mechanism.name[:80]}, {worth}>"

    def _repr_html_(self) -> str:
        rows = []
        for number, (placement, count) in enumerate(zip(self.placements(), self.coincident, strict=True), 1):
            angles = np.degrees(pin.rpy.matrixToRpy(placement.rotation))
            values = *(f"{1e3 * value:.3f}" for value in placement.translation), *(f"{angle:.2f}" for angle in angles)
            rows.append((number, *values, count))
        header = "mode", "x (mm)", "y (mm)", "z (mm)", "roll (°)", "pitch (°)", "yaw (°)", "solutions"
        return table(f"{self!r}: {self.mechanism.end}. {self.method}", header, rows)

    def placements(self, node: str | None = None) -> list[pin.SE3]:
        """Return the placement of a node, by default the mechanism's end, in the world, mode by mode.

        Raises:
            UnknownNameError: no such node.
        """
        name = self.mechanism.end if node is None else node
        return [self.mechanism.placement(q, name) for q in self]

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: rad and m, and the end's placements."""
        return {
            "robot": self.mechanism.name,
            "actuated": dict(zip(self.mechanism.actuated, map(float, self.actuated), strict=True)),
            "complete": self.complete,
            "trace_test": self.trace_test,
            "method": self.method,
            "counts": vars(self.counts),
            "end": self.mechanism.end,
            "modes": [
                {
                    "joints": self.mechanism.values(q),
                    "position": placement.translation.tolist(),
                    "rotation": placement.rotation.tolist(),
                    "coincident": count,
                }
                for q, placement, count in zip(self, self.placements(), self.coincident, strict=True)
            ],
            "closest": self.closest
            and {"gap": self.closest.gap, "message": self.closest.message, "q": self.closest.q.tolist()},
        }
