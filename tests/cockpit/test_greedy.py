"""Clients that ask for scenes without end, and one that only watches: it still sees the robot move."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from contextlib import suppress
from urllib.parse import urlsplit

import pytest
import tornado.websocket
from browsers import Browser, becomes, get

from cinegen.cockpit import Cockpit
from cinegen.cockpit.hub import MOST
from cinegen.cockpit.server import _TURN, CONNECTIONS
from cinegen.session import arrange

pytestmark = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")
GREEDY = 8


async def draw(address, drawn):
    """Connect, take the first of the scene, and connect again."""
    while True:
        with suppress(Exception):
            connection = await tornado.websocket.websocket_connect(f"ws://{address}/scene")
            await connection.read_message()
            drawn.append(address)
            connection.close()


@pytest.fixture
def page(robot):
    setup = arrange({"delta4": robot("delta4")}, follow="circle")
    with Cockpit(setup, port=0, token="", own_process=False) as one:
        yield one


@pytest.fixture
def greedy():
    """`greedy(url)`: begins, with an event loop of their own; a list that grows with each scene."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    begun, drawn = [], []

    def begin(url):
        address = urlsplit(url).netloc
        begun.extend(asyncio.run_coroutine_threadsafe(draw(address, drawn), loop) for _ in range(GREEDY))
        return drawn

    yield begin
    for one in begun:
        one.cancel()
    loop.call_soon_threadsafe(loop.stop)
    thread.join()


def test_an_honest_viewer_sees_states_among_greedy_clients(page, greedy):
    """Whole scenes are sent one after the other, with a pause after each, however many are asked for."""
    begin = time.monotonic()
    drawn, browser = greedy(page.url), Browser(page.url)
    assert becomes(lambda: browser.frames >= 20 and len(drawn) >= 20, 60.0)
    assert len(drawn) <= (time.monotonic() - begin) / _TURN + 1


def _is_served(url):
    with suppress(OSError):
        return get(url)[0] == 200
    return False


def test_scenes_and_connections_are_limited(page):
    scenes = [Browser(page.url, path="scene") for _ in range(MOST)]
    one_more = Browser(page.url, path="scene")
    assert becomes(lambda: one_more.closed is not None)
    assert one_more.closed == (1013, f"this session has {MOST} clients already")
    for scene in scenes:
        scene.leave()
    silent = [socket.create_connection(("127.0.0.1", page.server.port)) for _ in range(CONNECTIONS)]
    late = socket.create_connection(("127.0.0.1", page.server.port))
    late.settimeout(5.0)
    with suppress(ConnectionResetError):
        assert late.recv(1) == b""
    for one in (*silent, late):
        one.close()
    assert becomes(lambda: _is_served(page.url))  # once the server has seen that they have gone


def test_who_asks_slowly_is_disconnected(robot, monkeypatch):
    monkeypatch.setattr("cinegen.cockpit.server._SLOW", 0.3)
    with Cockpit(arrange({"delta4": robot("delta4")}), port=0, token="", own_process=False) as one:
        for half in (
            b"",
            b"GET / HTTP/1.1\r\nHost: ",
            b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\nabc",
        ):
            peer = socket.create_connection(("127.0.0.1", one.server.port))
            peer.settimeout(5.0)
            peer.sendall(half)
            assert peer.recv(1) == b""
            peer.close()
