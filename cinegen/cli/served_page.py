"""The options of commands that serve a page, and its service until the end of the session."""

from __future__ import annotations

import math
import os
import re
import sys
import webbrowser
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.cli.files import check_outputs, write
from cinegen.cli.options import STOP_AFTER, force_option
from cinegen.cli.progress import Progress
from raff2urdf.command.command_line import UsageError, flag, option, quantity_option
from raff2urdf.command.output import unescaped, until_stopped
from raff2urdf.escape import one_line
from raff2urdf.quantities import TIME

if TYPE_CHECKING:
    from cinegen.cockpit import Cockpit, SetupFiles
    from cinegen.session import Setup

FILMS = (".mp4", ".webm", ".gif")
"""Endings of films."""

_REALTIME = 40  # priority of SCHED_FIFO, above ordinary programs and below most kernel threads (50)
_UNATTENDED = 10.0  # s of motion without a terminal, where Ctrl-C is impossible
_PANEL: dict[str, Any] = {"rich_help_panel": "Page"}
_SERVED: dict[str, Any] = {**_PANEL, "needs": "--view", "unless": "--video"}
"""Settings of options of a page that is served; a film is none."""


@dataclass(frozen=True)
class PageOptions:
    """The page of a session."""

    seconds: float | None = quantity_option("S", STOP_AFTER, TIME, needs="--view")
    port: int = option("PORT", "first port to try", 7000, min=1, max=65535, **_SERVED)
    host: str = option("ADDRESS", "address to listen on, for other machines", "127.0.0.1", **_SERVED)
    token: str | None = option(
        "TEXT", "token that browsers must send (default: a random one); the environment hides it from other users",
        envvar="CINEGEN_TOKEN", **_SERVED,
    )  # fmt: skip
    no_token: bool = flag("--no-token", "let all users of this machine open the page", **_SERVED)
    https: bool = flag(
        "--https", "encrypt connections by a self-signed certificate: headsets of the network need it", **_SERVED
    )
    no_browser: bool = flag(
        "--no-browser", "only print the address of the page", needs="--view", unless="--video", **_PANEL
    )
    realtime: bool = flag(
        "--realtime", f"run the session in the real-time class SCHED_FIFO, priority {_REALTIME}, if the system permits "
        "it: more punctual on a busy machine, but other programs must wait", **_SERVED,
    )  # fmt: skip
    video: Path | None = option(
        "FILE.mp4", "film --seconds of the session, as fast as it can be drawn; a folder for its frames",
        needs="--view", endings=FILMS, **_PANEL,
    )  # fmt: skip
    size: str = option("WxH", "size of the film, pixels", "1280x720", needs="--video", **_PANEL)
    force: bool = force_option("--view, --plot, --plot-joints, --output")
    aids: bool = flag("--aids", "draw the visual aids in the film", needs="--video", **_PANEL)

    @property
    def writes(self) -> bool:
        """True if `show` writes a file: a film, or what is seen without a terminal, unless a snapshot is named."""
        return self.video is not None or self.seconds is None

    def show(self, setup: Setup, stem: str, snapshot: Path | None = None, files: SetupFiles | None = None) -> int:
        """Serve the page of a session until it ends; return the exit code.

        Args:
            setup: of the session.
            stem: of the snapshot that is written without a terminal.
            snapshot: file of the snapshot that is written in the end.
            files: files that describe the setup, which are watched.

        Raises:
            CinegenError: the page can't be served or filmed, or the recording ended early.
        """
        from cinegen.cockpit import Cockpit
        from cinegen.cockpit.handlers import is_local
        from cinegen.session import SessionError

        if self.no_token and self.token:
            raise UsageError("--no-token and --token exclude each other")
        if self.realtime:
            setup = replace(setup, priority=_REALTIME)
        if self.video:
            check_outputs(self.video, force=self.force)
            return self._film(setup, self.video)
        seconds = self.seconds
        if seconds is None and not (sys.stdin is not None and sys.stdin.isatty()):
            seconds, snapshot = _UNATTENDED, snapshot or Path(f"{stem}.html")
            check_outputs(snapshot, force=self.force)
        with Cockpit(
            setup, host=self.host, port=self.port, token="" if self.no_token else self.token or None, https=self.https,
            files=files,
        ) as cockpit:  # fmt: skip
            self._announce(cockpit, seconds)
            if cockpit.server.certificate is not None:
                print(f"      browsers warn of its certificate, {cockpit.server.certificate.fingerprint}", flush=True)
            if not is_local(self.host):
                line = "" if self.https else "; the line is not encrypted"
                print(f"      whoever has the address of the page can drive{line}", flush=True)
            with until_stopped():
                _wait(cockpit, seconds)
            state = cockpit.state
            print(f"stopped; loops closed to {max(robot.closure for robot in state.robots.values()):.1g}", flush=True)
            if snapshot:
                write_snapshot(snapshot, cockpit.snapshot())
        if state.recording is not None:
            print(f"recorded: {state.recording.file}")
            if state.recording.error is not None:
                raise SessionError(f"{state.recording.file}: recording ended early: {state.recording.error}")
        return 0

    def _announce(self, cockpit: Cockpit, seconds: float | None) -> None:
        from cinegen.devices.reading_json import encode_token

        scripts = {script.name: script.robot for script in cockpit.setup.devices if script.robot is not None}
        for sensor in cockpit.state.sensors:
            if sensor.id in scripts:
                print(f"{scripts[sensor.id]}: {sensor.message}")
        for device in cockpit.setup.devices:
            if device.token:
                print(f"{device.name}: {device.url}: a program sends first: {encode_token(device.token)}")
        print(f"page: {cockpit.url}", "- Ctrl-C ends" if seconds is None else f"- for {seconds:g} s", flush=True)
        if cockpit.view_url is not None:
            print(f"view only: {cockpit.view_url}", flush=True)
        if self.realtime:
            _report_scheduling(cockpit.runner.report().scheduling)
        if not self.no_browser and _has_screen():
            webbrowser.open(cockpit.server.local_url)

    def _film(self, setup: Setup, path: Path) -> int:
        from cinegen.cockpit import film

        if self.seconds is None:
            raise UsageError("--video needs --seconds: the duration of the film")
        size = re.fullmatch(r"(\d{2,4})x(\d{2,4})", self.size)
        if size is None or not all(64 <= int(side) <= 8192 for side in size.groups()):
            raise UsageError(f"--size: '{self.size}' is not a size in pixels, such as 1280x720")
        with Progress() as progress:
            shape = int(size[1]), int(size[2])
            print(f"film: {film(setup, path, self.seconds, shape, self.aids, progress.fraction)}")
        return 0


