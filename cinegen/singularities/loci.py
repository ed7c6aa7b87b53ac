"""`singular_loci`: the curves on a slice of its workspace where a mechanism is singular, refined between grid points.

The configurations of a grid are solved from neighbour to neighbour, beginning near home, so that they are all on home's
branch; `contour` finds the curves between them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count as counter
from typing import Any

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.html import table
from cinegen.singularities.branch import flood, neighbours
from cinegen.singularities.contour import SingularCurve, SingularityGrid
from cinegen.singularities.slice import Slice, SliceError
from cinegen.typed_json import as_json
from raff2urdf.errors import counted


@dataclass(frozen=True, eq=False, repr=False)
class SingularLoci:
    """Singularities on a slice.

    Attributes:
        of: the slice.
        u: (m,) values of the first axis.
        v: (n,) values of the second.
        q: (m, n, nq) configurations; NaN where there is none on home's branch.
        first: (m, n) smallest singular values of type 1.
        second: (m, n) and of type 2.
        curves: all that were found.
    """

    of: Slice
    u: Array
    v: Array
    q: Array
    first: Array
    second: Array
    curves: tuple[SingularCurve, ...]

    def __repr__(self) -> str:
        axes = " and ".join(axis.name for axis in self.of.axes)
        return f"<SingularLoci of {self.of.mechanism.name[:80]} over {axes[:60]}: {counted(len(self.curves), 'curve')}>"

    def _repr_html_(self) -> str:
        rows = [(c.kind.value, "branch ends" if c.border else "inside", len(c.points)) for c in self.curves]
        return table(repr(self), ("type", "where", "points"), rows)

    @property
    def reached(self) -> Bools:
        """(m, n) whether there is a configuration."""
        return np.asarray(np.isfinite(self.q).all(axis=2))

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON shows: m and rad."""
        return as_json(
            self, "u", "v",
            robot=self.of.mechanism.name,
            node=self.of.node,
            axes=[axis.name for axis in self.of.axes],
            fixed=self.of.given(*self.of.start()),
            **{"type 1": self.first, "type 2": self.second},
            curves=[as_json(curve, "kind", "border", "points", "q") for curve in self.curves],
        )  # fmt: skip


def singular_loci(of: Slice, count: int = 61, report: Callable[[float], None] | None = None) -> SingularLoci:
    """Find the singularities of a mechanism on a slice.

    Args:
        of: the slice.
        count: grid points along each axis.
        report: called with the part that is done, 0 to 1.

    Raises:
        SliceError: no point of the slice can be reached from home; or fewer than two grid points.
    """
    if count < 2:
        raise SliceError(f"a grid of {count} points has no cells: give 2 or more")
    u, v = (np.linspace(axis.low, axis.high, count) for axis in of.axes)
    progress = report or (lambda _: None)
    grid = SingularityGrid(of, u, v)
    _fill(grid, of, lambda part: progress(0.6 * part))
    curves = grid.curves(lambda part: progress(0.6 + 0.4 * part))
    return SingularLoci(of, u, v, grid.q.reshape(count, count, -1), *grid.values(), curves)


def _fill(grid: SingularityGrid, of: Slice, report: Callable[[float], None]) -> None:
    """Solve all points that can be reached from neighbour to neighbour."""
    points, q, done = grid.points, grid.q, counter(1)

    def reach(point: int, near: int) -> bool:
        end = None if np.isfinite(q[near]).all() else of.onward(points[point], points[near], q[point])
        if end is None:
            return False
        q[near] = end
        if (number := next(done)) % 64 == 0:
            report(number / len(q))
        return True

    flood([_first(grid, of)], neighbours((len(grid.u), len(grid.v))).tolist(), reach)


def _first(grid: SingularityGrid, of: Slice) -> int:
    """Solve the grid's point nearest to home, or another one around it; return its number."""
    start, home = np.array(of.start()), of.mechanism.q_home
    q_start = of.configuration(start, home)
    if q_start is None:
        q_start = of.from_home(of.given(*of.start()))
    away = ((grid.points - start) ** 2).sum(axis=1)
    for node in np.argsort(away, kind="stable")[:9].tolist():
        end = None if q_start is None else of.near(grid.points[node], q_start)
        if end is not None:
            grid.q[node] = end
            return int(node)
    axes = " and ".join(axis.name for axis in of.axes)
    at = ", ".join(f"{name} {value:.4g}" for name, value in of.coordinates(home).items())
    raise SliceError(
        f"{of.mechanism.name}: no point of this slice over {axes} can be reached from home: choose one nearer to "
        f"home, which is at {at}"
    )
