"""Tables and working memory of the kernels of a linkage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array, Integers
from cinegen.assembly._kernels.tables import ARRIVED, COLUMN, Complex, LinkageScratch, LinkageTables
from cinegen.assembly.bodies import CutJoint, Feature
from cinegen.jit.compiled import Table
from raff2urdf.raff.document import LoopKind


def attached(cuts: Sequence[CutJoint], features: Sequence[Feature] = ()) -> tuple[Table, Array, Table, Table]:
    """Return the vectors (c, 2), their coordinates (c, 3), differences (d, 2) and products (p, 3) of `LinkageTables`
    for cut joints: of each first the second end's origin, the first end's, then likewise x, y, z axes as needed."""
    vectors: list[tuple[int, bool]] = [(feature.body, feature.is_direction) for feature in features]
    local: list[Array] = [feature.local for feature in features]
    differences, products = list[tuple[int, int]](), list[tuple[int, int, int]]()

    def pair(cut: CutJoint, row: int) -> tuple[int, int]:
        vectors.extend((body, row < 3) for body in cut.bodies[::-1])
        local.extend(cut.anchors[::-1, row])
        return len(vectors) - 2, len(vectors) - 1

    for cut in cuts:
        points = pair(cut, 3)
        axes = {LoopKind.BALL: (), LoopKind.REVOLUTE: (2,)}.get(cut.kind, (0, 1, 2))
        ends = [pair(cut, row) for row in axes]
        if cut.kind is LoopKind.PRISMATIC:
            products += [(end[1], *points) for end in ends[:2]]
            differences += ends
        else:
            differences += [points, *ends]
    return (
        np.array(vectors, dtype=np.int64).reshape(-1, 2), np.array(local).reshape(-1, 3),
        np.array(differences, dtype=np.int64).reshape(-1, 2), np.array(products, dtype=np.int64).reshape(-1, 3),
    )  # fmt: skip


def scratch_of(tables: LinkageTables, passive: int) -> LinkageScratch:
    """Allocate working memory for a linkage with so many passive joints."""
    rows, features = 3 * len(tables.differences) + len(tables.products) + 1, tables.features
    joints, unknowns = len(tables.joints), passive + 1
    locked = max(int(tables.joints[:, COLUMN].max()) - passive, 0)  # joints that follow others have no column

    def zeros(*shape: int) -> Complex:
        return np.zeros(shape, dtype=np.complex128)

    return LinkageScratch(
        line=zeros(locked, 2), slice=zeros(3 * features + 2), bodies=zeros(joints + 1, 5, 3),
        vectors=zeros(len(tables.vectors), 3), matrix=zeros(joints + 1, rows), residual=zeros(rows),
        order=np.zeros(unknowns, dtype=np.int64), stages=zeros(6, unknowns),
    )  # fmt: skip


class Tracked(NamedTuple):
    """Solutions at the end of a path.

    Attributes:
        solutions: (count, k + 1) the unknowns.
        ends: (count,) how each path ends: ARRIVED, SINGULAR, INFINITE or LOST.
        pivots: (count,) smallest pivot over the largest: 0 where solutions coincide.
    """

    solutions: Complex
    ends: Integers
    pivots: Array

    @property
    def arrived(self) -> Complex:
        """The solutions whose paths arrived."""
        return np.asarray(self.solutions[self.ends == ARRIVED])