PAGE = tuple(f"--{field.name.replace('_', '-')}" for field in fields(PageOptions))
"""Names of the options of a page."""


def _wait(cockpit: Cockpit, seconds: float | None) -> None:
    """Wait until the time is over or Ctrl-C; at a terminal, with a line about the state."""
    from cinegen.jit.starting import COMPILATION

    if not sys.stderr.isatty():
        cockpit.wait(seconds)
        return
    left = math.inf if seconds is None else seconds
    while left > 0.0 and not cockpit.wait(min(left, 1.0)):
        left -= 1.0
        state = cockpit.state
        text = ", ".join(
            f"{name}: {robot.status.label}, closure {robot.closure:.0e}" for name, robot in state.robots.items()
        )
        if not state.compiled:
            text = f"compiling {COMPILATION.fraction:.0%}, Python computes: {text}"
        line = f"\r{state.time:5.0f} s  {one_line(text)[:110]:<110}"
        print(line, end="", file=unescaped(sys.stderr), flush=True)


def _report_scheduling(scheduling: str) -> None:
    if scheduling.startswith("SCHED_FIFO"):
        print(f"real-time scheduling: {scheduling}", flush=True)
    else:
        hint = (
            f". To permit it, run `ulimit -r {_REALTIME}` as root before, or set rtprio in /etc/security/limits.conf"
            if "permitted" in scheduling
            else ""
        )
        print(f"warning: --realtime: {scheduling}{hint}", file=sys.stderr)


def _has_screen() -> bool:
    """Return whether a browser can open a window here (a text browser would take the terminal instead)."""
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def write_snapshot(path: Path, text: str) -> None:
    """Write a snapshot.

    Raises:
        CinegenError: it can't be written.
    """
    write(path, text)
    print(f"snapshot: {path.resolve()}")
