"""Films of a session: it runs in real time first, then a browser without a window draws it frame by frame.

So films are smooth on any machine, however slowly that draws. The browser is driven by the package playwright, films
are encoded by ffmpeg (of the package imageio-ffmpeg if there is no other): both come with `cinegen[film]`.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from cinegen.cockpit.build_messages import NodePoses, hello_message, report_message, state_message
from cinegen.cockpit.cockpit import draw, title_of
from cinegen.cockpit.hub import Hub
from cinegen.cockpit.messages import ReportMessage, StateMessage, TickRate
from cinegen.cockpit.page import Page
from cinegen.cockpit.server import Server
from cinegen.errors import CinegenError
from cinegen.session import Reporter, RobotReport, SessionRunner, SessionState, Setup
from raff2urdf.command.extras import install, needs
from raff2urdf.files import write_all, writing

FPS = 30
"""Frames per second."""

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")
_FLAGS = (
    "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
_SHOWN = "(number) => Number(document.documentElement.dataset.frame) >= number"
_READY = "() => document.documentElement.dataset.view === 'ready'"
_DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
_PATIENCE = 60_000.0  # ms for the page to load, and for a frame
_REPORTED = 6  # frames per report


class FilmError(CinegenError):
    """A film can't be made; the message names what is missing."""


def film(
    setup: Setup,
    path: str | Path,
    seconds: float,
    size: tuple[int, int] = (1280, 720),
    aids: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Film a session.

    Args:
        setup: setup of the session.
        path: path of the film (.mp4, .webm, .gif ...), or without a suffix, of a folder for the frames (PNG).
        seconds: duration, s.
        size: width and height, pixels.
        aids: draw the visual aids.
        progress: called with the fraction that is done, 0 to 1.

    Returns:
        The path.

    Raises:
        MissingExtraError: Playwright is not installed.
        FilmError: there is no browser or no ffmpeg, or the film can't be written.
        CinegenError: the session can't be constructed.
    """
    path, report = Path(path), progress or (lambda fraction: None)
    with needs("film", "films"):
        import playwright.sync_api  # noqa: F401
    if not path.suffix:
        _draw_frames(setup, path, seconds, size, aids, report)
        return path
    ffmpeg = _ffmpeg()
    with tempfile.TemporaryDirectory(prefix="cinegen-") as folder:
        one_colour = f"color=size={size[0]}x{size[1]}:rate={FPS}:duration=0.1"
        _encoded(["-f", "lavfi", "-i", one_colour], Path(folder), path, ffmpeg)  # drawing takes minutes
        _draw_frames(setup, Path(folder), seconds, size, aids, report)
        _write(path, _encoded(_frames_of(Path(folder)), Path(folder), path, ffmpeg))
    return path


def _draw_frames(
    setup: Setup, folder: Path, seconds: float, size: tuple[int, int], aids: bool, report: Callable[[float], None]
) -> None:
    """Run a session, and draw its frames into files of a folder: 00001.png and so on."""
    from playwright.sync_api import sync_playwright

    states, changed = list(_played(setup, seconds, report)), SimpleQueue[int]()
    page = Page(title_of(setup))
    draw(page, setup)
    hub = Hub(setup, lambda command: None, lambda client: hello_message(setup, page.title, client))
    server = Server(page, hub, page.html)

    def show(frame: StateMessage, frame_report: ReportMessage | None) -> None:
        hub.show(frame, frame_report)
        changed.put(hub.changed)

    server.start(7600)
    try:
        with sync_playwright() as playwright:
            browser = next(filter(None, map(shutil.which, _BROWSERS)), None)
            try:
                chromium = playwright.chromium.launch(executable_path=browser, args=list(_FLAGS))
            except Exception as error:
                raise FilmError(f"films need a browser: install chromium ({str(error).splitlines()[0]})") from None
            view: Any = {"width": size[0], "height": size[1]}
            tab = chromium.new_page(viewport=view, bypass_csp=True)  # for the functions below
            tab.goto(f"{server.url}&camera=1{'&aids=1' if aids else ''}")
            for number, (frame, frame_report) in enumerate(_messages(setup, states, aids), 1):
                server.call(show, frame, frame_report)
                tab.wait_for_function(_SHOWN, arg=changed.get(), timeout=_PATIENCE, polling=5)
                if number == 1:
                    tab.wait_for_function(_READY, timeout=_PATIENCE, polling=5)
                tab.evaluate(_DRAWN)
                _write(folder / f"{number:05d}.png", tab.screenshot(timeout=_PATIENCE))
                report(0.2 + 0.8 * number / len(states))
    finally:
        server.stop()


def _played(setup: Setup, seconds: float, report: Callable[[float], None]) -> Iterator[SessionState]:
    """Run a session in real time; yield the state of each frame."""
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
            report(0.2 * number / count)


def _messages(
    setup: Setup, states: list[SessionState], aids: bool
) -> Iterator[tuple[StateMessage, ReportMessage | None]]:
    """Yield the state of each frame, and the report of some."""
    poses = NodePoses(setup.robots)
    reporters = {name: Reporter(robot) for name, robot in setup.robots.items()}
    reports: dict[str, RobotReport] = {}
    for number, state in enumerate(states):
        report = None
        if aids and number % _REPORTED == 0:
            reports = {name: reporter.report(state.robots[name], state.time) for name, reporter in reporters.items()}
            report = report_message(state, reports, TickRate(setup.rate, 0, 0, 0.0, False), 1)
        yield state_message(state, poses, reports), report


def _frames_of(folder: Path) -> list[str]:
    """Return ffmpeg's options for the frames in a folder."""
    return ["-framerate", str(FPS), "-i", str(folder / "%05d.png")]


def _encoded(source: Sequence[str], folder: Path, path: Path, ffmpeg: str) -> bytes:
    """Return a film in the format of a path, from ffmpeg's options for its source; it is made in a folder.

    Raises:
        FilmError: ffmpeg can't make it.
    """
    even = "pad=ceil(iw/2)*2:ceil(ih/2)*2"  # most players need even sizes
    codec = ["-pix_fmt", "yuv420p", "-crf", "20"] if path.suffix.lower() == ".mp4" else []
    made = folder / path.name
    command = [ffmpeg, "-y", "-loglevel", "error", *source, "-vf", even, *codec, str(made)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["no reason is given"])[-1]
        raise FilmError(f"{path.name}: ffmpeg can't write it: {reason}")
    return made.read_bytes()


def _write(path: Path, content: bytes) -> None:
    with writing(FilmError):
        write_all({path: content})


def _ffmpeg() -> str:
    """Return the path of ffmpeg.

    Raises:
        FilmError: there is none.
    """
    program = shutil.which("ffmpeg")
    if program is None:
        try:
            import imageio_ffmpeg

            program = imageio_ffmpeg.get_ffmpeg_exe()
        except (ImportError, RuntimeError):
            raise FilmError(f"films need ffmpeg: {install('film')}; or name a folder for the frames") from None
    return str(program)
