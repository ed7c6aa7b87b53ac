"""`cinegen drive`: a page from which robots are driven."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import sys
import webbrowser
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cinegen.cli.files import count, mechanisms_and_files, of_files, seconds, write

if TYPE_CHECKING:
    from cinegen.cockpit import Cockpit
    from cinegen.session import Setup

_REALTIME = 40  # priority of SCHED_FIFO, above ordinary programs and below most kernel threads (50)
_UNATTENDED = 10.0  # s: how long a robot moves where nobody can press Ctrl-C


def add(commands: Any) -> None:
    """Adds the command."""
    drive = commands.add_parser(
        "drive", help="move robots in a page: drag any part, lead motors, plug in sensors",
        description="Serves a page to this machine in which any part of any robot can be taken and moved; loops stay "
        "closed. Until somebody takes it, each robot's end follows a path. In a scene the robot keeps clear of the "
        "obstacles, which can be moved too.",
    )  # fmt: skip
    of_files(drive, count="*")
    drive.add_argument("--scene", metavar="SCENE.toml", help="a robot among obstacles, instead of files of robots")
    drive.add_argument(
        "--follow", choices=["circle", "figure8", "line", "still"],
        help="the path its end follows, as large as fits into the workspace (circle; in a scene still); still: none",
    )  # fmt: skip
    drive.add_argument("--node", metavar="NAME", help="which node follows it (its sensor's, or the last in the file)")
    drive.add_argument(
        "--sensor", action="append", default=[], metavar="N=URL",
        help="another port for the files' sensor N; NODE=URL: a sensor that holds a node",
    )  # fmt: skip
    drive.add_argument(
        "--stand", action="append", default=[], metavar="NAME=PLACE",
        help="where a robot stands: ROBOT.NODE, x,y,z[,roll,pitch,yaw] (m, degrees), or ROBOT.NODE@x,y,z...",
    )  # fmt: skip
    drive.add_argument("--record", metavar="FILE.jsonl", help="record what happens, for `cinegen replay` and `export`")
    drive.add_argument(
        "--snapshot", metavar="FILE.html",
        help="write a page that needs no server: at once, or after --seconds of motion",
    )  # fmt: skip
    drive.add_argument("--rate", type=_rate, default=1000.0, metavar="HZ", help="ticks a second (%(default)g)")
    of_page(drive)
    drive.set_defaults(run=run)


def of_page(parser: argparse.ArgumentParser) -> None:
    """A command that serves a page."""
    parser.add_argument("--seconds", type=seconds, metavar="S", help="stop after so long (at Ctrl-C)")
    parser.add_argument("--port", type=int, default=7000, help="first port to try (%(default)s)")
    parser.add_argument(
        "--host", default="127.0.0.1", metavar="ADDRESS",
        help="listen there (%(default)s: this machine only); others need the token that is printed",
    )  # fmt: skip
    parser.add_argument("--token", metavar="TEXT", help="the token that browsers must know; else one is made up")
    parser.add_argument("--no-browser", action="store_true", help="only print the page's address")
    parser.add_argument(
        "--realtime", action="store_true",
        help=f"run the session in the real-time class SCHED_FIFO, priority {_REALTIME}, where the system permits it: "
        "more punctual on a busy machine, but other programs must wait for it",
    )  # fmt: skip
    parser.add_argument(
        "--video", metavar="FILE.mp4", help="a film of --seconds, as fast as it can be drawn; a folder for its frames"
    )
    parser.add_argument("--size", type=_size, default=(1280, 720), metavar="WxH", help="of the film (1280x720)")
    parser.add_argument("--aids", action="store_true", help="with the visual aids in the film")


def run(options: argparse.Namespace) -> int:
    """Drives."""
    setup = _scene(options) if options.scene is not None else _files(options)
    from cinegen.cockpit import Page, draw, title_of
    from cinegen.session import is_obstacle

    for name, mechanism in setup.robots.items():
        if is_obstacle(mechanism):
            continue
        said = f"{name}: {count(mechanism.joints, 'joint')}, {count(mechanism.loops, 'loop')}"
        said += f", mobility {mechanism.mobility}"
        print(f"{said}, loops closed to {mechanism.closure(mechanism.q_home):.1g}" if mechanism.loops else said)
    around = setup.surroundings
    if around is not None:
        print(f"keeps {1e3 * around.scene.safety:.3g} mm clear of {count(around.obstacles, 'obstacle')}")
    if options.snapshot and options.seconds is None and not options.video:
        page = Page(title_of(setup))
        draw(page, setup)
        write_page(Path(options.snapshot), page.html())
        return 0
    return show(setup, options, Path(options.scene or options.files[0]).stem, options.snapshot)


def _files(options: argparse.Namespace) -> Setup:
    """A session with the robots of files."""
    from cinegen.errors import CinegenError

    if not options.files:
        raise CinegenError("nothing to drive: name a file of a robot, or a scene with --scene SCENE.toml")
    loaded = mechanisms_and_files(options)
    from cinegen.session import arrange

    return arrange(
        {name: mechanism for name, (mechanism, _) in loaded.items()},
        files={name: file for name, (_, file) in loaded.items()},
        sensors=options.sensor,
        follow=_followed(options, "circle"),
        node=options.node,
        stands=options.stand,
        rate=options.rate,
        record=options.record,
    )


def _scene(options: argparse.Namespace) -> Setup:
    """A session with the robot and the obstacles of a scene."""
    from cinegen.errors import CinegenError

    beside = {"a FILE": options.files, "--robot": options.robot, "--loop": options.loop, "--stand": options.stand}
    for what, said in beside.items():
        if said:
            raise CinegenError(f"--scene names its robot and where that stands: leave {what} out")
    from cinegen.collision.scene import load_scene
    from cinegen.session import in_scene

    return in_scene(
        load_scene(options.scene, options.ignore_loops), options.sensor, _followed(options, "still"), options.node,
        options.rate, options.record,
    )  # fmt: skip


def _followed(options: argparse.Namespace, usual: str) -> str | None:
    """The path that robots follow."""
    shape: str = options.follow or usual
    return None if shape == "still" else shape


def show(setup: Setup, options: argparse.Namespace, stem: str, snapshot: str | None = None) -> int:
    """Serves a session's page until it ends.

    Args:
        setup: of the session.
        options: as `of_page` has them.
        stem: of the file that is written where nobody can press Ctrl-C.
        snapshot: the file that the page is written to at the end.
    """
    from cinegen.cockpit import Cockpit
    from cinegen.session import SessionError

    if options.realtime:
        setup = replace(setup, priority=_REALTIME)
    if options.video:
        return _film(setup, options)
    time = options.seconds
    if time is None and not (sys.stdin is not None and sys.stdin.isatty()):
        time, snapshot = _UNATTENDED, snapshot or f"{stem}.html"
    cockpit = Cockpit(setup, host=options.host, port=options.port, token=options.token)
    with cockpit:
        _tell(cockpit, options, time)
        with contextlib.suppress(KeyboardInterrupt):
            _wait(cockpit, time)
        state = cockpit.state
        print(f"stopped; loops closed to {max(robot.closure for robot in state.robots.values()):.1g}", flush=True)
        if snapshot:
            write_page(Path(snapshot), cockpit.snapshot())
    if state.recording is not None:
        print(f"recorded: {state.recording.file}")
        if state.recording.error is not None:
            raise SessionError(f"{state.recording.file}: recording ended early: {state.recording.error}")
    return 0


def _wait(cockpit: Cockpit, time: float | None) -> None:
    """Until the time is over; at a terminal, with a line of what goes on."""
    from cinegen.session import is_obstacle

    left = math.inf if time is None else time
    robots = [name for name, mechanism in cockpit.setup.robots.items() if not is_obstacle(mechanism)]
    if not sys.stderr.isatty():
        cockpit.wait(time)
        return
    while left > 0.0 and not cockpit.wait(min(left, 1.0)):
        left -= 1.0
        state = cockpit.state
        told = ((name, state.robots[name]) for name in robots)
        said = ", ".join(f"{name}: {robot.status[1]}, closure {robot.closure:.0e}" for name, robot in told)
        print(f"\r{state.time:5.0f} s  {said[:110]:<110}", end="", file=sys.stderr, flush=True)


def _tell(cockpit: Cockpit, options: argparse.Namespace, time: float | None) -> None:
    scripts = {one.name: one.robot for one in cockpit.setup.devices if one.robot is not None}
    for sensor in cockpit.state.sensors:
        if sensor.name in scripts:
            print(f"{scripts[sensor.name]}: {sensor.status.message}")
    print(f"page: {cockpit.url}", "- Ctrl-C ends" if time is None else f"- for {time:g} s", flush=True)
    if options.realtime:
        _tell_scheduling(cockpit.loop.report().scheduling)
    if cockpit.server.token is not None and not options.token:
        print("      whoever has this address can drive; the line is not encrypted", flush=True)
    if not options.no_browser and _has_screen():
        webbrowser.open(cockpit.server.local_url)


def _tell_scheduling(found: str) -> None:
    if found.startswith("SCHED_FIFO"):
        print(f"real-time scheduling: {found}", flush=True)
    else:
        print(
            f"warning: --realtime: {found}. To permit it, run `ulimit -r {_REALTIME}` as root before, or set rtprio in "
            "/etc/security/limits.conf",
            file=sys.stderr,
        )


def _film(setup: Setup, options: argparse.Namespace) -> int:
    from cinegen.cockpit import film
    from cinegen.errors import CinegenError

    if options.seconds is None:
        raise CinegenError("--video needs --seconds: how long the film is")
    where = film(setup, Path(options.video), options.seconds, options.size, options.aids, _progress)
    print(f"film: {where}")
    return 0


def _progress(part: float) -> None:
    if sys.stderr.isatty():
        print(f"\r{100.0 * part:3.0f} %", end="\n" if part >= 1.0 else "", file=sys.stderr, flush=True)


def _has_screen() -> bool:
    """Whether a browser can open a window here (a text browser would take the terminal instead)."""
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def write_page(path: Path, text: str) -> None:
    """Writes a page that needs no server."""
    write(path, text)
    print(f"page without a server: {path.resolve()}")


def _rate(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 10.0 <= value <= 1e4:
        raise argparse.ArgumentTypeError(f"'{text}' is no rate from 10 to 10000 a second")
    return value


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and 64 <= int(width) <= 8192 and 64 <= int(height) <= 8192):
        raise argparse.ArgumentTypeError(f"'{text}' is no size in pixels, such as 1280x720")
    return int(width), int(height)
