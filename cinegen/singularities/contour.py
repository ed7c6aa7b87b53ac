"""`SingularityGrid`: the curves along which a mechanism is singular, on a grid of configurations, refined between them.

On the edge between two neighbours a singular value that changes its sign is found by its singular vectors (`crossing`),
and the point by bisection, on the surface of the grid. Where a neighbour has no configuration, the point where the
branch ends is found likewise: it is singular there too, or ends for another reason. Points on the edges of a cell are
joined to lines, as by marching squares. (A contour library needs one signed number at each grid point. Here the sign is
known between neighbours only, and an edge may be crossed twice.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.singularities.branch import BranchTracker, neighbours
from cinegen.singularities.crossing import Rows, can_vanish
from cinegen.singularities.singularity import SingularityType

Edge = tuple[int, int]
"""Numbers of two neighbours on the grid, the smaller one first."""

_SHORT = 2.0**-18  # of an edge: accuracy of a branch's end
_STEPS = 90  # at most, to a branch's end
_ZERO = 1e-9  # of a matrix: a singular value that is 0 within rounding
_NUDGE, _SLANTED = 1e-5, 0.618  # of a step of the grid; and of that, the second axis' part
_BEFORE = 0.999  # of the path to a border: a singularity nearer to it is the border
_END = 0.1  # a singular value below this, where a branch ends, is why it ends


class SingularPoint(NamedTuple):
    """A singular point: its coordinates (2,), m or rad, and q (nq,) there."""

    values: Array
    q: Array


@dataclass(frozen=True, eq=False)
class SingularCurve:
    """A curve of singularities.

    Attributes:
        kind: TYPE_1, TYPE_2, or NONE for a border of the reachable region that is not singular.
        points: (n, 2) on the two axes, m or rad, one after the other.
        q: (n, nq) there.
        border: whether the branch ends there.
    """

    kind: SingularityType
    points: Array
    q: Array
    border: bool

    def __repr__(self) -> str:
        return f"<SingularCurve: {self.kind.value}, {len(self.points)} points{', a border' * self.border}>"


class SingularityGrid:
    """Configurations on a grid, and the singularities on the edges between them. Points are numbered with the second
    axis fastest.

    Args:
        on: configurations over two coordinates.
        u: (m,) values of the first.
        v: (n,) values of the second.

    Attributes:
        points: (m n, 2) coordinates of the points, m or rad.
        q: (m n, nq) configurations; NaN where there is none, as everywhere at first.
    """

    def __init__(self, on: BranchTracker, u: Array, v: Array) -> None:
        self.on, self.u, self.v = on, u, v
        self.points: Array = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        self.q = np.full((len(self.points), on.mechanism.model.nq), np.nan)
        kinds = [(SingularityType.TYPE_1, on.end), (SingularityType.TYPE_2, on.passive)]
        self._rows = {kind: rows for kind, rows in kinds if rows is not None}
        # where two branches meet the grid's own coordinates are singular
        self._kind = SingularityType.TYPE_2 if on.over_joints else SingularityType.TYPE_1
        self._sigma = {kind: np.full(len(self.points), np.nan) for kind, _ in kinds}

    def values(self) -> tuple[Array, Array]:
        """Return the smallest singular values (m, n) of type 1, and of type 2, after `curves`; NaN without a
        configuration."""
        first, second = (sigma.reshape(len(self.u), len(self.v)) for sigma in self._sigma.values())
        return first, second

    def curves(
        self, report: Callable[[float], None] | None = None, linked: Callable[[Array, Array], bool] | None = None,
        stopped: Callable[[Array], bool] | None = None, outside: Bools | None = None,
    ) -> tuple[SingularCurve, ...]:  # fmt: skip
        """Return all curves on the grid.

        Args:
            report: called with the part that is done, 0 to 1.
            linked: returns whether the configurations of two neighbours are on one branch; they are by default.
            stopped: returns, at the end of a branch, whether something else ends it there, such as a joint limit.
            outside: (m n,) where it is known that there is no configuration; wherever there is none by default.
        """
        reached: Bools = np.asarray(np.isfinite(self.q).all(axis=1))
        nothing: Bools = ~reached if outside is None else np.asarray(outside & ~reached)
        matrices = {kind: self._matrices(kind, rows, reached) for kind, rows in self._rows.items()}
        points: dict[tuple[SingularityType, bool], dict[Edge, list[SingularPoint]]] = {}
        near = enumerate(neighbours((len(self.u), len(self.v))).tolist())
        edges = [(first, second) for first, others in near for second in others if second > first]
        for number, (first, second) in enumerate(edges):
            if report is not None and number % 64 == 0:
                report(number / len(edges))
            between: Iterable[tuple[SingularityType, bool, SingularPoint]] = ()
            if reached[first] and reached[second]:
                if linked is None or linked(self.q[first], self.q[second]):
                    between = self._between(first, second, matrices)
            elif reached[first] and nothing[second]:
                between = self._to_the_border(first, second, stopped)
            elif reached[second] and nothing[first]:
                between = self._to_the_border(second, first, stopped)
            for kind, border, point in between:
                points.setdefault((kind, border), {}).setdefault((first, second), []).append(point)
        curves = [
            SingularCurve(kind, np.array([p.values for p in chain]), np.array([p.q for p in chain]), border)
            for (kind, border), by_edge in points.items()
            for chain in _chains(by_edge, len(self.u), len(self.v))
        ]
        return tuple(curve for curve in curves if not self._is_stray(curve, curves))

    def _is_stray(self, curve: SingularCurve, curves: list[SingularCurve]) -> bool:
        """Return whether a curve is a single point next to a border of the same kind: the same curve seen from
        inside."""
        if len(curve.points) > 1 or curve.border:
            return False
        cell = 1.5 * np.array([self.u[1] - self.u[0], self.v[1] - self.v[0]])
        borders = [other.points for other in curves if other.border and other.kind is curve.kind]
        return any((np.abs(points - curve.points[0]) <= cell).all(axis=1).any() for points in borders)

    def _matrices(self, kind: SingularityType, rows: Rows, reached: Bools) -> dict[int, Array]:
        """Return the matrix of each grid point with a configuration, after its smallest singular value is noted."""
        matrices = {node: rows.of(self.q[node]) for node in np.flatnonzero(reached).tolist()}
        for node, matrix in matrices.items():
            self._sigma[kind][node] = rows.sigma(matrix[None])[0]
        return matrices

    def _between(
        self, first: int, second: int, matrices: dict[SingularityType, dict[int, Array]]
    ) -> Iterator[tuple[SingularityType, bool, SingularPoint]]:
        """Return the singularities between two points."""
        for kind, of in matrices.items():
            sigma = self._sigma[kind]
            if not can_vanish(sigma[first], sigma[second], np.linalg.norm(of[second] - of[first])):
                continue
            start, end = (
                self._nudged(node) if sigma[node] <= _ZERO * np.linalg.norm(of[node]) else self.q[node]
                for node in (first, second)
            )
            for _, point in self._singular(kind, (self.points[first], self.points[second]), (start, end)):
                yield kind, False, point

    def _singular(
        self, kind: SingularityType, line: tuple[Array, Array], ends: tuple[Array, Array]
    ) -> Iterator[tuple[float, SingularPoint]]:
        """Yield the singular points of one type on a straight line between two points: the part of the line, from 0 to
        1, and the point.

        Args:
            kind: the type.
            line: (2,) coordinates of both points, m or rad.
            ends: (nq,) configurations there.
        """
        rows = self._rows[kind]
        for crossing in self.on.crossings(rows, *line, ends):
            if self.on.is_singular(rows, crossing, ends):
                yield crossing.x, SingularPoint(line[0] + crossing.x * (line[1] - line[0]), crossing.q)

    def _nudged(self, node: int) -> Array:
        """Return q (nq,) next to a grid point that is itself singular, always on the same side, so that all its edges
        agree on its side of the curve."""
        aside = _NUDGE * np.array([self.u[1] - self.u[0], _SLANTED * (self.v[1] - self.v[0])])
        q = self.on.near(self.points[node] + aside, self.q[node])
        return self.q[node] if q is None else q

    def _to_the_border(
        self, inside: int, outside: int, stopped: Callable[[Array], bool] | None
    ) -> Iterator[tuple[SingularityType, bool, SingularPoint]]:
        """Return where the branch ends between two points, and singularities of the other type before that."""
        border, q = self._border(self.points[inside], self.points[outside], self.q[inside])
        kind = SingularityType.NONE if stopped is not None and stopped(q) else self._end(q)
        yield kind, True, SingularPoint(border, q)
        if (border == self.points[inside]).all():
            return
        for other in self._rows.keys() - {self._kind}:
            for x, point in self._singular(other, (self.points[inside], border), (self.q[inside], q)):
                if x < _BEFORE:
                    yield other, False, point

    def _border(self, inside: Array, outside: Array, q: Array) -> tuple[Array, Array]:
        """Return the point (2,) between two others at which the branch of q (nq,) ends, and the configuration there."""
        part, length = 0.0, 0.5
        for _ in range(_STEPS):
            if length <= _SHORT:
                break
            ahead = min(part + length, 1.0)
            moved = self.on.step(inside + ahead * (outside - inside), q)
            if moved is None:
                length *= 0.5
            else:  # as long again: a step may have failed only because it was long
                part, q = ahead, moved
                if part == 1.0:
                    break
        return inside + part * (outside - inside), q

    def _end(self, q: Array) -> SingularityType:
        """Return the singularity by which a branch ends at q (nq,): that of the surface's coordinates first."""
        for kind in sorted(self._rows, key=lambda kind: kind is not self._kind):
            if self._rows[kind].sigma(self._rows[kind].of(q)[None])[0] < _END:
                return kind
        return SingularityType.NONE


