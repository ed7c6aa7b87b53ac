"""Tables of linkages, paths of their parameters, and the memory of a thread, for the kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.jit.compiled import Array, Table

Complex = NDArray[np.complex128]
Vector = tuple[complex, complex, complex]

PARENT, IS_PRISMATIC, COLUMN = range(3)
"""Columns of `LinkageTables.joints`."""

BODY, IS_DIRECTION = range(2)
"""Columns of `LinkageTables.vectors`."""

ARRIVED, SINGULAR, INFINITE, LOST = 1, 2, 3, 4
"""How a path ends."""


class LinkageTables(NamedTuple):
    """A linkage, dimensionless: lengths are divided by the characteristic length. n joints, c attached vectors.

    Attributes:
        joints: (n, 3) parent body, whether it is prismatic, column: that of a passive joint among the k unknowns, or
            k + 1 plus the number of a locked joint.
        constants: (n, 15) placement in the parent (rotation row by row, translation), axis.
        above: (n + 1, n) whether a joint moves a body; body 0 is the base, body i + 1 is moved by joint i.
        vectors: (c, 2) body, and whether the vector is a direction (else a point); the features first.
        local: (c, 3) the vectors in their bodies' axes.
        differences: (d, 2) vectors that coincide: 3 equations each.
        products: (p, 3) a direction, and two points whose difference is normal to it: 1 equation each.
        features: number of features.
        rank: of all equations by all unknowns, the slice and t included.
    """

    joints: Table
    constants: Array
    above: Table
    vectors: Table
    local: Array
    differences: Table
    products: Table
    features: int
    rank: int


class ParameterPath(NamedTuple):
    """Parameters that change from a first value to a second.

    Attributes:
        lines: (2, locked, 2) A and B.
        slices: (2, 3 f + 2) alpha, beta, gamma.
        algebraic: whether A + B t is tan(theta / 2) of a locked revolute joint, not theta.
        accuracy: target error of a prediction (radians, characteristic lengths).
    """

    lines: Complex
    slices: Complex
    algebraic: bool
    accuracy: float


class LinkageScratch(NamedTuple):
    """Working memory for one thread, k passive joints.

    Attributes:
        line: (locked, 2).
        slice: (3 f + 2,).
        bodies: (n + 1, 5, 3) rotation, position, joint axis.
        vectors: (c, 3).
        matrix: (k + 1 + locked, rows) derivatives by the passive joints, t, and the locked joints' A + B t.
        residual: (rows,).
        order: (k + 1,).
        stages: (6, k + 1).
    """

    line: Complex
    slice: Complex
    bodies: Complex
    vectors: Complex
    matrix: Complex
    residual: Complex
    order: Table
    stages: Complex
