"""Run a command so that it ends in order: after a signal, and if its standard streams are closed, broken or full."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TextIO, cast

from raff2urdf.escape import terminal

STOPPED = 130
"""Exit code after Ctrl-C, by the convention of command interpreters: 128 + SIGINT."""

TERMINATED = 143
"""Exit code after SIGTERM: 128 + SIGTERM."""

NO_READER = 141
"""Exit code if the reader of standard output has gone (`| head -1`): 128 + SIGPIPE, by the same convention."""


DEFECT = 70
"""Exit code after an error that the command did not expect: EX_SOFTWARE of sysexits.h."""

TRACEBACK = "CINEGEN_TRACEBACK"
"""Environment variable: if it is set, unexpected errors are raised, so that Python prints their traceback."""


class OutputLostError(Exception):
    """Standard output no longer reaches a reader: a command that streams its results, or writes a file there, stops."""


def run(program: str, command: Callable[[], int]) -> int:
    """Run a command; return its exit code.

    A command whose standard output breaks or fills up goes on without it: the files that it writes don't depend on who
    reads its messages. If it succeeds otherwise, the exit code is `NO_READER` where the reader has gone; else it is 1,
    with a line on standard error. A standard stream that is closed from the beginning (`>&-`) is taken for the null
    device, as Python's own `print` takes it. Failures of standard error are ignored.

    Ctrl-C raises KeyboardInterrupt in the command, SIGTERM SystemExit, so that files are completed and devices closed;
    the exit code is `STOPPED` or `TERMINATED`.

    What the system refuses (memory, processes, open files) is reported in a line; the exit code is 1. So is an error
    that the command did not expect; the exit code is `DEFECT`.

    Args:
        program: its name, for messages.
        command: what to run.

    Raises:
        SystemExit: the command did.
        Exception: the command raised it, and `TRACEBACK` is set.
    """
    _open_closed()
    output, errors = _Stream(sys.stdout), _Stream(sys.stderr)
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors), _stoppable():
        code, end = _outcome(program, command, output)
        if _stopping:
            code, end = 128 + _stopping[-1], None
        if code == STOPPED:
            sys.stderr.write(f"{program}: stopped\n")
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


def _outcome(program: str, command: Callable[[], int], output: _Stream) -> tuple[int, SystemExit | None]:
    """Return the exit code of a command, or the SystemExit that it raised; report other errors."""
    try:
        return command(), None
    except SystemExit as error:
        return 0, error
    except KeyboardInterrupt:
        return STOPPED, None
    except OutputLostError:
        return 0 if output.failure else NO_READER, None
    except Exception as error:
        if _stopping:  # some library made it of the signal's exception
            return 0, None
        if os.environ.get(TRACEBACK):
            raise
        sys.stderr.write(f"{program}: {_unexpected(error)}\n")
        return 1 if isinstance(error, (OSError, MemoryError)) else DEFECT, None


def _unexpected(error: Exception) -> str:
    """Return a line about an error that no command reports itself."""
    if isinstance(error, MemoryError):
        return "out of memory: the system, or `ulimit -v`, grants no more"
    if isinstance(error, OSError):
        place = f"{error.filename}: " if error.filename is not None else ""
        return f"{place}{error.strerror or error}"
    frames = traceback.extract_tb(error.__traceback__)
    packages = Path(__file__).parents[1], Path(__file__).parents[2] / "cinegen"
    ours = [frame for frame in frames if any(map(Path(frame.filename).is_relative_to, packages))] or frames
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return (
        f"internal error, please report it: {text[:500]} ({Path(ours[-1].filename).name}:{ours[-1].lineno}; "
        f"{TRACEBACK}=1 shows the traceback)"
    )


@contextlib.contextmanager
def until_stopped() -> Iterator[None]:
    """Run a block that Ctrl-C ends, and nothing else."""
    try:
        yield
    except KeyboardInterrupt:
        _stopping.clear()


_AGAIN = 0.5  # s until an exception that some library swallowed is raised again
_stopping: list[int] = []
"""Signals that ask the command to stop, and that it has not answered yet."""


@contextlib.contextmanager
def _stoppable() -> Iterator[None]:
    """Have SIGINT raise KeyboardInterrupt and SIGTERM raise SystemExit; a second SIGTERM ends the process at once.

    C libraries swallow exceptions while they are imported. An exception that was not handled is raised again.
    """
    numbers = [signal.SIGTERM]
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # it is ignored in background jobs of sh
        numbers.append(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield  # only the main thread may handle signals
        return

    def stop(number: int, _: object) -> None:
        if number == signal.SIGTERM:
            signal.signal(number, signal.SIG_DFL)
        _stopping.append(number)
        check()

    def check(*_: object) -> None:
        if _stopping:
            signal.setitimer(signal.ITIMER_REAL, _AGAIN)
            if sys.exc_info()[0] is None:
                raise KeyboardInterrupt if _stopping[-1] == signal.SIGINT else SystemExit(TERMINATED)

    before = {number: signal.signal(number, stop) for number in numbers}
    before[signal.SIGALRM] = signal.signal(signal.SIGALRM, check)
    hooks = sys.excepthook, sys.unraisablehook
    sys.excepthook = lambda *error: None if _stopping else hooks[0](*error)  # which C libraries call
    sys.unraisablehook = lambda error: None if _stopping else hooks[1](error)
    try:
        yield
    finally:
        sys.excepthook, sys.unraisablehook = hooks
        _stopping.clear()
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


def write_at_once(text: str) -> None:
    """Write a text to standard output and flush it.

    Raises:
        OutputLostError: standard output no longer reaches a reader.
    """
    sys.stdout.write(text)
    sys.stdout.flush()
    if getattr(sys.stdout, "failure", None) is not None:
        raise OutputLostError


class _Stream:
    """A standard stream that does not raise: from its first failure on it drops what it is given.

    Control characters of what it is given are escaped, since names and messages are foreign text: see `unescaped`.

    Attributes:
        failure: why it does; None while it works.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.failure: OSError | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write a text; control characters, and characters that the stream's encoding lacks, are escaped."""
        self.write_unescaped(terminal(text))
        return len(text)

    def write_unescaped(self, text: str) -> None:
        """Write a text with its control characters."""
        try:
            self._try(self._stream.write, text)
        except UnicodeEncodeError as error:
            self._try(self._stream.write, text.encode(error.encoding, "backslashreplace").decode(error.encoding))

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


class _Unescaped:
    """The same stream, for texts whose control characters are meant."""

    def __init__(self, stream: _Stream) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write a text."""
        self._stream.write_unescaped(text)
        return len(text)


def unescaped(stream: TextIO) -> TextIO:
    """Return a standard stream for texts whose control characters are meant: colours, moves of the cursor.

    Foreign text in them needs `raff2urdf.escape.terminal`.
    """
    return cast(TextIO, _Unescaped(stream)) if isinstance(stream, _Stream) else stream


def _open_closed() -> None:
    """Open the null device for standard streams that are closed, so that no other file is opened in their place."""
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # the lowest number that is free: this one
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), "w" if descriptor else "r"))
