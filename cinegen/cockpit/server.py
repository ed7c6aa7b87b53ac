"""Serve the page by tornado; unless requested otherwise, to this machine only.

Two websockets, which send states and receive commands (see `hub.py`): `/session` for programs, and `/page` for pages,
which also get meshcat's commands there, so that what is drawn and where it is are of one moment.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import errno
import hashlib
import hmac
import ipaddress
import re
import secrets
import socket
import threading
import time
from collections.abc import AsyncIterator, Callable
from functools import cache, partial
from importlib.resources import files
from typing import Any
from urllib.parse import urlencode, urlsplit

import tornado.httpserver
import tornado.web
import tornado.websocket
from tornado.iostream import IOStream

from cinegen.cockpit.certificate import PageCertificate
from cinegen.cockpit.hub import FASTEST, Client, Hub, TokenBucket
from cinegen.cockpit.page import Page, PageFeed, viewer
from cinegen.cockpit.served_map import ServedMap
from cinegen.errors import CinegenError
from raff2urdf.escape import html_text

LARGEST = 8192
"""Bytes of a message from a browser; a longer one ends its connection."""

CONNECTIONS = 200
"""Connections for requests at a time. Beyond them, the one that has waited longest for a request is closed, or the new
one if all are being answered. Websockets are not among them."""

REQUESTS = 100
"""Requests per second of all browsers, beyond bursts of 200; further ones wait for their turn."""

ALL = ("", "0.0.0.0", "::")
"""Addresses that stand for all of this machine."""

_SLOW = 20.0  # s that a browser may take to send a further request, and that a connection may be idle
_FIRST = 5.0  # s that a browser may take to send its first request
_TURN = 0.02  # s from one costly request to the next
_FRESH = 1.0  # s in which a snapshot is not made again
_PING = 10.0  # s between two questions whether a browser is still there
_REASON = 123  # bytes of the reason in a close frame (RFC 6455: 125 of a control frame, 2 for the code)
_NEARBY = "'self' http://localhost:* http://127.0.0.1:* https://localhost:* https://127.0.0.1:*"
_POLICY = (
    "default-src 'self'; script-src 'self' 'sha256-{digest}'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self'{sockets}; object-src 'none'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors {framed}"
)
_SNAPSHOT_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; "
    "frame-ancestors 'none'; sandbox allow-scripts allow-downloads"
)


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
        self.pages: set[_Page] = set()
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
        self._thread = threading.Thread(target=self._run, args=(sockets, ready), name="cinegen page", daemon=True)
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
            routes: list[Any] = [
                ("/", _Index),
                ("/viewer.js", _Viewer),
                ("/snapshot.html", _Snapshot),
                (r"/static/([\w./-]+\.\w+)", _Static, {"path": str(files("cinegen.cockpit").joinpath("static"))}),
                ("/map/(about.json|cells.bin|cell/[0-9]{1,18})", _Map),
                ("/session", _Session),
                ("/page", _Page),
            ]
            application = tornado.web.Application(
                routes, server=self, websocket_ping_interval=_PING, websocket_max_message_size=LARGEST,
                log_function=_no_log, default_handler_class=_Unknown,
            )  # fmt: skip
            server = self.http = _HttpServer(
                application, max_header_size=1 << 14, max_body_size=1 << 14, idle_connection_timeout=_SLOW,
                body_timeout=_SLOW, ssl_options=self.certificate and self.certificate.context,
            )  # fmt: skip
            server.add_sockets(sockets)
            ready.set()
            await self._over.wait()
            server.stop()
            await asyncio.sleep(0.1)  # to send the last messages

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
    found = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    with contextlib.ExitStack() as opened:
        sockets: list[socket.socket] = []
        for family, address in dict.fromkeys((one[0], one[4][:2]) for one in found):
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


def is_local(host: str) -> bool:
    """Return whether only this machine can reach an address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _hostname(host: str) -> str:
    """Return the name in a request's Host header; empty if that is malformed."""
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


def _no_log(handler: tornado.web.RequestHandler) -> None:
    """Disable request logging."""


_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Content-Security-Policy": "default-src 'none'; frame-ancestors 'none'",
}


_ERROR = """<!DOCTYPE html>
<html lang="en"><meta name="viewport" content="width=device-width"><meta name="color-scheme" content="light dark">
<title>{reason}</title><style>body {{ font: 16px system-ui; display: grid; place-content: center; min-height: 90vh;
padding: 16px; text-align: center }}</style><p>{reason}.</p></html>
"""


