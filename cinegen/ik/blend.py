"""Leading a pull over from one target and weight to others, without a jerk."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from cinegen.errors import CinegenError
from cinegen.ik.pull import Pull

_LEAST = 1e-6  # part of its weight that a fading pull keeps until it is let go


def eased(part: float) -> float:
    """From 0 to 1 while `part` goes there, with the least jerk: speed and acceleration are 0 at both ends (T. Flash and
    N. Hogan, "The coordination of arm movements", 1985)."""
    u = min(max(part, 0.0), 1.0)
    return u * u * u * (10.0 - u * (15.0 - 6.0 * u))


class Blend:
    """On its way. Ends early where somebody else sets the pull's target or weight meanwhile: those hold, then.

    Args:
        pull: after a pose.
        seconds: how long it takes.
        target: pose to end at; the origin goes straight, the orientation about one axis. Stays unless given.
        weight: to end with; stays unless given. 0 lets go.

    Raises:
        CinegenError: the pull follows no pose, or the others make no sense.
    """

    def __init__(self, pull: Pull, seconds: float, target: pin.SE3 | None = None, weight: float | None = None) -> None:
        if not (np.isfinite(seconds) and seconds >= 0.0):
            raise CinegenError(f"a blend takes 0 seconds or more, not {seconds}")
        if target is not None and not (isinstance(target, pin.SE3) and np.isfinite(target.homogeneous).all()):
            raise CinegenError(f"a blend leads to a finite pinocchio.SE3, not {target!r}")
        if weight is not None and not 0.0 <= weight < np.inf:
            raise CinegenError(f"a blend leads to a weight of 0 or more, not {weight}")
        if target is not None and (pull.twist is not None or not pull.makes_sense()):
            raise CinegenError(f"a blend begins at a pose, and the pull of '{pull.node}' follows none")
        self.pull, self._seconds, self._elapsed = pull, seconds, 0.0
        self._lets_go = weight == 0.0
        self._target = None if target is None else (pull.target.copy(), target.copy())
        self._weight = None if weight is None else (pull.weight, max(weight, _LEAST * pull.weight))
        self._set = pull.target, pull.weight  # as this blend has left them

    def advance(self, dt: float) -> bool:
        """Goes on by dt (s); whether it is still on its way."""
        pull = self.pull
        target, weight = pull.target, pull.weight
        if self._target is not None and not _same(target, self._set[0]):
            self._target = None
        if self._weight is not None and weight != self._set[1]:
            self._weight, self._lets_go = None, False
        self._elapsed += dt
        part = 1.0 if self._elapsed >= self._seconds - 1e-9 * dt else eased(self._elapsed / self._seconds)
        if self._target is not None:
            begin, end = self._target
            turn = begin.rotation @ pin.exp3(part * pin.log3(begin.rotation.T @ end.rotation))
            way = begin.translation + part * (end.translation - begin.translation)
            pull.target = pin.SE3(turn, way) if part < 1.0 else end
        if self._weight is not None:
            first, last = self._weight
            pull.weight = first + part * (last - first)
        self._set = pull.target.copy() if self._target is not None else target, pull.weight
        return part < 1.0 and (self._target is not None or self._weight is not None)

    @property
    def lets_go(self) -> bool:
        """Whether the pull ends with it."""
        return self._lets_go


def _same(one: object, other: object) -> bool:
    return isinstance(one, pin.SE3) and isinstance(other, pin.SE3) and bool(one == other)
