"""What is drawn is kept, handed to whoever looks, and written whole into one file."""

import re

import numpy as np
import pytest
import umsgpack
from meshcat import Visualizer
from meshcat.geometry import Box, MeshLambertMaterial, TriangularMeshGeometry

from cinegen.cockpit import Page, RobotScene


def _taken(feed):
    """What a browser gets."""
    return [umsgpack.unpackb(message) for message in feed.take()]


def _box(page, path, x=0.0):
    place = Visualizer(window=page)[path]
    place.set_object(Box([1.0, 1.0, 1.0]), MeshLambertMaterial())
    matrix = np.eye(4)
    matrix[0, 3] = x
    place.set_transform(matrix)


def test_a_browser_that_comes_late_gets_the_newest_of_everything_placed_before_it_is_drawn():
    page = Page()
    _box(page, "a", 1.0)
    _box(page, "b", 2.0)
    _box(page, "a", 3.0)
    Visualizer(window=page)["a/<object>"].set_property("visible", True)  # of the object, which must be there
    feed = page.feed()
    messages = _taken(feed)
    kinds = [*["set_transform"] * 2, *["set_object"] * 2, "set_property"]
    assert [message["type"] for message in messages] == kinds
    moved = {message["path"]: message["matrix"][12] for message in messages[:2]}
    assert moved == {"/meshcat/a": 3.0, "/meshcat/b": 2.0}
    assert _taken(feed) == []


def test_who_follows_gets_what_is_new_and_only_the_newest_of_it():
    page = Page()
    woken = []
    page.wake = lambda: woken.append(1)
    feed = page.feed()
    for x in (1.0, 2.0, 3.0):
        _box(page, "a", x)
    assert woken
    assert [message["matrix"][12] for message in _taken(feed) if message["type"] == "set_transform"] == [3.0]
    page.forget(feed)
    _box(page, "a", 4.0)
    assert _taken(feed) == []


def test_a_geometry_of_many_objects_is_sent_once_and_whole_to_who_comes_after_the_first_is_deleted():
    page = Page()
    place = Visualizer(window=page)
    for name in "abc":
        place[name].set_object(TriangularMeshGeometry(np.eye(3), np.array([[0, 1, 2]])), MeshLambertMaterial())
    for names in ("abc", "bc"):
        (first,), *others = [command["object"]["geometries"] for command in _taken(page.feed())]
        assert first["data"]["attributes"]["position"]
        assert [one for (one,) in others] == [{**first, "data": {"attributes": {}}}] * (len(names) - 1)
        place[names[0]].delete()


def test_every_part_is_drawn_where_it_is(robot):
    delta = robot("delta4")
    page = Page()
    RobotScene(page, {"delta": delta})
    sent = {key: umsgpack.unpackb(message) for key, message in page.scene().items()}
    for node in delta.nodes:
        matrix = sent[f"/meshcat/cinegen/:delta/:{node}", "set_transform", ""]["matrix"]
        assert pytest.approx(delta.placement(delta.q_home, node).homogeneous) == np.reshape(matrix, (4, 4)).T
    drawn = {path.split("/")[4] for path, kind, _ in sent if kind == "set_object" and "/:delta/" in path}
    assert {":base", ":link1", ":link8", ":link14", ":platform"} <= drawn
    assert any("loop link5-link11" in path for path, _, _ in sent)


@pytest.mark.parametrize("button", ["undo", "redo"])
def test_what_can_not_be_undone_yet_looks_so_before_the_first_report(root, button):
    text = (root / "cinegen/cockpit/static/index.html").read_text()
    assert re.search(rf'<button id="{button}"[^>]* disabled ', text)
