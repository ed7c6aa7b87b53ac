"""`SessionRunner`: runs a session at its rate, in a process of its own or in a thread."""

from __future__ import annotations

import contextlib
import multiprocessing
import multiprocessing.connection
import warnings
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Self

from cinegen.errors import CinegenError, CinegenWarning
from cinegen.ik import tick_is_compiled
from cinegen.realtime import Clock, Tick, TimingReport
from cinegen.session.commands import Command
from cinegen.session.session import Session
from cinegen.session.setup import Setup
from cinegen.session.state import SessionState

FRAMES = 120
"""States per second."""

INTERPRETED_RATE = 60.0
"""Highest rate, ticks per second, of a session that begins before its kernels are compiled."""

_MOST = 100  # commands that are carried out in a tick
_PATIENCE = 10.0  # s that a session has to end


class SessionError(CinegenError):
    """Something went wrong in a session that has ended."""


class _End:
    """The last command."""


class SessionRunner:
    """Runs a session.

    Args:
        setup: setup of the session.
        own_process: run it in a process of its own; otherwise in a thread, which other Python code delays.

    Attributes:
        setup: as given; with a rate of at most `INTERPRETED_RATE` if kernels are not compiled yet.

    Raises:
        CinegenError: the session can't be constructed, or its process not started.
    """

    def __init__(self, setup: Setup, own_process: bool = True) -> None:
        if not tick_is_compiled():
            setup = replace(setup, rate=min(setup.rate, INTERPRETED_RATE))
        self.setup = setup
        self._clock = Clock(1.0 / setup.rate, priority=setup.priority)
        if own_process:
            inbox, outbox = multiprocessing.get_context("spawn").Pipe(duplex=False)
            self._clock.spawn(_in_process, setup, inbox)
            inbox.close()
            self._send: Callable[[Command | _End], None] = outbox.send
        else:
            commands: deque[Command | _End] = deque()
            self._send = commands.append
            self._clock.start(_ticks(Session(setup), lambda: commands.popleft() if commands else None))

    def send(self, command: Command | _End) -> None:
        """Send a command. Commands are carried out in their order, before the next tick."""
        with contextlib.suppress(OSError):  # the process has ended: `state` raises the reason
            self._send(command)

    @property
    def state(self) -> SessionState | None:
        """Newest state; None until there is one.

        Raises:
            Exception: the exception that ended the session.
        """
        state: SessionState | None = self._clock.state
        return state

    def report(self) -> TimingReport:
        """Return the timing of its ticks."""
        return self._clock.report()

    def stop(self) -> None:
        """End the session: close its sensors, and complete its recording.

        Raises:
            Exception: the exception that ended the session before.
        """
        self.send(_End())
        self._clock.join(_PATIENCE)
        self._clock.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def _in_process(
    setup: Setup, connection: multiprocessing.connection.Connection
) -> Callable[[Tick], SessionState | None]:
    def take() -> Command | _End | None:
        try:
            command: Command | _End | None = connection.recv() if connection.poll() else None
        except (EOFError, OSError):  # the other process has ended; the clock ends this one
            return None
        return command

    with warnings.catch_warnings():  # issued when the setup was made
        warnings.simplefilter("ignore", CinegenWarning)
        session = Session(setup)
    return _ticks(session, take)


def _ticks(session: Session, take: Callable[[], Command | _End | None]) -> Callable[[Tick], SessionState | None]:
    """Return the function that the clock calls."""
    every = max(1, round(session.setup.rate / FRAMES))
    count = 0

    def tick(tick: Tick) -> SessionState | None:
        nonlocal count
        for _ in range(_MOST):
            command = take()
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
