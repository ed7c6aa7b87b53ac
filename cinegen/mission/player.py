"""`Player`: replay a recording at any speed."""

from __future__ import annotations

import math
from functools import partial

import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import read_all
from cinegen.mission.file_format import MissionError
from cinegen.mission.recording import Recording

SLOWEST, FASTEST = 0.01, 100.0
"""Limits of the playback speed; 1 is real time."""


class Player:
    """Replay a recording. It is paused at the start, and stops at the end. It may be used in a loop of 1 kHz: only the
    constructor raises.

    Args:
        recording: recording to replay.

    Attributes:
        recording: recording that is replayed.
        time: playback position, s since the first moment.
        playing: whether it plays.
        speed: playback speed; 1 is real time.

    Raises:
        MissionError: robots can't be built any more.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.time = 0.0
        self.playing = False
        self.speed = 1.0
        read_all({name: partial(recording.mechanism, name) for name in recording.robots}, MissionError)
        for part in (0.25, 0.5, 0.75):  # compile the closing of their loops
            recording.at(part * recording.seconds)
        self._q = recording.at(0.0)
        self._shown = 0.0

    @property
    def seconds(self) -> float:
        """Duration of the recording, s."""
        return self.recording.seconds

    @property
    def index(self) -> int:
        """Index of the last moment up to now, for `recording.tasks` and `recording.statuses`."""
        return self.recording.index_at(self.time)

    def play(self) -> None:
        """Play; from the start if it is at the end."""
        if self.time >= self.seconds:
            self.time = 0.0
        self.playing = self.seconds > 0.0

    def pause(self) -> None:
        """Pause."""
        self.playing = False

    def seek(self, time: float) -> None:
        """Jump to a time (s), clipped to the recording."""
        if not math.isnan(time):
            self.time = min(max(0.0, time), self.seconds)

    def set_speed(self, speed: float) -> None:
        """Set the playback speed, clipped to 0.01 to 100; 1 is real time."""
        if not math.isnan(speed):
            self.speed = min(max(SLOWEST, speed), FASTEST)

    def placements(self) -> dict[str, pin.SE3]:
        """Return the present poses of all obstacles in the world (m)."""
        return self.recording.placements_at(self.time)

    def advance(self, dt: float) -> dict[str, Array]:
        """Advance by dt (s, before the playback speed) and return the configurations (nq,) of all robots by name."""
        if self.playing:
            self.seek(self.time + dt * self.speed)
            self.playing = self.time < self.seconds
        if self.time != self._shown:
            self._q, self._shown = self.recording.at(self.time), self.time
        return self._q
