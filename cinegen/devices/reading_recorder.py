"""`ReadingRecorder`: write the readings of a sensor to a file as they come, so that a crash loses none of them.

The file is lines of JSON: a `ReadingsHeader`, then `RecordedReading`s.
"""

from __future__ import annotations

from pathlib import Path
from typing import Self

from cinegen.devices.reading_json import encode_header, encode_recorded
from cinegen.errors import CinegenError
from cinegen.line_file import LineFile, reason
from cinegen.sensor import Reading


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
