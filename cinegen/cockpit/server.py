"""Serve the page by tornado; unless requested otherwise, to this machine only.

Two websockets, which send states and receive commands (see `hub.py`): `/session` for programs, and `/page` for pages,
which also get meshcat's commands there, so that what is drawn and where it is are of one moment.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import secrets
import socket
import threading
import time
from collections.abc import Callable
from typing import Any
from urllib.parse import urlencode

import tornado.httpserver
from tornado.iostream import IOStream

from cinegen.cockpit.certificate import PageCertificate
from cinegen.cockpit.clients import TokenBucket
from cinegen.cockpit.handlers import REQUESTS, PageSocket, application, is_local
from cinegen.cockpit.hub import Hub
from cinegen.cockpit.page import Page
from cinegen.cockpit.served_map import ServedMap
from cinegen.errors import CinegenError

CONNECTIONS = 200
"""Connections for requests at a time. Beyond them, the one that has waited longest for a request is closed, or the new
one if all are being answered. Websockets are not among them."""


ALL = ("", "0.0.0.0", "::")
"""Addresses that stand for all of this machine."""

_SLOW = 20.0  # s that a browser may take to send a further request, and that a connection may be idle
_FIRST = 5.0  # s that a browser may take to send its first request
_FRESH = 1.0  # s in which a snapshot is not made again
_THREAD = "cinegen page"


def _is_logged(record: logging.LogRecord) -> bool:
    """Return whether what tornado logs is no fault of a peer, such as a browser that refuses the certificate."""
    return record.threadName != _THREAD or record.levelno >= logging.ERROR


logging.getLogger("tornado.general").addFilter(_is_logged)


class ServerError(CinegenError):
    """A page can't be served."""


class Server:
    """Serves a page and its session, in a thread of its own.

    Args:
        page: scene that is drawn.
        hub: clients of the session.
        snapshot: returns the present scene as one HTML file.
        host: address to listen on.
        token: token that browsers need; generated unless given. Empty: none, then every user of this machine can drive.
            Unless it is empty, there is another one, always generated, with which browsers only view.
        framed: let any other page show this one in a frame, as notebooks do; otherwise only pages of this machine.
        served_map: map that is drawn; None: none.
        certificate: with which the connection is encrypted; None: it is not.

    Raises:
        ServerError: no token, and an address that other machines reach.
    """

    def __init__(
        self,
        page: Page,
        hub: Hub,
        snapshot: Callable[[], str],
        host: str = "127.0.0.1",
        token: str | None = None,
        framed: bool = False,
        served_map: ServedMap | None = None,
        certificate: PageCertificate | None = None,
    ) -> None:
        self.page, self.hub, self.snapshot, self.host, self.framed = page, hub, snapshot, host, framed
        self.map, self.certificate = served_map, certificate
        self.token = secrets.token_urlsafe(16) if token is None else token or None
        self.view_token = secrets.token_urlsafe(16) if self.token else None
        if self.token is None and not is_local(host):
            raise ServerError(
                f"other machines reach {host}: a page there needs a token; leave out --no-token (in Python token='')"
            )
        self.port = 0
        self.pages: set[PageSocket] = set()
        self._snapshot: tuple[float, str] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        """Address of the page; for other machines if they can reach it."""
        return self._url(socket.gethostname() if self.host in ALL else self.host)

    @property
    def view_url(self) -> str | None:
        """Address at which the page only shows the session; None without a token, where all may drive."""
        return self.url.replace(self._query("token"), self._query("view")) if self.token else None

    @property
    def local_url(self) -> str:
        """Address of the page on this machine."""
        return self._url("127.0.0.1" if self.host in ALL else self.host)

    @property
    def session_url(self) -> str:
        """Address of the websocket of the session, on this machine."""
        return self._url("127.0.0.1" if self.host in ALL else self.host, "ws", "session")

    def _url(self, host: str, scheme: str = "http", path: str = "") -> str:
        host = f"[{host}]" if ":" in host else host
        secure = "s" if self.certificate is not None else ""
        return f"{scheme}{secure}://{host}:{self.port}/{path}{self._query('token') if self.token else ''}"

    def _query(self, key: str) -> str:
        return f"?{urlencode({key: self.token if key == 'token' else self.view_token})}"

    def start(self, port: int = 7000, tries: int = 100) -> None:
        """Start to serve.

        Args:
            port: first port to try.
            tries: number of ports to try.

        Raises:
            ServerError: none of them is free, or this machine has no such address.
        """
        reason: OSError | None = None
        for candidate in range(port, min(port + tries, 65536)):
            try:
                sockets = _listening_sockets(candidate, self.host)
                break
            except OSError as error:
                reason = error
        else:
            why = f": {reason.strerror or reason}" if reason is not None else ""
            raise ServerError(f"no free port from {port} to {port + tries - 1} at {self.host}{why}")
        self.port = sockets[0].getsockname()[1]
        ready = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(sockets, ready), name=_THREAD, daemon=True)
        self._thread.start()
        ready.wait()

    def call(self, function: Callable[..., object], *arguments: object) -> None:
        """Call a function in the thread of the server; the hub is only used there."""
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # it has ended
                self._loop.call_soon_threadsafe(function, *arguments)

    def stop(self) -> None:
        """Stop, and close all connections."""
        if self._loop is not None and self._thread is not None:
            self.call(self._end)
            self._thread.join(3.0)

    def _end(self) -> None:
        for client in tuple(self.hub.clients.values()):
            client.connection.close(1001, "the session has ended")
        self._over.set()

    def _run(self, sockets: list[Any], ready: threading.Event) -> None:
        async def run() -> None:
            self._loop = asyncio.get_running_loop()
            self._over, self.turns, self.queue = asyncio.Event(), asyncio.Lock(), asyncio.Lock()
            self.requests = TokenBucket(2 * REQUESTS)
            self.page.wake = self._wake
            server = self.http = _HttpServer(
                application(self), max_header_size=1 << 14, max_body_size=1 << 14, idle_connection_timeout=_SLOW,
                body_timeout=_SLOW, ssl_options=self.certificate and self.certificate.context,
            )  # fmt: skip
            server.add_sockets(sockets)
            ready.set()
            await self._over.wait()
            server.stop()
            await asyncio.sleep(0.1)  # to send the last messages
            server.close_connections()

        asyncio.run(run())

    async def fresh_snapshot(self) -> str:
        """Return the scene as one file, as it was in the last second; called by one request at a time."""
        if self._snapshot is None or time.monotonic() - self._snapshot[0] > _FRESH:
            text = await asyncio.get_running_loop().run_in_executor(None, self.snapshot)
            self._snapshot = time.monotonic(), text
        return self._snapshot[1]

    def _wake(self) -> None:
        """Wake all connections that draw."""
        for page in tuple(self.pages):
            self.call(page.wake.set)


