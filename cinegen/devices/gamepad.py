"""The gamepad of a browser: whoever serves the page says what the browser says of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from cinegen.devices.newest import Newest
from cinegen.sensor import Reading, SensorState, SensorStatus

_BUTTONS = 64


class Gamepad:
    """Has no device of its own: `put` is called as the browser's messages come, from whichever thread.

    The browser need not say that a gamepad is at rest more than once; while it is deflected it must, 10 times a second
    at least.

    Attributes:
        url: "gamepad:".
        timeout: s: if nothing comes for so long while it is deflected, it has fallen silent.
        damaged: how often something was put that makes no sense.
    """

    timeout = 0.25

    def __init__(self) -> None:
        self.url = "gamepad:"
        self.damaged = 0
        self._newest = Newest()
        self._said = SensorState.CLOSED, f"{self.url} is not started"

    def start(self) -> None:
        """Begins to take what is put."""
        if self._said[0] is SensorState.CLOSED:
            self._newest, self.damaged = Newest(), 0
            self._said = SensorState.OPENING, "no browser has sent anything of a gamepad yet"

    def put(self, twist: Sequence[float], buttons: Iterable[int] = ()) -> None:
        """The browser says this; does not raise: what makes no sense is counted and left out.

        Args:
            twist: six numbers from -1 to 1, see `Twist`; what is beyond is cut.
            buttons: those that are down, from 0 to 63.
        """
        if self._said[0] is SensorState.CLOSED:
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
        self._newest.put(twist=(x, y, z, a, b, c), buttons=down)
        self._said = SensorState.LIVE, "the gamepad of a browser"

    def gone(self) -> None:
        """The browser is gone, or its gamepad: it moves nothing from now on, without the time-out's delay."""
        if self._said[0] is SensorState.LIVE:
            self._said = SensorState.LOST, "the browser with the gamepad is gone"
            self._newest.end()

    def read(self) -> Reading | None:
        """The newest reading, if there is one that was not read yet."""
        return self._newest.take()

    @property
    def status(self) -> SensorStatus:
        """What it is doing."""
        state, words = self._said
        silent = self._newest.silence()
        if state is SensorState.LIVE and silent > self.timeout:
            state, words = SensorState.SILENT, f"the browser has said nothing of its gamepad for {silent:.1f} s"
        return SensorStatus(state, words, self._newest.count, self.damaged)

    def close(self) -> None:
        """Ends; may be started again."""
        self._said = SensorState.CLOSED, f"{self.url} is closed"
        self._newest.end()
