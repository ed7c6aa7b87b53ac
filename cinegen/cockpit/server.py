"""Serves the page: tornado, on this machine only unless told otherwise.

Two sockets: `/scene` sends meshcat's commands, `/session` sends states and takes commands (`cinegen.cockpit.hub`).
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import hashlib
import hmac
import html
import ipaddress
import mimetypes
import secrets
import socket
import threading
from collections.abc import Callable
from importlib.resources import files
from typing import Any
from urllib.parse import urlsplit

import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket

from cinegen.cockpit.chart import Chart
from cinegen.cockpit.hub import Client, Hub
from cinegen.cockpit.page import Page, viewer
from cinegen.errors import CinegenError

LARGEST = 8192
"""Bytes of a message from a browser; a longer one ends its connection."""

_ALL = ("", "0.0.0.0", "::")  # addresses that stand for all of this machine
_PING = 10.0  # s between two questions whether a browser is still there
_REASON = 123  # bytes of the reason in a close frame (RFC 6455: 125 of a control frame, 2 for the code)
_NEARBY = "'self' http://localhost:* http://127.0.0.1:* https://localhost:* https://127.0.0.1:*"
_POLICY = (
    "default-src 'self'; script-src 'self' 'sha256-{}'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self' ws: wss: data: blob:; object-src 'none'; frame-ancestors {}"
)


class ServerError(CinegenError):
    """A page that can't be served."""


class Server:
    """Serves a page and its session, in a thread of its own.

    Args:
        page: what is drawn.
        hub: the browsers' session.
        snapshot: makes the page that needs no server.
        host: the address to listen on; others than this machine's own need a token.
        token: that browsers must know; made up where one is needed.
        framed: whether any other page may show this one in a frame, as notebooks do; else only those of this machine.
        chart: a map that is shown; None: none is.
    """

    def __init__(
        self,
        page: Page,
        hub: Hub,
        snapshot: Callable[[], str],
        host: str = "127.0.0.1",
        token: str | None = None,
        framed: bool = False,
        chart: Chart | None = None,
    ) -> None:
        self.page, self.hub, self.snapshot, self.host, self.framed = page, hub, snapshot, host, framed
        self.chart = chart
        self.token = token or (None if is_local(host) else secrets.token_urlsafe(16))
        self.port = 0
        self.scenes: set[_Scene] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        """Where the page is; for other machines, where those can reach it."""
        return self._url(socket.gethostname() if self.host in _ALL else self.host)

    @property
    def local_url(self) -> str:
        """Where the page is on this machine."""
        return self._url("127.0.0.1" if self.host in _ALL else self.host)

    def _url(self, host: str) -> str:
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.port}/" + (f"?token={self.token}" if self.token else "")

    def start(self, port: int = 7000, tries: int = 100) -> None:
        """Begins.

        Args:
            port: the first to try.
            tries: how many to try.

        Raises:
            ServerError: none of them is free, or there is no such address here.
        """
        reason: OSError | None = None
        for candidate in range(port, min(port + tries, 65536)):
            try:
                sockets = tornado.netutil.bind_sockets(candidate, self.host)
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
        """Calls a function in the server's thread, soon; whoever uses the hub does it so."""
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # it has ended
                self._loop.call_soon_threadsafe(function, *arguments)

    def stop(self) -> None:
        """Ends; browsers are told."""
        if self._loop is not None and self._thread is not None:
            self.call(self._end)
            self._thread.join(3.0)

    def _end(self) -> None:
        for client in tuple(self.hub.clients.values()):
            client.line.close(1001, "the session has ended")
        self._over.set()

    def _run(self, sockets: list[Any], ready: threading.Event) -> None:
        async def run() -> None:
            self._loop = asyncio.get_running_loop()
            self._over = asyncio.Event()
            self.page.wake = self._wake
            options = {"server": self}
            routes = [
                ("/", _Index, options),
                ("/viewer.js", _Viewer, options),
                ("/snapshot.html", _Snapshot, options),
                ("/static/(.*)", _Static, options),
                ("/map/about.json", _Map, options),
                ("/map/cells.bin", _MapCells, options),
                ("/map/cell/([0-9]{1,18})", _MapCell, options),
                ("/scene", _Scene, options),
                ("/session", _Session, options),
            ]
            application = tornado.web.Application(
                routes, websocket_ping_interval=_PING, websocket_max_message_size=LARGEST, log_function=_no_log
            )
            server = tornado.httpserver.HTTPServer(application, max_header_size=1 << 14, max_body_size=1 << 14)
            server.add_sockets(sockets)
            ready.set()
            await self._over.wait()
            server.stop()
            await asyncio.sleep(0.1)  # for the last words

        asyncio.run(run())

    def _wake(self) -> None:
        """Something was drawn."""
        for scene in tuple(self.scenes):
            self.call(scene.wake.set)


def is_local(host: str) -> bool:
    """Whether only this machine can reach an address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _hostname(host: str) -> str:
    """The name in a request's header Host; empty where that is malformed."""
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


def _no_log(handler: tornado.web.RequestHandler) -> None:
    """Requests are no news."""


class _Guarded(tornado.web.RequestHandler):
    """Answers only who asks for this machine by name (a foreign page can't rebind its own name to it), or who knows the
    token."""

    def initialize(self, server: Server) -> None:
        self.server = server

    def prepare(self) -> None:
        if self.server.token is None:
            if not is_local(_hostname(self.request.host)):
                raise tornado.web.HTTPError(403, reason="Served to this machine only")
        elif self.is_private and not self._knows():
            raise tornado.web.HTTPError(403, reason="The address needs the token that was printed at the start")

    is_private = True

    def _knows(self) -> bool:
        given = self.get_query_argument("token", "")
        return hmac.compare_digest(given.encode(), str(self.server.token).encode())

    def set_default_headers(self) -> None:
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cache-Control", "no-store")


