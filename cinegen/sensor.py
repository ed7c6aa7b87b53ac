"""The interface of all sensors: readings, status, and what a sensor can do."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from enum import Enum
from typing import NamedTuple, Protocol

import pinocchio as pin

from cinegen.errors import CinegenError

Twist = tuple[float, float, float, float, float, float]
"""Three translations, then three rotations, each from -1 to 1: full deflection is 1.

x points to the right, y away from the user, z up: the axes of a world with z up, seen from its front. Rotations are
right-handed about the same axes. The readings of all devices are converted to these axes.
"""

NO_TWIST: Twist = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class SensorError(CinegenError):
    """A sensor cannot be made: its URL is wrong, or it needs something that is missing."""


class SensorState(Enum):
    """State of a sensor."""

    CLOSED = "closed"  # not started, or ended
    OPENING = "opening"  # looking for its device
    LIVE = "live"  # connected
    SILENT = "silent"  # no reading within the time-out after a deflection: the deflection no longer counts
    LOST = "lost"  # not connected; connection is tried again
    REFUSED = "refused"  # connected to another kind of device; connection is tried again


class SensorStatus(NamedTuple):
    """Status of a sensor.

    Attributes:
        state: state of the connection.
        message: description for users.
        packets: number of readings since the start.
        damaged: number of packets or lines that could not be used.
    """

    state: SensorState
    message: str
    packets: int = 0
    damaged: int = 0


class Reading(NamedTuple):
    """Reading of a sensor: a deflection, a target pose, or only buttons.

    Attributes:
        time: time of reception, s of `time.monotonic`.
        twist: deflection, dimensionless; see `Twist`. None without one.
        target: target pose of the node in the world; None without one.
        buttons: indices of the buttons that are down, from 0.
        pressed: buttons that went down since the previous reading, in order, even if they are up again.
    """

    time: float
    twist: Twist | None = None
    target: pin.SE3 | None = None
    buttons: frozenset[int] = frozenset()
    pressed: tuple[int, ...] = ()


class Sensor(Protocol):
    """Input device, or a program instead. Its methods do not raise; `read` and `status` take microseconds.

    Attributes:
        url: address of the device.
        timeout: time without a reading, s, after which a deflected sensor counts as silent.
    """

    url: str
    timeout: float

    def start(self) -> None:
        """Start, and return at once; `status` reports the connection."""

    def read(self) -> Reading | None:
        """Return the newest reading that was not read yet, or None. Only one thread may read."""

    @property
    def status(self) -> SensorStatus:
        """Status of the connection."""

    def close(self) -> None:
        """Close the device; it may be started again."""


class TimedSensor(ABC):
    """Base of sensors whose readings follow from the time since their start: scripts and recordings.

    Args:
        url: name of the script.
    """

    timeout = math.inf

    def __init__(self, url: str) -> None:
        self.url = url
        self._begin: float | None = None
        self._now = 0.0  # s since the start, at the last call of `read`
        self._count = 0  # readings since the start

    def start(self) -> None:
        """Start the time; does nothing if it was started already."""
        if self._begin is None:
            self._now, self._count = 0.0, 0
            self._begin = time.monotonic()

    def go_on(self, other: TimedSensor) -> None:
        """Start with the time of another sensor, whose place it takes."""
        self.start()
        self._begin = other._begin if other._begin is not None else self._begin

    def read(self) -> Reading | None:
        """Return the newest reading; None when it is stopped, at its end, or has no new one."""
        if self._begin is None or self.ended:
            return None
        self._now = time.monotonic() - self._begin
        reading = self.reading_at(self._now)
        return None if reading is None else reading._replace(time=self._begin + reading.time)

    @property
    def status(self) -> SensorStatus:
        """Live from its start to its end."""
        if self._begin is None:
            return SensorStatus(SensorState.CLOSED, f"{self.url} is not started")
        if self.ended:
            return SensorStatus(SensorState.CLOSED, f"{self.url} is at its end", self._count)
        return SensorStatus(SensorState.LIVE, self.progress, self._count)

    def close(self) -> None:
        """Stop; started again, it begins at its beginning."""
        self._begin = None

    # --- for subclasses --------------------------------------------------------------------------------------------

    @abstractmethod
    def reading_at(self, seconds: float) -> Reading | None:
        """Return the new reading, timed from the start, at a time (s) after the start; None: there is none. Count it
        in `_count`."""

    @property
    @abstractmethod
    def progress(self) -> str:
        """Description of what it does, for users."""

    @property
    def ended(self) -> bool:
        """True after its last reading."""
        return False
