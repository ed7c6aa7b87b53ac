"""`Grid`: the curves along which a mechanism is singular, through a grid of its configurations, refined between them.

On the edge between two neighbours a singular value that changes its sign is found by its singular vectors (`crossing`),
and the place by bisection, on the surface that the grid lies on. Where a neighbour has no configuration, the place
where the branch ends is found likewise: it is singular there too, or ends for another reason. Points on the edges of a
cell are joined to lines, as by marching squares.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cinegen.model import Mechanism
from cinegen.singularities.crossing import Rows, crossings, turned
from cinegen.singularities.singularity import Kind

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

Node = tuple[int, int]
"""Of the grid."""

Edge = tuple[Node, Node]
"""Between two neighbours on the grid."""

_SHORT = 2.0**-18  # of an edge: a branch's end is that near
_STEPS = 90  # on the way there, at most
_SINGULAR = 1e-4  # a singular value up to this is 0, where the place was found by bisection
_ZERO = 1e-9  # of a matrix: a singular value that is 0 but for rounding
_NUDGE, _SLANTED = 1e-5, 0.618  # of a step of the grid; and of that, the second axis' part
_BEFORE = 0.999  # of the way to a border: what is singular nearer to it is the border
_END = 0.1  # a singular value below this, where a branch ends, is why it ends


class Surface(Protocol):
    """Two coordinates of a mechanism vary on it."""

    mechanism: Mechanism
    of_motors: bool

    def configuration(self, u: float, v: float, q: Array) -> Array | None:
        """(nq,) at a point, m or rad, on the branch of a q (nq,) near it; None where there is none."""

    def is_at(self, u: float, v: float, q: Array) -> bool:
        """Whether q (nq,) is a configuration of a point."""


class Point(NamedTuple):
    """A singular place: on the two axes (m or rad), and q (nq,) there."""

    u: float
    v: float
    q: Array


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of singularities.

    Attributes:
        kind: TYPE_1, TYPE_2, or NONE for a border of what can be reached that is not singular.
        points: (n, 2) on the two axes, m or rad, one after the other.
        q: (n, nq) there.
        border: whether the branch ends there.
    """

    kind: Kind
    points: Array
    q: Array
    border: bool


