"""Clients that ask for scenes without end, and one that only watches: it still sees the robot move."""

import asyncio
import http.client
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from urllib.parse import urlsplit

import pytest
import tornado.websocket
from browsers import Browser, becomes, get

from cinegen.cockpit import Cockpit
from cinegen.cockpit.handlers import _TURN
from cinegen.cockpit.server import CONNECTIONS
from cinegen.session import arrange

pytestmark = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")
GREEDY = 8


async def draw(address, drawn):
    """Connect, take the first of the scene, and connect again."""
    while True:
        with suppress(Exception):
            connection = await tornado.websocket.websocket_connect(f"ws://{address}/page")
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


def test_pages_and_connections_are_limited(page, monkeypatch):
    monkeypatch.setattr("cinegen.cockpit.hub.MOST", 4)
    pages = [Browser(page.url, path="page") for _ in range(4)]
    one_more = Browser(page.url, path="page")
    assert becomes(lambda: one_more.closed is not None)
    assert one_more.closed == (1013, "this session has 4 clients already")
    for one in pages:
        one.leave()


def test_half_open_connections_keep_nobody_out(page):
    """Twice as many as there may be: the oldest have gone, and who asks is answered at once."""
    silent = []
    for k in range(2 * CONNECTIONS):
        silent.append(socket.create_connection(("127.0.0.1", page.server.port), timeout=10.0))
        silent[-1].sendall((b"", b"GET / HTTP/1.1\r\n", b"\x16\x03\x01")[k % 3])
    assert get(page.url)[0] == 200
    with suppress(ConnectionResetError):
        assert silent[0].recv(1) == b""
    for one in silent:
        one.close()


def test_connections_that_are_answered_are_not_closed_for_others(page, monkeypatch):
    monkeypatch.setattr("cinegen.cockpit.server.CONNECTIONS", 2)
    inside, go = threading.Event(), threading.Event()
    snapshot = page.server.snapshot

    def wait_inside():
        inside.set()
        assert go.wait(20)
        return snapshot()

    page.server.snapshot = wait_inside
    with ThreadPoolExecutor(2) as pool:
        try:
            asked = [pool.submit(get, page.url, "snapshot.html") for _ in range(2)]
            assert inside.wait(20)
            assert becomes(lambda: len(page.server.http._answered) == 2)
            with pytest.raises((ConnectionError, http.client.RemoteDisconnected)):
                get(page.url)
        finally:
            go.set()
        assert [one.result(20)[0] for one in asked] == [200, 200]
    assert becomes(lambda: _is_served(page.url))


@pytest.mark.parametrize("deadline", ["_SLOW", "_FIRST"])
def test_who_asks_slowly_is_disconnected(robot, monkeypatch, deadline):
    monkeypatch.setattr(f"cinegen.cockpit.server.{deadline}", 0.3)
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
