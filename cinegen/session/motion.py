"""Motions of a robot that no task makes: motors led by hand, the way to a configuration, a way gone before.

Each has `advance(dt)`: the configuration after dt (s), loops closed, or None where it has ended. None of them raises.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cinegen.errors import CinegenError
from cinegen.ik.blend import eased
from cinegen.model import ForwardKinematics, Mechanism

Array = NDArray[np.float64]

_FASTEST = 2.0  # rad/s, or characteristic lengths: of a motor without a limit
_LIMIT = 1e-9  # rad or m: rounding at a limit
_SHORTEST, _LONGEST = 0.3, 30.0  # s for a way
_THERE = 1e-6  # rad or lengths: near enough to be there
_BACK = 1.5  # s: the longest that undoing takes
_PATIENCE = 0.5  # s: what is in the way may be going away itself


class Motion(Protocol):
    """What moves a robot.

    Attributes:
        name: of what it does, for people.
        trouble: why it did not do all that it should; empty if it did.
    """

    name: str
    trouble: str

    def advance(self, dt: float) -> Array | None:
        """(nq,) after dt (s); None where it has ended."""

    def halt(self, q: Array, trouble: str) -> None:
        """It could not go where it led last: it is still at q (nq,), and why."""


class Motors:
    """Motors go where sliders say, as fast as they may; all other joints follow on this branch (`ForwardKinematics`).

    Where the loops can't follow, or a joint that follows would pass its limit, all stay where they are.

    Args:
        mechanism: whose.
        q: (nq,) where it is, loops closed.
    """

    name = "motors"

    def __init__(self, mechanism: Mechanism, q: Array) -> None:
        self.trouble = ""
        self.goal: dict[str, float] = {}
        self._mechanism = mechanism
        self._forward = ForwardKinematics(mechanism, q)
        self._q = q.copy()
        self._speed = speeds(mechanism)
        self._ends = False

    def lead(self, joint: str, value: float) -> None:
        """A motor should be at a value, as far as its limits allow."""
        limits = self._mechanism.limits[joint]
        self.goal[joint] = min(max(value, limits.lower), limits.upper)

    def end(self) -> None:
        """Ends when the motors have arrived."""
        self._ends = True

    def advance(self, dt: float) -> Array | None:
        """One step of all motors."""
        wanted = {}
        for joint, goal in self.goal.items():
            here, most = self._q[self._mechanism.q_index(joint)], self._speed[joint] * dt
            if here != goal:
                wanted[joint] = float(here + min(max(goal - here, -most), most))
        if not wanted:
            return None if self._ends else self._q
        self.trouble = ""
        try:
            q = self._forward.move(wanted)
            passed = beyond(self._mechanism, q, self._q)
            if passed:
                self._forward.q = self._q
                self.trouble = f"at limit: {passed}"
        except CinegenError as error:
            self.trouble = str(error)
        if self.trouble:
            self.goal = {}  # a slider that moves on tries again
            return None if self._ends else self._q
        self._q = q
        return q

    def halt(self, q: Array, trouble: str) -> None:
        """The motors stay there; a slider that moves on tries again."""
        self._forward.q = self._q = q
        self.goal, self.trouble = {}, trouble


class _Timed:
    """Goes on with time; waits where something is in the way, and ends where that stays."""

    name: str
    trouble = ""
    _seconds: float
    _time = 0.0
    _waited = 0.0
    _dt = 0.0
    _halted = False

    def _go_on(self, dt: float) -> float | None:
        """Which part of the way is to be gone after dt (s), 0 to 1; None where it has ended."""
        if self._time >= self._seconds:
            return None
        if not self._halted:
            self._waited = 0.0
        self._halted = False
        self._dt = dt
        self._time += dt
        return eased(self._time / self._seconds) if self._time < self._seconds else 1.0

    def halt(self, q: Array, trouble: str) -> None:
        """It waits at q (nq,)."""
        self._halted = True
        self._waited += self._dt
        self._time -= self._dt
        if self._waited >= _PATIENCE or self._time == math.inf:
            self._time, self.trouble = math.inf, trouble


class Way(_Timed):
    """To a configuration, led by the motors; where they can't lead there on this branch, at once.

    Args:
        mechanism: which goes.
        q: (nq,) where it is, loops closed.
        goal: (nq,) where it should be, loops closed.
        name: of what it does.
    """

    def __init__(self, mechanism: Mechanism, q: Array, goal: Array, name: str) -> None:
        self.name = name
        self._mechanism, self._goal, self._start = mechanism, goal, q.copy()
        self._forward = ForwardKinematics(mechanism, q)
        speed = speeds(mechanism)
        places = [(joint, mechanism.q_index(joint)) for joint in mechanism.actuated]
        longest = max((abs(goal[i] - q[i]) / speed[joint] for joint, i in places), default=0.0)
        self._seconds = min(max(2.0 * longest, _SHORTEST), _LONGEST)
        self._places = places

    def advance(self, dt: float) -> Array | None:
        """One step on the way."""
        part = self._go_on(dt)
        if part is None:
            return None
        values = {joint: float((1.0 - part) * self._start[i] + part * self._goal[i]) for joint, i in self._places}
        try:
            q = self._forward.move(values)
        except CinegenError:
            return self._jump()
        if self._mechanism.floating:
            base = self._mechanism.interpolate(self._start, self._goal, part)[:7]
            q[:7] = base
        if part < 1.0:
            return q
        return self._jump() if self._mechanism.distance(q, self._goal) > _THERE else self._goal

    def halt(self, q: Array, trouble: str) -> None:
        """See `Motion`."""
        self._forward.q = q
        super().halt(q, trouble)

    def _jump(self) -> Array:
        self._time = math.inf
        self.trouble = "its motors don't lead there from this assembly mode: it was put there at once"
        return self._goal


class Retrace(_Timed):
    """A way gone before, backwards or again: every configuration on it was there.

    Args:
        trace: configurations (nq,), as they were passed.
        period: s between two of them.
        name: of what it does.
    """

    def __init__(self, trace: Sequence[Array], period: float, name: str) -> None:
        self.name = name
        self._trace = trace
        self._seconds = min(period * (len(trace) - 1), _BACK)

    def advance(self, dt: float) -> Array | None:
        """The next of them whose time has come."""
        part = self._go_on(dt)
        return None if part is None else self._trace[round(part * (len(self._trace) - 1))]


def speeds(mechanism: Mechanism) -> dict[str, float]:
    """How fast each joint may be, rad/s or m/s."""
    found = {}
    for joint in mechanism.joints:
        limit = mechanism.limits[joint].velocity
        usual = _FASTEST * (mechanism.length if mechanism.is_prismatic(joint) else 1.0)
        found[joint] = limit if math.isfinite(limit) else usual
    return found


def beyond(mechanism: Mechanism, q: Array, before: Array) -> str:
    """The first joint that q (nq,) leads beyond a limit, or further beyond it than before; empty if there is none."""
    for joint, limit in mechanism.limits.exceeded(q, _LIMIT).items():
        i = mechanism.q_index(joint)
        if (q[i] - before[i]) * (q[i] - limit) > 0.0:
            return joint
    return ""
