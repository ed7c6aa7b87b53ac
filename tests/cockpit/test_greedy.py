"""Twenty clients that ask for all that the rules allow, and one that only watches: it still sees the robot move.

Run as a program, this file is the greedy clients: `test_greedy.py KIND URL`.
"""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from urllib.parse import urlsplit

import pytest
import tornado.websocket
from browsers import Browser, becomes, get
from tornado.httpclient import AsyncHTTPClient
from tornado.simple_httpclient import SimpleAsyncHTTPClient

from cinegen.cockpit import Cockpit
from cinegen.cockpit.hub import MOST
from cinegen.cockpit.server import CONNECTIONS
from cinegen.session import arrange

GREEDY = 20
VIEW = json.dumps({"type": "set_view", "quaternion": [0, 0, 0, 1]})


async def talk(address, message):
    """Send just under 400 messages per second, and acknowledge every state."""
    connection = await tornado.websocket.websocket_connect(f"ws://{address}/session")

    async def listen():
        while (text := await connection.read_message()) is not None:
            message = json.loads(text)
            if message["type"] == "state":
                await connection.write_message(json.dumps({"type": "ack", "frame": message["frame"]}))

    listening = asyncio.ensure_future(listen())
    while not listening.done():
        for _ in range(16):
            await connection.write_message(message)
        await asyncio.sleep(0.05)


async def take_turns(address, message):
    """Connect, take control, send as many messages as are allowed at once, and connect again."""
    while True:
        with suppress(Exception):
            connection = await tornado.websocket.websocket_connect(f"ws://{address}/session")
            await connection.write_message(json.dumps({"type": "request_control", "on": True}))
            for _ in range(390):
                await connection.write_message(message)
            await asyncio.sleep(0.2)
            connection.close()


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
    "views": (talk, VIEW),
    "controls": (talk, json.dumps({"type": "request_control", "on": True})),
    "refused commands": (talk, json.dumps({"type": "undo"})),
    "slow commands": (talk, json.dumps({"type": "move_home"})),
    "slow commands in turns": (take_turns, json.dumps({"type": "move_home"})),
    "snapshots": (fetch, "snapshot.html"),
    "viewers": (fetch, "viewer.js"),
    "pages": (fetch, ""),
    "scenes": (draw, ""),
}


async def greedy(kind, url):
    behave, what = KINDS[kind]
    AsyncHTTPClient.configure(SimpleAsyncHTTPClient, max_clients=GREEDY, max_buffer_size=1 << 28)
    print("begun", flush=True)
    await asyncio.gather(*(behave(urlsplit(url).netloc, what) for _ in range(GREEDY)))


@pytest.fixture
def page(robot):
    setup = arrange({"delta4": robot("delta4")}, follow="circle")
    with Cockpit(setup, port=8300, token="") as one:
        yield one


HARDEST = ("scenes",)


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[] if kind in HARDEST else pytest.mark.slow) for kind in KINDS]
)
@pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")
def test_an_honest_viewer_sees_states_among_greedy_clients(page, kind):
    command = ["nice", sys.executable, __file__, kind, page.url]  # they must not starve the machine
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as others:
        try:
            assert others.stdout.readline() == "begun\n"
            time.sleep(1.0)
            browser = Browser(page.url)
            assert becomes(lambda: browser.state is not None)
            before = browser.frames
            assert becomes(lambda: browser.frames >= before + 60, 60.0)  # three seconds on a machine of its own
            assert others.poll() is None
        finally:
            others.kill()


def _is_served(url):
    with suppress(OSError):
        return get(url)[0] == 200
    return False


@pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")
def test_scenes_and_connections_are_limited(page):
    import socket

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


@pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")
def test_who_asks_slowly_is_disconnected(robot, monkeypatch):
    import socket

    monkeypatch.setattr("cinegen.cockpit.server._SLOW", 0.3)
    with Cockpit(arrange({"delta4": robot("delta4")}), port=8300, token="", own_process=False) as one:
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
