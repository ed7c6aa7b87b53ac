"""The whole cockpit over real sockets: many browsers, hostile ones, ones that come late."""

import http.client
import socket
from urllib.parse import urlsplit

import numpy as np
import pytest
from browsers import Browser, becomes, get
from tornado.httpclient import HTTPClientError

from cinegen.cockpit import Cockpit
from cinegen.cockpit.handlers import LARGEST
from cinegen.cockpit.server import ServerError
from cinegen.session import arrange


def drag(browser, robot, node, by):
    """Drag a node's origin."""
    place = origin(browser, robot, node)
    browser.say("start_drag", robot=robot, node=node, point=[0, 0, 0])
    browser.say("move_drag", position=(place + np.array(by)).tolist())
    return place


def origin(browser, robot, node):
    """Where a node is, as the page is told; the robots here stand in the origin."""
    entry = next(entry for entry in browser.told[0]["robots"] if entry["name"] == robot)
    k = 7 * (1 + [listed["name"] for listed in entry["nodes"]].index(node))
    return np.array(browser.state["poses"][robot][k : k + 3])


def _is_at(browser, robot, node, place):
    return np.linalg.norm(origin(browser, robot, node) - place) < 1e-6


def test_what_one_browser_drags_all_see(cockpit):
    live_cockpit = cockpit("delta4", "five_bar")
    first, second = Browser(live_cockpit.url), Browser(live_cockpit.url)
    assert becomes(lambda: first.state and second.state)
    before = drag(first, "delta4", "platform", [0.1, 0.05, -0.2])
    to = before + np.array([0.1, 0.05, -0.2])
    assert becomes(lambda: _is_at(first, "delta4", "platform", to) and _is_at(second, "delta4", "platform", to))
    assert becomes(lambda: second.state["controller"] == first.told[0]["client"])
    late = Browser(live_cockpit.url)
    assert becomes(lambda: late.state is not None and late.report is not None)
    assert late.state["tasks"][0]["node"] == "platform"
    first.leave()
    assert becomes(lambda: second.state["controller"] is None and second.state["tasks"] == [])


def test_hello_says_who_is_there(cockpit):
    live_cockpit = cockpit("delta4", follow="circle")
    browser = Browser(live_cockpit.url)
    assert becomes(lambda: browser.told)
    hello = browser.told[0]
    (robot,) = hello["robots"]
    mechanism = live_cockpit.setup.robots["delta4"]
    assert [node["name"] for node in robot["nodes"]] == list(mechanism.nodes)
    parents = {node["name"]: node["parent"] for node in robot["nodes"]}
    assert parents["base"] is None
    assert parents["link2"] == "link1"
    assert all(parents[node] is not None for node in parents if node != "base")
    assert [loop["name"] for loop in robot["loops"]] == [loop.name for loop in mechanism.loops]
    choices = [None, "1", "path", "gamepad"]
    assert hello["switches"] == [{"robot": "delta4", "node": "platform", "choices": choices, "first": "path"}]


def test_nonsense_oversized_messages_silence_and_laziness_hold_up_nobody_else(cockpit):
    live_cockpit = cockpit("delta4")
    wild, large, lazy, good = (Browser(live_cockpit.url, lazy=k == 2) for k in range(4))
    assert becomes(lambda: all(browser.state for browser in (wild, large, lazy, good)))
    wild.say(b"\x00\x01\x02")
    assert becomes(lambda: wild.closed is not None)
    assert wild.closed[0] == 1008
    assert "text" in wild.closed[1]
    address = urlsplit(live_cockpit.url)
    dumb, rude = (socket.create_connection((address.hostname, address.port)) for _ in range(2))  # one says nothing
    rude.sendall(b"GET /session HTTP/1.1\r\n\x00\xff garbage\r\n\r\n")
    large.say("x" * (2 * LARGEST))
    assert becomes(lambda: large.closed is not None)
    assert large.closed[0] == 1009
    before = drag(good, "delta4", "platform", [0, 0, -0.1])
    assert becomes(lambda: _is_at(good, "delta4", "platform", before + np.array([0, 0, -0.1])))
    assert lazy.frames == 1 < good.frames
    for peer in (dumb, rude):
        peer.close()


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_nobody_gets_in_without_the_token(cockpit, host):
    live_cockpit = cockpit("planar_3r", host=host)
    token = live_cockpit.server.token
    assert token
    assert token in live_cockpit.url
    address = urlsplit(live_cockpit.url)
    local = f"http://127.0.0.1:{address.port}/"
    assert get(local)[0] == 403
    assert get(f"{local}?token=wrong")[0] == 403
    assert get(f"{local}?token={token}")[0] == 200
    assert get(f"{local}?token={token}", host="robot.example:1234")[0] == 200
    for path in ("session", "page", "snapshot.html", "map/about.json", "map/cells.bin", "map/cell/7"):
        assert get(local, path)[0] == 403
    with pytest.raises(HTTPClientError, match="403"):
        Browser(local)
    browser = Browser(f"{local}?token={token}")
    assert becomes(lambda: browser.state is not None)


