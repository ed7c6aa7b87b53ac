"""The browsers on one session: each gets the newest state as fast as it takes it, and one at a time holds the hand."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any, Protocol

from cinegen.session import Command, CommandError, Vocabulary, parse, read
from cinegen.session.commands import EndJoint, LetGo, Play, View

MOST = 100
"""Browsers on one session."""

FASTEST = 400
"""Messages a second that a browser may send."""

PATIENCE = 30.0
"""s that a browser may take for one state before it is given up."""

_POLITE = 1008  # close codes of websockets: it broke a rule
_CROWDED = 1013  # try again later


class Line(Protocol):
    """A connection to a browser; neither of its methods waits or raises."""

    def send(self, text: str) -> None:
        """Sends a message."""

    def close(self, code: int, reason: str) -> None:
        """Ends the connection."""


class Client:
    """A browser.

    Args:
        number: its own in the session.
        line: to it.
    """

    def __init__(self, number: int, line: Line) -> None:
        self.number, self.line = number, line
        self.waiting: tuple[int, float] | None = None  # for the acknowledgement of this frame, since then
        self.sent = 0  # the last frame
        self.reported = 0  # the last report
        self.frames = 0  # that it has acknowledged
        self._allowed, self._heard = float(FASTEST), time.monotonic()

    def too_fast(self) -> bool:
        """Whether it says more than anybody could mean; called for each message."""
        now = time.monotonic()
        self._allowed = min(FASTEST, self._allowed + (now - self._heard) * FASTEST)
        self._heard = now
        self._allowed -= 1.0
        return self._allowed < 0.0


class Hub:
    """Who is there, and who may do what. One thread at a time; nothing here waits or raises.

    Args:
        known: names that commands may use.
        send: takes the commands that are obeyed.
        hello: what a new browser is told first, by its number.
    """

    def __init__(
        self, known: Vocabulary, send: Callable[[Command], None], hello: Callable[[int], dict[str, Any]]
    ) -> None:
        self.clients: dict[int, Client] = {}
        self.hand: int | None = None
        self._known, self._obey, self._hello = known, send, hello
        self._count = 0
        self._frame: tuple[int, dict[str, Any]] = (0, {})
        self._report: tuple[int, dict[str, Any]] = (0, {})
        self._texts: dict[bool, str] = {}  # of the newest frame, with the report and without

    # --- coming and going ----------------------------------------------------------------------------------------

    def join(self, line: Line) -> Client | None:
        """A browser comes; None if there is no room."""
        if len(self.clients) >= MOST:
            line.close(_CROWDED, f"{MOST} browsers look at this session already")
            return None
        self._count += 1
        client = Client(self._count, line)
        self.clients[client.number] = client
        line.send(json.dumps(self._hello(client.number)))
        self._feed(client)
        return client

    def leave(self, client: Client) -> None:
        """A browser is gone: what it held is let go."""
        if self.clients.pop(client.number, None) is not None and self.hand == client.number:
            self._let_go()

    def drop(self, client: Client, reason: str) -> None:
        """A browser is listened to no more, and told why."""
        self.leave(client)
        client.line.close(_POLITE, reason)

    # --- what they say -------------------------------------------------------------------------------------------

    def heard(self, client: Client, message: str | bytes) -> None:
        """A browser says something."""
        if client.number not in self.clients:  # it was dropped
            return
        if client.too_fast():
            self.drop(client, f"more than {FASTEST} messages a second")
            return
        try:
            said = read(message)
            ((kind, value),) = said.items()
            if kind == "ack":
                self._acknowledged(client, value)
            elif kind == "hand":
                self._wants_hand(client, value)
            else:
                self._command(client, parse(said, self._known))
        except CommandError as error:
            self.drop(client, str(error))

    def _acknowledged(self, client: Client, frame: Any) -> None:
        if type(frame) is not int:
            raise CommandError("a frame is a whole number")
        if client.waiting is not None and client.waiting[0] == frame:
            client.waiting = None
            client.frames += 1
            self._feed(client)

    def _wants_hand(self, client: Client, wanted: Any) -> None:
        if not isinstance(wanted, bool):
            raise CommandError("hand is true or false")
        if wanted and self.hand != client.number:
            before = self.clients.get(self.hand or 0)
            self._let_go()
            self.hand = client.number
            if before is not None:
                self.tell(before, "another browser has taken the hand")
        elif not wanted and self.hand == client.number:
            self._let_go()

    def _command(self, client: Client, command: Command) -> None:
        if isinstance(command, View):
            if self.hand in (None, client.number):
                self._obey(command)
            return
        if self.hand is None and not isinstance(command, LetGo | EndJoint):
            self.hand = client.number
        if self.hand == client.number:
            self._obey(command)
        elif not isinstance(command, LetGo | EndJoint | Play):
            self.tell(client, "another browser holds the hand: take it first", warning=True)

    def _let_go(self) -> None:
        if self.hand is not None:
            self.hand = None
            self._obey(LetGo(False))
            self._obey(EndJoint())

    # --- what they are told --------------------------------------------------------------------------------------

    def show(self, frame: dict[str, Any], report: dict[str, Any] | None = None) -> None:
        """There is a new frame, and maybe a new report: all who wait for one get it.

        Args:
            frame: as `cinegen.cockpit.frames.frame` makes it, without its number and hand.
            report: as `cinegen.cockpit.frames.report` makes it.
        """
        number = self._frame[0] + 1
        self._frame = number, {**frame, "frame": number, "hand": self.hand}
        self._texts = {}
        if report is not None:
            self._report = self._report[0] + 1, report
        now = time.monotonic()
        for client in tuple(self.clients.values()):
            if client.waiting is None:
                self._feed(client)
            elif now - client.waiting[1] > PATIENCE:
                self.leave(client)
                client.line.close(1001, f"nothing was heard for {PATIENCE:g} s")

    def tell(self, client: Client, words: str, warning: bool = False) -> None:
        """One browser is told something."""
        client.line.send(json.dumps({"kind": "notice", "words": words, "level": "warning" if warning else "info"}))

    def tell_all(self, words: str, warning: bool = False) -> None:
        """All are."""
        for client in tuple(self.clients.values()):
            self.tell(client, words, warning)

    def _feed(self, client: Client) -> None:
        """The newest frame, unless it has that."""
        number, frame = self._frame
        if number <= client.sent or client.waiting is not None:
            return
        new = self._report[0] > client.reported
        if new not in self._texts:
            self._texts[new] = json.dumps({**frame, "report": self._report[1]} if new else frame, allow_nan=False)
        client.sent, client.reported = number, self._report[0]
        client.waiting = number, time.monotonic()
        client.line.send(self._texts[new])
