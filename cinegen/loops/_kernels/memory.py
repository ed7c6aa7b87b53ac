"""Where the kernels' numbers lie: one table of sizes and addresses, so that a kernel is called with one argument.

Passing thirty arrays to a compiled function costs more than the function itself. What is here is what closing loops
takes; the table of a solver goes on where this one ends (`cinegen.ik._kernels.memory`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.jit.compiled import Array

SIZES = (
    "nq",  # numbers of a configuration
    "nv",  # degrees of freedom of the model
    "n",  # those that may move: without a base that rests
    "offset",  # the first of them
    "loops",
    "rows",  # of all loops
    "rank",  # of all loops: generic
    "motors",
    "corrections",  # of the present trial
    "factored",  # where the loops are factored: 0 nowhere that is of use, 1 at q or near it, 2 at the trial
    "singular",  # whether the factors are singular vectors: near a type 2 singularity
    "begun",  # whether there is a way to where motors are led
    "halved",  # how often a step on it was halved
    "whole",  # whether this step leads all the way
    "alike",  # how many steps before this one led all the way by as much as this one, up to 2
)
NQ, NV, N, OFFSET, LOOPS, ROWS, RANK, MOTORS, CORRECTIONS, FACTORED, SINGULAR, BEGUN, HALVED, WHOLE, ALIKE = range(
    len(SIZES)
)

ARRAYS = (
    "q",  # (nq,) where it is
    "trial",  # (nq,) where it may go
    "before",  # (nq,) what `delta` is to be added to
    "delta",  # (nv,) m and rad
    "columns",  # (nv, 6) Pinocchio's Jacobian
    "placements",  # (joints, 12) Pinocchio's
    "scale",  # (nv,) m or rad that one step without unit is
    "at",  # (nv,) where in q; -1 where the joint is no number
    "loop_table",  # (loops, 32) kind, joints, placements, first row, rows
    "signs",  # (loops, nv)
    "settings",  # see below
    "jc",  # (rows, nv) loops at q or at the trial
    "jc_before",  # (rows, nv) loops at q
    "c",  # (rows,) residual at the trial
    "f",  # (max(rows, nv), nv)
    "order",
    "left",
    "tau",
    "h",  # (max(rank, nv), nv)
    "loop_u",  # (rows, rows)
    "loop_b",  # (rows, nv)
    "loop_square",  # (rows,)
    "held",  # (nv,) joints that stay while loops are closed
    "step",  # (nv,)
    "motor_columns",  # (motors,)
    "motor_places",  # (motors,) in q
    "goal",  # (motors,) where motors are led, m and rad
    "way",  # (nv,) how all joints get there, to first order
    "bends",  # (3, nv) what this step and the two before were more than that
    "way_before",  # (motors,) what motors did in the step before
    "sides",  # (rows, rows) scratch
    "w",  # (16, 3) scratch
)
_FIRST = len(SIZES)
(
    Q,
    TRIAL,
    BEFORE,
    DELTA,
    COLUMNS,
    PLACEMENTS,
    SCALE,
    AT,
    LOOP_TABLE,
    SIGNS,
    SETTINGS,
    JC,
    JC_BEFORE,
    C,
    F,
    ORDER,
    LEFT,
    TAU,
    H,
    LOOP_U,
    LOOP_B,
    LOOP_SQUARE,
    HELD,
    STEP,
    MOTOR_COLUMNS,
    MOTOR_PLACES,
    GOAL,
    WAY,
    BENDS,
    WAY_BEFORE,
    SIDES,
    W,
) = range(_FIRST, _FIRST + len(ARRAYS))

LAYOUT: tuple[str, ...] = SIZES + ARRAYS

# settings: characteristic length (m); the gap where loops were factored, the last gap, the gap of the last that counts,
# the smallest singular value of the loops or 1 where that is not small; of a walk what counts as closed, its longest
# step, the part of a step that closing may add, the part of the way that the last step is, and the sign of a
# determinant at q; the squared gap and the damping of Gauss-Newton
LENGTH, SHARP, GAP, CLOSED, LOOP_SIGMA, TOLERANCE, STRIDE, ASTRAY, PART, SIDE, SQUARED, DAMPING = range(12)
SETTINGS_WIDTH = 12

# a loop's row of its table
KIND, FIRST, SECOND, FIRST_ROW, LOOP_ROWS, FIRST_LOCAL, SECOND_LOCAL = 0, 1, 2, 3, 4, 5, 17
LOOP_WIDTH = 32


class Memory:
    """All arrays that kernels work on, by name, and the table of their addresses.

    Args:
        layout: the names of all entries of the table, sizes first in each of its parts.
        sizes: some of them, by name; the others are 0 at first.
    """

    def __init__(self, layout: tuple[str, ...] = LAYOUT, **sizes: int) -> None:
        self._where = {name: i for i, name in enumerate(layout)}
        self.table: NDArray[np.int64] = np.zeros(len(layout), dtype=np.int64)
        self.arrays: dict[str, Array] = {}
        for name, value in sizes.items():
            self.table[self._where[name]] = value

    def put(self, name: str, array: Any) -> Array:
        """Keeps an array, and its address."""
        given: Array = np.ascontiguousarray(array, dtype=float)
        if given.size == 0:
            given = np.zeros(1)  # an address all the same
        self.arrays[name] = given
        self.table[self._where[name]] = address(given)
        return given

    def point(self, name: str, where: int) -> None:
        """Keeps an address of memory that others own."""
        self.table[self._where[name]] = where


def address(array: Array) -> int:
    """Of an array's first number."""
    return int(array.__array_interface__["data"][0])


def columns_of(placement: pin.SE3) -> Array:
    """The 12 numbers of a placement, as Pinocchio keeps them: three columns of the rotation, then the translation."""
    return np.concatenate([placement.rotation.ravel(order="F"), placement.translation])


def placements_address(data: pin.Data) -> int:
    """Of the joints' placements, 96 bytes each."""
    first, second = data.oMi[0], data.oMi[len(data.oMi) - 1]
    begin = address(first.rotation)
    if address(first.translation) != begin + 72 or address(second.rotation) != begin + 96 * (len(data.oMi) - 1):
        raise AssertionError("this build of Pinocchio lays placements out in a way that the kernels don't know")
    return begin
