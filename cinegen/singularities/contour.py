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
from functools import cache
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cinegen.model import Mechanism
from cinegen.singularities.crossing import Rows, crossings, turned
from cinegen.singularities.singularity import SingularityType

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

Node = tuple[int, int]
"""Indices of a grid point."""

Edge = tuple[Node, Node]
"""Between two neighbours on the grid."""

_SHORT = 2.0**-18  # of an edge: accuracy of a branch's end
_STEPS = 90  # at most, to a branch's end
_SINGULAR = 1e-4  # a singular value up to this is 0, where the point was found by bisection
_ZERO = 1e-9  # of a matrix: a singular value that is 0 within rounding
_NUDGE, _SLANTED = 1e-5, 0.618  # of a step of the grid; and of that, the second axis' part
_BEFORE = 0.999  # of the path to a border: a singularity nearer to it is the border
_END = 0.1  # a singular value below this, where a branch ends, is why it ends


class ConfigurationSurface(Protocol):
    """A surface of configurations, over two coordinates."""

    mechanism: Mechanism
    over_joints: bool
    """Whether the coordinates are actuated joints (else they are of a pose)."""

    def configuration(self, u: float, v: float, q: Array) -> Array | None:
        """Return the configuration (nq,) at a point, m or rad, on the branch of a q (nq,) near it; None if there is
        none."""

    def is_at(self, u: float, v: float, q: Array) -> bool:
        """Return whether q (nq,) is a configuration of a point."""


class SingularPoint(NamedTuple):
    """A singular point: its two coordinates (m or rad), and q (nq,) there."""

    u: float
    v: float
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


