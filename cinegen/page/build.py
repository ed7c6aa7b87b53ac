"""Build a page without a server from the cockpit's own parts."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import zlib
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec
import pinocchio as pin

from cinegen.cockpit.build_messages import hello_message
from cinegen.cockpit.cockpit import draw, title_of
from cinegen.cockpit.page import Page, viewer
from cinegen.page.kernels_module import KERNELS, module
from cinegen.page.modules import import_map
from cinegen.page.tables import robot_tables
from cinegen.session import Setup
from raff2urdf.escape import html_text, xml_comment
from raff2urdf.files import GENERATED

RATE = 240.0
"""Ticks per second."""

_POLICY = (
    "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; "
    "form-action 'none'"
)

_STYLES = tuple(
    f"style/{name}.css" for name in ("theme", "layout", "controls", "plots", "waypoints", "users", "preferences")
)  # as index.html has them
_NO_FORCES = "a page without a server computes none"


def build_page(setup: Setup, title: str = "") -> str:
    """Build an HTML file in which the robots of a session can be driven without a server.

    Args:
        setup: setup of the session; only its robots, their starts and base poses are used.
        title: title of the page; the robots' names unless given.

    Raises:
        CinegenError: a robot has joints that the kernels don't know.
    """
    title = title or title_of(setup)
    content = content_of(setup, title) | {"scene": _scene(setup, title)}
    packed = _packed({"viewer": viewer(), "modules": import_map({KERNELS: module()}), "content": content})
    nonce = hashlib.sha256(packed.encode()).hexdigest()[:32]
    scripts = (
        f'<script type="text/plain" id="packed">{packed}</script>\n<script nonce="{nonce}">{_own("unpack.js")}</script>'
    )
    policy = f'<meta http-equiv="Content-Security-Policy" content="{_POLICY.format(nonce=nonce)}">'
    styles = "\n".join(_static(name) for name in _STYLES) + _own("local.css")
    text = _static("index.html").replace("{{title}}", html_text(title))
    text = text.replace("<html ", '<html data-source="local" ', 1)
    text = text.replace("<head>\n", f"<head>\n<!-- {GENERATED}\n{_licences()}-->\n{policy}\n", 1)
    text = re.sub(r'<link rel="icon"[^>]*>', f'<link rel="icon" href="{_icon()}" type="image/svg+xml">', text)
    text = re.sub(r'(<link rel="stylesheet"[^>]*>\s*)+', lambda _: f"<style>\n{styles}</style>\n", text)
    text = re.sub(r'<script type="importmap">.*?</script>\n', "", text)
    return re.sub(r"<script src=.*</script>(?=\n</body>)", lambda _: scripts, text, flags=re.DOTALL)


def content_of(setup: Setup, title: str) -> dict[str, Any]:
    """Return what the session in the page begins with: the first message, and each robot's tables, start and base."""
    return {"hello": _hello(setup, title), "robots": list(_robots(setup)), "rate": RATE, "kernels": KERNELS}


def _hello(setup: Setup, title: str) -> Any:
    """Return the first message to the page, without what only a server has."""
    hello = hello_message(setup, title, 1)
    robots = tuple(
        msgspec.structs.replace(robot, forces=msgspec.structs.replace(robot.forces, missing=_NO_FORCES))
        for robot in hello.robots
    )
    changed = msgspec.structs.replace(hello, robots=robots, obstacles=(), sensors=(), switches=(), map=None)
    return msgspec.to_builtins(changed)


def _robots(setup: Setup) -> Iterator[Any]:
    """Yield what the session needs of each robot, each after the one that carries it."""
    for name in setup.order():
        base = setup.base(name)
        mounting = {"robot": base.robot, "node": base.node, "placement": pin.SE3ToXYZQUAT(base.placement).tolist()}
        start = setup.start(name).tolist()
        yield {"name": name, "tables": robot_tables(setup.robots[name], RATE), "base": mounting, "start": start}


def _scene(setup: Setup, title: str) -> list[str]:
    """Return the drawing commands of the scene, in base16."""
    page = Page(title)
    draw(page, setup)
    return [message.hex() for message in page.scene().values()]


def _packed(content: Any) -> str:
    """Return JSON, compressed and in base64."""
    return base64.b64encode(zlib.compress(json.dumps(content, allow_nan=False).encode(), 9)).decode()


def _licences() -> str:
    return xml_comment("\n".join((_project_licence(), *_viewer_licences())))


def _viewer_licences() -> Iterator[str]:
    """Yield the licences of meshcat's viewer and of the libraries in it, from its package."""
    viewer = files("meshcat").joinpath("viewer")
    yield viewer.joinpath("LICENSE").read_text(encoding="utf-8")
    for library in json.loads(viewer.joinpath("dist/main.min.js.THIRD_PARTY_LICENSES.json").read_text("utf-8")):
        yield f"{library['name']} {library['version']}\n{library.get('licenseText') or library['license']}"


def _project_licence() -> str:
    """Return cinegen's licence."""
    with suppress(PackageNotFoundError):
        if text := distribution("cinegen").read_text("licenses/LICENSE"):
            return text
    return Path(__file__).parents[2].joinpath("LICENSE").read_text(encoding="utf-8")  # run from its sources


def _icon() -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(_static("style/icon.svg").encode()).decode()


@cache
def _static(name: str) -> str:
    return files("cinegen.cockpit").joinpath("static", name).read_text(encoding="utf-8")


def _own(name: str) -> str:
    return files("cinegen.page").joinpath("static", name).read_text(encoding="utf-8")
