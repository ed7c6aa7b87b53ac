"""Where a solver's numbers lie: the table of `cinegen.loops._kernels.memory`, and behind it what a tick needs."""

from __future__ import annotations

import pinocchio as pin

from cinegen.loops._kernels import memory as loops
from cinegen.loops._kernels.memory import *  # noqa: F403 - all names of the table at one place, `m`

_SIZES = (
    "pulls",
    "p",  # rows of the pulls that hold in this tick
    "k",  # free motions
    "pull_rank",  # of the pulls: generic
    "signature",  # which pulls that rank was counted for, as bits
    "phase",  # what the tick waits for
    "warm",  # whether the last singular vectors are a guess for the next
    "tries",  # how often the step was shortened
    "closes",  # whether some part of the step could be closed
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
    "barriers",  # rows of the barriers in this tick
    "guarded",  # whether a trial must be asked about before it is accepted
)
_FIRST = len(loops.LAYOUT)
(
    PULLS,
    P,
    K,
    PULL_RANK,
    SIGNATURE,
    PHASE,
    WARM,
    TRIES,
    CLOSES,
    REFINE,
    QUICK,
    ACCELERATED,
    WISHING,
    TICKS,
    SWEEPS,
    EVALUATIONS,
    LEFT_OUT,
    NUDGED,
    DETOUR,
    BARRIERS,
    GUARDED,
) = range(_FIRST, _FIRST + len(_SIZES))

_ARRAYS = (
    "low",  # (nv,) position limits, m and rad
    "high",  # (nv,)
    "longest",  # (nv,) longest step without unit
    "acceleration",  # (nv,) largest change of the step without unit
    "pull_table",  # (pulls, 48) what the pulls are
    "pull_state",  # (pulls, 32) what they are in this tick
    "moves",  # (pulls, nv)
    "record",  # (.,) what the tick did
    "motions",  # (k, nv)
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
    "room",  # (3, nv + barriers) scratch: how far it may go, and what holds it
    "taken",  # (nv,) part of the step that is tried
    "moved",  # (nv,) what it led to
    "last",  # (nv,) what was moved in the last tick
    "drift",  # (nv,) what of it was not in its step: what closed the loops
    "braking",  # (nv,) the step that slows down as much as accelerations allow
    "stopped",  # (nv + barriers,) bounds that hold the step back
    "floor",  # (nv + barriers,) bounds of the step, and of what barriers see of it
    "ceiling",  # (nv + barriers,)
    "barrier_rows",  # (barriers, nv) without unit
    "barrier_room",  # (barriers,) how much of it a step may have
    "axes",  # (nv, nv)
    "size",  # (nv,)
    "x",  # (nv,)
    "g",  # (nv + barriers, nv)
    "work",  # (3, nv, nv)
    "scratch",  # (8, nv)
    "r",  # (4, 3)
)
(
    LOW,
    HIGH,
    LONGEST,
    ACCELERATION,
    PULL_TABLE,
    PULL_STATE,
    MOVES,
    RECORD,
    MOTIONS,
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
    TAKEN,
    MOVED,
    LAST,
    DRIFT,
    BRAKING,
    STOPPED,
    FLOOR,
    CEILING,
    BARRIER_ROWS,
    BARRIER_ROOM,
    AXES,
    SIZE,
    X,
    G,
    WORK,
    SCRATCH,
    R,
) = range(_FIRST + len(_SIZES), _FIRST + len(_SIZES) + len(_ARRAYS))

LAYOUT = loops.LAYOUT + _SIZES + _ARRAYS

# settings, behind those of loops: seconds, gain, largest error of a tick, most that a placement bends (lengths per
# rad^2, infinite where it is not known), the singular value below which damping sets in; then what a tick remembers:
# the distance it began with, what its step should win, what pulls lacked last, and the part of its wish that
# redundancy is trusted with; and the part of a trial that barriers allow
_DT = loops.SETTINGS_WIDTH
DT, GAIN, ERROR_CAP, BEND, NEAR, DISTANCE, GAINED, LACK, TRUST, CLEAR = range(_DT, _DT + 10)
SETTINGS_WIDTH = _DT + 10

# a pull's row of its table
VALID, JOINT, TRANSLATION, ROTATION, WEIGHT, AXES_OF, AXES_JOINT, IS_TWIST, TARGET = range(9)
LOCAL, AXES_LOCAL, TWIST = 9, 21, 33
PULL_WIDTH = 48
OF_TARGET, OF_WORLD, OF_NODE = 0, 1, 2

# a pull's state in a tick
AIM, AXES_NOW, HOLDS, METRES, RADIANS, FOLLOWED = 0, 12, 21, 22, 23, 24
STATE_WIDTH = 32

# the record of a tick; then come q, v, error of each pull (m, rad), what each pull wanted, singular values, and which
# joints stopped it. Errors and singular values may be left out, where the status is known without them
R_STATUS, R_CLOSURE, R_PACE, R_PULL_RANK, R_SLOWEST, R_EVALUATIONS, R_SWEEPS = range(7)
R_MEASURED, R_SIGMA, R_LEFT_OUT, R_BARRED, R_HEAD = 7, 8, 9, 10, 11
MOST_LEFT_OUT = 52  # objectives that are told apart: bits of a double
WANTED = 25  # numbers for each pull: aim, axes, translation, rotation, weight, whether it holds


def _offset() -> int | None:
    """Where in a copied pin.SE3 its numbers begin, seen from the object; None if that differs from copy to copy."""
    copies = [pin.SE3.Identity().copy() for _ in range(4)]
    offsets = {loops.address(copy.rotation) - id(copy) for copy in copies}
    return offsets.pop() if len(offsets) == 1 else None


_OFFSET = _offset()


def address_of_copy(copied: pin.SE3) -> int:
    """Of the 12 numbers of what `SE3.copy` has returned. Asking numpy for it takes ten times as long."""
    return id(copied) + _OFFSET if _OFFSET is not None else loops.address(copied.rotation)
