"""Films of a session: it runs in real time first, then a browser that nobody sees draws it, picture by picture.

So a film is smooth on any machine, however slowly that draws. The browser is driven by the package playwright, films
are made by ffmpeg (from the package imageio-ffmpeg where there is no other): both come with `cinegen[film]`.
"""

from __future__ import annotations

import contextlib
import math
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from cinegen.cockpit.build_messages import NodePoses, hello_message, report_message, state_message
from cinegen.cockpit.cockpit import draw, title_of
from cinegen.cockpit.hub import Hub
from cinegen.cockpit.messages import ReportMessage, StateMessage
from cinegen.cockpit.page import Page
from cinegen.cockpit.server import Server
from cinegen.errors import CinegenError
from cinegen.session import KnownNames, Reporter, SessionRunner, SessionState, Setup
from raff2urdf.files import write_all

FPS = 30
"""Pictures a second."""

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")
_FLAGS = (
    "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
_SHOWN = "(number) => Number(document.documentElement.dataset.frame) >= number"
_DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
_PATIENCE = 60_000.0  # ms for the page to come, and for a picture
_REPORTED = 6  # pictures that one report lasts


class FilmError(CinegenError):
    """A film that can't be made; says what is missing."""


def film(
    setup: Setup,
    path: str | Path,
    seconds: float,
    size: tuple[int, int] = (1280, 720),
    aids: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Films a session.

    Args:
        setup: of the session.
        path: of the film (.mp4, .webm, .gif ...); a folder for pictures (PNG) if it has no ending.
        seconds: how long it is.
        size: in pixels.
        aids: whether singularities, the path ahead and the like are shown.
        progress: told the part that is done, 0 to 1.

    Returns:
        the film's path, or the folder's.

    Raises:
        FilmError: there is no browser, or no ffmpeg.
        CinegenError: there can't be such a session.
    """
    path, tell = Path(path), progress or (lambda part: None)
    browser = next(filter(None, map(shutil.which, _BROWSERS)), None)
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise FilmError("films need the package playwright: pip install 'cinegen[film]'") from None
    ffmpeg = _ffmpeg() if path.suffix else ""
    states = list(_played(setup, seconds, tell))
    page = Page(title_of(setup))
    draw(page, setup)
    hub = Hub(KnownNames.of(setup), lambda command: None, lambda client: hello_message(setup, page.title, client))
    server = Server(page, hub, page.html)
    server.start(7600)
    try:
        with sync_playwright() as playwright:
            try:
                chromium = playwright.chromium.launch(executable_path=browser, args=list(_FLAGS))
            except Exception as error:
                raise FilmError(f"films need a browser: install chromium ({str(error).splitlines()[0]})") from None
            view: Any = {"width": size[0], "height": size[1]}
            tab = chromium.new_page(viewport=view, bypass_csp=True)  # what waits in the page is not the page's own
            tab.goto(f"{server.url}?camera=1{'&aids=1' if aids else ''}")
            with _output(path, ffmpeg) as put:
                for number, (frame, report) in enumerate(_messages(setup, states, aids), 1):
                    server.call(hub.show, frame, report)
                    tab.wait_for_function(_SHOWN, arg=number, timeout=_PATIENCE, polling=5)
                    if number == 1:
                        tab.wait_for_timeout(500.0)  # meshes are being read
                        tab.evaluate("cockpit.frame()")
                    tab.evaluate(_DRAWN)
                    put(tab.screenshot(timeout=_PATIENCE))
                    tell(0.2 + 0.8 * number / len(states))
    finally:
        server.stop()
    return path


def _played(setup: Setup, seconds: float, tell: Callable[[float], None]) -> Iterator[SessionState]:
    """The session's states, so many a second, as it runs."""
    with SessionRunner(setup) as runner:
        while runner.state is None:
            time.sleep(0.01)
        begin = time.monotonic()
        count = max(1, math.ceil(seconds * FPS))
        for number in range(count):
            time.sleep(max(0.0, begin + number / FPS - time.monotonic()))
            state = runner.state
            if state is not None:
                yield state
            tell(0.2 * number / count)


def _messages(
    setup: Setup, states: list[SessionState], aids: bool
) -> Iterator[tuple[StateMessage, ReportMessage | None]]:
    """Yield the state of each picture, and the report of some."""
    poses = NodePoses(setup.robots)
    reporters = {name: Reporter(one) for name, one in setup.robots.items()}
    for number, state in enumerate(states):
        report = None
        if aids and number % _REPORTED == 0:
            found = {name: one.report(state.robots[name], state.time) for name, one in reporters.items()}
            report = report_message(state, found, (setup.rate, 0.0), 1)
        yield state_message(state, poses), report


@contextlib.contextmanager
def _output(path: Path, ffmpeg: str) -> Iterator[Callable[[bytes], object]]:
    """Takes pictures: for a film, or into a folder."""
    if not ffmpeg:
        count = iter(range(1, 10**9))
        yield lambda picture: _write(path / f"{next(count):05d}.png", picture)
        return
    with tempfile.TemporaryDirectory(prefix="cinegen-") as folder:
        made = Path(folder) / path.name
        with _encoder(made, ffmpeg) as put:
            yield put
        _write(path, made.read_bytes())


@contextlib.contextmanager
def _encoder(path: Path, ffmpeg: str) -> Iterator[Callable[[bytes], object]]:
    """Takes the pictures of a film."""
    even = "pad=ceil(iw/2)*2:ceil(ih/2)*2"  # most players want that
    coded = ["-pix_fmt", "yuv420p", "-crf", "20"] if path.suffix.lower() == ".mp4" else []
    command = [
        ffmpeg, "-y", "-loglevel", "error", "-f", "image2pipe", "-framerate", str(FPS), "-c:v", "png", "-i", "-",
        "-vf", even, *coded, str(path),
    ]  # fmt: skip
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        into, out = process.stdin, process.stderr
        if into is None or out is None:
            raise FilmError(f"{path.name}: ffmpeg can't be talked to")
        with contextlib.suppress(BrokenPipeError):
            yield into.write
            into.close()
        said = out.read().decode(errors="replace").strip()
    if process.returncode:
        raise FilmError(f"{path.name}: ffmpeg can't write it: {said.splitlines()[-1] if said else 'it says nothing'}")


def _write(path: Path, content: bytes) -> None:
    try:
        write_all({path: content})
    except OSError as error:
        raise FilmError(f"{path}: can't be written: {error.strerror}") from None


def _ffmpeg() -> str:
    """The program.

    Raises:
        FilmError: there is none.
    """
    found = shutil.which("ffmpeg")
    if found is None:
        try:
            import imageio_ffmpeg

            found = imageio_ffmpeg.get_ffmpeg_exe()
        except (ImportError, RuntimeError):
            raise FilmError("films need ffmpeg: pip install 'cinegen[film]'; or name a folder, for pictures") from None
    return str(found)
