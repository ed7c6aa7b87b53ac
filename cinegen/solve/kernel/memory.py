"""Where a solver's numbers lie: one table of sizes and addresses, so that a kernel is called with a single argument.

Passing thirty arrays to a compiled function costs more than the function itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.solve.kernel.compiled import Array

SIZES = (
    "nq",  # numbers of a configuration
    "nv",  # degrees of freedom of the model
    "n",  # those that may move in this tick: without a base that rests
    "offset",  # the first of them
    "loops",
    "rows",  # of all loops
    "rank",  # of all loops: generic
    "pulls",
    "p",  # rows of the pulls that hold in this tick
    "k",  # free motions
    "pull_rank",  # of the pulls: generic
    "signature",  # which pulls that rank was counted for, as bits
    "phase",  # what the tick waits for
    "warm",  # whether the last singular vectors are a guess for the next
    "tries",  # how often the step was shortened
    "corrections",
    "closes",  # whether some part of the step could be closed
    "factored",  # where the loops are factored: 0 nowhere that is of use, 1 at q, 2 at the trial
    "singular",  # whether the factors are singular vectors: near a type 2 singularity
    "refine",  # whether the pulls are corrected together with the loops
    "quick",  # how pulls are factored: 0 singular values, 1 triangle, 2 singular values without the joints held
    "accelerated",  # whether accelerations are limited
    "wishing",  # whether there is something that redundancy should do in this tick
    "ticks",
    "sweeps",  # of the singular values, in the last tick
    "evaluations",  # of Pinocchio, in the last tick
    "left_out",  # objectives that made no sense in this tick, as bits
    "nudged",  # whether the step is one out of a singularity
    "detour",  # whether pulls wait, while redundancy leads elsewhere
)
NQ, NV, N, OFFSET, LOOPS, ROWS, RANK, PULLS, P, K, PULL_RANK, SIGNATURE, PHASE, WARM, TRIES = range(15)
CORRECTIONS, CLOSES, FACTORED, SINGULAR, REFINE, QUICK, ACCELERATED, WISHING, TICKS, SWEEPS, EVALUATIONS = range(15, 26)
LEFT_OUT, NUDGED, DETOUR = 26, 27, 28

_FIRST = len(SIZES)
ARRAYS = (
    "q",  # (nq,) where it is
    "trial",  # (nq,) where it may go
    "before",  # (nq,) what `delta` is to be added to
    "delta",  # (nv,) m and rad
    "columns",  # (nv, 6) Pinocchio's Jacobian
    "placements",  # (joints, 12) Pinocchio's
    "scale",  # (nv,) m or rad that one step without unit is
    "at",  # (nv,) where in q; -1 where the joint is no number
    "low",  # (nv,) position limits, m and rad
    "high",  # (nv,)
    "longest",  # (nv,) longest step without unit
    "acceleration",  # (nv,) largest change of the step without unit
    "loop_table",  # (loops, 32) kind, joints, placements, first row, rows
    "signs",  # (loops, nv)
    "pull_table",  # (pulls, 48) what the pulls are
    "pull_state",  # (pulls, 32) what they are in this tick
    "moves",  # (pulls, nv)
    "settings",  # (12,) see below
    "record",  # (.,) what the tick did
    "jc",  # (rows, nv) loops at q or at the trial
    "c",  # (rows,) residual at the trial
    "f",  # (max(rows, nv), nv)
    "order",
    "left",
    "tau",
    "h",  # (max(rank, nv), nv)
    "motions",  # (k, nv)
    "loop_u",  # (rows, rows)
    "loop_b",  # (rows, nv)
    "loop_square",  # (rows,)
    "jp",  # (p, nv)
    "e",  # (p,) what the pulls want of this tick
    "e_whole",  # (p,) what is left in all
    "e_trial",  # (p,)
    "a",
    "u",
    "b",
    "square",
    "triangle",  # (2, p, p)
    "y",
    "wish",  # (nv,) what redundancy would like to do, without unit
    "wish_free",  # (nv,) the part of it that loops and pulls leave, in the free motions
    "secondary",  # (nv,) what of it is taken
    "room",  # (3, nv) scratch: how far it may go, and what holds it
    "step",  # (nv,)
    "taken",  # (nv,) part of the step that is tried
    "moved",  # (nv,) what it led to
    "last",  # (nv,) what was moved in the last tick
    "drift",  # (nv,) what of it was not in its step: what closed the loops
    "braking",  # (nv,) the step that slows down as much as accelerations allow
    "held",  # (nv,) joints at their limits while loops are closed
    "stopped",  # (nv,) bounds that hold the step back
    "floor",  # (nv,) bounds of the step
    "ceiling",  # (nv,)
    "axes",  # (nv, nv)
    "size",  # (nv,)
    "x",  # (nv,)
    "g",  # (nv, nv)
    "work",  # (3, nv, nv)
    "scratch",  # (8, nv)
    "w",  # (16, 3)
    "r",  # (4, 3)
)
(
    Q,
    TRIAL,
    BEFORE,
    DELTA,
    COLUMNS,
    PLACEMENTS,
    SCALE,
    AT,
    LOW,
    HIGH,
    LONGEST,
    ACCELERATION,
    LOOP_TABLE,
    SIGNS,
    PULL_TABLE,
    PULL_STATE,
    MOVES,
    SETTINGS,
    RECORD,
    JC,
    C,
    F,
    ORDER,
    LEFT,
    TAU,
    H,
    MOTIONS,
    LOOP_U,
    LOOP_B,
    LOOP_SQUARE,
    JP,
    E,
    E_WHOLE,
    E_TRIAL,
    A,
    U,
    B,
    SQUARE,
    TRIANGLE,
    Y,
    WISH,
    WISH_FREE,
    SECONDARY,
    ROOM,
    STEP,
    TAKEN,
    MOVED,
    LAST,
    DRIFT,
    BRAKING,
    HELD,
    STOPPED,
    FLOOR,
    CEILING,
    AXES,
    SIZE,
    X,
    G,
    WORK,
    SCRATCH,
    W,
    R,
) = range(_FIRST, _FIRST + len(ARRAYS))

# settings: seconds, characteristic length (m), gain, largest error of a tick, most that a placement bends (lengths per
# rad^2, infinite where it is not known); then what a tick remembers: the distance it began with, what its step should
# win, the gap where loops were factored, the last gap, what pulls lacked then, the gap of the last tick, and the part
# of its wish that redundancy is trusted with
DT, LENGTH, GAIN, ERROR_CAP, BEND, DISTANCE, GAINED, SHARP, GAP, LACK, CLOSED, TRUST = range(12)
SETTINGS_WIDTH = 12

# a loop's row of its table
KIND, FIRST, SECOND, FIRST_ROW, LOOP_ROWS, FIRST_LOCAL, SECOND_LOCAL = 0, 1, 2, 3, 4, 5, 17
LOOP_WIDTH = 32

# a pull's row of its table
VALID, JOINT, TRANSLATION, ROTATION, WEIGHT, AXES_OF, AXES_JOINT, IS_TWIST, TARGET = range(9)
LOCAL, AXES_LOCAL, TWIST = 9, 21, 33
PULL_WIDTH = 48
OF_TARGET, OF_WORLD, OF_NODE = 0, 1, 2

# a pull's state in a tick
AIM, AXES_NOW, HOLDS, METRES, RADIANS, FOLLOWED = 0, 12, 21, 22, 23, 24
STATE_WIDTH = 32

# the record of a tick; then come q, v, error of each pull (m, rad), what each pull wanted, singular values, and which
# joints stopped it. Errors and singular values may be left out, where the verdict is known without them
R_VERDICT, R_CLOSURE, R_PACE, R_PULL_RANK, R_SLOWEST, R_EVALUATIONS, R_SWEEPS, R_LOOP_SIGMA = range(8)
R_MEASURED, R_SIGMA, R_LEFT_OUT, R_HEAD = 8, 9, 10, 11
MOST_LEFT_OUT = 52  # objectives that are told apart: bits of a double
WANTED = 25  # numbers for each pull: aim, axes, translation, rotation, weight, whether it holds


class Memory:
    """All arrays of one solver, by name, and the table of their addresses."""

    def __init__(self, **sizes: int) -> None:
        self.table: NDArray[np.int64] = np.zeros(_FIRST + len(ARRAYS), dtype=np.int64)
        self.arrays: dict[str, Array] = {}
        for name, value in sizes.items():
            self.table[SIZES.index(name)] = value

    def put(self, name: str, array: Any) -> Array:
        """Keeps an array, and its address."""
        given: Array = np.ascontiguousarray(array, dtype=float)
        if given.size == 0:
            given = np.zeros(1)  # an address all the same
        self.arrays[name] = given
        self.table[_FIRST + ARRAYS.index(name)] = address(given)
        return given

    def point(self, name: str, where: int) -> None:
        """Keeps an address of memory that others own."""
        self.table[_FIRST + ARRAYS.index(name)] = where


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


def _offset() -> int | None:
    """Where in a copied pin.SE3 its numbers begin, seen from the object; None if that differs from copy to copy."""
    copies = [pin.SE3.Identity().copy() for _ in range(4)]
    offsets = {address(copy.rotation) - id(copy) for copy in copies}
    return offsets.pop() if len(offsets) == 1 else None


_OFFSET = _offset()


def address_of_copy(copied: pin.SE3) -> int:
    """Of the 12 numbers of what `SE3.copy` has returned. Asking numpy for it takes ten times as long."""
    return id(copied) + _OFFSET if _OFFSET is not None else address(copied.rotation)
