"""`Cockpit`: a session that users drive from a page."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from contextvars import copy_context
from typing import NamedTuple, Self

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.cockpit.build_messages import NodePoses, hello_message, report_message, state_message
from cinegen.cockpit.certificate import self_signed
from cinegen.cockpit.hub import Hub
from cinegen.cockpit.messages import HelloMessage, ReportMessage, StateMessage, TickRate
from cinegen.cockpit.page import Page
from cinegen.cockpit.scene import ROOT, RobotScene
from cinegen.cockpit.served_map import ServedMap
from cinegen.cockpit.server import ALL, Server
from cinegen.cockpit.watched_files import SetupFiles, WatchedFiles
from cinegen.errors import CinegenError
from cinegen.realtime.timing import RecentTiming
from cinegen.session import Reporter, RobotReport, SessionRunner, SessionState, Setup
from cinegen.session.runner import AT_REST
from raff2urdf.escape import html_text
from raff2urdf.files import noting

REPORTS = 10
"""Reports per second; fewer if they take long."""

_SHARE = 0.15  # of a core for the reports


class _Drawn(NamedTuple):
    """A setup, and its scene in a page."""

    setup: Setup
    page: Page
    scene: RobotScene


class Cockpit:
    """Runs a session, and serves the page from which it is driven; as the value of a notebook's cell, the page is shown
    below it.

    Args:
        setup: setup of the session.
        title: title of the page; the robots' names unless given.
        host: address to listen on.
        port: first port to try.
        token: token that browsers need; generated unless given. Empty: none, then every user of this machine can drive.
        own_process: run the session in a process of its own, which this one doesn't delay.
        framed: let any other page show this one in a frame, as notebooks do.
        https: encrypt connections, with a self-signed certificate that browsers warn of.
        files: files that describe the setup. When they are saved, the session goes on with what they describe then; the
            page shows what is wrong with them. None: none are watched.
        height: height of the page in a notebook's cell, pixels.

    Raises:
        CinegenError: the session can't be constructed, or its page not served.
    """

    def __init__(
        self,
        setup: Setup,
        title: str | None = None,
        host: str = "127.0.0.1",
        port: int = 7000,
        token: str | None = None,
        own_process: bool = True,
        framed: bool = False,
        https: bool = False,
        height: int = 600,
        files: SetupFiles | None = None,
    ) -> None:
        certificate = self_signed(socket.gethostname() if host in ALL else host) if https else None
        self.setup, self.height = setup, height
        self.title = title or title_of(setup)
        self.page = Page(self.title)
        with noting() as noted:
            self.scene = draw(self.page, setup)
        self._edition = 0  # number of the setup that is shown
        self._drawn = {0: _Drawn(setup, self.page, self.scene)}  # by number: shown, or to be shown
        self.map = None if setup.map is None else ServedMap(setup.map)
        self._over, self._shown = threading.Event(), threading.Event()
        self._unreported = threading.Event()  # there are robots without a report
        self._shown.set()
        self._state: SessionState | None = None  # newest that `_feed` has seen
        self._reports: tuple[int, dict[str, RobotReport]] = 0, {}  # and the number of their setup
        self._reported = 0
        self.error: BaseException | None = None
        with contextlib.ExitStack() as started:  # nothing runs on if one of them can't start
            self.runner = started.enter_context(SessionRunner(setup, own_process))
            self.hub = Hub(setup, self.runner.send, self._hello, self.runner.wake, lambda: self.runner.waiting)
            self.server = Server(self.page, self.hub, self.snapshot, host, token, framed, self.map, certificate)
            self.server.start(port)
            started.callback(self.server.stop)
            started.callback(self._over.set)
            self._threads = [
                threading.Thread(target=self._feed, name="cinegen frames", daemon=True),
                threading.Thread(target=self._report, name="cinegen reports", daemon=True),
            ]
            if files is not None:
                watched = WatchedFiles(files, self._draw_again, noted)
                self._threads.append(
                    threading.Thread(  # in this context, which has the unit of lengths in messages
                        target=copy_context().run, args=(self._watch_files, watched), name="cinegen files", daemon=True
                    )
                )
            for thread in self._threads:
                thread.start()
            started.pop_all()

    def __repr__(self) -> str:
        return f"<{self.title} at {self.url}>"

    def _repr_html_(self) -> str:
        url, title = html_text(self.url), html_text(self.title)
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe src="{url}" title="{title}" style="{style}" allow="gamepad; fullscreen"></iframe>'

    @property
    def url(self) -> str:
        """Address of the page."""
        return self.server.url

    @property
    def view_url(self) -> str | None:
        """Address at which the page only shows the session: commands from there are refused; None without a token."""
        return self.server.view_url

    @property
    def session_url(self) -> str:
        """Address of the websocket for programs on this machine."""
        return self.server.session_url

    @property
    def state(self) -> SessionState:
        """Newest state of the session.

        Raises:
            Exception: the exception that ended the session.
        """
        while (state := self.runner.state) is None:  # in its first tick
            time.sleep(0.001)
        return state

    @property
    def q(self) -> dict[str, Array]:
        """Configuration (nq,) of each robot, by name."""
        return {name: robot.q for name, robot in self.state.robots.items()}

    def snapshot(self) -> str:
        """Return a snapshot: the present scene as one HTML file to look at; nothing moves in it."""
        state = self.state
        if state.edition == self._edition:  # else they are being exchanged
            for name, robot in state.robots.items():
                self.scene.show(name, robot.q, robot.base)
            for name, obstacle in state.obstacles.items():
                self.scene.show_obstacle(name, obstacle.pose)
        return self.page.html()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the time (s) is over or the session has ended. Return whether it has ended.

        Raises:
            Exception: the exception that ended it.
        """
        over = self._over.wait(seconds)
        if self.error is not None:
            raise self.error
        return over

    def close(self) -> None:
        """End the session and the server."""
        self._over.set()
        self.runner.wake()
        self._unreported.set()
        for thread in self._threads:
            thread.join(5.0)
        self.server.stop()
        self.runner.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # --- threads -------------------------------------------------------------------------------------------------

    def _hello(self, client: int) -> HelloMessage:
        return hello_message(self.setup, self.title, client, self.state.playback, self.server.view_token)

    def _feed(self) -> None:
        """Send states to all clients. While there are none, or the server is busy, none are built."""
        poses, timing = NodePoses(self.setup.robots), RecentTiming()
        reported, noticed, shown, refused = 0, 0, None, None
        reports: dict[str, RobotReport] = {}  # that pages show
        next_time = time.monotonic()
        while not self._over.is_set():
            try:
                state = self._state = self.runner.state
            except BaseException as error:
                self.error = error
                self.server.call(self.hub.notify_all, f"the session has ended: {error}", True)
                self._over.set()
                return
            if state is not None and state.edition != self._edition:
                poses, reports = NodePoses(self._exchange(state.edition).robots), {}
            if state is not None and state.refused not in (None, refused):
                refused = state.refused
                self.server.call(self.hub.state_problem, state.refused[1])
            if not self.hub.clients:
                reported, reports = self._reported, {}
                timing.add(self.runner.report())
            elif state is not None and state is not shown and self._shown.is_set():
                if shown is not None and shown.at_rest and not state.at_rest:
                    self._unreported.set()
                shown, report = state, None
                edition, newest = self._reports
                if self._reported > reported and edition == state.edition:
                    reported, reports = self._reported, dict(newest)
                    rate = self._rate(timing, state.at_rest)
                    report = report_message(state, reports, rate, len(self.hub.clients))
                self._shown.clear()
                self.server.call(self._show, state_message(state, poses, reports), report)
            for notice in () if state is None else state.notices:
                if notice.number > noticed:
                    noticed = notice.number
                    self.server.call(self.hub.notify_all, notice.text, notice.warning)
            rests = not self.hub.clients or (shown is not None and shown is state and shown.at_rest)
            next_time = max(next_time + 1.0 / (AT_REST if rests else self.hub.rate), time.monotonic())
            if self.runner.wait(next_time - time.monotonic()):
                next_time = time.monotonic()

    def _show(self, state: StateMessage, report: ReportMessage | None) -> None:
        try:
            self.hub.show(state, report)
        finally:
            self._shown.set()

    def _report(self) -> None:
        """Report on all robots, as long as they move and are watched."""
        edition, reporters = -1, dict[str, Reporter]()
        rested = with_reactions = False  # whether the last reports are of robots at rest, and have reactions
        while not self._over.is_set():
            begin, state = time.monotonic(), self._state
            drawn = None if state is None else self._drawn.get(state.edition)
            if state is not None and drawn is not None and (self.hub.clients or not self._reports[1]):
                if state.edition != edition:
                    edition, rested = state.edition, False
                    reporters = {name: Reporter(robot) for name, robot in drawn.setup.robots.items()}
                    self._reports = edition, {}
                wanted = self.hub.wants_reactions
                if not (rested and state.at_rest and wanted == with_reactions):
                    rested, with_reactions = state.at_rest, wanted
                    for name, reporter in reporters.items():
                        with contextlib.suppress(CinegenError, np.linalg.LinAlgError):  # the last report stays
                            self._reports[1][name] = reporter.report(state.robots[name], state.time, wanted)
                self._reported += 1
            spent, rate = time.monotonic() - begin, AT_REST if rested else REPORTS
            self._unreported.wait(max(1.0 / rate - spent, spent * (1.0 / _SHARE - 1.0)))
            self._unreported.clear()

    def _watch_files(self, watched: WatchedFiles[_Drawn]) -> None:
        """Read files again when they are saved, and hand on what they describe."""
        edition = 0
        while (reading := watched.wait(self._over)) is not None:
            for text in reading.warnings:
                self.server.call(self.hub.notify_all, text, True)
            if reading.made is None:
                self.server.call(self.hub.state_problem, reading.problem)
                continue
            edition += 1
            self._drawn[edition] = reading.made
            self.runner.exchange(reading.made.setup, edition)

    def _draw_again(self, setup: Setup) -> _Drawn:
        page = Page(self.title)
        return _Drawn(setup, page, draw(page, setup, self.scene))

    def _exchange(self, edition: int) -> Setup:
        """Show the robots of another setup, which the session goes on with; return it."""
        drawn = self._drawn[edition]
        self._edition, self.scene = edition, drawn.scene
        self._unreported.set()
        for old in [number for number in tuple(self._drawn) if number < edition]:
            del self._drawn[old]
        self.server.call(self._meet, drawn.setup)
        self.page.replace(ROOT, drawn.page)  # browsers know its robots by then
        drawn.scene.move_to(self.page)
        return drawn.setup

    def _meet(self, setup: Setup) -> None:
        self.setup = setup
        self.hub.exchange(setup)
        self.hub.state_problem("")

    def _rate(self, timing: RecentTiming, at_rest: bool) -> TickRate:
        report = self.runner.report()
        ticks, missed = timing.add(report)
        late = 1e3 * report.late.p99
        return TickRate(ticks, missed, report.skipped + report.pending, late, at_rest)


