"""The page: what is drawn is kept, served to this machine only, and written whole into one file."""

from __future__ import annotations

import asyncio
import http.client
from urllib.parse import urlsplit

import meshcat
import meshcat.geometry
import numpy as np
import pytest
import tornado.websocket
import umsgpack
from tornado.httpclient import HTTPClientError, HTTPRequest

from cinegen.show import Page, Scene
from cinegen.show.page import PageError


def _get(url, host=None):
    address = urlsplit(url)
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=10)
    connection.request("GET", address.path or "/", headers={"Host": host} if host else {})
    answer = connection.getresponse()
    return answer.status, answer.read()


def _listen(url, count, **headers):
    """The first `count` messages that a browser gets."""

    async def listen():
        request = HTTPRequest(url.replace("http:", "ws:") + "scene", headers=headers)
        connection = await tornado.websocket.websocket_connect(request)
        messages = [umsgpack.unpackb(await asyncio.wait_for(connection.read_message(), 10)) for _ in range(count)]
        connection.close()
        return messages

    return asyncio.run(listen())


def _box(page, path, x=0.0):
    place = meshcat.Visualizer(window=page)[path]
    place.set_object(meshcat.geometry.Box([1, 1, 1]))
    matrix = np.eye(4)
    matrix[0, 3] = x
    place.set_transform(matrix)


def test_the_page_is_served_to_this_machine_only():
    page = Page("title of the page")
    url = page.serve(port=7100)
    assert url.startswith("http://127.0.0.1:")
    status, text = _get(url)
    assert status == 200
    assert b"title of the page" in text
    assert len(_get(url + "viewer.js")[1]) > 100_000
    assert _get(url, host="evil.example:7100")[0] == 403


def test_a_browser_that_comes_late_gets_the_newest_of_everything_objects_first():
    page = Page()
    _box(page, "a", 1.0)
    _box(page, "b", 2.0)
    _box(page, "a", 3.0)
    url = page.serve(port=7200)
    messages = _listen(url, 4)
    assert [message["type"] for message in messages] == ["set_object"] * 2 + ["set_transform"] * 2
    moved = {message["path"]: message["matrix"][12] for message in messages[2:]}
    assert moved == {"/meshcat/a": 3.0, "/meshcat/b": 2.0}


def test_a_foreign_page_is_refused():
    page = Page()
    _box(page, "a")
    url = page.serve(port=7300)
    with pytest.raises(HTTPClientError, match="403"):
        _listen(url, 1, Origin="http://evil.example")
    assert _listen(url, 1, Origin=url.rstrip("/"))


def test_what_is_deleted_is_not_sent_any_more():
    page = Page()
    _box(page, "a/b")
    _box(page, "ab")
    meshcat.Visualizer(window=page)["a"].delete()
    assert [path for path, _, _ in page._scene()] == ["/meshcat/ab", "/meshcat/ab"]


def test_a_port_in_use_is_passed_over_and_none_free_is_an_error():
    first, second = Page(), Page()
    port = urlsplit(first.serve(port=7400)).port
    assert urlsplit(second.serve(port=port)).port != port
    with pytest.raises(PageError, match="no free port"):
        Page().serve(port=port, tries=1)


def test_the_static_page_holds_the_viewer_and_every_part(robot):
    delta = robot("delta4")
    page = Page()
    scene = Scene(page, {"delta": delta})
    text = page.html()
    assert "MeshCat.Viewer" in text
    assert text.count('"', text.index("for (const text of [")) > 2 * len(delta.nodes)
    assert len(text) < 2_000_000
    scene.show("delta", delta.random_closed(1)[0])
    assert page.html() != text


def test_every_part_is_drawn_where_it_is(robot):
    delta = robot("delta4")
    page = Page()
    Scene(page, {"delta": delta})
    sent = {key: umsgpack.unpackb(message) for key, message in page._scene().items()}
    for node in delta.nodes:
        matrix = sent[f"/meshcat/cinegen/delta/{node}", "set_transform", ""]["matrix"]
        assert pytest.approx(delta.placement(delta.q_home, node).homogeneous) == np.reshape(matrix, (4, 4)).T
    drawn = {path.split("/")[4] for path, kind, _ in sent if kind == "set_object" and "/delta/" in path}
    assert {"base", "link1", "link9", "link17", "platform"} <= drawn
    assert any("loop link5-link11" in path for path, _, _ in sent)


def test_a_robot_of_any_size_fills_the_same_view(robot):
    sizes = []
    for name in ("tssm", "delta4"):
        page = Page()
        Scene(page, {name: robot(name)})
        whole = umsgpack.unpackb(page._scene()["/meshcat/cinegen", "set_transform", ""])["matrix"]
        sizes.append(whole[0] * robot(name).length)
    assert sizes[0] == pytest.approx(sizes[1], rel=0.6)
