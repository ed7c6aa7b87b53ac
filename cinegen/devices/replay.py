"""A recording of readings as a sensor: it says the same at the same times."""

from __future__ import annotations

import json
import math
import time
from bisect import bisect_right
from pathlib import Path
from typing import Any

from cinegen.devices.json_line import LineError, numbers, parse, pressed
from cinegen.devices.record import VERSION, RecordError
from cinegen.sensor import NO_TWIST, Reading, SensorState, SensorStatus

_BESIDES = frozenset({"time", "pressed"})


class Replay:
    """Plays a recording once; ends at rest.

    Args:
        path: of the file.

    Attributes:
        timeout: of the sensor that was recorded: its silences are replayed too.

    Raises:
        RecordError: the file can't be read, or is no recording.
    """

    def __init__(self, path: str | Path) -> None:
        self.url = f"replay:{path}"
        self.readings, self.timeout = load(path)
        last = self.readings[-1] if self.readings else Reading(0.0)
        if last.twist not in (None, NO_TWIST):
            self.readings.append(Reading(last.time + self.timeout if self.timeout < math.inf else last.time, NO_TWIST))
        self._times = [reading.time for reading in self.readings]
        self._begin: float | None = None
        self._read = 0

    def start(self) -> None:
        """Begins to count the time, once."""
        if self._begin is None:
            self._begin, self._read = time.monotonic(), 0

    def read(self) -> Reading | None:
        """The newest reading whose time has come, with all presses since the one before."""
        if self._begin is None:
            return None
        due = bisect_right(self._times, time.monotonic() - self._begin)
        if due <= self._read:
            return None
        passed, self._read = self.readings[self._read : due], due
        down = [button for reading in passed for button in reading.pressed]
        return passed[-1]._replace(time=self._begin + passed[-1].time, pressed=tuple(down))

    @property
    def status(self) -> SensorStatus:
        """Live until its end."""
        count = len(self.readings)
        if self._begin is None:
            return SensorStatus(SensorState.CLOSED, f"{self.url} is not started")
        if self._read < count:
            return SensorStatus(SensorState.LIVE, f"{self.url}: {self._read} of {count} readings", self._read)
        return SensorStatus(SensorState.CLOSED, f"{self.url} is at its end", self._read)

    def close(self) -> None:
        """Ends; when it is started again, it begins at its beginning."""
        self._begin = None


def load(path: str | Path) -> tuple[list[Reading], float]:
    """The readings of a recording, their times counted from its beginning, and its sensor's time-out (s).

    A last line that was cut by a crash is left out.

    Raises:
        RecordError: the file can't be read, or is no recording; says in which line.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise RecordError(f"{path}: can't be read: {(error.strerror or str(error)).lower()}") from None
    first, *lines = data.split(b"\n")
    timeout = _timeout(first, path)
    readings: list[Reading] = []
    for number, line in enumerate(lines[:-1], 2):  # behind the last line's end there is nothing, or a line that was cut
        if not line.strip():
            continue
        try:
            reading = _reading(line)
            if readings and reading.time < readings[-1].time:
                raise LineError("its time is before that of the line before")
        except LineError as error:
            raise RecordError(f"{path}:{number}: {error}") from None
        readings.append(reading)
    return readings, timeout


def _timeout(first: bytes, path: str | Path) -> float:
    try:
        values: Any = json.loads(first)
    except (ValueError, RecursionError):
        values = None
    if not isinstance(values, dict) or values.get("cinegen") != "readings":
        raise RecordError(f'{path}: no recording of readings (those begin with {{"cinegen": "readings", ...}})')
    if values.get("version") != VERSION:
        raise RecordError(f"{path}: a recording of version {values.get('version')}, only {VERSION} can be read")
    timeout = values.get("timeout")
    if timeout is None:
        return math.inf
    if type(timeout) not in (int, float) or not 0.0 <= timeout < math.inf:
        raise RecordError(f"{path}: its time-out is no time in seconds")
    return float(timeout)


def _reading(line: bytes) -> Reading:
    said, values = parse(line, _BESIDES)
    (when,) = numbers([values.get("time")], 1, "time")
    return Reading(when, said.twist, said.target, said.buttons or frozenset(), pressed(values))
