"""Answers to the page's requests: files, the sockets of viewer and session, maps and snapshots."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import hashlib
import hmac
import ipaddress
import re
from collections.abc import AsyncIterator
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import tornado.web
import tornado.websocket
from tornado.iostream import IOStream

from cinegen.cockpit.clients import FASTEST, Client, TokenBucket
from cinegen.cockpit.page import PageFeed, viewer
from cinegen.errors import CinegenError
from raff2urdf.escape import html_text

if TYPE_CHECKING:
    from cinegen.cockpit.server import Server

LARGEST = 8192
"""Bytes of a message from a browser; a longer one ends its connection."""

REQUESTS = 100
"""Requests per second of all browsers, beyond bursts of 200; further ones wait for their turn."""

_TURN = 0.02  # s from one costly request to the next
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


def application(server: Server) -> tornado.web.Application:
    """Return what answers the requests to a server."""
    routes: list[Any] = [
        ("/", _Index),
        ("/viewer.js", _Viewer),
        ("/snapshot.html", _Snapshot),
        (r"/static/([\w./-]+\.\w+)", _Static, {"path": str(files("cinegen.cockpit").joinpath("static"))}),
        ("/map/(about.json|cells.bin|cell/[0-9]{1,18})", _Map),
        ("/session", _SessionSocket),
        ("/page", PageSocket),
    ]
    return tornado.web.Application(
        routes, server=server, websocket_ping_interval=_PING, websocket_max_message_size=LARGEST,
        log_function=_no_log, default_handler_class=_Unknown,
    )  # fmt: skip


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
    _stream: IOStream | None = None  # of a method that HTTP does not have: `prepare` is not called

    @property
    def may_drive(self) -> bool:
        """True if the request may do more than view."""
        return self.server.token is None or self._has("token", self.server.token)

    def _has(self, key: str, token: str | None) -> bool:
        text = self.get_query_argument(key, "")
        return hmac.compare_digest(text.encode(), str(token).encode())

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
    """Return the page; it asks for all its modules at once, not for each when it has read the one that needs it."""
    folder = Path(str(files("cinegen.cockpit").joinpath("static")))
    modules = sorted(path.relative_to(folder.parent).as_posix() for path in folder.rglob("*.js"))
    links = "\n".join(f'<link rel="modulepreload" href="{module}">' for module in modules)
    return (folder / "index.html").read_text(encoding="utf-8").replace("</head>", f"{links}\n</head>")


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


class _SessionSocket(_Socket):
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


class PageSocket(_SessionSocket):
    """A page: a client whose states come after everything that was drawn before."""

    feed: PageFeed | None = None

    def open(self, *_: str, **__: str) -> None:
        """Begin to draw."""
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
        """End to draw."""
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
