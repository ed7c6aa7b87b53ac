"""Files of lines: a recording is appended line by line, and read as a whole."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TypeVar

from cinegen.errors import CinegenError, read_all
from raff2urdf.errors import RaffError, raised_as
from raff2urdf.files import is_stream, open_stream, read_bytes, write_all

_LARGEST = 4_000_000_000  # bytes of a recording that is read
_FULL = (errno.ENOSPC, errno.EDQUOT)
_H = TypeVar("_H")
_L = TypeVar("_L")


class LineFile:
    """A file to which lines are appended, each by one call of the system: after a crash, only the last line can be cut.

    Args:
        path: path of the file; an existing one is replaced when the first line has been written.
        first: first line.
        failure: class of the exception.

    Raises:
        failure: the file can't be written.
    """

    def __init__(self, path: str | Path, first: bytes, failure: type[CinegenError]) -> None:
        try:
            if is_stream(path):  # a pipe, for example
                self._file = open_stream(path)
                try:
                    self.append(first)
                except OSError:
                    os.close(self._file)
                    raise
            else:
                write_all({Path(path): first})
                self._file = os.open(path, os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0))
        except OSError as error:
            raise failure(f"{path}: can't be written: {reason(error)}") from None

    def append(self, line: bytes) -> None:
        """Append a line: mostly in one call; a disk that runs full takes a part of it.

        Raises:
            OSError: it can't be written.
        """
        while line:
            line = line[os.write(self._file, line) :]

    def synchronize(self) -> None:
        """Wait until all lines are on the disk.

        Raises:
            OSError: the disk fails.
        """
        try:
            os.fsync(self._file)
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # a pipe can't be synchronised
                raise

    def close(self) -> None:
        """Close the file; what was written is on the disk then."""
        with contextlib.suppress(OSError):
            os.fsync(self._file)
        with contextlib.suppress(OSError):
            os.close(self._file)


def reason(error: OSError) -> str:
    """Return the reason of an error, for messages."""
    return "the disk is full" if error.errno in _FULL else (error.strerror or str(error)).lower()


def read_lines(
    path: str | Path,
    failure: type[CinegenError],
    decode_header: Callable[[bytes], _H],
    decode: Callable[[bytes, _H, _L | None], _L],
) -> tuple[_H, list[_L]]:
    """Return the decoded first line of a file, and the decoded further lines that are not blank. A last line that was
    cut off by a crash is left out.

    Args:
        path: path of the file.
        failure: class of the exception.
        decode_header: decodes the first line; raises a `CinegenError` if it is wrong, as `decode` does.
        decode: decodes a line; it gets the header and the decoded line before, None for the first.

    Raises:
        failure: the file can't be read, or lines are wrong; names all of them.
    """
    with raised_as(failure, RaffError):
        first, *lines = read_bytes(path, largest=_LARGEST).split(b"\n")
    try:
        header = decode_header(first)
    except CinegenError as error:
        raise failure("\n".join(f"{path}: {why}" for why in str(error).split("\n"))) from None
    decoded: list[_L] = []

    def read(number: int, line: bytes) -> None:
        try:
            decoded.append(decode(line, header, decoded[-1] if decoded else None))
        except CinegenError as error:
            raise failure("\n".join(f"{path}:{number}: {why}" for why in str(error).split("\n"))) from None

    # after the last line's end there is nothing, or a line that was cut
    read_all((("", partial(read, number, line)) for number, line in enumerate(lines[:-1], 2) if line.strip()), failure)
    return header, decoded
