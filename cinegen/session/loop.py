"""Runs a session at its rate: in a process of its own, which nothing else holds up, or in a thread."""

from __future__ import annotations

import contextlib
import multiprocessing
import multiprocessing.connection
import warnings
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Protocol, Self

from cinegen.errors import CinegenWarning
from cinegen.realtime import Clock, Tick, TimingReport
from cinegen.session.commands import Command
from cinegen.session.session import Session
from cinegen.session.setup import Setup
from cinegen.session.state import State

FRAMES = 120
"""States a second that are told."""

_MOST = 100  # commands that are obeyed in a tick
_PATIENCE = 10.0  # s that a session has to end


class _End:
    """The last command."""


class _Inbox(Protocol):
    """Where commands come from."""

    def take(self) -> Command | _End | None:
        """The next; None if there is none."""


class _Here(deque[Command | _End]):
    """Within one process."""

    def take(self) -> Command | _End | None:
        """The next."""
        return self.popleft() if self else None


class _There:
    """From another process."""

    def __init__(self, connection: multiprocessing.connection.Connection) -> None:
        self._connection = connection

    def take(self) -> Command | _End | None:
        """The next."""
        try:
            command: Command | _End | None = self._connection.recv() if self._connection.poll() else None
        except (EOFError, OSError):  # whoever commands is gone; the clock's end follows
            return None
        return command


class Loop:
    """A session that runs.

    Args:
        setup: what it is made of.
        own_process: whether in a process of its own; else in a thread, where other Python code holds it up.

    Raises:
        CinegenError: there can't be such a session, or no process for it.
    """

    def __init__(self, setup: Setup, own_process: bool = True) -> None:
        self.setup = setup
        self._clock = Clock(1.0 / setup.rate, priority=setup.priority)
        if own_process:
            inbox, outbox = multiprocessing.get_context("spawn").Pipe(duplex=False)
            self._clock.spawn(_there, setup, inbox)
            inbox.close()
            self._send: Callable[[Command | _End], None] = outbox.send
        else:
            here = _Here()
            self._send = here.append
            self._clock.start(_ticks(Session(setup), here))

    def send(self, command: Command) -> None:
        """Commands are obeyed in their order, before the next tick."""
        try:
            self._send(command)
        except OSError:  # the process is gone: `state` says why
            return

    @property
    def state(self) -> State | None:
        """The newest; None until there is one.

        Raises:
            Exception: what ended the session.
        """
        state: State | None = self._clock.state
        return state

    def report(self) -> TimingReport:
        """How well it keeps its rate."""
        return self._clock.report()

    def stop(self) -> None:
        """Ends the session: sensors are closed, a recording is whole.

        Raises:
            Exception: what ended the session before.
        """
        with contextlib.suppress(OSError):  # the process is gone: `join` raises why
            self._send(_End())
        self._clock.join(_PATIENCE)
        self._clock.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()


def _there(setup: Setup, connection: multiprocessing.connection.Connection) -> Callable[[Tick], State | None]:
    with warnings.catch_warnings():  # they were told where the session was put together
        warnings.simplefilter("ignore", CinegenWarning)
        session = Session(setup)
    return _ticks(session, _There(connection))


def _ticks(session: Session, inbox: _Inbox) -> Callable[[Tick], State | None]:
    """What a clock calls."""
    every = max(1, round(session.setup.rate / FRAMES))
    count = 0

    def tick(tick: Tick) -> State | None:
        nonlocal count
        for _ in range(_MOST):
            command = inbox.take()
            if command is None:
                break
            if isinstance(command, _End):
                session.close()
                tick.clock.stop()
                return None
            session.obey(command)
        session.tick()
        count += 1
        return session.state() if count % every == 1 or every == 1 else None

    return tick