class _Guarded(tornado.web.RequestHandler):
    """Base of the handlers. It accepts requests to a name of this machine, so that a foreign page can't rebind its own
    name to it, or requests with the token."""

    @property
    def server(self) -> Server:
        """The server of the page."""
        server: Server = self.settings["server"]
        return server

    async def prepare(self) -> None:
        """Refuse other requests, and let those beyond the budget wait."""
        self._stream = getattr(self.request.connection, "stream", None)
        if self._stream is not None:
            self.server.http.begin(self._stream)
        if self.server.requests.take(REQUESTS) < 0.0:
            async with self.server.queue:
                if not self._has_gone():
                    await asyncio.sleep(1.0 / REQUESTS)
        if self.server.token is None:
            if not is_local(_hostname(self.request.host)):
                raise tornado.web.HTTPError(403, reason="Served to this machine only")
        elif self.is_private and not (self.may_drive or self._has("view", self.server.view_token)):
            raise tornado.web.HTTPError(
                403, reason="This address lacks the session's token: open the one that cinegen drive printed"
            )

    is_private = True  # whether a token is needed, if there is one

    @property
    def may_drive(self) -> bool:
        """True if the request may do more than view."""
        return self.server.token is None or self._has("token", self.server.token)

    def _has(self, key: str, token: str | None) -> bool:
        given = self.get_query_argument(key, "")
        return hmac.compare_digest(given.encode(), str(token).encode())

    def log_exception(self, kind: Any, error: Any, trace: Any) -> None:
        """Log errors of this program; those of a request are sent to the browser."""
        if not isinstance(error, tornado.web.HTTPError):
            super().log_exception(kind, error, trace)

    def write_error(self, status_code: int, **_: Any) -> None:
        """Write what is wrong into the middle of a page without scripts."""
        self.set_header(
            "Content-Security-Policy", "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'"
        )
        self.finish(_ERROR.format(reason=html_text(self._reason)))

    def set_default_headers(self) -> None:
        for name, value in _HEADERS.items():
            self.set_header(name, value)
        self.clear_header("Server")

    @contextlib.asynccontextmanager
    async def turn(self) -> AsyncIterator[None]:
        """Wait until all costly requests that came before are answered.

        Raises:
            HTTPError: the browser has gone meanwhile.
        """
        async with self.server.turns:
            if self._has_gone():
                raise tornado.web.HTTPError(408)
            yield
            await asyncio.sleep(_TURN)

    def on_finish(self) -> None:
        """Let the connection wait for the next request."""
        if self._stream is not None:
            self.server.http.end(self._stream)

    def _has_gone(self) -> bool:
        return self._stream is not None and self._stream.closed()


class _Unknown(_Guarded):
    """Addresses at which there is nothing."""

    is_private = False

    async def prepare(self) -> None:
        await super().prepare()
        raise tornado.web.HTTPError(404)


class _Index(_Guarded):
    """The page."""

    def get(self) -> None:
        text = _index()
        inline = text.partition('<script type="importmap">')[2].partition("</script>")[0]  # the only one
        digest = base64.b64encode(hashlib.sha256(inline.encode()).digest()).decode()
        host = self.request.host  # 'self' does not stand for websockets in all browsers
        sockets = f" ws://{host} wss://{host}" if re.fullmatch(r"[\w.:\[\]-]+", host, re.ASCII) else ""
        framed = "* vscode-webview:" if self.server.framed else _NEARBY
        policy = _POLICY.format(digest=digest, sockets=sockets, framed=framed)
        self.set_header("Content-Security-Policy", policy)
        self.write(text.replace("{{title}}", html_text(self.server.page.title)))


@cache
def _index() -> str:
    return files("cinegen.cockpit").joinpath("static/index.html").read_text(encoding="utf-8")


class _Viewer(_Guarded):
    """meshcat's viewer."""

    is_private = False

    async def get(self) -> None:
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        async with self.turn():
            self.write(viewer())


class _Snapshot(_Guarded):
    """The present scene as one file."""

    async def get(self) -> None:
        self.set_header("Content-Disposition", 'inline; filename="snapshot.html"')
        self.set_header("Content-Security-Policy", _SNAPSHOT_POLICY)
        async with self.turn():
            self.write(await self.server.fresh_snapshot())


class _Static(_Guarded, tornado.web.StaticFileHandler):
    """The page's parts."""

    is_private = False

    def get_content_type(self) -> str:
        """Return the type of scripts independent of the system's registry."""
        return "text/javascript; charset=utf-8" if self.path.endswith(".js") else super().get_content_type()


