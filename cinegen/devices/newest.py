"""The newest reading of a sensor: its thread writes, another one reads, neither waits."""

from __future__ import annotations

import time
from collections import deque

import pinocchio as pin

from cinegen.sensor import NO_TWIST, Reading, Twist

_MOST = 64  # presses that nobody has read yet

_NOTHING = Reading(0.0)


class Newest:
    """Of readings only the newest is kept; of presses of buttons, all until they are read (the last 64).

    Assignments and a deque's ends are atomic in Python: there is no lock, so a reader never waits.
    """

    def __init__(self) -> None:
        self.last = _NOTHING
        self.count = 0
        self._seen = _NOTHING
        self._pressed: deque[int] = deque(maxlen=_MOST)

    def put(
        self, twist: Twist | None = None, target: pin.SE3 | None = None, buttons: frozenset[int] | None = None
    ) -> None:
        """Puts a reading in place of the one before. Buttons stay as they were unless given."""
        self.count += 1
        self.last = Reading(time.monotonic(), twist, target, self._down(buttons))

    def press(self, buttons: frozenset[int]) -> None:
        """These are down now; the motion is the one before, and no newer for it."""
        self.count += 1
        self.last = self.last._replace(time=self.last.time or time.monotonic(), buttons=self._down(buttons))

    def end(self) -> None:
        """Nobody moves or presses any more; presses that are unread stay. Not counted: nobody has said it."""
        if self.last.twist is not None or self.last.target is not None or self.last.buttons:
            self.last = Reading(time.monotonic())

    def _down(self, buttons: frozenset[int] | None) -> frozenset[int]:
        down = self.last.buttons
        if buttons is None:
            return down
        self._pressed.extend(sorted(buttons - down))  # before the reading that they belong to
        return buttons

    def silence(self) -> float:
        """For how long (s) nothing was said after a motion that was not at rest; 0 after one that was."""
        last = self.last
        return 0.0 if last.twist is None or last.twist == NO_TWIST else time.monotonic() - last.time

    def take(self) -> Reading | None:
        """The newest reading, with all presses that were not read yet; None if it was read already."""
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
