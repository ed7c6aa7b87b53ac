"""A loop at a fixed rate."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np

from cinegen.realtime import scheduling
from cinegen.realtime.channel import Channel, ClockError
from cinegen.realtime.timing import TimingReport
from cinegen.realtime.worker import LoopProcess, LoopThread, LoopWorker

_SPIN = 2e-4  # s
_SLICE = 0.05  # s: longest sleep, so that a slow loop stops soon


class Tick(NamedTuple):
    """One tick of a clock.

    Attributes:
        number: index of its deadline, from 0; indices of skipped deadlines are missing.
        time: time of its deadline since the first one, s: `number` periods, unless they changed; without jitter.
        late: delay of its start after its deadline, s.
        skipped: number of deadlines that were skipped before it.
        command: newest value of `Clock.command`; None before the first.
        clock: clock of the loop, in the loop's own thread or process; `tick.clock.stop()` makes this tick the last.
    """

    number: int
    time: float
    late: float
    skipped: int
    command: Any
    clock: Clock


Function = Callable[[Tick], Any]


class Clock:
    """Calls a function at a fixed rate, in the calling thread, another thread or another process.

    Deadlines are whole periods after the first one, so they do not drift. If a tick takes longer than its period, the
    next tick starts at once for the newest deadline that has passed; earlier deadlines are skipped and counted.

    A clock runs one loop at a time. Each loop has its own timing record and deadlines.

    Args:
        period: time between two deadlines, s.
        spin: time before a deadline at which the loop wakes and waits busily, s. Wake-up delays up to this time do not
            affect the period. It occupies that fraction of a core, and of the interpreter lock if other threads run.
            By default a fifth of the period, at most 0.2 ms.
        priority: priority of the real-time class SCHED_FIFO, 1 to 99, where the system permits it; 0, the default,
            leaves the scheduling unchanged. A real-time tick blocks all other programs on its core while it runs, so
            one core remains for them: as many loops as there are other cores can be in real time on a machine.
            `TimingReport.scheduling` reports the result.

    Raises:
        ClockError: a value is out of range.
    """

    def __init__(self, period: float = 0.001, *, spin: float | None = None, priority: int = 0) -> None:
        self._spin = spin
        self.period = period
        if priority not in range(100):
            raise ClockError(f"a clock's priority must be from 0 to 99, not {priority}")
        self.priority = priority
        self._command: Any = None
        self._channel: Channel = Channel.local(period)
        self._worker: LoopWorker | None = None
        self._looping = False
        self._scheduling = ""
        self._rest: Callable[[], object] | None = None

    def __repr__(self) -> str:
        return f"<Clock of {1e3 * self.period:g} ms, {'running' if self.running else 'stopped'}>"

    @property
    def period(self) -> float:
        """Time between two deadlines, s. The loop's function may set it, by `tick.clock.period = ...`: the next
        deadline is a new period after that of the present tick.

        Raises:
            ClockError: set to a time that is not positive and finite, or shorter than `spin`.
        """
        return self._period

    @period.setter
    def period(self, period: float) -> None:
        if not (math.isfinite(period) and period > 0.0):
            raise ClockError(f"a clock's period must be a positive time in seconds, not {period}")
        if self._spin is not None and not 0.0 <= self._spin <= period:
            raise ClockError(f"a clock's spin must be from 0 to its period of {period} s, not {self._spin}")
        self._period = period

    @property
    def spin(self) -> float:
        """Time before a deadline at which the loop wakes and waits busily, s."""
        return min(_SPIN, 0.2 * self._period) if self._spin is None else self._spin

    # --- loops ---------------------------------------------------------------------------------------------------

    def __iter__(self) -> Iterator[Tick]:
        """Iterate over ticks in the calling thread, until `stop` is called or the loop is left."""
        return self.ticks()

    def ticks(self, seconds: float | None = None) -> Iterator[Tick]:
        """Iterate over ticks in the calling thread, until `stop` is called or the loop is left.

        Args:
            seconds: duration; unlimited unless given.

        Raises:
            ClockError: the clock is running already, or seconds is negative or not finite.
        """
        count = self._begin(seconds, Channel.local(self.period))
        return self._served(count)

    def run(self, function: Function, seconds: float | None = None) -> TimingReport:
        """Call function(tick) at every tick in the calling thread; its return value becomes `state`.

        Args:
            function: called with a `Tick`.
            seconds: duration; unlimited unless given.

        Raises:
            ClockError: the clock is running already, or seconds is negative or not finite.
            Exception: exception of the function; it ends the loop.
        """
        count = self._begin(seconds, Channel.local(self.period))
        self._serve(function, count)
        return self.report()

    def start(self, function: Function, seconds: float | None = None) -> Self:
        """Start a thread that calls function(tick) at every tick until `stop` is called, and return at once.

        The function's return value becomes `state`. An exception of the function ends the loop; it is raised again by
        the next call of `stop`, `join`, `state`, `command = ...`, the end of a `with` block, or the next loop.

        Args:
            function: called with a `Tick`.
            seconds: duration; unlimited unless given.

        Raises:
            ClockError: the clock is running already, or seconds is negative or not finite.
        """
        count = self._begin(seconds, Channel.local(self.period))
        self._worker = LoopThread(lambda: self._serve(function, count))
        return self

    def spawn(self, factory: Callable[..., Function], *arguments: Any, seconds: float | None = None) -> Self:
        """Start the loop in a new process, which other Python threads do not delay; return when the loop starts.

        The new process creates the function by `factory(*arguments)`. Arguments, commands and states are pickled; the
        newest command and state pass through shared memory, at most 64 KiB each. Exceptions of the factory are raised
        here.

        Args:
            factory: function at the top level of a module.
            arguments: its arguments. A `Mechanism` can be pickled.
            seconds: duration; unlimited unless given.

        Raises:
            ClockError: the clock is running already; seconds is negative or not finite; an argument can't be pickled;
                or the process ended before the loop started.
            Exception: exception of the factory.
        """
        count = self._begin(seconds, Channel.shared(self.period))
        settings = {"period": self.period, "spin": self._spin, "priority": self.priority}
        worker = LoopProcess(_serve_there, settings, self._channel, count, factory, arguments)
        self._worker, self._scheduling = worker, worker.scheduling
        return self

    def stop(self, timeout: float = 10.0) -> None:
        """Stop the loop after the present tick. Unless called by the loop itself, wait until it has ended.

        Args:
            timeout: time to wait, s; after that, a process is ended by force.

        Raises:
            ClockError: the loop did not end in time.
            Exception: exception that ended the loop, unless it was raised before.
        """
        worker = self._worker
        self._channel.stopped.value = True
        if worker is None or worker.inside():
            return
        if not worker.ended(timeout):
            end = "its process was ended by force" if worker.kill() else "its thread still runs"
            raise ClockError(f"a clock's tick took longer than {timeout:g} s: {end}")
        self._raise_error()

    def join(self, timeout: float | None = None) -> bool:
        """Wait until the loop ends by itself. Return whether it has.

        Args:
            timeout: longest time to wait, s; unlimited unless given.

        Raises:
            Exception: exception that ended the loop, unless it was raised before.
        """
        if self._worker is not None and not self._worker.ended(timeout):
            return False
        self._raise_error()
        return True

    def rest(self, wait: Callable[[], object]) -> None:
        """Call wait() after the present tick, which calls this. The loop has nothing to do until wait() returns, after
        any time: deadlines that pass meanwhile are neither late nor skipped. The next tick starts at once.

        Args:
            wait: returns when there is something to do, or after some time.
        """
        self._rest = wait

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.stop()
        except Exception as failure:
            if error is None:
                raise
            error.add_note(f"A clock's loop had also ended by {failure!r}")
            logging.getLogger("cinegen").error("a clock's loop was ended by an exception", exc_info=failure)

    # --- while a loop runs -------------------------------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """True while a loop is running."""
        return self._looping or (self._worker is not None and not self._worker.ended())

    @property
    def command(self) -> Any:
        """Value that ticks receive. It may be set at any time, also before a loop starts; only the newest is kept.

        Raises, when set:
            ClockError: the value can't be sent to the loop's process.
            Exception: exception that ended the loop, unless it was raised before.
        """
        return self._command

    @command.setter
    def command(self, command: Any) -> None:
        self._raise_error()
        self._channel.command.write(command, "command")
        self._command = command

    @property
    def state(self) -> Any:
        """Newest return value of the function that is not None; from another process it is a copy.

        Raises:
            Exception: exception that ended the loop, unless it was raised before.
        """
        self._raise_error()
        return self._channel.state.read()

    def report(self) -> TimingReport:
        """Return the timing statistics of the present loop, or of the last one."""
        return self._channel.record.report(self._scheduling)

    # --- inside --------------------------------------------------------------------------------------------------

    def _begin(self, seconds: float | None, channel: Channel) -> float:
        """Prepare a loop; return its number of deadlines."""
        if self.running:
            raise ClockError("this clock is running already: stop it first, or use another clock")
        if seconds is not None and not (math.isfinite(seconds) and seconds >= 0.0):
            raise ClockError(f"seconds must be finite and not negative, not {seconds}")
        self._raise_error()
        if self._command is not None:
            channel.command.write(self._command, "command")
        self._channel, self._worker = channel, None
        return math.inf if seconds is None else math.ceil(seconds / self.period - 1e-6)

    def _raise_error(self) -> None:
        """Raise the exception that ended the loop, once."""
        error = self._worker.error() if self._worker is not None else None
        if error is not None:
            raise error

    @contextmanager
    def _prepared(self) -> Iterator[str]:
        with scheduling.quiet_interpreter(), scheduling.scheduled(self.priority) as description:
            self._scheduling = description
            self._looping = True
            try:
                yield description
            finally:
                self._looping = False

    def _served(self, count: float) -> Iterator[Tick]:
        with self._prepared():
            yield from self._loop(count)

    def _serve(self, function: Function, count: float, ready: Callable[[str], None] | None = None) -> None:
        with self._prepared() as description:
            if ready is not None:
                ready(description)
            for tick in self._loop(count):
                state = function(tick)
                if state is not None:
                    self._channel.state.write(state, "state")

    def _loop(self, count: float) -> Iterator[Tick]:
        """Iterate over the ticks of `count` deadlines."""
        channel, period, now = self._channel, self.period, time.perf_counter
        record = channel.record
        begin, since, first = now(), 0.0, 0  # of the deadline since which the period is the same: when, and its number
        due, rested = 0, False
        try:
            while due < count and self._wait(channel, begin + (due - first) * period):
                start = now()
                passed = first + (start - begin) // period
                if rested:
                    due = max(due, int(passed))
                number = int(min(max(due, passed), count - 1))
                after = (number - first) * period
                skipped, late = number - due, 0.0 if rested else start - (begin + after)
                record.begun(start, late + skipped * period, skipped)
                due = number + 1
                try:
                    yield Tick(number, since + after, late, skipped, channel.command.read(), self)
                finally:
                    if self.period != period:
                        begin, since, first = begin + after, since + after, number
                        count = number + float(np.ceil((count - number) * period / self.period - 1e-6))
                        period = record.period = self.period
                    record.ended(now(), begin + (due - first) * period)
                rest, self._rest = self._rest, None
                rested = rest is not None
                if rest is not None:
                    record.rest()
                    scheduling.asleep()
                    rest()
                    scheduling.awake()
        finally:
            record.rest()

    def _wait(self, channel: Channel, deadline: float) -> bool:
        """Wait until a deadline (s); return False if the loop is to end."""
        now = time.perf_counter
        while not channel.stopped.value:
            left = deadline - self.spin - now()
            if left <= 0.0:
                while now() < deadline:
                    pass
                return True
            scheduling.asleep()
            time.sleep(min(left, _SLICE))
            scheduling.awake()
        return False


def _serve_there(
    settings: dict[str, Any],
    channel: Channel,
    count: float,
    factory: Callable[..., Function],
    arguments: tuple[Any, ...],
    ready: Callable[[str], None],
) -> None:
    """Run a loop in a new process."""
    clock = Clock(**settings)
    clock._channel = channel
    clock._serve(factory(*arguments), count, ready)
