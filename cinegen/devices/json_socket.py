"""Anybody's program as a sensor: it connects by TCP and sends lines of JSON."""

from __future__ import annotations

import contextlib
import selectors
import socket
import time
from dataclasses import dataclass, field

from cinegen.devices.reading_json import LONGEST, ReadingError, decode_reading
from cinegen.devices.threaded_sensor import DeviceLostError, ThreadedSensor
from cinegen.sensor import NO_TWIST
from cinegen.typed_json import encode

CLIENTS = 16
"""At once; one more is told so."""

LINES = 2000
"""A second, from one client, on the average of half a second."""

MISTAKES = 20
"""Lines that make no sense, in succession, after which a client is dropped."""

_POLL = 0.1  # s
_CHUNK = 1 << 14  # bytes that are taken from one client before the next has its turn


@dataclass(eq=False)
class _Client:
    line: bytes = b""
    mistakes: int = 0
    credit: float = LINES / 2  # lines that it may send now
    since: float = field(default_factory=time.monotonic)
    spoken: bool = False
    ignored: bool = False


class JsonSocket(ThreadedSensor):
    """Listens for programs. The one that connected last, of those that have said something, speaks.

    A line that makes sense is not answered; one that doesn't is, by `{"error": "..."}`. Whoever goes on with that, or
    sends lines faster than anything needs, is dropped.

    Args:
        url: `tcp://address:port`; only programs on this machine reach 127.0.0.1. Port 0 takes any that is free.

    Attributes:
        port: that it listens on; 0 while it doesn't.
    """

    def __init__(self, url: str, address: str, port: int) -> None:
        super().__init__(url)
        self._address = address, port
        self.port = 0

    def serve(self) -> None:
        """Listens, until `ending`.

        Raises:
            OSError: somebody else has the port, or the address is not this machine's.
        """
        host, port = self._address
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._clients: dict[socket.socket, _Client] = {}  # in the order of their coming
        try:
            listener = socket.create_server((host, self.port or port), family=family, backlog=128)
        except OSError as error:
            raise DeviceLostError(f"can't listen ({(error.strerror or str(error)).lower()})") from None
        with listener, selectors.DefaultSelector() as selector:
            listener.setblocking(False)
            self.port = int(listener.getsockname()[1])
            selector.register(listener, selectors.EVENT_READ)
            self._introduce()
            try:
                while not self.ending:
                    for key, _ in selector.select(_POLL):
                        if key.fileobj is listener:
                            self._accept(listener, selector)
                        else:
                            self._hear(key.fileobj, selector)  # type: ignore[arg-type]
            finally:
                for client in self._clients:
                    client.close()

    def _introduce(self) -> None:
        count = len(self._clients)
        self.live(f"{count or 'no'} program{'s' * (count != 1)} on port {self.port} of {self._address[0]}")

    def _accept(self, listener: socket.socket, selector: selectors.BaseSelector) -> None:
        try:
            client, _ = listener.accept()
        except OSError:  # it is gone already, or this process has too many files open
            return
        client.setblocking(False)
        if len(self._clients) >= CLIENTS:
            _answer(client, f"{CLIENTS} programs are here already")
            client.close()
            return
        self._clients[client] = _Client()
        selector.register(client, selectors.EVENT_READ)
        self._introduce()

    def _hear(self, client: socket.socket, selector: selectors.BaseSelector) -> None:
        try:
            data = client.recv(_CHUNK)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._drop(client, selector)
            return
        state = self._clients[client]
        *lines, rest = (state.line + data).split(b"\n")
        state.line = rest
        now = time.monotonic()
        state.credit = min(LINES / 2, state.credit + LINES * (now - state.since)) - len(lines)
        state.since = now
        if state.credit < 0:
            self._drop(client, selector, f"more than {LINES} lines a second")
            return
        if len(rest) > LONGEST:
            self._drop(client, selector, f"a line of more than {LONGEST} bytes")
            return
        for line in lines:
            if line.strip():
                self._take(client, line)
            if state.mistakes > MISTAKES:
                self._drop(client, selector, f"{state.mistakes} lines in succession that make no sense")
                return

    def _take(self, client: socket.socket, line: bytes) -> None:
        state = self._clients[client]
        try:
            reading = decode_reading(line)
        except ReadingError as error:
            self.damaged += 1
            state.mistakes += 1
            _answer(client, str(error))
            return
        state.mistakes, state.spoken = 0, True
        if client is not self._speaker():
            if not state.ignored:
                _answer(client, "a program that came later speaks; this one will be heard again when that is gone")
            state.ignored = True
            return
        state.ignored = False
        if reading.twist is None and reading.target is None:  # only buttons: the motion goes on
            if reading.buttons is not None:
                self.newest.press(reading.buttons)
        else:
            self.newest.put(*reading)

    def _speaker(self) -> socket.socket | None:
        return next((client for client in reversed(self._clients) if self._clients[client].spoken), None)

    def _drop(self, client: socket.socket, selector: selectors.BaseSelector, why: str = "") -> None:
        if why:
            self.damaged += 1
            _answer(client, f"{why}: dropped")
        spoke = client is self._speaker()
        selector.unregister(client)
        del self._clients[client]
        client.close()
        if spoke:  # what it held, nobody holds now
            self.newest.put(NO_TWIST if self.newest.last.twist is not None else None, None, frozenset())
        self._introduce()


def _answer(client: socket.socket, error: str) -> None:
    """Says what is wrong; whoever does not listen, misses it."""
    with contextlib.suppress(OSError):
        client.send(encode({"error": error}) + b"\n")
