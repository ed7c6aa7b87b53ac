"""`SessionRunner`: runs a session at its rate, in a process of its own or in a thread."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import multiprocessing.connection
import pickle
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.context import SpawnContext
from typing import Any, Self

from cinegen.errors import CinegenError, CinegenWarning
from cinegen.jit.starting import COMPILATION
from cinegen.realtime import Clock, Tick, TimingReport
from cinegen.session.commands import Command
from cinegen.session.other_robots import OtherRobots
from cinegen.session.session import Session
from cinegen.session.setup import Setup
from cinegen.session.state import SessionState

FRAMES = 120
"""States per second."""

INTERPRETED_RATE = 60.0
"""Highest rate of a session, ticks per second, while its kernels are not compiled."""

AT_REST = 4.0
"""Ticks per second of a session at rest."""

_FASTER = 1.03  # factor from a tick's rate to the next: the lag behind targets depends on the rate, and must not jump
_LONGEST = 0.005  # s in which commands are carried out before a tick; the others wait
_PATIENCE = 10.0  # s that a session has to end


class SessionError(CinegenError):
    """Something went wrong in a session that has ended."""


@dataclass(frozen=True)
class _Exchange:
    """Message about another setup, which is pickled: it is unpickled outside of the ticks.

    Attributes:
        edition: its number.
        setup: the setup.
    """

    edition: int
    setup: bytes


@dataclass(frozen=True)
class _Refusal:
    """Answer to an `_Exchange` whose robots can't be driven."""

    edition: int
    why: str


class _End:
    """The last command."""


_Message = Command | _Exchange | OtherRobots | _Refusal | _End


class _Inbox:
    """Commands for a session, and what wakes it at rest.

    Args:
        taken: number of commands that were taken.
    """

    def __init__(self, taken: ctypes.c_longlong) -> None:
        self._taken = taken
        self._commands: deque[_Message] = deque()
        self._woken = threading.Event()

    def put(self, command: _Message) -> None:
        """Add a command. The robots of another setup are made by a thread of its own, and come when they are ready."""
        if isinstance(command, _Exchange):
            self._taken.value += 1
            threading.Thread(target=self._prepare, args=(command,), name="cinegen exchange", daemon=True).start()
            return
        self._commands.append(command)
        self._woken.set()

    def _prepare(self, command: _Exchange) -> None:
        message: OtherRobots | _Refusal
        try:
            with warnings.catch_warnings():  # issued when the setup was made
                warnings.simplefilter("ignore")
                message = OtherRobots.of(pickle.loads(command.setup), command.edition)
        except Exception as error:  # whatever it is, the session goes on with the robots that it has
            message = _Refusal(command.edition, f"the robots can't be driven: {error}")
        self._taken.value -= 1  # of a message that nobody sent
        self.put(message)

    def take(self) -> _Message | None:
        """Return the next command; None if there is none."""
        self._woken.clear()
        if not self._commands:
            return None
        self._taken.value += 1
        return self._commands.popleft()

    def wake(self) -> None:
        """End `wait`."""
        self._woken.set()

    def wait(self, seconds: float) -> None:
        """Wait for a command or a call of `wake` since the last `take`, at most for some time (s)."""
        self._woken.wait(seconds)

    def receive(self, connection: multiprocessing.connection.Connection) -> None:
        """Take commands from a connection until it ends, which ends the session."""
        with contextlib.suppress(EOFError, OSError):
            while True:
                self.put(connection.recv())
        self.put(_End())


class _Bell:
    """Wakes a thread, from any process. Rings that were not heard yet are one, so that ringing never waits."""

    def __init__(self, context: SpawnContext) -> None:
        self._ear, self._clapper = context.Pipe(duplex=False)
        self._rung = context.RawValue(ctypes.c_bool)

    def ring(self) -> None:
        """End `wait`."""
        if not self._rung.value:
            self._rung.value = True
            with contextlib.suppress(OSError):  # nobody listens any more
                self._clapper.send_bytes(b"")

    def wait(self, seconds: float) -> bool:
        """Wait for a ring since the last call of this; return whether there was one."""
        if not self._ear.poll(max(0.0, seconds)):
            return False
        self._ear.recv_bytes()
        self._rung.value = False  # what rings before this has written its state, which is read after it
        return True

    def close(self) -> None:
        """Close it."""
        self._ear.close()
        self._clapper.close()


