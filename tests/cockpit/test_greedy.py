"""Clients that ask for scenes without end, and one that only watches: it still sees the robot move."""

import contextlib
import gc
import http.client
import json
import logging
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import pytest
from browsers import Browser, becomes, get
from campaign.served import UPGRADE, Peer
from tornado.httpclient import HTTPClientError

from cinegen.cockpit import Cockpit
from cinegen.cockpit.handlers import _TURN
from cinegen.cockpit.server import CONNECTIONS
from cinegen.session import arrange

GREEDY = 8


@pytest.fixture
def page(cockpit):
    return cockpit("delta4", follow="circle", token="")


@pytest.fixture
def greedy():
    """`greedy(url)`: clients begin to ask for the scene, take the first of it, and ask again; a list that grows with
    each scene."""
    over, drawn = threading.Event(), []

    def ask(url):
        while not over.is_set():
            with suppress(Exception):
                browser = Browser(url, path="page")
                try:
                    if becomes(lambda browser=browser: browser.told or over.is_set()):
                        drawn.append(url)
                finally:
                    browser.leave()

    def begin(url):
        for _ in range(GREEDY):
            pool.submit(ask, url)
        return drawn

    with ThreadPoolExecutor(GREEDY) as pool:
        yield begin
        over.set()


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
    for browser in pages:
        browser.leave()


def test_half_open_connections_keep_nobody_out(page):
    """Twice as many as there may be: the oldest have gone, and who asks is answered at once."""
    silent = []
    for k in range(2 * CONNECTIONS):
        silent.append(socket.create_connection(("127.0.0.1", page.server.port), timeout=60.0))
        silent[-1].sendall((b"", b"GET / HTTP/1.1\r\n", b"\x16\x03\x01")[k % 3])
    assert get(page.url)[0] == 200
    with suppress(ConnectionResetError):
        assert silent[0].recv(1) == b""
    for peer in silent:
        peer.close()


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
        assert [future.result(20)[0] for future in asked] == [200, 200]
    assert becomes(lambda: _is_served(page.url))


@pytest.mark.parametrize("deadline", ["_SLOW", "_FIRST"])
@pytest.mark.parametrize(
    "half",
    [b"", b"GET / HTTP/1.1\r\nHost: ", b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\nabc"],
)
def test_who_asks_slowly_is_disconnected(cockpit, monkeypatch, deadline, half):
    monkeypatch.setattr(f"cinegen.cockpit.server.{deadline}", 0.3)
    live_cockpit = cockpit("delta4", token="")
    with socket.create_connection(("127.0.0.1", live_cockpit.server.port), timeout=60.0) as peer:
        peer.sendall(half)
        assert peer.recv(1) == b""


# --- hostile ----------------------------------------------------------------------------------------------------------
# Clients that say nonsense or vanish, over real sockets: they are answered, or forgotten, and nothing is logged.


@pytest.fixture
def served(robot, caplog):
    """`served()`: a cockpit that is still served in the end, and in which nobody may have raised anything."""
    caplog.set_level(logging.WARNING)
    used = []

    def use(host="127.0.0.1"):
        setup, token = arrange({"delta4": robot("delta4")}, follow="circle"), None if host == "0.0.0.0" else ""
        used.append(Cockpit(setup, host=host, port=0, token=token, own_process=False))
        return used[-1]

    yield use
    for _ in range(2):
        for live_cockpit in used:
            browser = Browser(live_cockpit.server.local_url)
            assert becomes(lambda browser=browser: browser.state is not None), "the page is served no more"
            browser.leave()
            assert becomes(lambda live_cockpit=live_cockpit: not live_cockpit.hub.clients)
        gc.collect()  # asyncio logs a failure that nobody looked at when it is collected
    for live_cockpit in used:
        live_cockpit.close()
    records = [record for phase in ("setup", "call", "teardown") for record in caplog.get_records(phase)]
    logged = [record.getMessage() for record in records if record.exc_info or record.levelno >= logging.ERROR]
    assert logged == []


def status(peer):
    """The status of the answer to a request."""
    answer = b""
    while b"\r\n" not in answer:
        answer += peer.socket.recv(1000)
    peer.socket.close()
    return int(answer.split()[1])


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ('{"type": "\\ud83d"}', "Input data was truncated"),
        (json.dumps({"type": "😀" * 40}, ensure_ascii=False), "Invalid value '" + "😀" * 26),
        (json.dumps({"type": "ä" * 40}), "Invalid value '" + "ä" * 40 + "'"),
        (json.dumps({"type": "undo", "😀" * 40: 1}), "Object contains unknown field `" + "😀" * 20),
        (json.dumps({"type": "pin", "robot": "ä" * 100, "node": "link5"}), "Unknown robot '" + "ä" * 50),
    ],
    ids=["surrogate", "emoji", "umlauts", "field", "robot"],
)
def test_a_name_that_no_close_frame_can_hold(served, said, why):
    browser = Browser(served().url)
    assert becomes(lambda: browser.state is not None)
    browser.say(said)
    assert becomes(lambda: browser.closed is not None)
    code, reason = browser.closed
    assert code == 1008
    assert reason.startswith(why)
    assert len(reason.encode()) <= 123


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_static_files_that_there_are_not(served, host):
    """Where others may come too, without the token."""
    url = f"http://127.0.0.1:{served(host=host).server.port}/"
    names = ("a" * 4000, "%F0%9F%98%80" * 300, "a/" * 2000, "a%00b", "base/" + "a" * 300, "base", "no")
    outside = ("../cockpit.py", "%2e%2e/cockpit.py", "/etc/passwd")
    assert {name[:20]: get(url, f"static/{name}")[0] for name in names} == {name[:20]: 404 for name in names}
    assert {get(url, f"static/{name}")[0] for name in outside} <= {403, 404}


