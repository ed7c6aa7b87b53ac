"""`Clock`: a loop at a fixed rate."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, NamedTuple, Self

from cinegen.realtime import quiet
from cinegen.realtime.board import Board, ClockError, HereBoard, SharedBoard
from cinegen.realtime.record import Report
from cinegen.realtime.worker import ProcessWorker, ThreadWorker, Worker

_SPIN = 2e-4  # s
_SLICE = 0.05  # s: the longest sleep, so that a slow loop stops soon


class Tick(NamedTuple):
    """One tick of a clock.

    Attributes:
        number: of its deadline, from 0; those of skipped ones are missing.
        time: s from the first deadline to this one, `number` periods: when it should be, free of jitter.
        late: s after its deadline that it began.
        skipped: how many deadlines before it were skipped.
        command: what `Clock.command` was last set to; None if it never was.
        clock: whose tick it is, as it is in the loop's own thread or process; `tick.clock.stop()` makes this the last.
    """

    number: int
    time: float
    late: float
    skipped: int
    command: Any
    clock: Clock


Function = Callable[[Tick], Any]


class Clock:
    """Ticks at a fixed rate, here, in a thread of its own or in a process of its own, and times itself.

    Deadlines are whole periods after the first one: nothing drifts. Where a tick takes longer than its period, or
    something holds the loop up, the next one begins at once, as that of the newest deadline that has passed; those
    before it are skipped and counted, not made good in a burst.

    A clock runs one loop at a time. Each has a record and deadlines of its own.

    Args:
        period: s between two deadlines.
        spin: s before a deadline that the loop wakes, to wait for it busily. What wakes it late by no more than this
            does not show in its periods. It costs that part of a core, and of the interpreter lock where other
            threads run. Unless given a fifth of the period, 0.2 ms at most.
        priority: of the real-time class SCHED_FIFO, 1 to 99, where the system permits it; 0, the default, leaves the
            scheduling as it is. `Report.scheduling` says what became of it. Real-time ticks keep all other programs
            from their core while they run; several such loops can make a machine unusable.
        cores: on which of the machine's cores the loop may run; any if empty.

    Raises:
        ClockError: one of these makes no sense.
    """

    def __init__(
        self, period: float = 0.001, *, spin: float | None = None, priority: int = 0, cores: Iterable[int] = ()
    ) -> None:
        if not (math.isfinite(period) and period > 0.0):
            raise ClockError(f"a clock's period must be a positive time in seconds, not {period}")
        if spin is None:
            spin = min(_SPIN, 0.2 * period)
        if not 0.0 <= spin <= period:
            raise ClockError(f"a clock's spin must be from 0 to its period of {period} s, not {spin}")
        if priority not in range(100):
            raise ClockError(f"a clock's priority must be from 0 to 99, not {priority}")
        self.period, self.spin, self.priority, self.cores = period, spin, priority, frozenset(cores)
        self._command: Any = None
        self._board: Board = HereBoard(period)
        self._worker: Worker | None = None
        self._looping = False
        self._scheduling = ""

    def __repr__(self) -> str:
        return f"<Clock of {1e3 * self.period:g} ms, {'running' if self.running else 'stopped'}>"

    # --- loops ---------------------------------------------------------------------------------------------------

    def __iter__(self) -> Iterator[Tick]:
        """Ticks in the calling thread, until `stop` is called or the loop is left."""
        return self.ticks()

    def ticks(self, seconds: float | None = None) -> Iterator[Tick]:
        """Ticks in the calling thread, until `stop` is called or the loop is left.

        Args:
            seconds: those whose deadlines are within this time; for ever unless given.

        Raises:
            ClockError: the clock runs already, or seconds make no sense.
        """
        count = self._begin(seconds, HereBoard(self.period))
        return self._served(count)

    def run(self, function: Function, seconds: float | None = None) -> Report:
        """Calls function(tick) at every tick, in the calling thread; see `ticks`. What it returns becomes `state`.

        Raises:
            ClockError: the clock runs already, or seconds make no sense.
            Exception: what the function raises; that ends the loop.
        """
        count = self._begin(seconds, HereBoard(self.period))
        self._serve(function, count)
        return self.report()

    def start(self, function: Function, seconds: float | None = None) -> Self:
        """Calls function(tick) at every tick, in a thread of its own, until `stop` is called. Returns at once.

        What the function returns becomes `state`. What it raises ends the loop, and is raised again by the next of
        `stop`, `join`, `state`, `command = ...`, the end of a `with`, or another loop's begin.

        Args:
            function: called with a `Tick`.
            seconds: those ticks whose deadlines are within this time; for ever unless given.

        Raises:
            ClockError: the clock runs already, or seconds make no sense.
        """
        count = self._begin(seconds, HereBoard(self.period))
        self._worker = ThreadWorker(lambda: self._serve(function, count))
        return self

    def spawn(self, factory: Callable[..., Function], *arguments: Any, seconds: float | None = None) -> Self:
        """As `start`, in a process of its own, that no other Python thread holds up. Returns when the loop begins.

        The function is made there, by factory(*arguments). These are pickled, and so are commands and states, whose
        newest pass through shared memory, 64 KiB at most each. Errors of the factory are raised here.

        Args:
            factory: a function at the top of a module.
            arguments: for it. A `Mechanism` can be sent.
            seconds: those ticks whose deadlines are within this time; for ever unless given.

        Raises:
            ClockError: the clock runs already, seconds make no sense, something can't be pickled, or the process
                ended before the loop began.
            Exception: what the factory raises.
        """
        count = self._begin(seconds, SharedBoard(self.period))
        settings = {"period": self.period, "spin": self.spin, "priority": self.priority, "cores": self.cores}
        worker = ProcessWorker(_serve_there, settings, self._board, count, factory, arguments)
        self._worker, self._scheduling = worker, worker.words
        return self

    def stop(self, timeout: float = 10.0) -> None:
        """Makes the tick that is on its way the last. From outside, waits until it has ended.

        Args:
            timeout: s to wait; after that, a process is ended by force.

        Raises:
            ClockError: it did not end in time.
            Exception: what ended the loop, if nobody was told yet.
        """
        worker = self._worker
        self._board.stopped = True
        if worker is None or worker.inside():
            return
        if not worker.ended(timeout):
            end = "its process was ended by force" if worker.kill() else "its thread still runs"
            raise ClockError(f"a clock's tick took longer than {timeout:g} s: {end}")
        self._tell()

    def join(self, timeout: float | None = None) -> bool:
        """Waits until the loop ends by itself. Returns whether it has.

        Args:
            timeout: s to wait at most.

        Raises:
            Exception: what ended the loop, if nobody was told yet.
        """
        if self._worker is not None and not self._worker.ended(timeout):
            return False
        self._tell()
        return True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.stop()
        except Exception as own:
            if error is None:
                raise
            error.add_note(f"Besides, a clock's loop had ended by {own!r}")
            logging.getLogger("cinegen").error("a clock's loop was ended by an exception", exc_info=own)

    # --- beside a loop -------------------------------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """Whether a loop runs."""
        return self._looping or (self._worker is not None and not self._worker.ended())

    @property
    def command(self) -> Any:
        """What ticks are told. May be set at any time, also before a loop begins; only the newest counts.

        Raises, when set:
            ClockError: it can't be sent to the loop's process.
            Exception: what ended the loop, if nobody was told yet.
        """
        return self._command

    @command.setter
    def command(self, command: Any) -> None:
        self._tell()
        self._board.command = command
        self._command = command

    @property
    def state(self) -> Any:
        """What the function last returned that is not None; None if nothing. From another process it is a copy.

        Raises:
            Exception: what ended the loop, if nobody was told yet.
        """
        self._tell()
        return self._board.state

    def report(self) -> Report:
        """How the loop keeps its period, or how the last one did."""
        return self._board.record.report(self._scheduling)

    # --- inside --------------------------------------------------------------------------------------------------

    def _begin(self, seconds: float | None, board: Board) -> float:
        """Makes everything ready for a loop; how many deadlines it has."""
        if self.running:
            raise ClockError("a clock runs one loop at a time: stop it first, or make another one")
        if seconds is not None and not (math.isfinite(seconds) and seconds >= 0.0):
            raise ClockError(f"a clock runs for 0 seconds or more, not {seconds}; for ever unless they are given")
        self._tell()
        if self._command is not None:
            board.command = self._command
        self._board, self._worker = board, None
        return math.inf if seconds is None else math.ceil(seconds / self.period - 1e-6)

    def _tell(self) -> None:
        """Raises what ended the loop, once."""
        error = self._worker.error() if self._worker is not None else None
        if error is not None:
            raise error

    @contextmanager
    def _prepared(self) -> Iterator[str]:
        with quiet.quiet_interpreter(), quiet.scheduled(self.priority, self.cores) as words:
            self._scheduling = words
            self._looping = True
            try:
                yield words
            finally:
                self._looping = False

    def _served(self, count: float) -> Iterator[Tick]:
        with self._prepared():
            yield from self._loop(count)

    def _serve(self, function: Function, count: float, ready: Callable[[str], None] | None = None) -> None:
        with self._prepared() as words:
            if ready is not None:
                ready(words)
            for tick in self._loop(count):
                state = function(tick)
                if state is not None:
                    self._board.state = state

    def _loop(self, count: float) -> Iterator[Tick]:
        """The ticks of so many deadlines."""
        board, period, now = self._board, self.period, time.perf_counter
        record = board.record
        begin, due = now(), 0
        while due < count and self._wait(board, begin + due * period):
            start = now()
            number = int(min(max(due, (start - begin) // period), count - 1))
            skipped, late = number - due, start - (begin + number * period)
            record.begun(start, late + skipped * period, skipped)
            due = number + 1
            try:
                yield Tick(number, number * period, late, skipped, board.command, self)
            finally:
                record.ended(now(), begin + due * period)

    def _wait(self, board: Board, deadline: float) -> bool:
        """Until a deadline (s on the clock); whether another tick is wanted."""
        now = time.perf_counter
        while not board.stopped:
            left = deadline - self.spin - now()
            if left <= 0.0:
                while now() < deadline:
                    pass
                return True
            quiet.asleep()
            time.sleep(min(left, _SLICE))
            quiet.awake()
        return False


def _serve_there(
    settings: dict[str, Any],
    board: Board,
    count: float,
    factory: Callable[..., Function],
    arguments: tuple[Any, ...],
    ready: Callable[[str], None],
) -> None:
    """What a process of its own does."""
    clock = Clock(**settings)
    clock._board = board
    clock._serve(factory(*arguments), count, ready)
