"""The whole cockpit over real sockets: browsers that come late or only view, its headers and tokens, and HTTPS."""

import asyncio
import hashlib
import http.client
import json
import socket
import ssl
import urllib.error
import urllib.request
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from browsers import Browser, becomes, get
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from cinegen.cockpit import Cockpit
from cinegen.cockpit.certificate import self_signed
from cinegen.cockpit.handlers import LARGEST
from cinegen.cockpit.hub import VIEW_ONLY
from cinegen.cockpit.server import ServerError
from cinegen.session import Setup, arrange


def origin(browser, robot, node):
    """Where a node is, as the page is told; the robots here stand in the origin."""
    entry = next(entry for entry in browser.told[0]["robots"] if entry["name"] == robot)
    k = 7 * (1 + [listed["name"] for listed in entry["nodes"]].index(node))
    return np.array(browser.state["poses"][robot][k : k + 3])


def test_what_one_browser_drags_all_see(cockpit):
    live_cockpit = cockpit("delta4", "five_bar")
    first, second = Browser(live_cockpit.url), Browser(live_cockpit.url)
    assert becomes(lambda: first.state and second.state)
    to = origin(first, "delta4", "platform") + np.array([0.1, 0.05, -0.2])
    first.say("start_drag", robot="delta4", node="platform", point=[0, 0, 0])
    first.say("move_drag", position=to.tolist())

    def is_seen_by(browser):
        return np.linalg.norm(origin(browser, "delta4", "platform") - to) < 1e-6

    assert becomes(lambda: is_seen_by(first) and is_seen_by(second))
    assert becomes(lambda: second.state["controller"] == first.told[0]["client"])
    late = Browser(live_cockpit.url)
    assert becomes(lambda: late.state is not None and late.report is not None)
    assert late.state["tasks"][0]["node"] == "platform"
    first.leave()
    assert becomes(lambda: second.state["controller"] is None and second.state["tasks"] == [])


def test_who_sends_too_much_at_once_is_dropped(cockpit):
    browser = Browser(cockpit("delta4").url)
    browser.say("x" * (2 * LARGEST))
    assert becomes(lambda: browser.closed is not None)
    assert browser.closed[0] == 1009


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


# --- view only --------------------------------------------------------------------------------------------------------
# An address that only shows the session: the server refuses commands from there, whatever the page does.


COMMANDS = [
    {"said": "request_control", "on": True},
    {"said": "start_drag", "robot": "delta4", "node": "link5", "point": [0, 0, 0]},
    {"said": "move_joint", "robot": "delta4", "joint": "joint1", "value": 0.1},
    {"said": "set_recording", "on": True},
    {"said": "change_settings", "damping": 0.3},
    {"said": "pause", "on": True},
    {"said": "undo"},
]


@pytest.fixture
def page(cockpit):
    return cockpit("delta4")


def notices(browser):
    return [said["text"] for said in browser.told if said["type"] == "notice"]


def test_it_sees_what_all_see(page):
    for path in ("", "snapshot.html", "viewer.js"):
        assert get(page.view_url, path)[0] == 200
    viewer, driver = Browser(page.view_url), Browser(page.url)
    scene = Browser(page.view_url, path="page")
    assert becomes(lambda: viewer.state is not None and driver.state is not None and scene.state is not None)
    assert [client.told[0]["view_only"] for client in (viewer, driver, scene)] == [True, False, True]
    assert [client.told[0]["view_token"] for client in (viewer, driver, scene)] == [None, page.server.view_token, None]
    assert any(isinstance(drawn, bytes) for drawn in scene.told)
    driver.say("move_joint", robot="delta4", joint="joint1", value=0.1)
    assert becomes(lambda: viewer.state["controller"] == driver.told[0]["client"])
    for client in (viewer, driver, scene):
        client.leave()


def test_its_commands_are_refused(page):
    viewer = Browser(page.view_url)
    assert becomes(lambda: viewer.state is not None)
    q = page.q["delta4"]
    for count, command in enumerate(COMMANDS, 1):
        viewer.say(**command)
        assert becomes(lambda count=count: notices(viewer) == [VIEW_ONLY] * count), command
    viewer.say("set_user", name="guest", colour=1)  # who only views may still be seen
    viewer.say("request_reactions", on=True)
    assert becomes(lambda: [user["name"] for user in viewer.users] == ["guest"])
    assert viewer.closed is None
    assert viewer.state["controller"] is None
    state = page.state
    assert (state.paused, state.recording) == (False, None)
    assert (page.q["delta4"] == q).all()
    viewer.leave()


def test_a_method_that_http_does_not_have_is_answered_without_a_traceback(page, caplog):
    address = urlsplit(page.url)
    with socket.create_connection((address.hostname, address.port), timeout=30) as client:
        client.sendall(b"BREW / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        assert client.makefile("rb").read().startswith(b"HTTP/1.1 405 ")
    assert get(page.url)[0] == 200  # by now what was logged is logged
    assert not caplog.records


def test_neither_token_stands_for_the_other(page):
    (token,), (view,) = parse_qs(urlsplit(page.url).query)["token"], parse_qs(urlsplit(page.view_url).query)["view"]
    assert token != view
    bare = page.url.partition("?")[0]
    for query in (f"token={view}", f"view={token}", "view=", "view", "token=&view="):
        assert get(f"{bare}?{query}")[0] == 403
        with pytest.raises(HTTPClientError, match="403"):
            Browser(f"{bare}?{query}")
    both = Browser(f"{bare}?view={view}&token={token}")  # who has the token may drive
    assert becomes(lambda: both.told)
    assert both.told[0]["view_only"] is False
    both.leave()


def test_a_page_without_a_token_is_open_to_all(cockpit):
    assert cockpit("delta4", token="").view_url is None


# --- HTTPS ------------------------------------------------------------------------------------------------------------
# Its own certificate, and everything encrypted.


def test_a_page_and_its_session_are_encrypted_with_the_certificate_that_is_printed(robot, tmp_path, caplog):
    with Cockpit(Setup({"four_bar": robot("four_bar")}), port=0, https=True, own_process=False) as cockpit:
        server, path = cockpit.server, tmp_path / "certificate.pem"
        certificate = ssl.get_server_certificate(("127.0.0.1", server.port))
        digest = hashlib.sha256(ssl.PEM_cert_to_DER_cert(certificate)).hexdigest().upper()
        assert server.certificate.fingerprint == ":".join(digest[i : i + 2] for i in range(0, 64, 2))
        path.write_text(certificate)
        context = ssl.create_default_context(cafile=str(path))  # trusts that one alone; the name is checked, too
        with urllib.request.urlopen(server.local_url, context=context, timeout=60) as answer:
            assert answer.status == 200
        with pytest.raises(ConnectionError):
            urllib.request.urlopen(server.local_url.replace("https:", "http:"), timeout=60)
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(server.local_url.partition("?")[0], context=context, timeout=60)

        async def first():
            line = await websocket_connect(HTTPRequest(server.session_url, ssl_options=context))
            try:
                return json.loads(await line.read_message())
            finally:
                line.close()

        assert server.session_url.startswith("wss://")
        assert asyncio.run(first())["type"] == "hello"
    assert not caplog.records  # who spoke HTTP did not write to the terminal


@pytest.mark.parametrize("host", ["robot-pc", "::1"])
def test_certificates_are_of_any_host(host):
    first, other = self_signed(host), self_signed(host)
    assert first.fingerprint != other.fingerprint
