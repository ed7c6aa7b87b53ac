"""Twenty clients that ask for all that the rules allow, and one that only watches: it still sees the robot move.

Run as a program, this file is the greedy clients: `test_greedy.py KIND URL`.
"""

from __future__ import annotations

import asyncio
import os
import socket
import subprocess
import sys
from contextlib import suppress
from urllib.parse import urlsplit

import pytest
import tornado.websocket
from browsers import Browser, becomes, get
from tornado.httpclient import AsyncHTTPClient
from tornado.simple_httpclient import SimpleAsyncHTTPClient
from variants import slow

from cinegen.cockpit import Cockpit
from cinegen.cockpit.hub import MOST
from cinegen.cockpit.server import CONNECTIONS
from cinegen.session import arrange

pytestmark = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")
GREEDY = 20


async def fetch(address, path):
    client = AsyncHTTPClient()
    while True:
        with suppress(Exception):
            await client.fetch(f"http://{address}/{path}")


async def draw(address, _):
    """Connect, take the first of the scene, and connect again."""
    while True:
        with suppress(Exception):
            connection = await tornado.websocket.websocket_connect(f"ws://{address}/scene")
            await connection.read_message()
            connection.close()


KINDS = {
    "scenes": (draw, ""),
    "snapshots": (fetch, "snapshot.html"),
}


async def greedy(kind, url):
    behave, what = KINDS[kind]
    AsyncHTTPClient.configure(SimpleAsyncHTTPClient, max_clients=GREEDY, max_buffer_size=1 << 28)
    print("begun", flush=True)
    await asyncio.gather(*(behave(urlsplit(url).netloc, what) for _ in range(GREEDY)))


@pytest.fixture
def page(robot):
    setup = arrange({"delta4": robot("delta4")}, follow="circle")
    with Cockpit(setup, port=0, token="") as one:
        yield one


@pytest.mark.parametrize("kind", ["scenes", *slow("snapshots")])
def test_an_honest_viewer_sees_states_among_greedy_clients(page, kind):
    command = ["nice", sys.executable, __file__, kind, page.url]  # they must not starve the machine
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as others:
        try:
            assert others.stdout.readline() == "begun\n"
            browser = Browser(page.url)
            assert becomes(lambda: browser.state is not None)
            before = browser.frames
            assert becomes(lambda: browser.frames >= before + 40, 60.0)  # two seconds on a machine of its own
            assert others.poll() is None
        finally:
            others.kill()


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


if __name__ == "__main__":
    asyncio.run(greedy(*sys.argv[1:]))