class _Index(_Guarded):
    """The page."""

    def get(self) -> None:
        text = files("cinegen.cockpit").joinpath("static/index.html").read_text(encoding="utf-8")
        inline = text.partition('<script type="importmap">')[2].partition("</script>")[0]  # the only one
        digest = base64.b64encode(hashlib.sha256(inline.encode()).digest()).decode()
        self.set_header(
            "Content-Security-Policy", _POLICY.format(digest, "* vscode-webview:" if self.server.framed else _NEARBY)
        )
        self.write(text.replace("{{title}}", html.escape(self.server.page.title)))


class _Viewer(_Guarded):
    """meshcat's viewer."""

    is_private = False  # anybody may have it

    def get(self) -> None:
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        self.write(viewer())


class _Snapshot(_Guarded):
    """The page as one file, as everything is now."""

    async def get(self) -> None:
        text = await asyncio.get_running_loop().run_in_executor(None, self.server.snapshot)
        self.set_header("Content-Disposition", 'inline; filename="snapshot.html"')
        self.write(text)


class _Static(_Guarded):
    """The page's parts."""

    is_private = False  # anybody may have them

    def get(self, name: str) -> None:
        place = files("cinegen.cockpit").joinpath("static")
        for part in name.split("/"):
            if part in ("", ".", "..") or "\\" in part:
                raise tornado.web.HTTPError(404)
            place = place.joinpath(part)
        try:
            found = place.is_file()
        except OSError:  # a name that is too long for the file system
            found = False
        if not found:
            raise tornado.web.HTTPError(404)
        kind = mimetypes.guess_type(name)[0] or "text/plain"
        self.set_header("Content-Type", "text/javascript; charset=utf-8" if name.endswith(".js") else kind)
        self.write(place.read_bytes())


class _OfMap(_Guarded):
    """What there is to know of the map that is shown: read beside the server's own work."""

    async def found(self, ask: Callable[[Chart], Any]) -> Any:
        """What a chart says.

        Raises:
            HTTPError: no map is shown; or it says nothing of that.
        """
        chart = self.server.chart
        if chart is None:
            raise tornado.web.HTTPError(404)
        try:
            answer = await asyncio.get_running_loop().run_in_executor(None, ask, chart)
        except (CinegenError, OSError, ValueError) as error:  # it was taken away
            raise tornado.web.HTTPError(404, reason="The map can't be read any more") from error
        if answer is None:
            raise tornado.web.HTTPError(404)
        return answer


class _Map(_OfMap):
    """What is said of it."""

    async def get(self) -> None:
        self.write(await self.found(lambda chart: chart.told()))


class _MapCells(_OfMap):
    """Its cells."""

    async def get(self) -> None:
        self.set_header("Content-Type", "application/octet-stream")
        self.write(await self.found(lambda chart: chart.block()))


class _MapCell(_OfMap):
    """How a cell is reached."""

    async def get(self, number: str) -> None:
        self.write(await self.found(lambda chart: chart.cell(int(number))))


class _Socket(tornado.websocket.WebSocketHandler, _Guarded):  # tornado's own check_origin refuses foreign pages
    """A websocket."""

    def prepare(self) -> None:
        super().prepare()
        try:
            urlsplit(self.request.headers.get("Origin", ""))  # as tornado does, where it raises
        except ValueError:
            raise tornado.web.HTTPError(403, reason="The origin is malformed") from None

    def close(self, code: int | None = None, reason: str | None = None) -> None:
        """Close it; a reason that is too long for a close frame is cut."""
        if reason is not None:
            reason = reason.encode(errors="backslashreplace")[:_REASON].decode(errors="ignore")
        super().close(code, reason)


class _Scene(_Socket):
    """What is drawn, newest only: each browser as fast as it takes it."""

    def open(self, *_: str, **__: str) -> None:
        self.wake = asyncio.Event()
        self.wake.set()
        self.feed = self.server.page.feed()
        self.server.scenes.add(self)
        self.task = asyncio.ensure_future(self._send())

    async def _send(self) -> None:
        with contextlib.suppress(tornado.websocket.WebSocketClosedError):
            while True:
                await self.wake.wait()
                self.wake.clear()
                for message in self.feed.take():
                    await self.write_message(message, binary=True)

    def on_message(self, message: str | bytes) -> None:
        self.close(1008, "nothing is to be said here")

    def on_close(self) -> None:
        if hasattr(self, "task"):
            self.server.scenes.discard(self)
            self.server.page.forget(self.feed)
            self.task.cancel()


class _Session(_Socket):
    """States out, commands in."""

    client: Client | None = None

    def open(self, *_: str, **__: str) -> None:
        self.set_nodelay(True)
        self.client = self.server.hub.join(self)

    def send(self, text: str) -> None:
        """See `Line`."""
        with contextlib.suppress(tornado.websocket.WebSocketClosedError):
            self.write_message(text).add_done_callback(_sent)

    def on_message(self, message: str | bytes) -> None:
        if self.client is not None:
            self.server.hub.heard(self.client, message)

    def on_close(self) -> None:
        if self.client is not None:
            self.server.hub.leave(self.client)


def _sent(message: asyncio.Future[None]) -> None:
    """Retrieve how sending went, for asyncio logs what nobody retrieves: a browser that has gone is no error."""
    error = None if message.cancelled() else message.exception()
    if error is not None and not isinstance(error, tornado.websocket.WebSocketClosedError):
        raise error
