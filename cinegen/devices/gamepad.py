"""The gamepad of a browser: the page's server passes on its readings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from cinegen.devices.latest_reading import DeviceSensor, LatestReading
from cinegen.sensor import SensorState

_BUTTONS = 64


class Gamepad(DeviceSensor):
    """Sensor whose readings come by calls of `put`, from any thread.

    The browser sends one message when the gamepad comes to rest, and at least 10 a second while it is deflected.
    """

    def __init__(self) -> None:
        super().__init__("gamepad:")

    def start(self) -> None:
        """Start to accept readings."""
        if self._reported[0] is SensorState.CLOSED:
            self.newest, self.damaged = LatestReading(), 0
            self._reported = SensorState.OPENING, "no browser has sent a gamepad's reading yet"

    def put(self, twist: Sequence[float], buttons: Iterable[int] = ()) -> None:
        """Set the reading; does not raise: invalid readings are counted and left out.

        Args:
            twist: six numbers, clipped to [-1, 1]; see `Twist`.
            buttons: indices of the buttons that are down, 0 to 63.
        """
        if self._reported[0] is SensorState.CLOSED:
            return
        try:
            x, y, z, a, b, c = (min(1.0, max(-1.0, float(value))) for value in twist if math.isfinite(value))
            down = frozenset(buttons)
            good = all(type(button) is int and 0 <= button < _BUTTONS for button in down)
        except (TypeError, ValueError, OverflowError):
            good = False
        if not good:
            self.damaged += 1
            return
        self.newest.put(twist=(x, y, z, a, b, c), buttons=down)
        self._reported = SensorState.LIVE, "the gamepad of a browser"

    def gone(self) -> None:
        """Report that the browser or its gamepad is gone: the motion ends at once, without the time-out."""
        if self._reported[0] is SensorState.LIVE:
            self._reported = SensorState.LOST, "the browser with the gamepad is gone"
            self.newest.end()

    def close(self) -> None:
        """Close; it may be started again."""
        self._reported = SensorState.CLOSED, f"{self.url} is closed"
        self.newest.end()
