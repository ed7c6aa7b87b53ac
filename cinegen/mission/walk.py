"""`record_modes`: all assembly modes of a mechanism as a recording, to be walked through in the page."""

from __future__ import annotations

from pathlib import Path

from cinegen.assembly import AssemblyModes
from cinegen.mission.line import MissionError, Motion
from cinegen.mission.recorder import Recorder

_AT_ONCE = 1e-6  # s: from one mode to the next; there is no way between them


def record_modes(modes: AssemblyModes, path: str | Path, name: str | None = None) -> None:
    """Writes a recording that holds mode 1 until second 2, then mode 2 until second 3, and so on: at second k it shows
    mode k. Nothing moves between modes: with its motors held, a mechanism can't go from one to another.

    Args:
        modes: at least one.
        path: of the file, see `cinegen.mission.Recorder`.
        name: of the robot in the recording; its own unless given.

    Raises:
        MissionError: there is no mode, or the file can't be written.
    """
    if not len(modes):
        raise MissionError(f"{modes.mechanism.name} has no assembly mode there: nothing can be recorded")
    robot = name or modes.mechanism.name
    with Recorder(path, {robot: modes.mechanism}) as recorder:
        recorder.write(0.0, {robot: Motion(modes[0])})
        for second in range(2, len(modes) + 1):
            recorder.write(second - _AT_ONCE, {robot: Motion(modes[second - 2])})
            recorder.write(float(second), {robot: Motion(modes[second - 1])})
    if recorder.error != "closed" or recorder.lost:
        raise MissionError(f"{path}: can't be written: {recorder.error}")
