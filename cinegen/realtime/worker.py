"""Who runs a loop beside its caller: a thread, or a process."""

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
from collections.abc import Callable
from typing import Any

from cinegen.realtime.board import ClockError

_GRACE = 2.0  # s that a process has to end its tick when its parent is gone, and to end when it is terminated


class Worker:
    """Runs one loop, once. What ends it is told once, at the program's exit at the latest."""

    def __init__(self) -> None:
        self._done = threading.Event()
        self._error: BaseException | None = None
        atexit.register(self._exit)

    def ended(self, timeout: float | None = 0.0) -> bool:
        """Whether it has ended, after waiting for that up to some seconds, or for ever."""
        return self._done.wait(timeout)

    def error(self) -> BaseException | None:
        """The error that ended it, if it has ended by one; once."""
        error, self._error = self._error, None
        return error

    def inside(self) -> bool:
        """Whether the caller is the loop itself."""
        return False

    def kill(self) -> bool:
        """Ends it by force; False if that can't be done."""
        return False

    def _end(self, error: BaseException | None) -> None:
        self._error = error
        self._done.set()
        if error is None:
            atexit.unregister(self._exit)

    def _exit(self) -> None:
        """The program ends."""
        error = self.error()
        if error is not None:
            error.add_note("That had ended a clock's loop, and nobody had asked.")
            sys.excepthook(type(error), error, error.__traceback__)


class ThreadWorker(Worker):
    """A thread of its own.

    Args:
        serve: runs the loop to its end.
    """

    def __init__(self, serve: Callable[[], None]) -> None:
        super().__init__()
        self._thread = threading.Thread(target=self._run, args=(serve,), name="cinegen clock", daemon=True)
        self._thread.start()

    def _run(self, serve: Callable[[], None]) -> None:
        try:
            serve()
        except BaseException as error:
            self._end(error)
        else:
            self._end(None)

    def inside(self) -> bool:
        """Whether the caller is that thread."""
        return threading.current_thread() is self._thread


class ProcessWorker(Worker):
    """A process of its own, started afresh: it inherits nothing, all it gets is pickled.

    Args:
        serve: a function at the top of a module. It runs the loop to its end, and says when it begins by calling its
            last argument with the words that `words` is to be.
        arguments: its other ones.

    Raises:
        ClockError: something can't be pickled, or the process ended before the loop began.
        Exception: what was raised before it began.
    """

    def __init__(self, serve: Callable[..., None], *arguments: Any) -> None:
        context = multiprocessing.get_context("spawn")
        self._answers, answers = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_run, args=(answers, serve, arguments), name="cinegen clock", daemon=True
        )
        try:
            self._process.start()
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise ClockError(
                f"a clock's process can't be sent all it needs: {error}. A factory must be a function at the top of a "
                "module, and its arguments picklable"
            ) from error
        finally:
            answers.close()
        super().__init__()
        begun, answer = self._answer()
        if not begun:
            self._finish(None)
            if answer is not None:
                raise answer
        self.words = str(answer)
        threading.Thread(target=self._watch, name="cinegen clock watch", daemon=True).start()

    def _answer(self) -> tuple[bool, Any]:
        """What the process says next: that it has begun, or what it ended by."""
        try:
            begun, answer = self._answers.recv()
        except (EOFError, OSError):
            self._process.join()
            begun, answer = (
                False,
                ClockError(
                    f"a clock's process is gone, with exit code {self._process.exitcode}; what it wrote may say why. A "
                    "program that spawns runs itself again there, unless it is guarded by: if __name__ == '__main__'"
                ),
            )
        return bool(begun), answer

    def _watch(self) -> None:
        self._finish(self._answer()[1])

    def _finish(self, error: BaseException | None) -> None:
        self._process.join()
        self._answers.close()
        self._end(error)

    def kill(self) -> bool:
        """Ends the process."""
        self._process.terminate()
        if not self.ended(_GRACE):
            self._process.kill()
            self.ended(None)
        self.error()
        return True

    def _exit(self) -> None:
        if self.ended():  # else it is ended together with this process
            super()._exit()


def _run(
    answers: multiprocessing.connection.Connection, serve: Callable[..., None], arguments: tuple[Any, ...]
) -> None:
    """What the process does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all processes; the parent decides
    threading.Thread(target=_end_with_parent, daemon=True).start()
    error: BaseException | None = None
    try:
        serve(*arguments, lambda words: answers.send((True, words)))
    except BaseException as caught:
        error = _portable(caught)
    answers.send((False, error))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        time.sleep(_GRACE)
        os._exit(1)


def _portable(error: BaseException) -> BaseException:
    """An error that can be sent, with its traceback as a note."""
    story = "".join(traceback.format_exception(error)).rstrip()
    try:
        sent: BaseException = pickle.loads(pickle.dumps(error))
    except Exception:
        sent = ClockError(f"{type(error).__name__} in a clock's process: {error}")
    sent.add_note(f"In the clock's process:\n{story}")
    return sent
