"""The newest reading of a device: one thread writes, another thread reads, neither waits."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

import pinocchio as pin

from cinegen.sensor import NO_TWIST, Reading, SensorState, SensorStatus, Twist

_MOST = 64  # presses that are kept until they are read

_NOTHING = Reading(0.0)


class LatestReading:
    """Newest reading, and all presses of buttons (the last 64) that were not read yet.

    Assignments and operations on a deque's ends are atomic in Python, so no lock is needed.

    Attributes:
        wake: called after each new reading, by the thread that writes; neither waits nor raises.
    """

    def __init__(self) -> None:
        self.last = _NOTHING
        self.count = 0
        self.wake: Callable[[], object] | None = None
        self._seen = _NOTHING
        self._pressed: deque[int] = deque(maxlen=_MOST)

    def put(
        self, twist: Twist | None = None, target: pin.SE3 | None = None, buttons: frozenset[int] | None = None
    ) -> None:
        """Replace the reading. Buttons are unchanged unless given."""
        self.count += 1
        self._set(Reading(time.monotonic(), twist, target, self._down(buttons)))

    def press(self, buttons: frozenset[int]) -> None:
        """Set the buttons that are down; the motion and its time are unchanged."""
        self.count += 1
        self._set(self.last._replace(time=self.last.time or time.monotonic(), buttons=self._down(buttons)))

    def end(self) -> None:
        """Set the reading to rest, without counting it; unread presses are kept."""
        if self.last.twist is not None or self.last.target is not None or self.last.buttons:
            self._set(Reading(time.monotonic()))

    def _set(self, reading: Reading) -> None:
        self.last = reading
        if self.wake is not None:
            self.wake()

    def _down(self, buttons: frozenset[int] | None) -> frozenset[int]:
        down = self.last.buttons
        if buttons is None:
            return down
        self._pressed.extend(sorted(buttons - down))  # before their reading
        return buttons

    def silence(self) -> float:
        """Return the time since the last reading if it was deflected, else 0; s."""
        last = self.last
        return 0.0 if last.twist is None or last.twist == NO_TWIST else time.monotonic() - last.time

    def take(self) -> Reading | None:
        """Return the newest reading with all unread presses; None if it was read already."""
        newest = self.last
        if newest is self._seen:
            return None
        self._seen = newest
        if not self._pressed:
            return newest
        pressed = []
        while self._pressed:
            pressed.append(self._pressed.popleft())
        return newest._replace(pressed=tuple(pressed))


class DeviceSensor:
    """Base of sensors whose readings another thread puts into `newest`.

    Args:
        url: address of the device.

    Attributes:
        timeout: time without a reading, s, after which a deflected sensor counts as silent.
        newest: newest reading.
        damaged: number of packets that could not be used.
    """

    timeout = 0.25

    def __init__(self, url: str) -> None:
        self.url = url
        self.newest = LatestReading()
        self.damaged = 0
        self._reported = SensorState.CLOSED, f"{url} is not started"

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.url}: {self.status.state.value}>"

    def read(self) -> Reading | None:
        """Return the newest reading that was not read yet, or None."""
        return self.newest.take()

    @property
    def status(self) -> SensorStatus:
        """Status of the connection."""
        state, message = self._reported
        silent = self.newest.silence()
        if state is SensorState.LIVE and silent > self.timeout:
            state, message = SensorState.SILENT, f"{self.url} has sent nothing for {silent:.1f} s"
        return SensorStatus(state, message, self.newest.count, self.damaged)
