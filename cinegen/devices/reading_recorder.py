"""`ReadingRecorder`: write the readings of a sensor to a file as they come, so that a crash loses none of them.

The file is lines of JSON: a `ReadingsHeader`, then `RecordedReading`s.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Self

from cinegen.devices.reading_json import encode_header, encode_recorded
from cinegen.errors import CinegenError
from cinegen.sensor import Reading
from raff2urdf.files import is_stream, open_stream, write_all


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
        header = encode_header(timeout)
        try:
            if is_stream(path):
                self._file = open_stream(path)
                self._write(header)
            else:
                write_all({Path(path): header})
                self._file = os.open(path, os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0))
        except OSError as error:
            raise RecordError(f"{path}: can't be written: {(error.strerror or str(error)).lower()}") from None

    def write(self, reading: Reading) -> None:
        """Write a reading. Never raises: see `error`. Times are counted from the first reading."""
        if self._begin is None:
            self._begin = reading.time
        self._write(encode_recorded(reading, self._begin))

    def _write(self, line: bytes) -> None:
        if self.error is not None:
            return
        try:
            if os.write(self._file, line) < len(line):
                self.error = "the disk is full"
        except OSError as error:
            self.error = (error.strerror or str(error)).lower()

    def close(self) -> None:
        """Close the file; what was written is on the disk then."""
        if self.error == "closed":
            return
        self.error = self.error or "closed"
        with contextlib.suppress(OSError):
            os.fsync(self._file)
        with contextlib.suppress(OSError):
            os.close(self._file)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
