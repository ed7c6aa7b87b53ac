"""`Page`: meshcat's messages, kept for browsers that connect later, and written as one file.

A `Page` stands where meshcat's ViewerWindow stands: `meshcat.Visualizer(window=page)` draws into it. It keeps the
newest of everything drawn, so that a browser that comes late sees the whole scene. meshcat's stock server is not
used: it listens on all interfaces and queues up behind a slow browser; here each browser gets the newest state, as
fast as it takes it (`cinegen.cockpit.server`).
"""

from __future__ import annotations

import base64
import html
import threading
from collections.abc import Callable
from importlib.resources import files
from typing import Any

import umsgpack

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{title}</title>
<style>
body {{ margin: 0; }}
#pane {{ width: 100vw; height: 100vh; overflow: hidden; }}
</style></head>
<body><div id="pane"></div>
<script>{viewer}</script>
<script>
var viewer = new MeshCat.Viewer(document.getElementById("pane"));
for (const text of [{blobs}]) {{
  viewer.handle_command_bytearray(Uint8Array.from(atob(text), c => c.charCodeAt(0)));
}}
</script>
<script id="embedded-json"></script>
</body></html>
"""

Key = tuple[str, str, str]
"""Path, kind and property of a message."""


class PageFeed:
    """Messages that one browser was not sent yet, the newest only."""

    def __init__(self, page: Page, waiting: dict[Key, bytes]) -> None:
        self._page, self.waiting = page, waiting

    def take(self) -> list[bytes]:
        """Return all of them."""
        with self._page.lock:
            messages, self.waiting = self.waiting, {}
        return list(messages.values())


class Page:
    """A scene, and the browsers that show it.

    Args:
        title: title of the page.

    Attributes:
        wake: called when something is drawn, in the thread that draws.
        lock: lock of the messages.
    """

    def __init__(self, title: str = "cinegen") -> None:
        self.title = title
        self.lock = threading.Lock()
        self.wake: Callable[[], None] | None = None
        self._kept: dict[Key, bytes] = {}
        self._feeds: set[PageFeed] = set()

    def send(self, command: Any) -> None:
        """Take one meshcat command; called by meshcat's Visualizer."""
        values = command.lower()
        kind, path = values["type"], values["path"]
        key = (path, kind, values.get("property", ""))
        message = umsgpack.packb(values)
        with self.lock:
            if kind in ("set_object", "delete"):  # removes what was drawn below
                below = [k for k in self._kept if k[0] == path or (kind == "delete" and k[0].startswith(path + "/"))]
                for old in below:
                    del self._kept[old]
            if kind != "delete":
                self._kept[key] = message
            for feed in self._feeds:
                feed.waiting[key] = message
        if self.wake is not None and self._feeds:
            self.wake()

    def feed(self) -> PageFeed:
        """Return a feed that starts with everything that is drawn."""
        with self.lock:
            feed = PageFeed(self, self._in_order())
            self._feeds.add(feed)
        return feed

    def forget(self, feed: PageFeed) -> None:
        """Remove a feed."""
        with self.lock:
            self._feeds.discard(feed)

    def html(self) -> str:
        """Return the present scene as an HTML page that needs no server."""
        blobs = ",\n".join(f'"{base64.b64encode(message).decode()}"' for message in self.scene().values())
        return _PAGE.format(title=html.escape(self.title), viewer=viewer(), blobs=blobs)

    def scene(self) -> dict[Key, bytes]:
        """Return all messages, objects before their properties."""
        with self.lock:
            return self._in_order()

    def _in_order(self) -> dict[Key, bytes]:
        return dict(sorted(self._kept.items(), key=lambda item: item[0][1] != "set_object"))


def viewer() -> str:
    """Return meshcat's viewer, from the installed package."""
    return files("meshcat").joinpath("viewer/dist/main.min.js").read_text(encoding="utf-8")
