"""A program as a sensor: it connects by TCP, sends a token and then lines of JSON.

A web page can connect, too: browsers send data of any page to ports of this machine, as HTTP. So a port needs a token,
and a connection ends at HTTP, or at a first line that is not JSON.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import re
import socket
import time

import msgspec

from cinegen.devices.reading_json import LONGEST, ReadingError, decode_reading, decode_token
from cinegen.devices.threaded_sensor import DeviceLostError, ThreadedSensor
from cinegen.sensor import NO_TWIST
from cinegen.typed_json import encode

CLIENTS = 16
"""Largest number of clients; further ones are refused with a message, after their first line."""

SILENT = 200
"""Connections that have not sent their first line yet; a further one takes the place of the oldest."""

LINES = 2000
"""Largest number of lines per second from one client, averaged over half a second."""

MISTAKES = 20
"""Number of invalid lines in succession after which a client is disconnected."""

_PATIENCE = 10.0  # s until a client must have sent the token
_POLL = 0.1  # s
_HTTP = re.compile(rb"\s*(?:[!-~]+ [!-~]+ HTTP/\d|HTTP/\d|[A-Za-z][!-9;-~]*:)")
"""Begin of a request, of an answer, or of a header."""


class _RejectedError(Exception):
    """A client must be disconnected."""


class _Client:
    """A connected program."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self.writer = writer
        self.mistakes = 0  # invalid lines in succession
        self.admitted = self.has_sent = self.ignored = False
        self._credit, self._since = LINES / 2, time.monotonic()  # lines that it may send now

    def count_line(self) -> None:
        """Count a line.

        Raises:
            _RejectedError: there are too many per second.
        """
        now = time.monotonic()
        self._credit = min(LINES / 2, self._credit + LINES * (now - self._since)) - 1
        self._since = now
        if self._credit < 0:
            raise _RejectedError(f"more than {LINES} lines per second")

    def answer(self, error: str) -> None:
        """Send an error message, if the client is still there."""
        with contextlib.suppress(OSError):
            self.writer.write(encode({"error": error}) + b"\n")


class JsonSocket(ThreadedSensor):
    """Listen for programs; the readings of the one that connected last, of those that have sent one, are used.

    The first line of a client is `{"token": "..."}`, with the token of the port; otherwise the client is disconnected.
    Valid lines are not answered; invalid ones are answered by `{"error": "..."}`. A client that continues to send
    invalid lines, sends too many, or sends HTTP, is disconnected.

    Args:
        url: `tcp://address:port`; 127.0.0.1 is reached from this machine only. Port 0 takes any free port.
        token: token of the port; empty: clients need none, and the first line must be JSON.

    Attributes:
        port: port on which it listens; 0 until then.
        token: token of the port.
    """

    def __init__(self, url: str, address: str, port: int, token: str) -> None:
        super().__init__(url)
        self.token = token
        self._address = address, port
        self.port = 0

    def serve(self) -> None:
        """Listen until `ending`.

        Raises:
            DeviceLostError: the port is in use, or the address is not of this machine.
        """
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        host, port = self._address
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            listener = socket.create_server((host, self.port or port), family=family, backlog=128)
        except OSError as error:
            raise DeviceLostError(f"can't listen ({(error.strerror or str(error)).lower()})") from None
        self._clients: list[_Client] = []  # in the order of their connection
        self.port = int(listener.getsockname()[1])
        server = await asyncio.start_server(self._serve_client, sock=listener, limit=LONGEST)
        self._report_clients()
        try:
            while not self.ending:
                await asyncio.sleep(_POLL)
        finally:
            server.close()

    async def _serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client = _Client(writer)
        silent = [other for other in self._clients if not other.admitted]
        if len(silent) >= SILENT:
            silent[0].answer(f"{SILENT} later connections have not sent their first line: disconnected")
            silent[0].writer.close()
            self._clients.remove(silent[0])
        self._clients.append(client)
        self._report_clients()
        try:
            while (line := await self._line(reader, client)).endswith(b"\n"):
                client.count_line()
                if _HTTP.match(line):
                    raise _RejectedError("this port takes lines of JSON, not HTTP")
                if line.strip() or not client.admitted:  # whose time would begin again
                    self._take(client, line)
        except ValueError:
            self._reject(client, f"a line of more than {LONGEST} bytes")
        except _RejectedError as error:
            self._reject(client, str(error))
        except TimeoutError:
            self._reject(client, f"no token within {_PATIENCE:g} s")
        except (OSError, asyncio.CancelledError):  # the connection is broken, or the sensor is closed
            pass
        finally:
            was_source = client is self._source()
            if client in self._clients:
                self._clients.remove(client)
            writer.close()
            if was_source:  # its deflection and buttons end with it
                self.newest.put(NO_TWIST if self.newest.last.twist is not None else None, None, frozenset())
            self._report_clients()

    async def _line(self, reader: asyncio.StreamReader, client: _Client) -> bytes:
        """Return the next line.

        Raises:
            TimeoutError: the first line does not come.
        """
        patience = _PATIENCE if self.token and not client.admitted else None
        return await asyncio.wait_for(reader.readline(), patience)

    def _report_clients(self) -> None:
        count = len(self._clients)
        self.live(f"{count or 'no'} program{'s' * (count != 1)} on port {self.port} of {self._address[0]}")

    def _source(self) -> _Client | None:
        """Return the client whose readings are used."""
        return next((client for client in reversed(self._clients) if client.has_sent), None)

    def _reject(self, client: _Client, reason: str) -> None:
        self.damaged += 1
        client.answer(f"{reason}: disconnected")

    def _admit(self, client: _Client, line: bytes) -> bool:
        """Admit a client by its first line. Return whether that was a token.

        Raises:
            _RejectedError: it is neither the token, nor JSON where no token is needed; or there are too many clients.
        """
        token = decode_token(line)
        if self.token and not (token and hmac.compare_digest(token.encode(), self.token.encode())):
            raise _RejectedError(
                'the first line must be {"token": "..."}, with the token that was printed at the start'
            )
        if not self.token and not _is_json(line):
            raise _RejectedError("the first line is not JSON")
        if sum(other.admitted for other in self._clients) >= CLIENTS:
            raise _RejectedError(f"{CLIENTS} programs are connected already")
        client.admitted = True
        return token is not None

    def _take(self, client: _Client, line: bytes) -> None:
        if not client.admitted and self._admit(client, line):
            return
        try:
            reading = decode_reading(line)
        except ReadingError as error:
            self.damaged += 1
            client.mistakes += 1
            client.answer(str(error))
            if client.mistakes > MISTAKES:
                raise _RejectedError(f"{client.mistakes} invalid lines in succession") from None
            return
        client.mistakes, client.has_sent = 0, True
        if client is not self._source():
            if not client.ignored:
                client.answer("ignored while a program that connected later is in control")
            client.ignored = True
            return
        client.ignored = False
        if reading.twist is None and reading.target is None:  # only buttons: the motion goes on
            if reading.buttons is not None:
                self.newest.press(reading.buttons)
        else:
            self.newest.put(*reading)


def _is_json(line: bytes) -> bool:
    try:
        msgspec.json.decode(line)
    except (msgspec.MsgspecError, RecursionError, UnicodeError):
        return False
    return True