class _HttpServer(tornado.httpserver.HTTPServer):
    """Closes connections beyond `CONNECTIONS`, and those that send no request: who opens many keeps no one else out."""

    def initialize(self, *arguments: Any, **named: Any) -> None:
        super().initialize(*arguments, **named)
        self._answered = set[IOStream]()
        self._waiting = dict[IOStream, asyncio.TimerHandle | None]()  # for a request, the longest first

    def handle_stream(self, stream: IOStream, address: tuple[Any, ...]) -> None:
        if len(self._waiting) + len(self._answered) >= CONNECTIONS:
            oldest = next(iter(self._waiting), stream)
            self._forget(oldest)
            oldest.close()
            if oldest is stream:
                return
        self._waiting[stream] = asyncio.get_running_loop().call_later(_FIRST, stream.close)
        super().handle_stream(stream, address)

    def begin(self, stream: IOStream) -> None:
        """Note that a request came."""
        if stream in self._waiting:
            self._forget(stream)
            self._answered.add(stream)

    def end(self, stream: IOStream) -> None:
        """Note that the request is answered."""
        if stream in self._answered:
            self._forget(stream)
            self._waiting[stream] = None

    def close_connections(self) -> None:
        """Close all connections: a page that asked for something in the last moment waits for no answer."""
        for stream in (*self._waiting, *self._answered):
            stream.close()

    def _forget(self, stream: IOStream) -> None:
        self._answered.discard(stream)
        if (deadline := self._waiting.pop(stream, None)) is not None:
            deadline.cancel()

    def on_close(self, server_conn: Any) -> None:
        self._forget(server_conn.stream)
        super().on_close(server_conn)


def _listening_sockets(port: int, host: str) -> list[socket.socket]:
    """Return sockets that listen at all addresses of a host. (tornado's function leaves one open if a port is in use.)

    Raises:
        OSError: the port is in use, or the host has no address on this machine.
    """
    entries = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    with contextlib.ExitStack() as opened:
        sockets: list[socket.socket] = []
        for family, address in dict.fromkeys((entry[0], entry[4][:2]) for entry in entries):
            try:
                listening = socket.create_server(address, family=family, backlog=128)
            except OSError as error:
                if error.errno == errno.EADDRNOTAVAIL and sockets:  # "localhost" without IPv6
                    continue
                raise
            listening.setblocking(False)
            sockets.append(opened.enter_context(listening))
        opened.pop_all()
        return sockets
