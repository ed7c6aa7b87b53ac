"""Plays a mission again: it keeps a time of its own, which goes on, stands, leaps or runs faster."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cinegen.mission.recording import Recording

Array = NDArray[np.float64]

SLOWEST, FASTEST = 0.01, 100.0
"""Times the speed it was recorded at."""


class Player:
    """Stands at the beginning until `play`; stops at the end. It may stand in a loop of 1 kHz: nothing but the
    constructor raises.

    Args:
        recording: what to play.

    Attributes:
        recording: what is played.
        time: where it is, s since the recording's first moment.
        playing: whether the time goes on.
        factor: how many times as fast as recorded.

    Raises:
        MissionError: a robot can't be built any more.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.time = 0.0
        self.playing = False
        self.factor = 1.0
        for part in (0.25, 0.5, 0.75):  # builds the robots, and compiles what closes their loops
            recording.at(part * recording.seconds)
        self._q = recording.at(0.0)
        self._shown = 0.0

    @property
    def seconds(self) -> float:
        """How long the recording is."""
        return self.recording.seconds

    @property
    def index(self) -> int:
        """Of the recorded moment that it is at, or has just passed: for `recording.tasks` and `recording.statuses`."""
        return self.recording.index_at(self.time)

    def play(self) -> None:
        """Goes on; from the beginning where it is at the end."""
        if self.time >= self.seconds:
            self.time = 0.0
        self.playing = self.seconds > 0.0

    def pause(self) -> None:
        """Stands."""
        self.playing = False

    def seek(self, time: float) -> None:
        """Goes to a time, s; at most to the end."""
        if not math.isnan(time):
            self.time = min(max(0.0, time), self.seconds)

    def tempo(self, factor: float) -> None:
        """Plays so many times as fast as recorded, from 0.01 to 100."""
        if not math.isnan(factor):
            self.factor = min(max(SLOWEST, factor), FASTEST)

    def advance(self, dt: float) -> dict[str, Array]:
        """Where all robots are (nq,), by name, after dt seconds for whoever watches."""
        if self.playing:
            self.seek(self.time + dt * self.factor)
            self.playing = self.time < self.seconds
        if self.time != self._shown:
            self._q, self._shown = self.recording.at(self.time), self.time
        return self._q