class _Map(_Guarded):
    """A part of the map, read in another thread."""

    async def get(self, name: str) -> None:
        served = self.server.map
        if served is None:
            raise tornado.web.HTTPError(404)
        read = {"about.json": served.about, "cells.bin": served.block}.get(name)
        loop = asyncio.get_running_loop()
        try:
            async with self.turn():
                answer = await loop.run_in_executor(None, read or partial(served.cell, int(name.removeprefix("cell/"))))
        except (CinegenError, OSError, ValueError) as error:  # it was removed
            raise tornado.web.HTTPError(404, reason="The map can't be read any more") from error
        if answer is None:
            raise tornado.web.HTTPError(404)
        binary = name.endswith(".bin")
        self.set_header("Content-Type", "application/octet-stream" if binary else "application/json; charset=UTF-8")
        self.write(answer)


class _Socket(tornado.websocket.WebSocketHandler, _Guarded):  # tornado's own check_origin refuses foreign pages
    """A websocket."""

    def initialize(self) -> None:
        self._pings = TokenBucket(FASTEST)

    async def prepare(self) -> None:
        await super().prepare()
        try:
            urlsplit(self.request.headers.get("Origin", ""))  # as tornado does, where it raises
        except ValueError:
            raise tornado.web.HTTPError(403, reason="The origin is malformed") from None

    def close(self, code: int | None = None, reason: str | None = None) -> None:
        """Close it; a reason that is too long for a close frame is cut."""
        if reason is not None:
            reason = reason.encode(errors="backslashreplace")[:_REASON].decode(errors="ignore")
        super().close(code, reason)

    def on_ping(self, data: bytes) -> None:
        if self._pings.take(FASTEST) < 0.0:
            self.close(1008, f"more than {FASTEST} pings per second")


class _Session(_Socket):
    """Messages to and from a client."""

    client: Client | None = None
    _sending: asyncio.Future[None] | None = None  # the last message

    def open(self, *_: str, **__: str) -> None:
        self.set_nodelay(True)
        self.client = self.server.hub.join(self, self.may_drive)

    def send(self, message: str | bytes) -> None:
        """See `Connection`."""
        with contextlib.suppress(tornado.websocket.WebSocketClosedError):
            self._sending = self.write_message(message, isinstance(message, bytes))
            self._sending.add_done_callback(_sent)

    async def on_message(self, message: str | bytes) -> None:
        """Pass on a message. The next is read when the client has taken what was sent to it, and it is its turn."""
        if self.client is None:
            return
        self.server.hub.receive(self.client, message)
        if self._sending is not None and not self._sending.done():
            await asyncio.wait((self._sending,))
        pause = self.server.hub.pause(self.client)
        if pause > 0.0:
            await asyncio.sleep(pause)
        while self.server.hub.queue_is_full():
            await asyncio.sleep(_TURN)

    def on_close(self) -> None:
        if self.client is not None:
            self.server.hub.leave(self.client)


class _Page(_Session):
    """A page: a client whose states come after everything that was drawn before."""

    feed: PageFeed | None = None

    def open(self, *_: str, **__: str) -> None:
        self.set_nodelay(True)
        self.wake = asyncio.Event()
        self._drawing = asyncio.ensure_future(self._draw())

    async def _draw(self) -> None:
        async with self.server.turns:  # the whole scene
            await asyncio.sleep(_TURN)
        self.feed = self.server.page.feed()
        self.server.pages.add(self)
        self.client = self.server.hub.join(self, self.may_drive, is_page=True)
        while self.client is not None:
            self._pass_on(self.feed)
            await self.wake.wait()
            self.wake.clear()
            if self._sending is not None and not self._sending.done():
                await asyncio.wait((self._sending,))

    def send(self, message: str | bytes) -> None:
        """See `Connection`."""
        if isinstance(message, bytes) and self.feed is not None:
            self._pass_on(self.feed)
        super().send(message)

    def _pass_on(self, feed: PageFeed) -> None:
        """Send the drawing commands that were not sent yet."""
        for command in feed.take():
            super().send(command)

    def on_close(self) -> None:
        super().on_close()
        self._drawing.cancel()
        if self.feed is not None:
            self.server.pages.discard(self)
            self.server.page.forget(self.feed)
            self.feed = None


def _sent(message: asyncio.Future[None]) -> None:
    """Retrieve the result of sending, which asyncio logs otherwise. A browser that has gone is not an error."""
    error = None if message.cancelled() else message.exception()
    if error is not None and not isinstance(error, tornado.websocket.WebSocketClosedError):
        raise error
