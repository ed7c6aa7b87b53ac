"""The page: meshcat's own viewer, served to this machine only, or written as one file.

A `Page` stands where meshcat's ViewerWindow stands: `meshcat.Visualizer(window=page)` draws into it. It keeps the
newest of everything drawn, so that a browser that comes late sees the whole scene. meshcat's stock server is not
used: it listens on all interfaces and queues up behind a slow browser; here each browser gets the newest state, as
fast as it takes it. A browser may take a part of a robot and lead it: see `cinegen.show.hand`.
"""

from __future__ import annotations

import asyncio
import base64
import threading
import time
from collections.abc import Collection, Mapping
from importlib.resources import files
from typing import Any

import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket
import umsgpack

from cinegen.errors import CinegenError
from cinegen.show.hand import Hand, HandError, after

_KEPT = ("set_object", "set_transform", "delete")  # what replaces its like; properties are kept by name

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{title}</title>
<style>
body {{ margin: 0; }}
#pane {{ width: 100vw; height: 100vh; overflow: hidden; }}
#hand {{ position: fixed; left: 0; right: 0; bottom: 12px; text-align: center; pointer-events: none;
         font: 15px system-ui, sans-serif; color: #333; }}
</style></head>
<body><div id="pane"></div><div id="hand" role="status"></div>
<script{source}>{viewer}</script>
<script>
var viewer = new MeshCat.Viewer(document.getElementById("pane"));
{commands}
</script>
<script id="embedded-json"></script>
</body></html>
"""

_DRAW = """
for (const text of {blobs}) {{
  viewer.handle_command_bytearray(Uint8Array.from(atob(text), c => c.charCodeAt(0)));
}}
"""


_CONNECT = """
viewer.connect("ws://" + location.host + "/scene");
var script = document.createElement("script");
script.onload = () => {
  viewer.hand = new CinegenHand(viewer, (said) => viewer.connection.send(JSON.stringify(said)));
};
script.src = "hand.js";
document.body.appendChild(script);
"""


class PageError(CinegenError):
    """A page that can't be served."""


class Page:
    """A scene, and the browsers that look at it.

    Attributes:
        nodes: of each robot, by its name in the page: what hands may take.
    """

    def __init__(self, title: str = "cinegen") -> None:
        self.title = title
        self._kept: dict[tuple[str, str, str], bytes] = {}  # path, kind, property -> newest message
        self._lock = threading.Lock()
        self._browsers: set[_Browser] = set()
        self.nodes: Mapping[str, Collection[str]] = {}
        self._loop: asyncio.AbstractEventLoop | None = None

    def send(self, command: Any) -> None:
        """Takes one meshcat command; called by meshcat's Visualizer."""
        values = command.lower()
        kind, path = values["type"], values["path"]
        key = (path, kind, values.get("property", ""))
        message = umsgpack.packb(values)
        with self._lock:
            if kind in ("set_object", "delete"):  # what was drawn below is gone
                below = [k for k in self._kept if k[0] == path or (kind == "delete" and k[0].startswith(path + "/"))]
                for old in below:
                    del self._kept[old]
            if kind != "delete":
                self._kept[key] = message
            for browser in self._browsers:
                browser.waiting[key] = message
        if self._loop is not None and self._browsers:
            self._loop.call_soon_threadsafe(self._wake)

    def html(self) -> str:
        """The scene as it stands, as a page that needs no server."""
        blobs = ",\n".join(f'"{base64.b64encode(message).decode()}"' for message in self._scene().values())
        commands = _DRAW.format(blobs=f"[{blobs}]")
        return _PAGE.format(title=self.title, source="", viewer=_viewer(), commands=commands)

    def serve(self, port: int = 7000, tries: int = 100) -> str:
        """Serves the page to this machine, in a thread of its own; returns its URL.

        Args:
            port: the first port to try.
            tries: how many ports to try.

        Raises:
            PageError: none of them is free.
        """
        for candidate in range(port, port + tries):
            try:
                sockets = tornado.netutil.bind_sockets(candidate, "127.0.0.1")
                break
            except OSError as error:
                reason = error
        else:
            raise PageError(f"no free port from {port} to {port + tries - 1}: {reason}")
        ready = threading.Event()
        threading.Thread(target=self._run, args=(sockets, ready), name="cinegen page", daemon=True).start()
        ready.wait()
        return f"http://127.0.0.1:{candidate}/"

    @property
    def hands(self) -> dict[str, Hand]:
        """What is held now, by robot; of two hands that hold the same robot, the one that took it first."""
        with self._lock:
            held = [browser.hand for browser in sorted(self._browsers, key=lambda browser: browser.since)]
        return {hand.robot: hand for hand in reversed(held) if hand is not None}

    @property
    def browsers(self) -> int:
        """How many browsers look at the page now."""
        return len(self._browsers)

    def _run(self, sockets: list[Any], ready: threading.Event) -> None:
        async def run() -> None:
            self._loop = asyncio.get_running_loop()
            hosts = {f"{name}:{sockets[0].getsockname()[1]}" for name in ("127.0.0.1", "localhost")}
            options = {"page": self, "hosts": hosts}
            routes = [
                ("/", _Index, options),
                ("/viewer.js", _Viewer, options),
                ("/hand.js", _HandScript, options),
                ("/scene", _Browser, options),
            ]
            tornado.httpserver.HTTPServer(tornado.web.Application(routes)).add_sockets(sockets)
            ready.set()
            await asyncio.Event().wait()

        asyncio.run(run())

    def _scene(self) -> dict[tuple[str, str, str], bytes]:
        """Everything that is drawn, objects before what is said of them."""
        with self._lock:
            return dict(sorted(self._kept.items(), key=lambda item: item[0][1] != "set_object"))

    def _wake(self) -> None:
        for browser in list(self._browsers):
            browser.wake.set()


