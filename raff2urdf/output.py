"""Run a command so that it ends in order where its standard streams are closed, broken or full."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable
from typing import Any, TextIO

STOPPED = 130
"""Exit code after Ctrl-C, by the convention of command interpreters: 128 + SIGINT."""

NO_READER = 141
"""Exit code if the reader of standard output has gone (`| head -1`): 128 + SIGPIPE, by the same convention."""


class OutputLostError(Exception):
    """Standard output no longer reaches a reader, so that a command that streams its results can stop."""


def run(program: str, command: Callable[[], int]) -> int:
    """Run a command; return its exit code.

    A command whose standard output breaks or fills up goes on without it: the files that it writes don't depend on who
    reads its messages. If it succeeds otherwise, the exit code is `NO_READER` where the reader has gone; else it is 1,
    with a line on standard error. A standard stream that is closed from the beginning (`>&-`) is taken for the null
    device, as Python's own `print` takes it. Failures of standard error are ignored.

    Args:
        program: its name, for messages.
        command: what to run.

    Raises:
        SystemExit: the command did, as argparse does for `--help` and for wrong calls.
    """
    _open_closed()
    output, errors = _Stream(sys.stdout), _Stream(sys.stderr)
    code = 0
    end: SystemExit | None = None
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        try:
            code = command()
        except SystemExit as error:
            end = error
        except KeyboardInterrupt:
            sys.stderr.write(f"{program}: stopped\n")
            code = STOPPED
        except OutputLostError:
            pass
        output.flush()
        if output.failure is not None and not isinstance(output.failure, BrokenPipeError):
            reason = output.failure.strerror or output.failure
            sys.stderr.write(f"{program}: standard output can't be written: {reason}\n")
        errors.flush()
    for stream in (output, errors):
        stream.discard()
    if end is not None and (end.code or output.failure is None):
        raise end
    if output.failure is None:
        return code
    return code or (NO_READER if isinstance(output.failure, BrokenPipeError) else 1)


def write_at_once(text: str) -> None:
    """Write a text to standard output and flush it.

    Raises:
        OutputLostError: standard output no longer reaches a reader.
    """
    sys.stdout.write(text)
    sys.stdout.flush()
    if isinstance(sys.stdout, _Stream) and sys.stdout.failure is not None:
        raise OutputLostError


class _Stream:
    """A standard stream that does not raise: from its first failure on it drops what it is given.

    Attributes:
        failure: why it does; None while it works.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.failure: OSError | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write a text; characters that the stream's encoding lacks are escaped."""
        try:
            self._try(self._stream.write, text)
        except UnicodeEncodeError as error:
            self._try(self._stream.write, text.encode(error.encoding, "backslashreplace").decode(error.encoding))
        return len(text)

    def flush(self) -> None:
        """Flush it."""
        self._try(self._stream.flush)

    def _try(self, function: Callable[..., object], *arguments: object) -> None:
        if self.failure is None:
            try:
                function(*arguments)
            except OSError as error:
                self.failure = error

    def discard(self) -> None:
        """Drop what a stream that failed still holds: Python would try to write it in the end, and fail again."""
        if self.failure is not None:
            with contextlib.suppress(OSError), open(os.devnull, "wb") as null:
                os.dup2(null.fileno(), self._stream.fileno())


def _open_closed() -> None:
    """Open the null device for standard streams that are closed, so that no other file is opened in their place."""
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # the lowest number that is free: this one
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), "w" if descriptor else "r"))
