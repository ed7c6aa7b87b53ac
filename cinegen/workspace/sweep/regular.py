"""`regularity`: whether a mechanism can go all over a box without a singularity, between the samples of a map, too.

From point to neighbouring point it is led on one branch (`Field`), and the signs of the singular values of both types
are compared (`cinegen.singularities.crossing`): one that has changed was 0 between. By Weyl's inequality most
neighbours need no more than a look at how much the matrix has changed. What is smaller than a cell and has no
neighbours on both sides, as a singular point that a value touches without changing its sign, is not seen unless it is
one of the points: least values are told for that.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cinegen.singularities.crossing import Rows, crossings
from cinegen.singularities.singularity import SingularityType
from cinegen.workspace.sweep.field import Field
from cinegen.workspace.sweep.ways import JUMP

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

_ZERO = 1e-4  # up to which a singular value is 0, at a point or where its sign was seen to change


@dataclass(frozen=True)
class Regularity:
    """What lies between the points of a box.

    Attributes:
        first: whether a singularity of type 1 does.
        second: and of type 2.
        joined: whether all points are on one branch: from each the mechanism can go to its neighbours and stay in the
            box.
    """

    first: bool
    second: bool
    joined: bool

    @property
    def kind(self) -> SingularityType:
        """Which singularities there are."""
        return {
            (False, False): SingularityType.NONE,
            (True, False): SingularityType.TYPE_1,
            (False, True): SingularityType.TYPE_2,
        }.get((self.first, self.second), SingularityType.BOTH)

    def __bool__(self) -> bool:
        """Whether there are none, and all points are on one branch."""
        return self.joined and self.kind is SingularityType.NONE


def regularity(field: Field) -> Regularity:
    """Whether a mechanism is regular all over a box, as far as it is led there."""
    edges = field.lattice.edges
    edges = edges[field.reached[edges].all(axis=1)]
    joined, found = field.parts <= 1, {}
    for kind, rows in ((SingularityType.TYPE_1, field.end), (SingularityType.TYPE_2, field.passive)):
        found[kind] = False
        if rows is None:
            continue
        for one, other in _may_cross(field, rows, edges):
            crossed, sure = _crossed(field, rows, one, other)
            found[kind] |= crossed
            joined &= crossed or sure
            if crossed:
                break
    joined = joined and all(field.end_of(*edge) is not None for edge in _far(field, edges))
    return Regularity(found[SingularityType.TYPE_1], found[SingularityType.TYPE_2], joined)


def _may_cross(field: Field, rows: Rows, edges: Ints) -> Iterator[tuple[int, int]]:
    """Neighbours between which the singular value can pass through 0 (`crossing.may_cross`), or one of which it is 0
    at; layer by layer, so that few matrices are kept."""
    layers = field.lattice.shape[0]
    layer = field.lattice.size // layers
    known: dict[int, tuple[Array, Array]] = {}
    for k in range(layers):
        known = {number: known[number] for number in known if number == k - 1}
        known[k] = _matrices(field, rows, slice(k * layer, (k + 1) * layer))
        both = [number for number in (k - 1, k) if number in known]
        matrices, sigma = (np.concatenate([known[number][i] for number in both]) for i in (0, 1))
        one, other = (edges[edges[:, 1] // layer == k] - both[0] * layer).T
        change = np.linalg.norm(matrices[one] - matrices[other], axis=(1, 2))
        least = np.minimum(sigma[one], sigma[other])
        for edge in np.flatnonzero((sigma[one] + sigma[other] <= change) | (least <= _ZERO)):
            yield int(one[edge]) + both[0] * layer, int(other[edge]) + both[0] * layer


def _matrices(field: Field, rows: Rows, part: slice) -> tuple[Array, Array]:
    """(n, rows, columns) and (n,) their singular values; 0 where there is no configuration."""
    nothing = np.zeros_like(rows.of(field.spec.mechanism.q_home))
    matrices = np.array([rows.of(q) if np.isfinite(q[0]) else nothing for q in field.q[part]])
    return matrices, rows.sigma(matrices)


def _crossed(field: Field, rows: Rows, one: int, other: int) -> tuple[bool, bool]:
    """Whether the singular value passes through 0 between two neighbours, or is 0 there; and if not, whether that is
    sure."""
    q = field.q[[one, other]]
    if rows.sigma(np.array([rows.of(q[0]), rows.of(q[1])])).min() <= _ZERO:
        return True, True
    end = field.end_of(one, other)
    if end is None:
        return False, False
    places = list(crossings(rows, field.ways.between(one, field.q[one], other, end)))
    crossed = any(rows.sigma(rows.of(place.q)[None])[0] <= _ZERO for place in places)
    return crossed, field.redundant or not places


def _far(field: Field, edges: Ints) -> Iterator[tuple[int, int]]:
    for one, other in edges.tolist():
        if field.ways.away(field.q[one], field.q[other]) > JUMP:
            yield one, other
