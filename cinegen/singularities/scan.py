"""`scan`: the curves on a slice of its workspace where a mechanism is singular, refined between the grid's points.

The configurations of a grid are solved from neighbour to neighbour, beginning near home, so that they are all on home's
branch; `contour` finds the curves between them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.singularities.contour import Curve, Grid, Node
from cinegen.singularities.crossing import of_end, of_passive_joints
from cinegen.singularities.slice import Slice, SliceError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Loci:
    """Singularities on a slice.

    Attributes:
        of: the slice.
        u: (m,) values of the first axis.
        v: (n,) values of the second.
        q: (m, n, nq) configurations; not a number where there is none on home's branch.
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
    curves: tuple[Curve, ...]

    @property
    def reached(self) -> NDArray[np.bool_]:
        """(m, n) where there is a configuration."""
        return np.asarray(np.isfinite(self.q).all(axis=2))

    def as_dict(self) -> dict[str, Any]:
        """As JSON has it: m and rad."""
        return {
            "robot": self.of.mechanism.name,
            "node": self.of.node,
            "axes": [axis.name for axis in self.of.axes],
            "held": self.of.given(*self.of.start()),
            "u": self.u.tolist(),
            "v": self.v.tolist(),
            "type 1": _numbers(self.first),
            "type 2": _numbers(self.second),
            "curves": [
                {
                    "kind": curve.kind.value,
                    "border": curve.border,
                    "points": curve.points.tolist(),
                    "q": curve.q.tolist(),
                }
                for curve in self.curves
            ],
        }


def scan(of: Slice, count: int = 61, say: Callable[[float], None] | None = None) -> Loci:
    """Singularities of a mechanism on a slice.

    Args:
        of: the slice.
        count: grid points along each axis.
        say: is told which part is done, 0 to 1.

    Raises:
        SliceError: no point of the slice can be reached from home; or fewer than two grid points.
    """
    if count < 2:
        raise SliceError(f"a grid of {count} points has no cells: give 2 or more")
    u, v = (np.linspace(axis.low, axis.high, count) for axis in of.axes)
    say = say or (lambda _: None)
    passive = of_passive_joints(of.mechanism) if of.mechanism.passive_rank else None
    grid = Grid(of, u, v, of_end(of.mechanism), passive)
    _fill(grid, of, lambda part: say(0.6 * part))
    return Loci(of, u, v, grid.q, *grid.values(), grid.curves(lambda part: say(0.6 + 0.4 * part)))


# --- the wave ----------------------------------------------------------------------------------------------------


def _fill(grid: Grid, of: Slice, say: Callable[[float], None]) -> None:
    """Solves all points that the wave comes to."""
    waiting, done = deque([_first(grid, of)]), 0
    while waiting:
        here = waiting.popleft()
        done += 1
        if done % 64 == 0:
            say(min(done / grid.q[..., 0].size, 1.0))
        for near in grid.near(*here):
            if np.isfinite(grid.q[near]).all():
                continue
            found = _onward(grid, here, near)
            if found is not None:
                grid.q[near] = found
                waiting.append(near)


def _first(grid: Grid, of: Slice) -> Node:
    """The grid's point nearest to home, solved; others around it where that can't be reached."""
    start = of.start()
    home = of.mechanism.q_home
    here = of.configuration(*start, home, np.inf)
    if here is None:
        here = of.led(of.given(*start))
    order = sorted(
        np.ndindex(len(grid.u), len(grid.v)),
        key=lambda ik: (grid.u[ik[0]] - start[0]) ** 2 + (grid.v[ik[1]] - start[1]) ** 2,
    )
    for i, k in order[:9]:
        found = of.configuration(float(grid.u[i]), float(grid.v[k]), here) if here is not None else None
        if found is not None:
            grid.q[i, k] = found
            return i, k
    axes = " and ".join(axis.name for axis in of.axes)
    raise SliceError(
        f"{of.mechanism.name}: no point of this slice over {axes} can be reached from home: choose one nearer to "
        f"home, which is at {_listed(of.coordinates(home))}"
    )


def _onward(grid: Grid, one: Node, other: Node) -> Array | None:
    """From one point to its neighbour, in one step or in several."""
    for steps in (1, 4, 16):
        there: Array | None = grid.q[one]
        for x in np.linspace(0.0, 1.0, steps + 1)[1:]:
            there = grid.step(there, *grid.place(one, other, x)) if there is not None else None
        if there is not None:
            return there
    return None


def _listed(values: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in values.items())


def _numbers(values: Array) -> list[list[float | None]]:
    return [[float(value) if np.isfinite(value) else None for value in row] for row in values]
