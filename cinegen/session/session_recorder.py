"""Recordings that a session makes, one at a time."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

from cinegen.mission import MissionRecorder
from cinegen.session.driven_obstacle import DrivenObstacle
from cinegen.session.robot import DrivenRobot
from cinegen.session.setup import Setup
from cinegen.session.state import RecordingStatus


class SessionRecorder:
    """Records the robots and obstacles of a session.

    Args:
        setup: setup of the session.
        robots: robots by name.
        obstacles: obstacles by name.

    Attributes:
        setup: as given; of the robots and obstacles that the mappings hold now.
    """

    def __init__(
        self, setup: Setup, robots: Mapping[str, DrivenRobot], obstacles: Mapping[str, DrivenObstacle]
    ) -> None:
        self.setup, self._robots, self._obstacles = setup, robots, obstacles
        self._recorder: MissionRecorder | None = None
        self._ended: list[MissionRecorder] = []  # whose files may still be written
        self._sampled = -1.0  # time of the last sample, s

    def __repr__(self) -> str:
        return f"<SessionRecorder: {'idle' if self._recorder is None else self._recorder.path}>"

    def __bool__(self) -> bool:
        return self._recorder is not None

    def start(self, path: str = "", overwrite: bool = False) -> None:
        """Start a recording, unless one is in progress.

        Args:
            path: path of the file; a new one in the working folder, named after the time, unless given.
            overwrite: whether an existing file is replaced.

        Raises:
            MissionError: the file can't be written or exists.
        """
        if self._recorder is not None:
            return
        path = path or time.strftime("mission-%Y%m%d-%H%M%S.jsonl")
        self._ended = [recorder for recorder in self._ended if not recorder.finished]
        setup = self.setup
        self._recorder = MissionRecorder(Path(path), setup.robots, setup.bases, overwrite, setup.obstacles)

    def stop(self) -> str:
        """Stop the recording without waiting for the disk. Return a message for people; empty if there was none."""
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return ""
        recorder.close(wait=False)
        self._ended.append(recorder)
        return f"recorded {recorder.seconds:.1f} s in {recorder.path}"

    def sample(self, time: float) -> None:
        """Record the moment at a time (s), unless it is recorded already, or nothing is."""
        if self._recorder is None or self._sampled == time:
            return
        self._sampled = time
        samples = {name: robot.sample() for name, robot in self._robots.items()}
        self._recorder.write(time, samples, {name: obstacle.pose for name, obstacle in self._obstacles.items()})

    def status(self) -> RecordingStatus | None:
        """Return the recording that is being made."""
        recorder = self._recorder
        return None if recorder is None else RecordingStatus(str(recorder.path), recorder.seconds, recorder.error)

    def close(self) -> None:
        """End all recordings, and wait for the disk."""
        for recorder in (*self._ended, self._recorder):
            if recorder is not None:
                recorder.close()
