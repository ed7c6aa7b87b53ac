"""Writes readings to a file as they come, so that all that was written is there whatever happens then.

A recording is lines of JSON. The first says what it is and which version: `{"cinegen": "readings", "version": 1,
"timeout": 0.25}`. Each other is a reading as programs send it, with `time` in seconds since the recording began, and
`pressed`, the buttons that went down:

    {"time": 0.5, "twist": [0.0, 0.0, 0.25, 0.0, 0.0, 0.0], "buttons": [1], "pressed": [1]}
"""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from cinegen.devices.json_line import written
from cinegen.errors import CinegenError
from cinegen.sensor import Reading
from raff2urdf.files import is_stream, open_stream, write_all

VERSION = 1


def header(timeout: float) -> dict[str, Any]:
    """The first line: a sensor's time-out (s) tells what a pause between two readings means."""
    return {"cinegen": "readings", "version": VERSION, "timeout": timeout if timeout < float("inf") else None}


def line(reading: Reading, begin: float) -> dict[str, Any]:
    """A reading's line.

    Args:
        reading: what to write.
        begin: when the recording began, on the clock of `Reading.time`.
    """
    values = {"time": round(reading.time - begin, 6), **written(reading)}
    return {**values, "pressed": list(reading.pressed)} if reading.pressed else values


class RecordError(CinegenError):
    """A recording that can't be written or read; says why."""


class Recorder:
    """Writes each reading as a whole line, in one call to the system: after a crash at most the last is cut.

    Args:
        path: of the file, which is written anew.
        timeout: of the sensor, s.

    Attributes:
        error: why it can write no more; None while it can.

    Raises:
        RecordError: the file can't be written.
    """

    def __init__(self, path: str | Path, timeout: float = 0.25) -> None:
        self.error: str | None = None
        self._begin: float | None = None
        try:
            if is_stream(path):
                self._file = open_stream(path)
                self._write(header(timeout))
            else:
                write_all({Path(path): _encoded(header(timeout))})
                self._file = os.open(path, os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0))
        except OSError as error:
            raise RecordError(f"{path}: can't be written: {(error.strerror or str(error)).lower()}") from None

    def write(self, reading: Reading) -> None:
        """Writes a reading; does not raise: see `error`. The time counts from the first."""
        if self._begin is None:
            self._begin = reading.time
        self._write(line(reading, self._begin))

    def _write(self, values: dict[str, Any]) -> None:
        if self.error is not None:
            return
        data = _encoded(values)
        try:
            if os.write(self._file, data) < len(data):
                self.error = "the disk is full"
        except OSError as error:
            self.error = (error.strerror or str(error)).lower()

    def close(self) -> None:
        """Ends; what was written is on the disk then."""
        if self.error == "closed":
            return
        self.error = self.error or "closed"
        with contextlib.suppress(OSError):
            os.fsync(self._file)
        with contextlib.suppress(OSError):
            os.close(self._file)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _encoded(values: dict[str, Any]) -> bytes:
    return json.dumps(values, separators=(",", ":")).encode() + b"\n"
