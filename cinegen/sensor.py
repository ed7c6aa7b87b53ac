"""What a sensor says: readings, its status, and what every sensor can do."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple, Protocol

import pinocchio as pin

from cinegen.errors import CinegenError

Twist = tuple[float, float, float, float, float, float]
"""Three translations, then three rotations, each from -1 to 1: full deflection is 1.

x is to the right, y away from whoever holds the device, z up: the axes of a world with z up, seen from its front.
Rotations are right-handed about the same axes. All devices are brought to this.
"""

NO_TWIST: Twist = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class SensorError(CinegenError):
    """A sensor that there can't be; says what can."""


class SensorState(Enum):
    """What a sensor is doing."""

    CLOSED = "closed"  # not started, or ended
    OPENING = "opening"  # looks for its device
    LIVE = "live"  # there, and what it says counts
    SILENT = "silent"  # has said nothing for its time-out, though it was not at rest: what it said counts no more
    LOST = "lost"  # not there, or gone; it is tried again
    REFUSED = "refused"  # there, and not what it should be; it is tried again


class SensorStatus(NamedTuple):
    """What becomes of a sensor.

    Attributes:
        state: what it is doing.
        words: a sentence about it, for people.
        packets: how many readings there were since it was started.
        damaged: how many packets or lines could not be used.
    """

    state: SensorState
    words: str
    packets: int = 0
    damaged: int = 0


class Reading(NamedTuple):
    """What a sensor says at a moment: a twist, a placement, or only buttons.

    Attributes:
        time: when its motion was received: s, of `time.monotonic`.
        twist: how far it is deflected, without unit; see `Twist`. None if it says nothing of motion.
        target: where the node should be, in the world; None if it doesn't say so.
        buttons: those that are down, from 0.
        pressed: those that went down since the reading before, in order, even if they are up again.
    """

    time: float
    twist: Twist | None = None
    target: pin.SE3 | None = None
    buttons: frozenset[int] = frozenset()
    pressed: tuple[int, ...] = ()


class Sensor(Protocol):
    """An input device, or a program that plays one. None of these raises; `read` and `status` take microseconds.

    Attributes:
        url: where it is.
        timeout: s: if there is no reading for so long after one that was not at rest, it has fallen silent.
    """

    url: str
    timeout: float

    def start(self) -> None:
        """Begins; returns at once. Whether there is a device, `status` says."""

    def read(self) -> Reading | None:
        """The newest reading, if there is one that was not read yet. Only one thread may read."""

    @property
    def status(self) -> SensorStatus:
        """What it is doing."""

    def close(self) -> None:
        """Ends; may be started again."""
