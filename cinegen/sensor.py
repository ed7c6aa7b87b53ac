"""The interface of all sensors: readings, status, and what a sensor can do."""

from __future__ import annotations

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
    """Input device, or a program in its place. Its methods do not raise; `read` and `status` take microseconds.

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
