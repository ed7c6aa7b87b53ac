"""`Page`: drawing commands of meshcat's viewer, kept for browsers that connect later, and written as one file.

It keeps the newest of everything drawn, so that a browser that comes late sees the whole scene. Each browser gets the
newest state, as fast as it takes it (`cinegen.cockpit.server`). A geometry that many objects have is sent with the
first of them.
"""

from __future__ import annotations

import base64
import threading
from collections.abc import Callable, Iterable
from functools import cache
from hashlib import blake2b
from importlib.resources import files
from typing import Any, NamedTuple, Protocol

import umsgpack

from raff2urdf.escape import html_text
from raff2urdf.files import GENERATED

_PAGE = """<!DOCTYPE html>
<!-- {generated} -->
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
const put = viewer.set_object.bind(viewer), geometries = {{}};
viewer.set_object = (path, object) => {{
  const id = object.geometry?.uuid;
  if (id) object.geometry = geometries[id] ??= object.geometry;
  put(path, object);
}};
for (const text of [{blobs}]) {{
  viewer.handle_command_bytearray(Uint8Array.from(atob(text), c => c.charCodeAt(0)));
}}
</script>
<script id="embedded-json"></script>
</body></html>
"""

_ORDER = ("set_transform", "set_object", "set_property")  # properties are an object's, placements those of its node


class DrawingCommand(Protocol):
    """A command of `meshcat.commands`."""

    def lower(self) -> dict[str, Any]:
        """Return the command as the viewer takes it."""


Key = tuple[str, str, str]
"""Path, kind and property of a message."""


class _Drawn(NamedTuple):
    """A message; of an object with a geometry that the browser has already, `again`."""

    message: bytes
    geometry: str = ""  # its digest; empty: none
    again: bytes = b""


class PageFeed:
    """Messages that one browser was not sent yet, the newest only."""

    def __init__(self, page: Page, waiting: dict[Key, _Drawn]) -> None:
        self._page, self.waiting = page, waiting

    def take(self) -> list[bytes]:
        """Return all of them."""
        with self._page.lock:
            messages, self.waiting = self.waiting, {}
        return _messages(messages.values())


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
        self._kept: dict[str, dict[Key, _Drawn]] = {}  # by path
        self._feeds: set[PageFeed] = set()

    def send(self, command: DrawingCommand) -> None:
        """Take a drawing command: a page is a window of `meshcat.Visualizer`."""
        lowered = command.lower()
        kind, path = lowered["type"], lowered["path"]
        key = (path, kind, lowered.get("property", ""))
        message = _drawn(lowered)
        with self.lock:
            if kind == "delete":
                for below in [kept for kept in self._kept if kept == path or kept.startswith(path + "/")]:
                    del self._kept[below]
            elif kind == "set_object":  # forgets the properties of the one before
                self._kept[path] = {key: message}
            else:
                self._kept.setdefault(path, {})[key] = message
            for feed in self._feeds:
                feed.waiting[key] = message
        if self.wake is not None and self._feeds:
            self.wake()

    def replace(self, path: str, other: Page) -> None:
        """Show another scene instead of this one.

        Args:
            path: path below which this scene is drawn: browsers delete it.
            other: page that has the other scene.
        """
        deleted = {(path, "delete", ""): _Drawn(umsgpack.packb({"type": "delete", "path": path}))}
        with self.lock:
            self._kept = {place: dict(messages) for place, messages in other._kept.items()}
            for feed in self._feeds:
                feed.waiting = deleted | self._in_order()
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
        """Return a snapshot: the present scene as one HTML file to look at; nothing moves in it."""
        blobs = ",\n".join(f'"{base64.b64encode(message).decode()}"' for message in self.scene().values())
        return _PAGE.format(title=html_text(self.title), generated=GENERATED, viewer=viewer(), blobs=blobs)

    def scene(self) -> dict[Key, bytes]:
        """Return all messages: placements before objects, so that none is drawn elsewhere, and properties at last."""
        with self.lock:
            drawn = self._in_order()
        return dict(zip(drawn, _messages(drawn.values()), strict=True))

    def _in_order(self) -> dict[Key, _Drawn]:
        every = [entry for kept in self._kept.values() for entry in kept.items()]
        return dict(sorted(every, key=lambda entry: _ORDER.index(entry[0][1])))


def _drawn(command: dict[str, Any]) -> _Drawn:
    """Return a command as a message; a geometry that is a list of triangles is called by its digest."""
    described = command.get("object", {})
    parts = described.get("geometries", ())
    geometries = [part for part in parts if part["type"] == "BufferGeometry" and part["data"]["attributes"]]
    if len(geometries) != 1:
        return _Drawn(umsgpack.packb(command))
    (geometry,) = geometries
    digest = blake2b(umsgpack.packb(geometry["data"]), digest_size=16).hexdigest()
    geometry["uuid"] = described["object"]["geometry"] = digest
    message = umsgpack.packb(command)
    geometry["data"] = {"attributes": {}}
    return _Drawn(message, digest, umsgpack.packb(command))


def _messages(drawn: Iterable[_Drawn]) -> list[bytes]:
    """Return messages in which each geometry is sent once."""
    drawn = list(drawn)
    first = {part.geometry: i for i, part in reversed(list(enumerate(drawn)))}
    return [part.again if part.geometry and first[part.geometry] != i else part.message for i, part in enumerate(drawn)]


@cache
def viewer() -> str:
    """Return meshcat's viewer, the script in its package."""
    return files("meshcat").joinpath("viewer/dist/main.min.js").read_text(encoding="utf-8")
