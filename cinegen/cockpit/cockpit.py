"""`Cockpit`: a session that people drive from a page."""

from __future__ import annotations

import contextlib
import threading
import time
from types import TracebackType
from typing import Any, Self

import numpy as np
import pinocchio as pin

from cinegen.cockpit import frames
from cinegen.cockpit.chart import Chart
from cinegen.cockpit.hub import Hub
from cinegen.cockpit.page import Page
from cinegen.cockpit.scene import Scene
from cinegen.cockpit.server import Server
from cinegen.errors import CinegenError
from cinegen.session import Loop, Report, Reporter, Setup, State, Vocabulary, is_obstacle

FRAMES = 60
"""A second, that pages are sent."""

REPORTS = 10
"""A second, of singularities and what lies ahead; fewer where they take long."""

_SHARE = 0.15  # of a core, that reports may take


class Cockpit:
    """Runs a session, and serves the page that it is driven from.

    Args:
        setup: of the session.
        title: of the page; the robots' names unless given.
        host: the address to listen on; others than this machine's own need a token.
        port: the first to try.
        token: that browsers must know, where one is needed; made up unless given.
        own_process: whether the session runs in a process of its own, undisturbed by this one.
        framed: whether any other page may show this one in a frame, as notebooks do.

    Raises:
        CinegenError: there can't be such a session, or its page can't be served.
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
    ) -> None:
        self.setup = setup
        self.title = title or title_of(setup)
        self.page = Page(self.title)
        self.scene = draw(self.page, setup)
        self.chart = None if setup.map is None else Chart(setup.map)
        self.loop = Loop(setup, own_process)
        self.hub = Hub(Vocabulary.of(setup), self.loop.send, self._hello)
        self.server = Server(self.page, self.hub, self.snapshot, host, token, framed, self.chart)
        self._over = threading.Event()
        self._reports: dict[str, Report] = {}
        self._reported = 0
        self.error: BaseException | None = None
        try:
            self.server.start(port)
        except BaseException:
            self.loop.stop()
            raise
        self._threads = [
            threading.Thread(target=self._feed, name="cinegen frames", daemon=True),
            threading.Thread(target=self._report, name="cinegen reports", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def url(self) -> str:
        """Where the page is."""
        return self.server.url

    @property
    def state(self) -> State:
        """The session's newest.

        Raises:
            Exception: what ended the session.
        """
        while (state := self.loop.state) is None:  # in its first tick
            time.sleep(0.001)
        return state

    def snapshot(self) -> str:
        """The page as one file that needs no server, as everything is now."""
        for name, robot in self.state.robots.items():
            self.scene.show(name, robot.q, robot.base)
        return self.page.html()

    def wait(self, seconds: float | None = None) -> bool:
        """Waits until the time is over, or the session has ended; whether it has.

        Raises:
            Exception: what ended it.
        """
        over = self._over.wait(seconds)
        if self.error is not None:
            raise self.error
        return over

    def close(self) -> None:
        """Ends the session and the server."""
        self._over.set()
        for thread in self._threads:
            thread.join(5.0)
        self.server.stop()
        self.loop.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # --- threads -------------------------------------------------------------------------------------------------

    def _hello(self, client: int) -> dict[str, Any]:
        return frames.hello(self.setup, self.title, client, self.state.replay)

    def _feed(self) -> None:
        """Tells all pages where everything is."""
        poses = frames.Poses(self.setup.robots)
        told, noticed, shown = 0, 0, None
        next_time = time.monotonic()
        while not self._over.is_set():
            try:
                state = self.loop.state
            except BaseException as error:
                self.error = error
                self.server.call(self.hub.tell_all, f"the session has ended: {error}", True)
                self._over.set()
                return
            if state is not None and state is not shown:
                shown = state
                report = None
                if self._reported > told:
                    told = self._reported
                    report = frames.report(self.setup, state, self._reports, self._rate(), len(self.hub.clients))
                self.server.call(self.hub.show, frames.frame(state, poses), report)
                for notice in state.notices:
                    if notice.number > noticed:
                        noticed = notice.number
                        self.server.call(self.hub.tell_all, notice.words, notice.warning)
            next_time = max(next_time + 1.0 / FRAMES, time.monotonic())
            self._over.wait(next_time - time.monotonic())

    def _report(self) -> None:
        """Looks at all robots, now and then."""
        reporters = {name: Reporter(one) for name, one in self.setup.robots.items() if not is_obstacle(one)}
        while not self._over.is_set():
            begin = time.monotonic()
            state = self.loop.state if self.error is None else None
            if state is not None and (self.hub.clients or not self._reports):
                for name, reporter in reporters.items():
                    with contextlib.suppress(CinegenError, np.linalg.LinAlgError):  # then the last one stays
                        self._reports[name] = reporter.report(state.robots[name], state.time)
                self._reported += 1
            spent = time.monotonic() - begin
            self._over.wait(max(1.0 / REPORTS - spent, spent * (1.0 / _SHARE - 1.0)))

    def _rate(self) -> tuple[float, float]:
        """Ticks a second, and by how many ms 99 % of them are late at most."""
        report = self.loop.report()
        return (1.0 / report.mean if report.mean > 0.0 else 0.0), 1e3 * report.late.p99


def title_of(setup: Setup) -> str:
    """What a session's page is called: its robots' names."""
    return ", ".join(name for name, mechanism in setup.robots.items() if not is_obstacle(mechanism))


def draw(page: Page, setup: Setup) -> Scene:
    """The robots of a session in a page, as it begins."""
    scene = Scene(page, setup.robots, standing(setup))
    around = setup.surroundings
    if around is not None:
        scene.show(around.robot, around.scene.start)
        scene.goal(around.robot, around.scene.goal, around.scene.rotation == 3)
    return scene


def standing(setup: Setup) -> dict[str, pin.SE3]:
    """Where the robots of a session stand while all are at home."""
    placed: dict[str, pin.SE3] = {}
    for name in setup.order():
        stand = setup.stand(name)
        placed[name] = stand.placement
        if stand.robot is not None and stand.node is not None:
            carrier = setup.robots[stand.robot]
            placed[name] = placed[stand.robot] * carrier.placement(carrier.q_home, stand.node) * stand.placement
    return placed
