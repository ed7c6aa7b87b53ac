"""Threads and processes that run a loop."""

from __future__ import annotations

import atexit
import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.heap import Arena
from multiprocessing.reduction import ForkingPickler
from typing import Any

from cinegen.realtime.channel import ClockError

_GRACE = 2.0  # s for a process to complete its tick when its parent is gone, and to end when it is terminated


class LoopWorker:
    """Runs one loop, once. The exception that ends it is raised once, or printed when the program exits."""

    def __init__(self) -> None:
        self._done = threading.Event()
        self._error: BaseException | None = None
        atexit.register(self._exit)

    def ended(self, timeout: float | None = 0.0) -> bool:
        """Return whether the loop has ended, after waiting for at most `timeout` seconds; None waits for ever."""
        return self._done.wait(timeout)

    def error(self) -> BaseException | None:
        """Return the exception that ended the loop, once; None without one."""
        error, self._error = self._error, None
        return error

    def inside(self) -> bool:
        """Return whether the caller is the loop itself."""
        return False

    def kill(self) -> bool:
        """End the loop by force; return False if that is not possible."""
        return False

    def _end(self, error: BaseException | None) -> None:
        self._error = error
        self._done.set()
        if error is None:
            atexit.unregister(self._exit)

    def _exit(self) -> None:
        """Print an exception that was never raised when the program exits."""
        error = self.error()
        if error is not None:
            error.add_note("This exception ended a clock's loop and was not raised before the program ended.")
            sys.excepthook(type(error), error, error.__traceback__)


class LoopThread(LoopWorker):
    """Runs a loop in a thread.

    Args:
        serve: runs the loop to its end.
    """

    def __init__(self, serve: Callable[[], None]) -> None:
        super().__init__()
        self._thread = threading.Thread(target=self._run, args=(serve,), name="cinegen clock", daemon=True)
        self._thread.start()

    def _run(self, serve: Callable[[], None]) -> None:
        error: BaseException | None = None
        try:
            serve()
        except BaseException as caught:
            error = caught
        self._end(error)

    def inside(self) -> bool:
        """Return whether the caller is that thread."""
        return threading.current_thread() is self._thread


class LoopProcess(LoopWorker):
    """Runs a loop in a new process, which inherits nothing: all its data are pickled.

    Args:
        serve: function at the top level of a module. It runs the loop to its end. When the loop starts, it calls its
            last argument with a description of the scheduling.
        arguments: its other arguments.

    Raises:
        ClockError: an argument can't be pickled, or the process ended before the loop started.
        Exception: exception that was raised before the loop started.
    """

    def __init__(self, serve: Callable[..., None], *arguments: Any) -> None:
        context = multiprocessing.get_context("spawn")
        self._answers, answers = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_run, args=(answers, _Parcel((serve, arguments))), name="cinegen clock", daemon=True
        )
        try:
            with _interrupts_blocked():
                self._process.start()
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise ClockError(
                f"arguments can't be sent to a clock's process: {error}. The factory must be a function at the "
                "top level of a module, and its arguments must be picklable"
            ) from error
        finally:
            answers.close()
        super().__init__()
        begun, answer = self._answer()
        if not begun:
            self._finish(None)
            if answer is not None:
                raise answer
        self.scheduling = str(answer)
        threading.Thread(target=self._watch, name="cinegen clock watch", daemon=True).start()

    def _answer(self) -> tuple[bool, Any]:
        """Return the next message of the process: whether its loop started, with its scheduling or its exception."""
        try:
            begun, answer = self._answers.recv()
        except (EOFError, OSError):
            self._process.join()
            return False, ClockError(
                f"a clock's process ended with exit code {self._process.exitcode}; its output may show why. "
                "The new process imports the main program again: guard it by: if __name__ == '__main__'"
            )
        return bool(begun), answer

    def _watch(self) -> None:
        self._finish(self._answer()[1])

    def _finish(self, error: BaseException | None) -> None:
        self._process.join()
        self._answers.close()
        self._end(error)

    def kill(self) -> bool:
        """End the process."""
        self._process.terminate()
        if not self.ended(_GRACE):
            self._process.kill()
            self.ended(None)
        self.error()
        return True

    def _exit(self) -> None:
        if self.ended():  # else it ends together with this process
            super()._exit()


class _Parcel:
    """A value for a new process, which gets it from shared memory. So the value is complete when the process begins:
    without this, a process whose parent is killed while it writes prints a traceback.
    """

    def __init__(self, value: Any) -> None:
        self._value = value
        self._memory: Arena | None = None  # kept until the process has begun

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Arena, int]]:
        data = ForkingPickler.dumps(self._value)
        self._memory = Arena(len(data))
        self._memory.buffer[: len(data)] = data
        return _opened, (self._memory, len(data))


def _opened(memory: Arena, size: int) -> Any:
    return pickle.loads(memory.buffer[:size])


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Start processes that no Ctrl-C reaches before they ignore it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # it is started with the first process, and unblocks what was blocked before
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _run(answers: multiprocessing.connection.Connection, parcel: tuple[Callable[..., None], tuple[Any, ...]]) -> None:
    """Run the process."""
    serve, arguments = parcel
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes; the parent decides
    threading.Thread(target=_end_with_parent, daemon=True).start()
    error: BaseException | None = None
    try:
        serve(*arguments, lambda scheduling: answers.send((True, scheduling)))
    except BaseException as caught:
        error = _portable(caught)
    with suppress(OSError):  # the parent has ended
        answers.send((False, error))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        time.sleep(_GRACE)
        os._exit(1)


def _portable(error: BaseException) -> BaseException:
    """Return an exception that can be pickled, with its traceback as a note."""
    story = "".join(traceback.format_exception(error)).rstrip()
    try:
        sent: BaseException = pickle.loads(pickle.dumps(error))
    except Exception:
        sent = ClockError(f"{type(error).__name__} in a clock's process: {error}")
    sent.add_note(f"In the clock's process:\n{story}")
    return sent