class _Local(tornado.web.RequestHandler):
    """Answers only who asks for this machine by name: a foreign page can't rebind its own name to it."""

    def initialize(self, page: Page, hosts: set[str]) -> None:
        self.page, self.hosts = page, hosts

    def prepare(self) -> None:
        if self.request.host not in self.hosts:
            raise tornado.web.HTTPError(403)


class _Index(_Local):
    def get(self) -> None:
        self.write(_PAGE.format(title=self.page.title, source=' src="viewer.js"', viewer="", commands=_CONNECT))


class _Viewer(_Local):
    def get(self) -> None:
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        self.write(_viewer())


class _HandScript(_Local):
    def get(self) -> None:
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        self.write(files("cinegen.show").joinpath("static/hand.js").read_text(encoding="utf-8"))


class _Browser(tornado.websocket.WebSocketHandler, _Local):  # its own check_origin refuses foreign pages
    """One browser: what it has not been sent yet, newest only."""

    def open(self, *_: str, **__: str) -> None:
        self.hand: Hand | None = None
        self.since = time.monotonic()  # it holds what it holds
        self.waiting: dict[tuple[str, str, str], bytes] = self.page._scene()
        self.wake = asyncio.Event()
        self.wake.set()
        with self.page._lock:
            self.page._browsers.add(self)
        self.task = asyncio.ensure_future(self._feed())

    async def _feed(self) -> None:
        try:
            while True:
                await self.wake.wait()
                self.wake.clear()
                with self.page._lock:
                    messages, self.waiting = self.waiting, {}
                for message in messages.values():
                    await self.write_message(message, binary=True)
        except tornado.websocket.WebSocketClosedError:
            pass

    def on_message(self, message: str | bytes) -> None:
        """What a hand does. Who says something else is told why, and heard no more."""
        try:
            hand = after(message, self.hand, self.page.nodes)
        except HandError as error:
            self.close(1008, str(error))
            return
        with self.page._lock:
            if (hand is None) != (self.hand is None):
                self.since = time.monotonic()
            self.hand = hand

    def on_close(self) -> None:
        with self.page._lock:
            self.page._browsers.discard(self)
        self.task.cancel()


def _viewer() -> str:
    """meshcat's viewer, from the installed package."""
    return files("meshcat").joinpath("viewer/dist/main.min.js").read_text(encoding="utf-8")
