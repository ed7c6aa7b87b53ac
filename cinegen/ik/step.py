"""What a tick did: its status, and the numbers behind it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.ik._kernels import memory as m
from cinegen.ik.plain import equations
from cinegen.ik.pull import Pull
from cinegen.ik.resolve import free_motions
from cinegen.ik.singular import Gained, Lost, gained, lost, passive_singular_values
from cinegen.model import Mechanism

Array = NDArray[np.float64]


class Status(Enum):
    """What became of a tick. Where several are true, this one is said: BAD_TARGET, IDLE, REFUSED, FOLLOWING (all
    targets reached), DETOUR, BARRED, AT_LIMIT, OUT_OF_REACH, SINGULAR, FOLLOWING (on the way)."""

    BAD_TARGET = "a pull was set to what can't be followed: it is left out"
    REFUSED = "the loops could not be closed after any part of the step: the last state stays"
    AT_LIMIT = "a joint limit holds the motion back"
    SINGULAR = "near a singularity: damped"
    OUT_OF_REACH = "nothing moves any more and a target is not reached"
    FOLLOWING = "every pull is followed"
    IDLE = "nothing is pulled"
    DETOUR = "on the way to the targets by another posture"
    BARRED = "a barrier holds the motion back"


STATUSES = tuple(Status)  # in the kernel's order


@dataclass(frozen=True)
class Layout:
    """Where things lie in a tick's record.

    Attributes:
        mechanism: which was moved.
        pulls: of each pull the node, the axes, and what of the node is pulled.
        resting: columns that rest: those of a base that is not pulled.
    """

    mechanism: Mechanism
    pulls: tuple[tuple[str, str, pin.SE3], ...]
    resting: int

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """Of q, v, errors, what was wanted, singular values and stopped joints; then the record's length."""
        nq, nv, pulls = self.mechanism.model.nq, self.mechanism.model.nv, len(self.pulls)
        return tuple(np.cumsum((m.R_HEAD, nq, nv, 2 * pulls, m.WANTED * pulls, 6 * pulls, nv)).tolist())