class SessionRunner:
    """Runs a session at its rate, or at `INTERPRETED_RATE` while its kernels are being compiled. When it is at rest,
    ticks are few until a command or a reading of a sensor comes.

    Args:
        setup: setup of the session.
        own_process: run it in a process of its own; otherwise in a thread, which other Python code delays.

    Attributes:
        setup: as given.

    Raises:
        CinegenError: the session can't be constructed, or its process not started.
    """

    def __init__(self, setup: Setup, own_process: bool = True) -> None:
        self.setup = setup
        self._sent = 0
        self._clock = Clock(1.0 / setup.rate, priority=setup.priority)
        context = multiprocessing.get_context("spawn")
        self._bell = _Bell(context)
        if own_process:
            inbox, outbox = context.Pipe(duplex=False)
            self._taken = context.RawValue(ctypes.c_longlong)
            self._clock.spawn(_in_process, setup, inbox, self._taken, self._bell)
            inbox.close()
            self._send: Callable[[_Message], None] = outbox.send
        else:
            self._taken = ctypes.c_longlong()
            local_inbox = _Inbox(self._taken)
            self._send = local_inbox.put
            self._clock.start(_ticks(Session(setup), local_inbox, self._bell.ring))

    def send(self, command: Command) -> None:
        """Send a command. Commands are carried out in their order, before the next tick."""
        self._try(command)

    def exchange(self, setup: Setup, edition: int) -> None:
        """Let the session go on with the robots of another setup (`Session.exchange`), as soon as they are made.

        Args:
            setup: the other setup, of the same rate.
            edition: its number, which states have from then on; they have it in `refused` if that can't be.
        """
        self._try(_Exchange(edition, pickle.dumps(setup)))

    def _try(self, command: _Message) -> None:
        with contextlib.suppress(OSError):  # the process has ended: `state` raises the reason
            self._send(command)
            self._sent += 1

    @property
    def waiting(self) -> int:
        """Number of commands that were sent and not begun yet."""
        return self._sent - int(self._taken.value)

    @property
    def state(self) -> SessionState | None:
        """Newest state; None until there is one.

        Raises:
            Exception: the exception that ended the session.
        """
        state: SessionState | None = self._clock.state
        return state

    def wake(self) -> None:
        """End `wait`."""
        self._bell.ring()

    def wait(self, seconds: float) -> bool:
        """Wait for a state of a session at rest that has obeyed a command, or moves; or for a call of `wake` since the
        last call of this.

        Args:
            seconds: longest time to wait.

        Returns:
            whether it was not that time that passed. For one thread.
        """
        return self._bell.wait(seconds)

    def report(self) -> TimingReport:
        """Return the timing of its ticks."""
        return self._clock.report()

    def stop(self) -> None:
        """End the session: close its sensors, and complete its recording.

        Raises:
            Exception: the exception that ended the session before.
        """
        self._try(_End())
        try:
            self._clock.join(_PATIENCE)
            self._clock.stop()
        finally:
            self._bell.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def _in_process(
    setup: Setup, connection: multiprocessing.connection.Connection, taken: ctypes.c_longlong, bell: _Bell
) -> Callable[[Tick], SessionState | None]:
    inbox = _Inbox(taken)
    threading.Thread(target=inbox.receive, args=(connection,), name="cinegen commands", daemon=True).start()
    with warnings.catch_warnings():  # issued when the setup was made
        warnings.simplefilter("ignore", CinegenWarning)
        session = Session(setup)
    return _ticks(session, inbox, bell.ring)


def _ticks(session: Session, inbox: _Inbox, ring: Callable[[], None]) -> Callable[[Tick], SessionState | None]:
    """Return the function that the clock calls; `ring` is called when the state of a session at rest is news."""
    session.wake = inbox.wake
    due, rested, last, is_news = 0, False, 0.0, False

    def rest(is_news: bool) -> None:
        if is_news:
            ring()
        inbox.wait(1.0 / AT_REST)

    def tick(tick: Tick) -> SessionState | None:
        nonlocal due, rested, last, is_news
        if is_news:  # the state of the tick before
            ring()
        session.dt = tick.clock.period
        if rested:
            session.pass_time(max(0.0, tick.time - last - session.dt))
        last, is_news = tick.time, False
        began = time.perf_counter()
        while (command := inbox.take()) is not None:
            is_news = rested
            if isinstance(command, _End):
                session.close()
                tick.clock.stop()
                return None
            _carry_out(session, command)
            if time.perf_counter() - began > _LONGEST:
                break
        session.tick()
        tick.clock.period = _next_period(session.setup.rate, session.dt)
        is_news |= rested and not session.at_rest
        rested = session.at_rest
        if rested:
            tick.clock.rest(partial(rest, is_news))
            is_news = False
        elif tick.number < due and not is_news:
            return None
        due = tick.number + max(1, round(1.0 / (FRAMES * session.dt)))
        return session.state()

    return tick


def _carry_out(session: Session, command: Any) -> None:
    """Let a session carry out a command of any kind but the end."""
    if isinstance(command, OtherRobots):
        session.exchange(command)
    elif isinstance(command, _Refusal):
        session.refuse(command.edition, command.why)
    elif not isinstance(command, _Exchange):
        session.obey(command)


def _next_period(rate: float, dt: float) -> float:
    """Return the period (s) of the next tick, for the rate that is asked for and the period before."""
    if COMPILATION.is_awaited:
        return 1.0 / min(rate, INTERPRETED_RATE)
    return max(1.0 / rate, dt / _FASTER)
