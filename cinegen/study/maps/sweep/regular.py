"""`regularity`: whether a mechanism can go all over a box without a singularity, between the samples of a map, too.

From cell to neighbouring cell it is led on one branch, and the signs of the singular values of both types are compared
(`cinegen.study.singular.crossing`): one that has changed was 0 between. By Weyl's inequality most neighbours need no
more than a look at how much the matrix has changed. What is smaller than a cell and has no neighbours on both sides, as
a singular point that a value touches without changing its sign, is not seen: least values are told for that.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.study.maps.survey import Survey
from cinegen.study.maps.sweep.ways import JUMP, Ways
from cinegen.study.singular.crossing import Rows, crossings, of_node, of_passive_joints, turned
from cinegen.study.singular.singularity import Kind

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

_ZERO = 1e-4  # up to which a singular value is 0 where its sign was seen to change
_LOW = 0.1  # above it, neighbours that are near are on one branch


@dataclass(frozen=True)
class Regularity:
    """What lies between the cells of a box.

    Attributes:
        first: whether a singularity of type 1 does.
        second: and of type 2.
        joined: whether all cells are on one branch: from each the mechanism can go to its neighbours and stay in the
            box.
    """

    first: bool
    second: bool
    joined: bool

    @property
    def kind(self) -> Kind:
        """Which singularities there are."""
        return {(False, False): Kind.NONE, (True, False): Kind.TYPE_1, (False, True): Kind.TYPE_2}.get(
            (self.first, self.second), Kind.BOTH
        )

    def __bool__(self) -> bool:
        """Whether there are none, and all cells are on one branch."""
        return self.joined and self.kind is Kind.NONE


def regularity(survey: Survey, cells: tuple[slice, ...], configurations: Array) -> Regularity:
    """Whether a mechanism is regular all over a part of a map.

    Args:
        survey: of the map.
        cells: the part, for each axis.
        configurations: (cells along each axis.., nq), not a number where there is none: there nothing is looked at.
    """
    return _Field(survey, cells, configurations).regularity()


class _Field:
    """Configurations of cells, and what lies between neighbours."""

    def __init__(self, survey: Survey, cells: tuple[slice, ...], configurations: Array) -> None:
        mechanism = survey.mechanism
        self.shape = configurations.shape[:-1]
        self.given = configurations.reshape(-1, configurations.shape[-1])
        self.q = np.full_like(self.given, np.nan)
        self.ways, self.home = Ways(survey, cells), mechanism.q_home
        self.end = Rows(of_node(mechanism, survey.node, sum(survey.counted)), survey.rank)
        self.passive = of_passive_joints(mechanism) if mechanism.passive_rank else None
        self.barrier = self.passive if survey.of_motors else self.end
        """What branches meet at."""
        self.redundant = not survey.of_motors and mechanism.mobility > survey.rank
        self.parts = 0

    def regularity(self) -> Regularity:
        edges = _edges(self.shape)
        self._lead(edges)
        edges = edges[np.isfinite(self.q[edges, 0]).all(axis=1)]
        joined, found = self.parts <= 1, {}
        for kind, rows in ((Kind.TYPE_1, self.end), (Kind.TYPE_2, self.passive)):
            found[kind] = False
            if rows is None:
                continue
            for one, other in self._may_cross(rows, edges):
                crossed, sure = self._crossed(rows, one, other)
                found[kind] |= crossed
                joined &= crossed or sure
                if crossed:
                    break
        joined = joined and all(self._end(*edge) is not None for edge in self._far(edges))
        return Regularity(found[Kind.TYPE_1], found[Kind.TYPE_2], joined)

    # --- leading -------------------------------------------------------------------------------------------------

    def _lead(self, edges: Ints) -> None:
        """A configuration for each cell that has one, led from its neighbour where that can be."""
        near: list[list[int]] = [[] for _ in self.given]
        for one, other in edges.tolist():
            near[one].append(other)
            near[other].append(one)
        reached = np.isfinite(self.given[:, 0])
        for first in np.flatnonzero(reached).tolist():
            if np.isfinite(self.q[first, 0]):
                continue
            self.parts += 1
            self.q[first] = self.given[first]
            waiting = deque([first])
            while waiting:
                here = waiting.popleft()
                for there in near[here]:
                    if reached[there] and not np.isfinite(self.q[there, 0]):
                        found = self._step(here, there)
                        if found is not None:
                            self.q[there] = found
                            waiting.append(there)

    def _step(self, one: int, other: int) -> Array | None:
        q: Array = self.q[one]
        known: Array = self.given[other]
        if self.ways.away(q, known) <= JUMP and self._same_branch(q, known):
            return known
        return self.ways.onward(q, one, other, self._same_branch)

    def _same_branch(self, q: Array, other: Array) -> bool:
        if self.barrier is None:
            return True
        a, b = self.barrier.of(q), self.barrier.of(other)
        if self.barrier.sigma(np.array([a, b])).min() > _LOW:
            return True
        return not turned(self.barrier, a, b)

    # --- what lies between ---------------------------------------------------------------------------------------

    def _may_cross(self, rows: Rows, edges: Ints) -> Iterator[tuple[int, int]]:
        """Neighbours between which the singular value can pass through 0 (`crossing.may_cross`); layer by layer, so
        that few matrices are kept."""
        layer = len(self.q) // self.shape[0]
        known: dict[int, tuple[Array, Array]] = {}
        for k in range(self.shape[0]):
            known = {number: known[number] for number in known if number == k - 1}
            known[k] = self._matrices(rows, slice(k * layer, (k + 1) * layer))
            both = [number for number in (k - 1, k) if number in known]
            matrices, sigma = (np.concatenate([known[number][i] for number in both]) for i in (0, 1))
            one, other = (edges[edges[:, 1] // layer == k] - both[0] * layer).T
            change = np.linalg.norm(matrices[one] - matrices[other], axis=(1, 2))
            for edge in np.flatnonzero(sigma[one] + sigma[other] <= change):
                yield int(one[edge]) + both[0] * layer, int(other[edge]) + both[0] * layer

    def _matrices(self, rows: Rows, part: slice) -> tuple[Array, Array]:
        """(n, rows, columns) and (n,) their singular values; 0 where there is no configuration."""
        nothing = np.zeros_like(rows.of(self.home))
        matrices = np.array([rows.of(q) if np.isfinite(q[0]) else nothing for q in self.q[part]])
        return matrices, rows.sigma(matrices)

    def _crossed(self, rows: Rows, one: int, other: int) -> tuple[bool, bool]:
        """Whether the singular value passes through 0 between two neighbours; and if not, whether that is sure."""
        end = self._end(one, other)
        if end is None:
            return False, False
        places = list(crossings(rows, self.ways.between(one, self.q[one], other, end)))
        crossed = any(rows.sigma(rows.of(place.q)[None])[0] <= _ZERO for place in places)
        return crossed, self.redundant or not places

    def _far(self, edges: Ints) -> Iterator[tuple[int, int]]:
        for one, other in edges.tolist():
            if self.ways.away(self.q[one], self.q[other]) > JUMP:
                yield one, other

    def _end(self, one: int, other: int) -> Array | None:
        """Where one leads to at a neighbour: what is known there, unless the mechanism can go there in many ways; None
        where that is on another branch."""
        known: Array = self.q[other]
        if self.ways.away(self.q[one], known) <= JUMP:
            return known
        led = self.ways.onward(self.q[one], one, other, self._same_branch)
        if led is None or not (self.redundant or self.ways.same(led, known)):
            return None
        return led


def _edges(shape: tuple[int, ...]) -> Ints:
    """(m, 2) numbers of neighbours on a grid, the smaller first."""
    numbers = np.arange(int(np.prod(shape))).reshape(shape)
    pairs = []
    for axis in range(len(shape)):
        moved = np.moveaxis(numbers, axis, 0)
        pairs.append(np.column_stack([moved[:-1].ravel(), moved[1:].ravel()]))
    return np.concatenate(pairs)