class SingularityGrid:
    """Configurations on a grid, and the singularities on the edges between them.

    Args:
        on: the surface.
        u: (m,) values of the first axis.
        v: (n,) values of the second.
        first: singular at type 1.
        second: singular at type 2; None if there are no passive joints.

    Attributes:
        q: (m, n, nq) configurations; NaN where there is none, as everywhere at first.
    """

    def __init__(self, on: ConfigurationSurface, u: Array, v: Array, first: Rows, second: Rows | None) -> None:
        self.on, self.u, self.v = on, u, v
        self.q = np.full((len(u), len(v), on.mechanism.model.nq), np.nan)
        kinds = [(SingularityType.TYPE_1, first), (SingularityType.TYPE_2, second)]
        self._rows = {kind: rows for kind, rows in kinds if rows is not None}
        # where two branches meet the surface's own coordinates are singular
        self._own = SingularityType.TYPE_2 if on.over_joints else SingularityType.TYPE_1

    def near(self, i: int, k: int) -> Iterator[Node]:
        """Return the neighbours of a point."""
        for a, b in ((i - 1, k), (i + 1, k), (i, k - 1), (i, k + 1)):
            if 0 <= a < len(self.u) and 0 <= b < len(self.v):
                yield a, b

    def place(self, one: Node, other: Node, x: float) -> tuple[float, float]:
        """Return the coordinates of a part x of the path from one point to another."""
        u = self.u[one[0]] + x * (self.u[other[0]] - self.u[one[0]])
        return float(u), float(self.v[one[1]] + x * (self.v[other[1]] - self.v[one[1]]))

    def step(self, q: Array, u: float, v: float) -> Array | None:
        """Return the configuration near q at a point; None if it lies on another branch: two meet where the surface's
        own coordinates are singular, type 1 for a pose and type 2 for joints, and no path connects them."""
        found, barrier = self.on.configuration(u, v, q), self._rows.get(self._own)
        if found is None or barrier is None:
            return found
        return None if turned(barrier, barrier.of(q), barrier.of(found)) else found

    # --- the curves ---------------------------------------------------------------------------------------------------

    def values(self) -> tuple[Array, Array]:
        """Return the smallest singular values (m, n) of type 1, and of type 2; NaN without a configuration."""
        return self._sigma(SingularityType.TYPE_1), self._sigma(SingularityType.TYPE_2)

    def curves(
        self, report: Callable[[float], None] | None = None, linked: Callable[[Array, Array], bool] | None = None,
        stopped: Callable[[Array], bool] | None = None, outside: Bools | None = None,
    ) -> tuple[SingularCurve, ...]:  # fmt: skip
        """Return all curves on the grid.

        Args:
            report: called with the part that is done, 0 to 1.
            linked: returns whether the configurations of two neighbours are on one branch; they are by default.
            stopped: returns, at the end of a branch, whether something else ends it there, such as a joint limit.
            outside: (m, n) where it is known that there is no configuration; wherever there is none by default.
        """
        reached: Bools = np.asarray(np.isfinite(self.q).all(axis=2))
        nothing: Bools = ~reached if outside is None else np.asarray(outside & ~reached)
        within = [(kind, rows, _matrices(rows, self.q)) for kind, rows in self._rows.items()]
        points: dict[tuple[SingularityType, bool], dict[Edge, list[SingularPoint]]] = {}
        edges = list(self._edges())
        for number, (one, other) in enumerate(edges):
            if report is not None and number % 64 == 0:
                report(number / len(edges))
            found: Iterable[tuple[SingularityType, bool, SingularPoint]] = ()
            if reached[one] and reached[other]:
                if linked is None or linked(self.q[one], self.q[other]):
                    found = self._between(one, other, within)
            elif reached[one] and nothing[other]:
                found = self._to_the_border(one, other, stopped)
            elif reached[other] and nothing[one]:
                found = self._to_the_border(other, one, stopped)
            for kind, border, point in found:
                points.setdefault((kind, border), {}).setdefault((one, other), []).append(point)
        curves = [
            SingularCurve(kind, np.array([(p.u, p.v) for p in chain]), np.array([p.q for p in chain]), border)
            for (kind, border), there in points.items()
            for chain in _chains(there, len(self.u), len(self.v))
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

    def _sigma(self, kind: SingularityType) -> Array:
        values, rows = np.full(self.q.shape[:2], np.nan), self._rows.get(kind)
        if rows is not None:
            for i, k in np.argwhere(np.isfinite(self.q).all(axis=2)):
                values[i, k] = rows.sigma(rows.of(self.q[i, k])[None])[0]
        return values

    def _edges(self) -> Iterator[Edge]:
        for node in np.ndindex(len(self.u), len(self.v)):
            yield from ((node, other) for other in self.near(*node) if other > node)

    def _between(
        self, one: Node, other: Node, within: list[tuple[SingularityType, Rows, Callable[[Node], tuple[Array, float]]]]
    ) -> Iterator[tuple[SingularityType, bool, SingularPoint]]:
        """Return the singularities between two points."""
        for kind, rows, at in within:
            (a, first), (b, second) = at(one), at(other)
            if first + second > np.linalg.norm(b - a):  # see `crossing.may_cross`
                continue
            singular = first <= _ZERO * np.linalg.norm(a), second <= _ZERO * np.linalg.norm(b)
            start, end = (self._nudged(n) if is_ else self.q[n] for n, is_ in zip((one, other), singular, strict=True))
            for crossing in crossings(rows, self._path(one, other, start=start, end=end)):
                point = SingularPoint(*self.place(one, other, crossing.x), crossing.q)
                if self._is_singular(rows, point):
                    yield kind, False, point

    def _nudged(self, node: Node) -> Array:
        """Return q (nq,) next to a grid point that is itself singular, always on the same side, so that all its edges
        agree on its side of the curve."""
        i, k = node
        u, v = self.u[i] + _NUDGE * (self.u[1] - self.u[0]), self.v[k] + _SLANTED * _NUDGE * (self.v[1] - self.v[0])
        found = self.on.configuration(float(u), float(v), self.q[node])
        return np.asarray(self.q[node] if found is None else found)

    def _is_singular(self, rows: Rows, point: SingularPoint) -> bool:
        """Return whether a point is singular, and on the surface: where both types meet, nothing closes between."""
        return self.on.is_at(*point) and bool(rows.sigma(rows.of(point.q)[None])[0] <= _SINGULAR)

    def _path(
        self, one: Node, other: Node, part: float = 1.0, start: Array | None = None, end: Array | None = None
    ) -> Callable[[float], Array]:
        """Return the path from one point towards another, a part of the distance, between their configurations unless
        others are given."""
        first, second = self.q[one] if start is None else start, self.q[other] if end is None else end

        def path(x: float) -> Array:
            if x in (0.0, 1.0):
                return np.asarray(second if x else first)
            guess = self.on.mechanism.interpolate(first, second, x)
            found = self.on.configuration(*self.place(one, other, part * x), guess)
            return found if found is not None else np.asarray(first if x < 0.5 else second)

        return path

    def _to_the_border(
        self, inside: Node, outside: Node, stopped: Callable[[Array], bool] | None
    ) -> Iterator[tuple[SingularityType, bool, SingularPoint]]:
        """Return where the branch ends between two points, and singularities of the other type before that."""
        part, q = self._border(inside, outside)
        kind = SingularityType.NONE if stopped is not None and stopped(q) else self._end(q)
        yield kind, True, SingularPoint(*self.place(inside, outside, part), q)
        for other, rows in self._rows.items() if part > 0.0 else ():
            if other is not self._own:
                for crossing in crossings(rows, self._path(inside, outside, part, end=q)):
                    point = SingularPoint(*self.place(inside, outside, part * crossing.x), crossing.q)
                    if crossing.x < _BEFORE and self._is_singular(rows, point):
                        yield other, False, point

    def _border(self, inside: Node, outside: Node) -> tuple[float, Array]:
        """Return the part of the path between two points on which the branch ends, and q (nq,) there."""
        part, length, q = 0.0, 0.5, np.asarray(self.q[inside])
        for _ in range(_STEPS):
            if length <= _SHORT:
                break
            ahead = min(part + length, 1.0)
            found = self.step(q, *self.place(inside, outside, ahead))
            if found is None:
                length *= 0.5
            elif ahead == 1.0:
                return ahead, found
            else:  # as long again: a step may have failed only because it was long
                part, q = ahead, found
        return part, q

    def _end(self, q: Array) -> SingularityType:
        """Return the singularity by which a branch ends at q (nq,): that of the surface's coordinates first."""
        for kind in sorted(self._rows, key=lambda kind: kind is not self._own):
            if self._rows[kind].sigma(self._rows[kind].of(q)[None])[0] < _END:
                return kind
        return SingularityType.NONE


def _matrices(rows: Rows, q: Array) -> Callable[[Node], tuple[Array, float]]:
    """Return a function of a grid point that returns its matrix, and the smallest singular value; computed once."""

    @cache
    def at(node: Node) -> tuple[Array, float]:
        matrix = rows.of(q[node])
        return matrix, float(rows.sigma(matrix[None])[0])

    return at


def _chains(found: dict[Edge, list[SingularPoint]], rows: int, columns: int) -> list[list[SingularPoint]]:
    """Return points on edges, joined across the cells that they bound into lines as long as possible."""
    links: dict[tuple[Edge, int], list[tuple[Edge, int]]] = {
        (edge, k): [] for edge, points in found.items() for k in range(len(points))
    }
    for i, k in np.ndindex(rows - 1, columns - 1):
        around = (
            ((i, k), (i + 1, k)), ((i + 1, k), (i + 1, k + 1)), ((i, k + 1), (i + 1, k + 1)), ((i, k), (i, k + 1)),
        )  # fmt: skip
        here = [(edge, n) for edge in around for n in range(len(found.get(edge, ())))]
        while len(here) > 1:
            one = here.pop(0)
            q = found[one[0]][one[1]].q
            away = [float(np.abs(found[edge][n].q - q).max()) for edge, n in here]
            nearest = here.pop(int(np.argmin(away)))
            links[one].append(nearest)
            links[nearest].append(one)
    chains, left = [], set(links)
    for first in sorted(links, key=lambda name: len(links[name])):  # ends of lines first, then rings
        if first not in left:
            continue
        left.discard(first)
        chain = [first]
        while onward := [name for name in links[chain[-1]] if name in left]:
            left.discard(onward[0])
            chain.append(onward[0])
        if len(chain) > 2 and first in links[chain[-1]]:
            chain.append(first)
        chains.append([found[edge][n] for edge, n in chain])
    return chains
