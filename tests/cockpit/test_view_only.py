"""An address that only shows the session: the server refuses commands from there, whatever the page does."""

import socket
from urllib.parse import parse_qs, urlsplit

import pytest
from browsers import Browser, becomes, get
from tornado.httpclient import HTTPClientError

from cinegen.cockpit.hub import VIEW_ONLY

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