def test_the_snapshot_shows_everything_as_it_is(cockpit):
    live_cockpit = cockpit("delta4", follow="circle")
    first = live_cockpit.snapshot()
    assert becomes(lambda: live_cockpit.snapshot() != first)
    status, page = get(live_cockpit.url, "snapshot.html")
    assert status == 200
    assert b"MeshCat.Viewer" in page


def test_a_port_in_use_is_passed_over(cockpit):
    live_cockpit = cockpit("planar_3r")
    assert cockpit("planar_3r", port=live_cockpit.server.port).server.port > live_cockpit.server.port


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"port": 70000}, "no free port from 70000"),
        ({"host": "no such host"}, "no such host"),
        ({"host": "0.0.0.0", "token": "", "own_process": True}, "needs a token"),
    ],
)
def test_where_the_page_cant_be_served_the_session_ends(robot, options, why):
    """`nothing_is_left` looks for its thread or process."""
    with pytest.raises(ServerError, match=why):
        Cockpit(arrange({"r": robot("planar_3r")}), **{"own_process": False, **options})


def test_the_end_of_a_session_is_told(cockpit, monkeypatch):
    live_cockpit = cockpit("delta4")
    browser = Browser(live_cockpit.url)
    assert becomes(lambda: browser.state is not None)
    live_cockpit.close()
    assert becomes(lambda: browser.closed is not None)
    assert browser.closed == (1001, "the session has ended")


def test_every_answer_has_the_headers_that_protect_it(cockpit):
    live_cockpit = cockpit("planar_3r", host="0.0.0.0")
    address = urlsplit(live_cockpit.server.local_url)
    for path in ("", "viewer.js", "snapshot.html", "static/cockpit.js", "static/none.js", "none", "map/about.json"):
        connection = http.client.HTTPConnection(address.netloc, timeout=60)
        connection.request("GET", f"/{path}?{address.query}")
        headers = connection.getresponse().headers
        policy = dict(part.split(maxsplit=1) for part in headers["Content-Security-Policy"].split(";") if part.strip())
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cross-Origin-Opener-Policy"] == "same-origin"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert "frame-ancestors" in policy
        assert "Server" not in headers
        if path == "":
            netloc = f"127.0.0.1:{address.port}"
            assert policy["connect-src"] == f"'self' ws://{netloc} wss://{netloc}"
            assert "*" not in policy["default-src"]
        else:
            assert policy["default-src"] == "'none'"


def test_the_token_is_not_logged_and_is_compared_in_constant_time(cockpit, caplog, monkeypatch, capfd):
    compared = []
    monkeypatch.setattr("hmac.compare_digest", lambda sent, two: compared.append(two) or sent == two)
    live_cockpit = cockpit("planar_3r", host="0.0.0.0")
    for path in ("", "none", "snapshot.html", "static/none.js", "../x"):
        get(live_cockpit.server.local_url, path)
    assert {two.decode() for two in compared} == {live_cockpit.server.token}
    out, err = capfd.readouterr()
    assert live_cockpit.server.token not in caplog.text + out + err