class Grid:
    """Configurations on a grid, and what lies on the edges between them.

    Args:
        on: the surface.
        u: (m,) values of the first axis.
        v: (n,) values of the second.
        first: singular at type 1.
        second: singular at type 2; None where nothing is passive.

    Attributes:
        q: (m, n, nq) configurations; not a number where there is none, as everywhere at first.
    """

    def __init__(self, on: Surface, u: Array, v: Array, first: Rows, second: Rows | None) -> None:
        self.on, self.u, self.v = on, u, v
        self.q = np.full((len(u), len(v), on.mechanism.model.nq), np.nan)
        self._first, self._second = first, second
        self._model = on.mechanism.model

    def near(self, i: int, k: int) -> Iterator[Node]:
        """The neighbours of a point."""
        for a, b in ((i - 1, k), (i + 1, k), (i, k - 1), (i, k + 1)):
            if 0 <= a < len(self.u) and 0 <= b < len(self.v):
                yield a, b

    def place(self, one: Node, other: Node, x: float) -> tuple[float, float]:
        """On the two axes, a part x of the way from one point to another."""
        u = self.u[one[0]] + x * (self.u[other[0]] - self.u[one[0]])
        return float(u), float(self.v[one[1]] + x * (self.v[other[1]] - self.v[one[1]]))

    def step(self, q: Array, u: float, v: float) -> Array | None:
        """The configuration near q at a place; None where it lies on another branch: two meet where the surface's own
        coordinates are singular, type 1 for a pose and type 2 for motors, and no way leads from one to the other."""
        found = self.on.configuration(u, v, q)
        barrier = self._second if self.on.of_motors else self._first
        if found is None or barrier is None:
            return found
        return None if turned(barrier, barrier.of(q), barrier.of(found)) else found

    # --- the curves ----------------------------------------------------------------------------------------------

    def values(self) -> tuple[Array, Array]:
        """(m, n) smallest singular values of type 1, and of type 2; not a number where there is no configuration."""
        return self._sigma(self._first), self._sigma(self._second)

    def curves(
        self,
        say: Callable[[float], None] | None = None,
        linked: Callable[[Array, Array], bool] | None = None,
        stopped: Callable[[Array], bool] | None = None,
        outside: Bools | None = None,
    ) -> tuple[Curve, ...]:
        """All curves on the grid.

        Args:
            say: is told which part is done, 0 to 1.
            linked: of the configurations of two neighbours, whether they are on one branch; they are unless said.
            stopped: at the end of a branch, whether something else ends it there, such as a joint's limit.
            outside: (m, n) where it is known that there is no configuration; wherever there is none unless said.
        """
        reached: Bools = np.asarray(np.isfinite(self.q).all(axis=2))
        nothing: Bools = ~reached if outside is None else np.asarray(outside & ~reached)
        kinds = [(Kind.TYPE_1, self._first), (Kind.TYPE_2, self._second)]
        within = [(kind, rows, _Matrices(rows, self.q)) for kind, rows in kinds if rows is not None]
        points: dict[tuple[Kind, bool], dict[Edge, list[Point]]] = {}
        edges = list(self._edges())
        for number, (one, other) in enumerate(edges):
            if say is not None and number % 64 == 0:
                say(number / len(edges))
            found: Iterator[tuple[Kind, bool, Point]]
            if reached[one] and reached[other]:
                if linked is not None and not linked(self.q[one], self.q[other]):
                    continue
                found = self._between(one, other, within)
            elif reached[one] and nothing[other]:
                found = self._to_the_border(one, other, stopped)
            elif reached[other] and nothing[one]:
                found = self._to_the_border(other, one, stopped)
            else:
                continue
            for kind, border, point in found:
                points.setdefault((kind, border), {}).setdefault((one, other), []).append(point)
        curves = [
            Curve(kind, np.array([(p.u, p.v) for p in chain]), np.array([p.q for p in chain]), border)
            for (kind, border), there in points.items()
            for chain in _chains(there, len(self.u), len(self.v))
        ]
        return tuple(curve for curve in curves if not self._stray(curve, curves))

    def _stray(self, curve: Curve, curves: list[Curve]) -> bool:
        """Whether it is a single point beside a border of the same kind: the same curve seen from inside."""
        if len(curve.points) > 1 or curve.border:
            return False
        cell = 1.5 * np.array([self.u[1] - self.u[0], self.v[1] - self.v[0]])
        borders = [other.points for other in curves if other.border and other.kind is curve.kind]
        return any((np.abs(points - curve.points[0]) <= cell).all(axis=1).any() for points in borders)

    def _sigma(self, rows: Rows | None) -> Array:
        values = np.full(self.q.shape[:2], np.nan)
        for i, k in np.ndindex(values.shape):
            if rows is not None and np.isfinite(self.q[i, k]).all():
                values[i, k] = rows.sigma(rows.of(self.q[i, k])[None])[0]
        return values

    def _edges(self) -> Iterator[Edge]:
        for i, k in np.ndindex(len(self.u), len(self.v)):
            if i + 1 < len(self.u):
                yield (i, k), (i + 1, k)
            if k + 1 < len(self.v):
                yield (i, k), (i, k + 1)

    def _between(
        self, one: Node, other: Node, within: list[tuple[Kind, Rows, _Matrices]]
    ) -> Iterator[tuple[Kind, bool, Point]]:
        """What is singular between two points."""
        for kind, rows, matrices in within:
            if not matrices.may_cross(one, other):
                continue
            start, end = (self._beside(node) if matrices.is_singular(node) else self.q[node] for node in (one, other))
            for crossing in crossings(rows, self._way(one, other, start=start, end=end)):
                point = Point(*self.place(one, other, crossing.x), crossing.q)
                if self._is(rows, point):
                    yield kind, False, point

    def _beside(self, node: Node) -> Array:
        """(nq,) where a point of the grid is itself singular: a very little beside it, always to the same side, so that
        all its edges agree on which side of the curve it is."""
        i, k = node
        u, v = self.u[i] + _NUDGE * (self.u[1] - self.u[0]), self.v[k] + _SLANTED * _NUDGE * (self.v[1] - self.v[0])
        found = self.on.configuration(float(u), float(v), self.q[node])
        return np.asarray(self.q[node] if found is None else found)

    def _is(self, rows: Rows, point: Point) -> bool:
        """Whether it is singular there, and there on the surface: where both types meet, nothing closes between."""
        if not self.on.is_at(*point):
            return False
        return bool(rows.sigma(rows.of(point.q)[None])[0] <= _SINGULAR)

    def _way(
        self, one: Node, other: Node, part: float = 1.0, start: Array | None = None, end: Array | None = None
    ) -> Callable[[float], Array]:
        """From one point towards another, a part of the way, between configurations that are theirs unless given."""
        first, second = self.q[one] if start is None else start, self.q[other] if end is None else end

        def way(x: float) -> Array:
            if x in (0.0, 1.0):
                return np.asarray(second if x else first)
            guess = self.on.mechanism.interpolate(first, second, x)
            found = self.on.configuration(*self.place(one, other, part * x), guess)
            return found if found is not None else np.asarray(first if x < 0.5 else second)

        return way

    def _to_the_border(
        self, inside: Node, outside: Node, stopped: Callable[[Array], bool] | None
    ) -> Iterator[tuple[Kind, bool, Point]]:
        """Where the branch ends between two points, and what is singular of the other type before that."""
        part, q = self._border(inside, outside)
        kind = Kind.NONE if stopped is not None and stopped(q) else self._ends(q)
        yield kind, True, Point(*self.place(inside, outside, part), q)
        other, rows = (Kind.TYPE_1, self._first) if self.on.of_motors else (Kind.TYPE_2, self._second)
        if rows is None or part == 0.0:
            return
        for crossing in crossings(rows, self._way(inside, outside, part, end=q)):
            point = Point(*self.place(inside, outside, part * crossing.x), crossing.q)
            if crossing.x < _BEFORE and self._is(rows, point):
                yield other, False, point

    def _border(self, inside: Node, outside: Node) -> tuple[float, Array]:
        """On which part of the way the branch ends between two points, and q (nq,) there."""
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
            else:  # as long again: a step may have been in vain only because it was long
                part, q = ahead, found
        return part, q

    def _ends(self, q: Array) -> Kind:
        """By which singularity a branch ends that does so at q (nq,): by that of the surface's coordinates first."""
        kinds = [(Kind.TYPE_1, self._first), (Kind.TYPE_2, self._second)]
        for kind, rows in reversed(kinds) if self.on.of_motors else kinds:
            if rows is not None and rows.sigma(rows.of(q)[None])[0] < _END:
                return kind
        return Kind.NONE


class _Matrices:
    """Of all points of a grid, each computed once, when it is first asked for."""

    def __init__(self, rows: Rows, q: Array) -> None:
        self._rows, self._q = rows, q
        self._known: dict[Node, tuple[Array, float]] = {}

    def may_cross(self, one: Node, other: Node) -> bool:
        """As `crossing.may_cross`, which needs both again."""
        (a, first), (b, second) = self._at(one), self._at(other)
        return bool(first + second <= np.linalg.norm(b - a))

    def is_singular(self, node: Node) -> bool:
        """Whether the point itself is, but for rounding."""
        matrix, sigma = self._at(node)
        return bool(sigma <= _ZERO * np.linalg.norm(matrix))

    def _at(self, node: Node) -> tuple[Array, float]:
        if node not in self._known:
            matrix = self._rows.of(self._q[node])
            self._known[node] = matrix, float(self._rows.sigma(matrix[None])[0])
        return self._known[node]


def _chains(found: dict[Edge, list[Point]], rows: int, columns: int) -> list[list[Point]]:
    """Points on edges joined across the cells that they bound, into lines as long as they go."""
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
