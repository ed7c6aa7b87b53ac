"""A sensor holds a node: what it says becomes the motion of a task's target."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.errors import CinegenError, UnknownNameError
from cinegen.ik import FrameTask
from cinegen.sensor import NO_TWIST, Reading, Sensor, SensorState, SensorStatus, Twist

Array = NDArray[np.float64]

REST = 0.1
"""s in which a target comes to rest when its sensor falls silent."""

_FREE = {0: (0, 0, 0), 1: (1, 0, 0), 2: (1, 1, 0), 3: (1, 1, 1)}
_TURNS = {0: (0, 0, 0), 1: (0, 0, 1), 2: (1, 1, 0), 3: (1, 1, 1)}


@dataclass(frozen=True)
class Grip:
    """How a sensor's twist is taken.

    Attributes:
        speed: at full deflection, m/s.
        turning: at full deflection, rad/s.
        dead: deflection, 0 to 1, that counts as none, on each axis. What is beyond grows from 0, without a step.
        dominant: only the axis that is deflected most counts.
        translation: how many translations the sensor commands, as RAFF says: 3 all; 2 along the frame's x and y; 1
            along x; 0 none.
        rotation: how many rotations: 3 all; 2 about x and y (the direction of z); 1 about z; 0 none.

    Raises:
        CinegenError: one of these makes no sense.
    """

    speed: float = 0.1
    turning: float = 0.5
    dead: float = 0.05
    dominant: bool = False
    translation: int = 3
    rotation: int = 3

    def __post_init__(self) -> None:
        if not (0.0 <= self.speed < math.inf and 0.0 <= self.turning < math.inf):
            raise CinegenError(f"a grip's speeds must be 0 or more, not {self.speed} m/s and {self.turning} rad/s")
        if not 0.0 <= self.dead < 1.0:
            raise CinegenError(f"a grip's dead zone must be from 0 to less than 1, not {self.dead}")
        if self.translation not in _FREE or self.rotation not in _TURNS:
            raise CinegenError(
                f"a grip holds 0 to 3 translations and rotations, not {self.translation}, {self.rotation}"
            )

    @property
    def free(self) -> tuple[int, ...]:
        """(6,) 1 for the axes that are commanded, 0 for the others."""
        return _FREE[self.translation] + _TURNS[self.rotation]

    def velocity(self, twist: Twist) -> Array:
        """(6,) m/s and rad/s in the axes of command, for a deflection."""
        values = [_beyond(value, self.dead) * free for value, free in zip(twist, self.free, strict=True)]
        if self.dominant:
            most = max(range(6), key=lambda i: abs(values[i]))
            values = [value if i == most else 0.0 for i, value in enumerate(values)]
        return np.array([value * (self.speed if i < 3 else self.turning) for i, value in enumerate(values)])


def _beyond(value: float, dead: float) -> float:
    return math.copysign(min(1.0, max(0.0, abs(value) - dead) / (1.0 - dead)), value)


class Hold:
    """Moves a task's target after a sensor, tick by tick.

    A twist moves the target along the axes of the frame of command, and turns it about its own origin. When the sensor
    falls silent while it is deflected, or is lost, the target comes to rest within `REST` and stays. A placement sets
    the target.

    Args:
        sensor: started by whoever has it.
        task: whose target it moves, after a pose.
        grip: how a twist is taken.
        frame: of command: a name in `axes`, or "node" for the axes of the target itself (the tool's).

    Attributes:
        axes: frames of command by name, each (3, 3), its axes in the world; "world" and "base" are there, others may be
            added (the view's), and all may be set anew at any time.

    Raises:
        UnknownNameError: no such frame.
    """

    def __init__(self, sensor: Sensor, task: FrameTask, grip: Grip | None = None, frame: str = "world") -> None:
        self.sensor, self.task, self.grip = sensor, task, grip or Grip()
        self.axes: dict[str, Array] = {"world": np.eye(3), "base": np.eye(3)}
        self.frame = frame
        self._twist: Twist = NO_TWIST
        self._meant = NO_TWIST, self.grip, np.zeros(6)  # a twist, and the velocity that a grip makes of it
        self._time = 0.0  # of the last reading
        self._age = 0.0  # s since it came

    @property
    def frame(self) -> str:
        """The frame of command."""
        return self._frame

    @frame.setter
    def frame(self, frame: str) -> None:
        if frame != "node" and frame not in self.axes:
            raise UnknownNameError("frame of command", frame, (*self.axes, "node"))
        self._frame = frame

    @property
    def status(self) -> SensorStatus:
        """The sensor's, or that it has fallen silent."""
        status = self.sensor.status
        if status.state is SensorState.LIVE and self._twist != NO_TWIST and self._age > self.sensor.timeout:
            words = f"{self.sensor.url} has fallen silent: its target is held"
            return status._replace(state=SensorState.SILENT, words=words)
        return status

    def advance(self, dt: float) -> Reading | None:
        """Goes on by dt (s), before a tick of the solver; does not raise. Returns what the sensor has said since."""
        reading = self.sensor.read()
        self._age += dt
        if reading is not None and reading.time != self._time:  # else only its buttons are new
            self._time, self._age = reading.time, 0.0
            self._twist = reading.twist or NO_TWIST
            if reading.target is not None:
                self._set(reading.target)
        if self._twist != NO_TWIST:
            self._move(dt)
        return reading

    def _axes(self) -> Array:
        return self.task.target.rotation if self._frame == "node" else self.axes[self._frame]

    def _move(self, dt: float) -> None:
        timeout = self.sensor.timeout
        if self._age <= timeout and self.sensor.status.state not in (SensorState.LIVE, SensorState.SILENT):
            self._age = timeout + dt  # lost: no need to wait
        part = 1.0
        if self._age > timeout:
            part = 1.0 - (self._age - timeout) / REST
            if part <= 0.0:
                self._twist = NO_TWIST
                return
            part *= part * (3.0 - 2.0 * part)  # neither begins nor ends with a jerk
        task = self.task
        if task.twist is not None or not task.is_valid():
            return
        target, axes = task.target, self._axes()
        if self._meant[:2] != (self._twist, self.grip):  # a device says the same for many ticks
            self._meant = self._twist, self.grip, self.grip.velocity(self._twist)
        velocity = part * dt * self._meant[2]
        turn = pin.exp3(axes @ velocity[3:]) @ target.rotation
        task.target = pin.SE3(_orthonormal(turn), target.translation + axes @ velocity[:3])

    def _set(self, given: pin.SE3) -> None:
        """The target there, as far as the sensor commands it."""
        free = np.array(self.grip.free, dtype=float)
        if free.all():
            self.task.target = given
            return
        if not self.task.is_valid():
            return
        target, axes = self.task.target, self._axes()
        step = axes @ (free[:3] * (axes.T @ (given.translation - target.translation)))
        turn = axes @ (free[3:] * (axes.T @ pin.log3(given.rotation @ target.rotation.T)))
        self.task.target = pin.SE3(_orthonormal(pin.exp3(turn) @ target.rotation), target.translation + step)


def _orthonormal(rotation: Array) -> Array:
    """One step towards the nearest rotation, enough against rounding that adds up over hours (Newton's, for the polar
    decomposition)."""
    return np.asarray(1.5 * rotation - 0.5 * rotation @ (rotation.T @ rotation))