def test_hosts_that_are_none(served):
    url = served().url
    for host in ("evil.example:80", "127.0.0.1.evil.example", "[::1", "[", "]", "a]b", "[x]", "[127.0.0.1]", ""):
        for path in ("", "session", "page", "snapshot.html", "static/cockpit.js", "map/about.json"):
            assert (host, path, status(Peer(url).request(path, host=host))) == (host, path, 403)


def test_origins_that_are_none(served):
    url = served().url
    for origin in ("http://evil.example", "http://[x", "http://]", "http://[x]:80", "null", "", "😀"):
        for path in ("session", "page"):
            with pytest.raises(HTTPClientError, match="403"):
                Browser(url, path=path, Origin=origin.encode().decode("latin-1"))


def test_tokens_that_are_none(served):
    url = served(host="0.0.0.0").server.local_url.partition("?")[0]
    for token in ("%ff", "%ed%a0%80", "%00", "a" * 9000):
        for path in ("", "session", "snapshot.html"):
            assert status(Peer(url).request(f"{path}?token={token}")) in (400, 403)


@pytest.mark.parametrize("path", ["session", "page", "snapshot.html", "static/cockpit.js"])
def test_who_looks_and_vanishes(served, path):
    """At once, in the middle of the first words, or after some time."""
    live_cockpit = served()
    for delay in (0.0, 0.0005, 0.001, 0.005, 0.02, 0.1):
        for _ in range(4):
            peer = Peer(live_cockpit.url, room=2048).request(path, *(UPGRADE if path in ("session", "page") else ()))
            time.sleep(delay)
            peer.vanish()
    assert becomes(lambda: not live_cockpit.hub.clients and not live_cockpit.server.pages)


def test_who_acknowledges_without_reading_and_vanishes(served):
    """What is sent piles up; it is in the middle of being sent when the connection ends."""
    live_cockpit = served()
    peers = [Peer(live_cockpit.url, room=2048).request("session", *UPGRADE) for _ in range(3)]
    for frame in range(200):
        for peer in peers:
            peer.send(type="ack", frame=frame)
        time.sleep(0.005)
    assert len(live_cockpit.hub.clients) == 3
    for peer in peers:
        peer.vanish()
    assert becomes(lambda: not live_cockpit.hub.clients)


@pytest.mark.parametrize("path", ["session", "page"])
@pytest.mark.parametrize("half", [socket.SHUT_WR, socket.SHUT_RD], ids=["says no more", "hears no more"])
def test_a_connection_that_is_half_open(served, path, half):
    live_cockpit = served()
    peers = [Peer(live_cockpit.url, room=2048).request(path, *UPGRADE) for _ in range(5)]
    assert becomes(lambda: len(live_cockpit.hub.clients) == 5)
    for peer in peers:
        peer.socket.shutdown(half)
    time.sleep(0.1)
    for peer in peers:
        with contextlib.suppress(OSError):
            peer.vanish()
    assert becomes(lambda: not live_cockpit.hub.clients and not live_cockpit.server.pages)


def test_who_answers_no_ping_is_given_up(served, monkeypatch):
    monkeypatch.setattr("cinegen.cockpit.handlers._PING", 0.1)
    live_cockpit = served()
    peers = [Peer(live_cockpit.url).request(path, *UPGRADE) for path in ("session", "page")]
    assert becomes(lambda: len(live_cockpit.hub.clients) == 2 and live_cockpit.server.pages)
    for peer in peers:
        said = b""
        while b"ping timed out" not in said:
            said += peer.socket.recv(1 << 16) or pytest.fail("it ended without a word")
        peer.vanish()  # else tornado waits 5 s for its last word
    assert becomes(lambda: not live_cockpit.hub.clients and not live_cockpit.server.pages)