class Step:
    """What one tick did. A value: later ticks do not change it."""

    __slots__ = ("_exceptions", "_layout", "_record")

    def __init__(self, record: Array, layout: Layout, exceptions: tuple[Exception, ...] = ()) -> None:
        self._record, self._layout, self._exceptions = record, layout, exceptions

    def __repr__(self) -> str:
        return f"<Step {self.status.name}: errors {self.errors}, closure {self.closure:.1g}>"

    @property
    def status(self) -> Status:
        """In one word."""
        return STATUSES[int(self._record[m.R_STATUS])]

    @property
    def q(self) -> Array:
        """(nq,) the new configuration."""
        start = self._layout.starts
        return self._record[start[0] : start[1]]

    @property
    def v(self) -> Array:
        """(nv,) the velocity that led there, rad/s and m/s."""
        start = self._layout.starts
        return self._record[start[1] : start[2]]

    @property
    def closure(self) -> float:
        """Largest loop residual at q, rad or characteristic lengths."""
        return float(self._record[m.R_CLOSURE])

    @property
    def errors(self) -> tuple[tuple[float, float], ...]:
        """For each pull, in the order they were made, what is left: metres and radians."""
        start = self._layout.starts
        if self._record[m.R_MEASURED]:
            left = self._record[start[2] : start[3]].tolist()
            return tuple(zip(left[::2], left[1::2], strict=True))
        mechanism, q = self._layout.mechanism, self.q
        found = []
        for pull, axes in self._wanted():
            straight, turn = pull.errors(mechanism.placement(q, pull.node) * pull.at, axes)
            found.append((math.hypot(*straight), math.hypot(*turn)))
        return tuple(found)

    def _wanted(self) -> list[tuple[Pull, Array]]:
        """What each pull that held wanted, and its axes in the world."""
        start = self._layout.starts
        rows = self._record[start[3] : start[4]].reshape(-1, m.WANTED)
        pulls = []
        for (node, _, at), row in zip(self._layout.pulls, rows, strict=True):
            if row[24]:
                aim = pin.SE3(row[:9].reshape(3, 3).T, row[9:12])
                frame = self._layout.mechanism.frame_id(node)
                pull = Pull(node, aim, int(row[21]), int(row[22]), row[23], frame=frame, at=at)
                pulls.append((pull, row[12:21].reshape(3, 3)))
        return pulls

    @property
    def singular_values(self) -> Array:
        """Of the pulls on what the loops leave, largest first, as many as their generic rank (type 1 where one
        vanishes). Far from singularities they are computed when asked for, at q."""
        count = int(self._record[m.R_PULL_RANK])
        if self._record[m.R_SIGMA]:
            start = self._layout.starts[4]
            return self._record[start : start + count]
        mechanism, resting = self._layout.mechanism, self._layout.resting
        system = mechanism.system
        loops = system.evaluate(self.q)[1][:, resting:]
        rows = equations(mechanism, system, self._wanted())[1][:, resting:]
        motions, _ = free_motions(loops, mechanism.loop_rank)
        return np.asarray(np.linalg.svd(rows @ motions, compute_uv=False)[:count])

    @property
    def loop_singular_values(self) -> Array:
        """Of all loops at q, largest first, as many as their generic rank. Computed when asked for."""
        mechanism = self._layout.mechanism
        if not mechanism.loops or mechanism.loop_rank == 0:
            return np.zeros(0)
        rows = mechanism.system.evaluate(self.q)[1][:, self._layout.resting :]
        return np.asarray(np.linalg.svd(rows, compute_uv=False)[: mechanism.loop_rank])

    @property
    def passive_singular_values(self) -> Array:
        """Of the passive joints in the loops at q, largest first, as many as their generic rank (type 2 where one
        vanishes: the mechanism moves though its motors are held). Computed when asked for."""
        return passive_singular_values(self._layout.mechanism, self.q)

    @property
    def losing(self) -> Lost | None:
        """The direction that the pulls follow worst at q, with its singular value (type 1); None where nothing is
        pulled that can move. Computed when asked for."""
        wanted, layout, start = self._wanted(), self._layout, self._layout.starts
        count = int(self._record[m.R_PULL_RANK])
        found = lost(layout.mechanism, self.q, wanted, count, layout.resting)
        if found is None or len(wanted) == len(layout.pulls):
            return found
        twists = np.zeros((len(layout.pulls), 6))
        twists[self._record[start[3] : start[4]].reshape(-1, m.WANTED)[:, 24] != 0.0] = found.twists
        return replace(found, twists=twists)

    @property
    def gaining(self) -> Gained | None:
        """The motion that the motors hold least at q, with its singular value (type 2); None without loops. Computed
        when asked for."""
        return gained(self._layout.mechanism, self.q)

    @property
    def saturated(self) -> tuple[str, ...]:
        """Joints that stand at a position limit which holds the motion back."""
        flags = self.stopped
        if not flags.any():
            return ()
        columns = self._layout.mechanism.columns
        return tuple(columns[j] for j in np.flatnonzero(flags))

    @property
    def stopped(self) -> Array:
        """(nv,) other than 0 for these: -1 at the lower limit, 1 at the upper."""
        start = self._layout.starts
        return self._record[start[5] : start[6]]

    @property
    def pace(self) -> float:
        """The part of the wanted motion that speed limits (and the longest step that a tick's linearisation is good
        for, 0.1 rad or characteristic lengths) let through, 0 to 1."""
        return float(self._record[m.R_PACE])

    @property
    def slowest(self) -> str | None:
        """The joint whose speed or acceleration limit the pace is due to."""
        which = int(self._record[m.R_SLOWEST])
        return None if which < 0 else self._layout.mechanism.columns[which]

    @property
    def left_out(self) -> tuple[int, ...]:
        """Which of the solver's objectives failed in this tick, by position: they were left out."""
        flags = int(self._record[m.R_LEFT_OUT])
        return tuple(i for i in range(flags.bit_length()) if flags >> i & 1)

    @property
    def exceptions(self) -> tuple[Exception, ...]:
        """What objectives, barriers or the search for a path around obstacles raised in this tick, with tracebacks.

        A value returned by them that makes no sense is a ValueError here. Empty as a rule.
        """
        return self._exceptions

    @property
    def barred(self) -> tuple[int, ...]:
        """Which rows of the solver's barriers hold the motion back, by position among all of this tick; 52 stands
        for all from there on."""
        flags = int(self._record[m.R_BARRED])
        return tuple(i for i in range(flags.bit_length()) if flags >> i & 1)

    @property
    def evaluations(self) -> int:
        """How often Pinocchio was called."""
        return int(self._record[m.R_EVALUATIONS])

    @property
    def sweeps(self) -> int:
        """How many sweeps of rotations the singular values took."""
        return int(self._record[m.R_SWEEPS])