def _chains(crossings: dict[Edge, list[SingularPoint]], rows: int, columns: int) -> list[list[SingularPoint]]:
    """Return points on edges of the grid, joined across the cells that they bound into lines as long as possible.

    In each cell, points on its four edges are joined in pairs, to the one whose configuration is nearest: so each point
    has at most two links, by the cells on both sides of its edge. Lines then follow the links; a line that returns to
    its first point has it at the end again.

    Args:
        crossings: points on each edge; point (i, k) of the grid has the number i columns + k.
        rows: number of the grid's points along the first axis.
        columns: along the second.
    """
    links: dict[tuple[Edge, int], list[tuple[Edge, int]]] = {
        (edge, n): [] for edge, points in crossings.items() for n in range(len(points))
    }
    for i, k in np.ndindex(rows - 1, columns - 1):
        corner = i * columns + k
        opposite = corner + columns + 1
        edges = ((corner, opposite - 1), (opposite - 1, opposite), (corner + 1, opposite), (corner, corner + 1))
        unpaired = [(edge, n) for edge in edges for n in range(len(crossings.get(edge, ())))]
        while len(unpaired) > 1:
            point = unpaired.pop(0)
            q = crossings[point[0]][point[1]].q
            away = [float(np.abs(crossings[edge][n].q - q).max()) for edge, n in unpaired]
            nearest = unpaired.pop(int(np.argmin(away)))
            links[point].append(nearest)
            links[nearest].append(point)
    chains, unused = [], set(links)
    for first in sorted(links, key=lambda point: len(links[point])):  # ends of lines first, then rings
        if first not in unused:
            continue
        unused.discard(first)
        chain = [first]
        while onward := [point for point in links[chain[-1]] if point in unused]:
            unused.discard(onward[0])
            chain.append(onward[0])
        if len(chain) > 2 and first in links[chain[-1]]:
            chain.append(first)
        chains.append([crossings[edge][n] for edge, n in chain])
    return chains
