"""Teleoperation: the readings of a sensor move the target of a task."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.ik import FrameTask
from cinegen.ik.tasks.values import ROTATIONS, TRANSLATIONS, is_count
from cinegen.sensor import NO_TWIST, Reading, Sensor, SensorState, SensorStatus, Twist
from raff2urdf.axes import UNCHANGED, parse_axes
from raff2urdf.errors import RaffError, raised_as

REST = 0.1
"""Time in which a target comes to rest when its sensor falls silent, s."""


@dataclass(frozen=True)
class TwistMapping:
    """Mapping from a sensor's deflection to a velocity.

    Attributes:
        speed: speed at full deflection, m/s.
        turning: angular speed at full deflection, rad/s.
        dead: dead zone of each axis, 0 to 1. The velocity grows continuously from 0 beyond it.
        dominant: whether only the axis with the largest deflection counts.
        translation: number of commanded translations, as in RAFF: 3 all; 2 along x and y of the command frame; 1 along
            x; 0 none.
        rotation: number of commanded rotations: 3 all; 2 about x and y (the direction of z); 1 about z; 0 none.
        axes: axes of the sensor that command x, y, z, rx, ry and rz, each with a sign and a factor, as in RAFF:
            "x, -z, y, rx, -rz, 0.5*ry". Targets of a sensor have no such axes, and stay.

    Raises:
        CinegenError: a value is out of range.
    """

    speed: float = 0.1
    turning: float = 0.5
    dead: float = 0.05
    dominant: bool = False
    translation: int = 3
    rotation: int = 3
    axes: str = UNCHANGED

    def __post_init__(self) -> None:
        if not (0.0 <= self.speed < math.inf and 0.0 <= self.turning < math.inf):
            raise CinegenError(f"speed and turning must be finite and 0 or more, not {self.speed} and {self.turning}")
        if not 0.0 <= self.dead < 1.0:
            raise CinegenError(f"the dead zone must be in [0, 1), not {self.dead}")
        if not (is_count(self.translation) and is_count(self.rotation)):
            raise CinegenError(f"translation and rotation must be 0 to 3, not {self.translation} and {self.rotation}")
        with raised_as(CinegenError, RaffError):
            parse_axes(self.axes)

    @property
    def commanded(self) -> tuple[float, ...]:
        """(6,) 1 for commanded axes, 0 for the others."""
        return TRANSLATIONS[self.translation] + ROTATIONS[self.rotation]

    def velocity(self, twist: Twist) -> Array:
        """Return the velocity (6,) of a deflection, m/s and rad/s in the axes of the command frame."""
        parts = [
            (factor * free, axis) for (factor, axis), free in zip(parse_axes(self.axes), self.commanded, strict=True)
        ]
        values = [_beyond(value, self.dead) for value in twist]
        if self.dominant:
            most = max((axis for factor, axis in parts if factor), key=lambda axis: abs(values[axis]), default=0)
            values = [value if axis == most else 0.0 for axis, value in enumerate(values)]
        speeds = (self.speed,) * 3 + (self.turning,) * 3
        return np.array([factor * values[axis] * speed for (factor, axis), speed in zip(parts, speeds, strict=True)])


def _beyond(value: float, dead: float) -> float:
    return math.copysign(min(1.0, max(0.0, abs(value) - dead) / (1.0 - dead)), value)


class Teleoperation:
    """Moves the target of a task by a sensor, tick by tick.

    A deflection moves the target along the axes of the command frame and rotates it about its own origin. If the sensor
    falls silent while deflected, or is lost, the target comes to rest within `REST`. A target pose of the sensor
    replaces the target.

    Args:
        sensor: sensor; it is started and closed by its owner.
        task: task that follows a pose.
        mapping: mapping from deflection to velocity.
        frame: command frame: a name in `axes`, or "node" for the axes of the target itself (the tool's).

    Attributes:
        axes: command frames by name, each (3, 3), axes in the world: "world", "base" (at first those of the world), and
            any that are added, such as the view's. They may be changed at any time.

    Raises:
        UnknownNameError: no such command frame.
    """

    def __init__(
        self, sensor: Sensor, task: FrameTask, mapping: TwistMapping | None = None, frame: str = "world"
    ) -> None:
        self.sensor, self.task, self.mapping = sensor, task, mapping or TwistMapping()
        self.axes: dict[str, Array] = {"world": np.eye(3), "base": np.eye(3)}
        self.frame = frame
        self._twist: Twist = NO_TWIST
        self._mapped = NO_TWIST, self.mapping, np.zeros(6)  # a deflection and its velocity
        self._time = 0.0  # time of the last reading, s
        self._age = 0.0  # time since then, s

    @property
    def frame(self) -> str:
        """Name of the command frame."""
        return self._frame

    @frame.setter
    def frame(self, frame: str) -> None:
        if frame != "node" and frame not in self.axes:
            raise UnknownNameError("frame of command", frame, (*self.axes, "node"))
        self._frame = frame

    @property
    def status(self) -> SensorStatus:
        """Status of the sensor, which counts as silent after its time-out."""
        status = self.sensor.status
        if status.state is SensorState.LIVE and self._twist != NO_TWIST and self._age > self.sensor.timeout:
            message = f"{self.sensor.url} has fallen silent: its target stays"
            return status._replace(state=SensorState.SILENT, message=message)
        return status

    def advance(self, dt: float) -> Reading | None:
        """Read the sensor and advance by dt (s), before a tick of the solver; does not raise. Return the reading since
        the last call."""
        reading = self.sensor.read()
        self.advance_by(reading, dt)
        return reading

    def advance_by(self, reading: Reading | None, dt: float) -> None:
        """Advance by dt (s) with a reading of the sensor, of which several tasks follow the same; does not raise."""
        self._age += dt
        if reading is not None and reading.time != self._time:  # else only its buttons are new
            self._time, self._age = reading.time, 0.0
            self._twist = reading.twist or NO_TWIST
            if reading.target is not None:
                self._set(reading.target)
        if self._twist != NO_TWIST:
            self._move(dt)

    def _axes(self) -> Array:
        return self.task.target.rotation if self._frame == "node" else self.axes[self._frame]

    def _move(self, dt: float) -> None:
        timeout = self.sensor.timeout
        if self._age <= timeout and self.sensor.status.state not in (SensorState.LIVE, SensorState.SILENT):
            self._age = timeout + dt  # lost: do not wait for the time-out
        part = 1.0
        if self._age > timeout:
            part = 1.0 - (self._age - timeout) / REST
            if part <= 0.0:
                self._twist = NO_TWIST
                return
            part *= part * (3.0 - 2.0 * part)  # smooth at both ends
        task = self.task
        if task.twist is not None or not task.is_valid():
            return
        target, axes = task.target, self._axes()
        if self._mapped[:2] != (self._twist, self.mapping):  # unchanged for many ticks
            self._mapped = self._twist, self.mapping, self.mapping.velocity(self._twist)
        velocity = part * dt * self._mapped[2]
        turn = pin.exp3(axes @ velocity[3:]) @ target.rotation
        task.target = pin.SE3(_orthonormal(turn), target.translation + axes @ velocity[:3])

    def _set(self, pose: pin.SE3) -> None:
        """Set the target in the commanded directions."""
        free = np.array(self.mapping.commanded, dtype=float)
        if free.all():
            self.task.target = pose
            return
        if not self.task.is_valid():
            return
        target, axes = self.task.target, self._axes()
        step = axes @ (free[:3] * (axes.T @ (pose.translation - target.translation)))
        turn = axes @ (free[3:] * (axes.T @ pin.log3(pose.rotation @ target.rotation.T)))
        self.task.target = pin.SE3(_orthonormal(pin.exp3(turn) @ target.rotation), target.translation + step)


def _orthonormal(rotation: Array) -> Array:
    """Return one Newton step of the polar decomposition towards the nearest rotation; it keeps rounding errors from
    adding up over hours."""
    return np.asarray(1.5 * rotation - 0.5 * rotation @ (rotation.T @ rotation))
