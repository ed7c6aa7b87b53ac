"""`scan`: the curves on a slice of its workspace where a mechanism is singular, refined between the grid's points.

The configurations of a grid are solved from neighbour to neighbour, beginning near home, so that they are all on home's
branch. On the edge between two of them a singular value that changes its sign is found by its singular vectors
(`crossing`), and the place by bisection, on the slice itself. Where the wave can't go on, the place where it stops is
found likewise: it is singular there too, of the other kind, or a branch ends for another reason.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.study.singular.crossing import Rows, crossings, of_end, of_passive_joints, turned
from cinegen.study.singular.singularity import Kind, singularity
from cinegen.study.singular.slice import Slice, SliceError

Array = NDArray[np.float64]

Edge = tuple[tuple[int, int], tuple[int, int]]
"""Between two neighbours on the grid."""

_HALVES = 18  # of an edge, to where a branch ends
_THERE = 1e-7  # rad or characteristic lengths: a configuration that far from its point is another's
_BEFORE = 0.999  # of the way to a border: what is singular nearer to it is the border
_END = 0.1  # a singular value below this, where a branch ends, is why it ends


class Point(NamedTuple):
    """A singular place: on the slice's two axes (m or rad), and q (nq,) there."""

    u: float
    v: float
    q: Array


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of singularities.

    Attributes:
        kind: TYPE_1, TYPE_2, or NONE for a border of what can be reached that is not singular.
        points: (n, 2) on the slice's two axes, m or rad, one after the other.
        q: (n, nq) there.
        border: whether the branch ends there.
    """

    kind: Kind
    points: Array
    q: Array
    border: bool


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
    grid = _Grid(of, u, v)
    grid.fill(lambda part: say(0.6 * part))
    return grid.loci(lambda part: say(0.6 + 0.4 * part))


class _Grid:
    """Configurations on a grid, and what lies on the edges between them."""

    def __init__(self, of: Slice, u: Array, v: Array) -> None:
        self.of, self.u, self.v = of, u, v
        self.mechanism = of.mechanism
        self.q = np.full((len(u), len(v), self.mechanism.model.nq), np.nan)
        self._end = of_end(self.mechanism)
        self._passive = of_passive_joints(self.mechanism) if self.mechanism.passive_rank else None

    # --- the wave ------------------------------------------------------------------------------------------------

    def fill(self, say: Callable[[float], None]) -> None:
        """Solves all points that the wave comes to."""
        first = self._first()
        waiting, done = deque([first]), 0
        while waiting:
            i, k = waiting.popleft()
            done += 1
            if done % 64 == 0:
                say(min(done / self.q[..., 0].size, 1.0))
            for near in self._near(i, k):
                if np.isfinite(self.q[near]).all():
                    continue
                found = self._onward(self.q[i, k], (i, k), near)
                if found is not None:
                    self.q[near] = found
                    waiting.append(near)

    def _first(self) -> tuple[int, int]:
        """The grid's point nearest to home, solved; others around it where that can't be reached."""
        start = self.of.start()
        home = self.mechanism.q_home
        here = self.of.configuration(*start, home, np.inf)
        if here is None:
            here = self.of.led(self.of.given(*start))
        order = sorted(
            ((i, k) for i in range(len(self.u)) for k in range(len(self.v))),
            key=lambda ik: (self.u[ik[0]] - start[0]) ** 2 + (self.v[ik[1]] - start[1]) ** 2,
        )
        for i, k in order[:9]:
            found = self.of.configuration(self.u[i], self.v[k], here) if here is not None else None
            if found is not None:
                self.q[i, k] = found
                return i, k
        axes = " and ".join(axis.name for axis in self.of.axes)
        raise SliceError(
            f"{self.mechanism.name}: no point of this slice over {axes} can be reached from home: choose one nearer to "
            f"home, which is at {_listed(self.of.coordinates(home))}"
        )

    def _near(self, i: int, k: int) -> Iterator[tuple[int, int]]:
        for a, b in ((i - 1, k), (i + 1, k), (i, k - 1), (i, k + 1)):
            if 0 <= a < len(self.u) and 0 <= b < len(self.v):
                yield a, b

    def _place(self, one: tuple[int, int], other: tuple[int, int], x: float) -> tuple[float, float]:
        u = self.u[one[0]] + x * (self.u[other[0]] - self.u[one[0]])
        return float(u), float(self.v[one[1]] + x * (self.v[other[1]] - self.v[one[1]]))

    def _onward(self, q: Array, one: tuple[int, int], other: tuple[int, int]) -> Array | None:
        """From one point to its neighbour, in one step or in several."""
        for steps in (1, 4, 16):
            there: Array | None = q
            for x in np.linspace(0.0, 1.0, steps + 1)[1:]:
                there = self._step(there, *self._place(one, other, x)) if there is not None else None
            if there is not None:
                return there
        return None

    def _step(self, q: Array, u: float, v: float) -> Array | None:
        """The configuration near q at a point; None where it lies on another branch: two meet where the slice's own
        coordinates are singular, type 1 for a pose and type 2 for motors, and no way leads from one to the other."""
        found = self.of.configuration(u, v, q)
        barrier = self._passive if self.of.of_motors else self._end
        if found is None or barrier is None:
            return found
        return None if turned(barrier, barrier.of(q), barrier.of(found)) else found

    # --- the curves ----------------------------------------------------------------------------------------------

    def loci(self, say: Callable[[float], None]) -> Loci:
        """All curves on the grid."""
        first, second = self._values(self._end), self._values(self._passive)
        edges = list(self._edges())
        points: dict[tuple[Kind, bool], dict[Edge, list[Point]]] = {}
        for number, (one, other) in enumerate(edges):
            if number % 64 == 0:
                say(number / len(edges))
            for kind, border, point in self._on_edge(one, other):
                points.setdefault((kind, border), {}).setdefault((one, other), []).append(point)
        curves = [
            Curve(kind, np.array([(p.u, p.v) for p in chain]), np.array([p.q for p in chain]), border)
            for (kind, border), found in points.items()
            for chain in _chains(found, len(self.u), len(self.v))
        ]
        return Loci(
            self.of, self.u, self.v, self.q, first, second, tuple(c for c in curves if not self._stray(c, curves))
        )

    def _stray(self, curve: Curve, curves: list[Curve]) -> bool:
        """Whether it is a single point beside a border of the same kind: the same curve seen from inside."""
        if len(curve.points) > 1 or curve.border:
            return False
        cell = 1.5 * np.array([self.u[1] - self.u[0], self.v[1] - self.v[0]])
        borders = [other.points for other in curves if other.border and other.kind is curve.kind]
        return any((np.abs(points - curve.points[0]) <= cell).all(axis=1).any() for points in borders)

    def _values(self, rows: Rows | None) -> Array:
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

    def _on_edge(self, one: tuple[int, int], other: tuple[int, int]) -> Iterator[tuple[Kind, bool, Point]]:
        known = [bool(np.isfinite(self.q[at]).all()) for at in (one, other)]
        if all(known):
            way = self._way(one, other)
            for kind, rows in ((Kind.TYPE_1, self._end), (Kind.TYPE_2, self._passive)):
                for crossing in crossings(rows, way) if rows is not None else ():
                    point = Point(*self._place(one, other, crossing.x), crossing.q)
                    if self._is(kind, point):
                        yield kind, False, point
        elif any(known):
            inside, outside = (one, other) if known[0] else (other, one)
            yield from self._to_the_border(inside, outside)

    def _is(self, kind: Kind, point: Point) -> bool:
        """Whether it is singular there, and there on the slice: where both types meet, nothing closes between."""
        here = self.of.coordinates(point.q)
        there = [here[axis.name] for axis in self.of.axes]
        if np.abs(np.subtract(there, point[:2])).max() > _THERE * max(self.mechanism.length, 1.0):
            return False
        return singularity(self.mechanism, point.q, tolerance=1e-4, within=1e-4).kind in (kind, Kind.BOTH)

    def _way(
        self, one: tuple[int, int], other: tuple[int, int], part: float = 1.0, end: Array | None = None
    ) -> Callable[[float], Array]:
        """From one point towards another, a part of the way, to a configuration that is the other's unless given."""
        first, second = self.q[one], self.q[other] if end is None else end

        def way(x: float) -> Array:
            if x in (0.0, 1.0):
                return np.asarray(second if x else first)
            guess = np.asarray(pin.interpolate(self.mechanism.model, first, second, x))
            found = self.of.configuration(*self._place(one, other, part * x), guess)
            return found if found is not None else np.asarray(first if x < 0.5 else second)

        return way

    def _to_the_border(self, inside: tuple[int, int], outside: tuple[int, int]) -> Iterator[tuple[Kind, bool, Point]]:
        """Where the branch ends between two points, and what is singular of the other type before that."""
        kind, part, q = self._border(inside, outside)
        yield kind, True, Point(*self._place(inside, outside, part), q)
        other, rows = (Kind.TYPE_1, self._end) if self.of.of_motors else (Kind.TYPE_2, self._passive)
        if rows is None or part == 0.0:
            return
        for crossing in crossings(rows, self._way(inside, outside, part, q)):
            point = Point(*self._place(inside, outside, part * crossing.x), crossing.q)
            if crossing.x < _BEFORE and self._is(other, point):
                yield other, False, point

    def _border(self, inside: tuple[int, int], outside: tuple[int, int]) -> tuple[Kind, float, Array]:
        """By which singularity the branch ends between two points, on which part of the way, and q (nq,) there."""
        low, high, q = 0.0, 1.0, self.q[inside]
        for _ in range(_HALVES):
            middle = 0.5 * (low + high)
            found = self._step(q, *self._place(inside, outside, middle))
            if found is None:
                high = middle
            else:
                low, q = middle, found
        first = self._end.sigma(self._end.of(q)[None])[0]
        second = self._passive.sigma(self._passive.of(q)[None])[0] if self._passive is not None else np.inf
        kind = Kind.NONE
        if min(first, second) < _END:
            kind = Kind.TYPE_1 if first <= second else Kind.TYPE_2
        return kind, low, q


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


def _listed(values: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in values.items())


def _numbers(values: Array) -> list[list[float | None]]:
    return [[float(value) if np.isfinite(value) else None for value in row] for row in values]
