"""Smooth transitions of a task from one target and weight to others."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from cinegen.errors import CinegenError
from cinegen.ik.task import FrameTask

_LEAST = 1e-6  # fraction of its weight that a fading task keeps until it is removed


def eased(part: float) -> float:
    """Return the minimum-jerk profile, 0 to 1 for `part` from 0 to 1, with zero speed and acceleration at both ends
    (T. Flash and N. Hogan, "The coordination of arm movements", 1985)."""
    u = min(max(part, 0.0), 1.0)
    return u * u * u * (10.0 - u * (15.0 - 6.0 * u))


class Blend:
    """Transition in progress. A target or weight that is set by others meanwhile ends its interpolation.

    Args:
        task: task that follows a pose.
        seconds: duration.
        target: final pose; the origin moves along a straight line, the orientation about one axis. Unchanged
            unless given.
        weight: final weight; unchanged unless given. 0 removes the task.

    Attributes:
        task: as given.
        removes: whether the task is removed at the end.

    Raises:
        CinegenError: the task follows a twist; or seconds, target or weight is negative or not finite.
    """

    def __init__(
        self, task: FrameTask, seconds: float, target: pin.SE3 | None = None, weight: float | None = None
    ) -> None:
        if not (np.isfinite(seconds) and seconds >= 0.0):
            raise CinegenError(f"a blend takes 0 seconds or more, not {seconds}")
        if target is not None and not (isinstance(target, pin.SE3) and np.isfinite(target.homogeneous).all()):
            raise CinegenError(f"a blend's target must be a finite pinocchio.SE3, not {target!r}")
        if weight is not None and not 0.0 <= weight < np.inf:
            raise CinegenError(f"a blend's weight must be 0 or more, not {weight}")
        if target is not None and (task.twist is not None or not task.is_valid()):
            raise CinegenError(f"a blend starts at a pose, but the task of '{task.node}' follows a twist or is invalid")
        self.task, self._seconds, self._elapsed = task, seconds, 0.0
        self.removes = weight == 0.0
        self._target = None if target is None else (task.target.copy(), target.copy())
        self._weight = None if weight is None else (task.weight, max(weight, _LEAST * task.weight))
        self._set = task.target, task.weight  # as this blend has left them

    def advance(self, dt: float) -> bool:
        """Advance by dt (s). Return whether the transition continues."""
        task = self.task
        target, weight = task.target, task.weight
        if self._target is not None and not _same(target, self._set[0]):
            self._target = None
        if self._weight is not None and weight != self._set[1]:
            self._weight, self.removes = None, False
        self._elapsed += dt
        part = 1.0 if self._elapsed >= self._seconds - 1e-9 * dt else eased(self._elapsed / self._seconds)
        if self._target is not None:
            begin, end = self._target
            rotation = begin.rotation @ pin.exp3(part * pin.log3(begin.rotation.T @ end.rotation))
            position = begin.translation + part * (end.translation - begin.translation)
            task.target = pin.SE3(rotation, position) if part < 1.0 else end
        if self._weight is not None:
            first, last = self._weight
            task.weight = first + part * (last - first)
        self._set = task.target.copy() if self._target is not None else target, task.weight
        return part < 1.0 and (self._target is not None or self._weight is not None)


def _same(pose: object, other: object) -> bool:
    return isinstance(pose, pin.SE3) and isinstance(other, pin.SE3) and bool(pose == other)
