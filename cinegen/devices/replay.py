"""`ReadingRecorder`: write the readings of a sensor to a file as they come, so that a crash loses none of them.

`Replay`: such a recording as a sensor.

The file is lines of JSON: a `ReadingsHeader`, then `RecordedReading`s.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from pathlib import Path
from typing import Self

import msgspec

from cinegen.devices.reading_json import (
    VERSION,
    ReadingError,
    ReadingsHeader,
    decode_recorded,
    encode_header,
    encode_recorded,
)
from cinegen.errors import CinegenError
from cinegen.line_file import LineFile, read_lines, reason
from cinegen.sensor import NO_TWIST, Reading, TimedSensor
from cinegen.typed_json import every_problem

_HEADER = msgspec.json.Decoder(ReadingsHeader)


class RecordError(CinegenError):
    """A recording can't be written or read."""


class ReadingRecorder:
    """Write each reading as one line, with one call of the system: after a crash, only the last line can be cut.

    Args:
        path: path of the file; an existing one is replaced.
        timeout: time-out of the sensor, s.

    Attributes:
        error: reason why nothing more can be written; None while it can.

    Raises:
        RecordError: the file can't be written.
    """

    def __init__(self, path: str | Path, timeout: float = 0.25) -> None:
        self.error: str | None = None
        self._begin: float | None = None
        self._file = LineFile(path, encode_header(timeout), RecordError)

    def write(self, reading: Reading) -> None:
        """Write a reading. Never raises: see `error`. Times are counted from the first reading."""
        if self._begin is None:
            self._begin = reading.time
        if self.error is None:
            try:
                self._file.append(encode_recorded(reading, self._begin))
            except OSError as error:
                self.error = reason(error)

    def close(self) -> None:
        """Close the file; what was written is on the disk then."""
        if self.error != "closed":
            self.error = self.error or "closed"
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Replay(TimedSensor):
    """Replay a recording once; it ends at rest.

    Args:
        path: path of the file.

    Attributes:
        timeout: time-out of the recorded sensor, s: its silences are replayed too.

    Raises:
        RecordError: the file can't be read, or is no recording.
    """

    def __init__(self, path: str | Path) -> None:
        super().__init__(f"replay:{path}")
        self.readings, self.timeout = load_readings(path)
        last = self.readings[-1] if self.readings else Reading(0.0)
        if last.twist not in (None, NO_TWIST):
            self.readings.append(Reading(last.time + self.timeout if self.timeout < math.inf else last.time, NO_TWIST))
        self._times = [reading.time for reading in self.readings]

    def reading_at(self, seconds: float) -> Reading | None:
        """Return the newest reading that is due, with all buttons pressed since the one before."""
        due = bisect_right(self._times, seconds)
        if due <= self._count:
            return None
        passed, self._count = self.readings[self._count : due], due
        return passed[-1]._replace(pressed=tuple(button for reading in passed for button in reading.pressed))

    @property
    def progress(self) -> str:
        """Number of readings."""
        return f"{self.url}: {self._count} of {len(self.readings)} readings"

    @property
    def ended(self) -> bool:
        """True when all readings were read."""
        return self._count >= len(self.readings)


def load_readings(path: str | Path) -> tuple[list[Reading], float]:
    """Return the readings of a recording, timed from its start, and the time-out of its sensor, s.

    A last line that was cut off by a crash is left out.

    Raises:
        RecordError: the file can't be read, or is no recording; names the line.
    """
    timeout, readings = read_lines(path, RecordError, _timeout, _decoded)
    return readings, timeout


def _decoded(line: bytes, timeout: float, before: Reading | None) -> Reading:
    reading = decode_recorded(line)
    if before is not None and reading.time < before.time:
        raise ReadingError("Expected a time not before that of the line before - at `$.time`")
    return reading


def _timeout(first: bytes) -> float:
    try:
        header = _HEADER.decode(first)
    except (msgspec.MsgspecError, RecursionError, UnicodeError) as error:
        example, why = '{"cinegen": "readings", ...}', every_problem(first, _HEADER, error)
        raise RecordError(f"not a recording of readings (its first line would be {example}): {why}") from None
    if header.version != VERSION:
        raise RecordError(f"a recording of version {header.version}; only version {VERSION} can be read")
    if header.timeout is not None and header.timeout < 0.0:
        raise RecordError("Expected a time-out >= 0 s - at `$.timeout`")
    return math.inf if header.timeout is None else header.timeout
