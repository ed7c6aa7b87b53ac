"""A hand in the page: what it says is judged, and the robot's part follows it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import threading

import numpy as np
import pytest
import tornado.websocket
from hypothesis import given
from hypothesis import strategies as st
from tornado.httpclient import HTTPRequest

from cinegen.show import Driven, Page, Scene, drive
from cinegen.show.hand import FURTHEST, LONGEST, Hand, HandError, after

NODES = {"delta": ("base", "link5"), "arm": ("tool",)}
TAKE = {"take": {"robot": "delta", "node": "link5", "point": [0.1, 0.2, 0.3]}}


def test_a_hand_takes_leads_and_lets_go():
    hand = after(json.dumps(TAKE), None, NODES)
    assert hand == Hand("delta", "link5", (0.1, 0.2, 0.3))
    led = after('{"lead": [1, 2, 3]}', hand, NODES)
    assert led == Hand("delta", "link5", (0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    assert after('{"let go": true}', led, NODES) is None
    assert after('{"lead": [1, 2, 3]}', None, NODES) is None  # on its way when the hand let go


@pytest.mark.parametrize(
    ("message", "says"),
    [
        (b"{}", "text"),
        ("{", "JSON"),
        ("[1]", "object"),
        ("{}", "takes, leads or lets go"),
        ('{"take": 1}', "takes, leads"),
        ('{"take": {"robot": "no", "node": "link5", "point": [0, 0, 0]}}', "no such robot"),
        ('{"take": {"robot": "delta", "node": "tool", "point": [0, 0, 0]}}', "no such part"),
        ('{"take": {"robot": ["delta"], "node": "tool", "point": [0, 0, 0]}}', "no such robot"),
        ('{"take": {"robot": "delta", "node": "link5"}}', "three numbers"),
        ('{"lead": [0, 0]}', "three numbers"),
        ('{"lead": [0, NaN, 0]}', "three numbers"),
        ('{"lead": [0, 1e400, 0]}', "three numbers"),
        (f'{{"lead": [0, {10 * FURTHEST}, 0]}}', "three numbers"),
        ('{"lead": [0, true, 0]}', "three numbers"),
        ('{"lead": "000"}', "three numbers"),
        ("[" * LONGEST, "JSON"),
        ('"' + "x" * LONGEST + '"', "characters at most"),
    ],
)
def test_what_makes_no_sense_is_told(message, says):
    with pytest.raises(HandError, match=says):
        after(message, Hand("delta", "link5", (0.0, 0.0, 0.0)), NODES)


ANYTHING = st.recursive(st.none() | st.booleans() | st.floats() | st.text(), st.lists)


@given(st.text() | st.binary() | ANYTHING.map(json.dumps))
def test_nothing_else_ever_happens(message):
    with contextlib.suppress(HandError):
        assert after(message, None, NODES) is None


class Browser:
    """What a browser says and is told, from a thread of its own."""

    def __init__(self, url):
        self.loop = asyncio.new_event_loop()
        threading.Thread(target=self.loop.run_forever, daemon=True).start()
        request = HTTPRequest(url.replace("http:", "ws:") + "scene")
        self.connection = self._now(tornado.websocket.websocket_connect, request)

    def _now(self, function, *arguments):
        async def wait():
            return await function(*arguments)

        return asyncio.run_coroutine_threadsafe(wait(), self.loop).result(20)

    def say(self, **said):
        self._now(self.connection.write_message, json.dumps(said))

    def closed(self):
        """Why it was closed, once it is."""
        while self._now(self.connection.read_message) is not None:
            pass
        return self.connection.close_code, self.connection.close_reason

    def leave(self):
        self.loop.call_soon_threadsafe(self.connection.close)


@pytest.fixture
def moved(robot):
    """A delta robot that stands in a page until it is taken; it moves as long as the test lasts."""
    delta = robot("delta4")
    page = Page()
    scene = Scene(page, {"delta": delta})
    driven = {"delta": Driven.still(delta)}
    url = page.serve(port=8100)
    over = threading.Event()

    def report(*_):
        if over.is_set():
            raise KeyboardInterrupt  # what ends a drive

    thread = threading.Thread(target=drive, args=(scene, driven, 120.0, report), daemon=True)
    thread.start()
    yield page, url, driven["delta"]
    over.set()
    thread.join(20)


def waits_for(condition):
    """Whether it comes true within 20 s."""
    pause = threading.Event()
    return any(condition() or pause.wait(0.02) for _ in range(1000))


def test_the_part_that_is_taken_follows_and_stays_where_it_is_left(moved):
    page, url, one = moved
    mechanism, point = one.mechanism, np.array([0.1, 0.0, 0.0])

    def place():
        return mechanism.placement(one.solver.q, "link5").act(point)

    browser, home = Browser(url), mechanism.placement(mechanism.q_home, "link5").act(point)
    browser.say(take={"robot": "delta", "node": "link5", "point": point.tolist()})
    target = home + np.array([0.1, 0.05, -0.2])
    browser.say(lead=target.tolist())
    assert waits_for(lambda: np.linalg.norm(place() - target) < 1e-6)
    assert one.step.closure < 1e-11
    browser.say(**{"let go": True})
    assert waits_for(lambda: one.pull is None)
    assert np.linalg.norm(place() - target) < 1e-6
    assert page.hands == {}


def test_who_takes_first_holds_until_gone(moved):
    page, url, one = moved
    first, second = Browser(url), Browser(url)
    first.say(take={"robot": "delta", "node": "link5", "point": [0, 0, 0]})
    assert waits_for(lambda: page.hands.get("delta", Hand("", "", (0, 0, 0))).node == "link5")
    second.say(take={"robot": "delta", "node": "link2", "point": [0, 0, 0]})
    second.say(lead=[0.0, 0.0, -1.0])
    assert waits_for(lambda: len([b for b in page._browsers if b.hand is not None]) == 2)
    assert page.hands["delta"].node == "link5"
    first.leave()
    assert waits_for(lambda: page.hands["delta"].node == "link2")
    assert waits_for(lambda: one.pull is not None and one.pull.node == "link2")


def test_who_talks_nonsense_is_heard_no_more_and_told_why(moved):
    page, url, _ = moved
    wild, good = Browser(url), Browser(url)
    wild.say(take={"robot": "delta", "node": "nose", "point": [0, 0, 0]})
    assert wild.closed() == (1008, "there is no such part")
    good.say(take={"robot": "delta", "node": "link5", "point": [0, 0, 0]})
    assert waits_for(lambda: "delta" in page.hands)