def title_of(setup: Setup) -> str:
    """Return the title of a session's page: its robots' names."""
    return ", ".join(setup.robots)


def draw(page: Page, setup: Setup, before: RobotScene | None = None) -> RobotScene:
    """Draw the robots of a session, what they hold, and the obstacles into a page, as it begins.

    Args:
        page: page to draw into.
        setup: setup of the session.
        before: scene in whose scale it is drawn, unless its size differs much.
    """
    scene = RobotScene(page, setup.robots, base_poses_at_start(setup), setup.obstacles, setup.attached, before=before)
    for name, q in setup.starts.items():
        scene.show(name, q)
    avoidance = setup.avoidance
    if avoidance is not None:
        scene.show(avoidance.robot, avoidance.scene.start)
        scene.goal(avoidance.robot, avoidance.scene.goal, avoidance.scene.rotation == 3)
    return scene


def base_poses_at_start(setup: Setup) -> dict[str, pin.SE3]:
    """Return the base poses of a session's robots in the world at the start."""
    placed: dict[str, pin.SE3] = {}
    for name in setup.order():
        base = setup.base(name)
        placed[name] = base.placement
        if base.robot is not None and base.node is not None:
            mounting = setup.robots[base.robot].placement(setup.start(base.robot), base.node)
            placed[name] = placed[base.robot] * mounting * base.placement
    return placed
