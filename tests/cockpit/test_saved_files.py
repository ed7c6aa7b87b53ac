"""Files are read again when they are saved, in every format and with all that is read for them."""

import os
import threading
from dataclasses import replace

import hostile_names
import numpy as np
import pytest
import trimesh
from browsers import Browser, becomes
from small_robots import two_bars
from test_hub import Line
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.cockpit import Cockpit, SetupFiles
from cinegen.cockpit.build_messages import hello_message
from cinegen.cockpit.hub import Hub
from cinegen.cockpit.watched_files import WatchedFiles
from cinegen.session import SessionRunner, arrange
from cinegen.session.setup import Device
from raff2urdf.files import noting

RAFF = two_bars(words=('filename { "part.stl" }', ""))
MESH = '<mesh filename="part.stl"/>'
URDF = urdf_text(
    [UrdfJoint("j", "base", "a", kind="continuous"), UrdfJoint("k", "a", "b", "0.4 0 0", kind="continuous")],
    {"a": f"<visual><geometry>{MESH}</geometry></visual>"},
)


@pytest.fixture(autouse=True)
def looks(monkeypatch):
    """Files are looked at often."""
    monkeypatch.setattr("cinegen.cockpit.watched_files._LOOK", 0.03)


def watched(path):
    """Return the file of a robot, watched, with meshes."""

    def draw(setup):
        for mechanism in setup.robots.values():
            mechanism.visual  # noqa: B018
        return setup.robots["r"]

    setup, files = SetupFiles.of(lambda: arrange({"r": cinegen.load(path)}))
    with noting() as noted:
        draw(setup)
    return WatchedFiles(files, draw, noted)


def part(folder, size):
    trimesh.creation.box([size, 0.1, 0.1]).export(folder / "part.stl")


def step(mechanism):
    """How far the last joint is from the one before."""
    return float(np.linalg.norm(mechanism.model.jointPlacements[2].translation))


@pytest.mark.parametrize(
    ("name", "text", "old", "new", "bad"),
    [
        ("r.raff", hostile_names.raff(("a", "b")), "d 300", "d 400", "d x"),
        ("r.urdf", hostile_names.arm_of(("a", "b"), "r"), "0.3 0 0", "0.4 0 0", "0.3 0 zero"),
        ("r.sdf", hostile_names.sdf(("a", "b")), "0.3 0 0", "0.4 0 0", "0.3 0 zero"),
        ("r.xml", hostile_names.mjcf(("a", "b")), "0.3 0 0", "0.4 0 0", "0.3 0 zero"),
    ],
)
def test_each_format_is_read_again_and_its_errors_are_returned(tmp_path, name, text, old, new, bad):
    path = tmp_path / name
    over = threading.Event()
    path.write_text(text)
    files = watched(path)
    before = cinegen.load(path)
    path.write_text(text.replace(old, bad))
    wrong = files.wait(over)
    assert wrong.made is None
    assert name in wrong.problem
    path.write_text(text.replace(old, new))
    after = files.wait(over).made
    assert step(after) == pytest.approx(step(before) * 4.0 / 3.0, abs=1e-6)


@pytest.fixture
def path(tmp_path):
    (tmp_path / "r.urdf").write_text(URDF)
    part(tmp_path, 0.1)
    return tmp_path / "r.urdf"


def test_saves_by_renaming_and_of_the_same_text_are_noticed_and_a_file_that_is_gone_is_an_error(path, tmp_path):
    files, over = watched(path), threading.Event()
    for text, is_new in ((URDF.replace("0.4", "0.5"), True), (URDF.replace("0.4", "0.5"), False)):
        other = tmp_path / "r.urdf~"
        other.write_text(text)
        os.replace(other, path)
        reading = files.wait(over)
        assert (reading.made is not None) is is_new
        assert reading.problem == ""
    path.unlink()
    assert "can't be read" in files.wait(over).problem
    path.write_text(URDF)
    assert files.wait(over).problem == ""


def test_what_is_next_to_a_file_is_watched_also_where_there_is_none_yet(tmp_path, text_file):
    path = text_file("r.urdf", URDF.replace(MESH, '<box size="1 1 1"/>'))
    files, over = watched(path), threading.Event()
    constraints = text_file("r.constraints.json", "{")
    assert "r.constraints.json" in files.wait(over).problem
    constraints.unlink()
    assert files.wait(over).problem == ""
    (tmp_path / "r.srdf").write_text('<robot name="r"><disable_collisions link1="a" link2="b" reason="Never"/></robot>')
    assert files.wait(over).made.source.srdf is not None


@pytest.mark.parametrize(("name", "text", "unit"), [("r.urdf", URDF, 1.0), ("r.raff", RAFF, 1e-3)])
def test_a_mesh_is_watched(tmp_path, name, text, unit):
    part(tmp_path, 0.1)
    path = tmp_path / name
    path.write_text(text)
    files, over = watched(path), threading.Event()
    part(tmp_path, 0.3)
    (mesh,) = [shape for shape in files.wait(over).made.visual.geometryObjects if shape.meshPath.endswith("part.stl")]
    assert np.ptp(mesh.geometry.vertices(), axis=0).max() == pytest.approx(0.3 * unit)


def test_nothing_is_read_while_a_file_keeps_changing(path):
    """A file that is being written is read when two looks find it the same."""
    files, looks = watched(path), []

    class Looks:
        """Stands for the event: each look finds another part of the text, until it is whole."""

        def wait(self, seconds):
            looks.append(seconds)
            if len(looks) <= 4:
                path.write_text(URDF.replace("0.4", "0.5")[: 100 * len(looks)])
            if len(looks) == 5:
                path.write_text(URDF.replace("0.4", "0.5"))
            return False

    assert files.wait(Looks()).problem == ""
    assert len(looks) == 6


def test_all_browsers_meet_the_new_robot_of_a_session_in_a_process_of_its_own(text_file):
    path = text_file("r.urdf", URDF.replace(MESH, '<box size="1 1 1"/>'))
    text = path.read_text()
    setup, files = SetupFiles.of(lambda: arrange({"r": cinegen.load(path)}))
    with Cockpit(setup, port=0, files=files) as cockpit:
        first, second = Browser(cockpit.url), Browser(cockpit.url)
        first.say("move_joint", robot="r", joint="j", value=0.3)
        assert becomes(lambda: cockpit.state and cockpit.state.robots["r"].q.tolist() == [0.3, 0.0])
        path.write_text(text.replace('"b"', '"c"'))
        nodes = [node["name"] for node in _hellos(first)[0]["robots"][0]["nodes"]]
        assert nodes == ["base", "a", "b"]
        for browser in (first, second):
            assert becomes(lambda browser=browser: len(_hellos(browser)) == 2)
            assert [node["name"] for node in _hellos(browser)[-1]["robots"][0]["nodes"]] == ["base", "a", "c"]
        assert becomes(lambda: len(second.state["poses"]["r"]) == 7 * 4)
        path.write_text(text.replace('type="continuous"', 'type="hinge"', 1))
        for browser in (first, second):
            assert becomes(lambda browser=browser: "hinge" in _problem(browser))
        late = Browser(cockpit.url)
        assert becomes(lambda: "hinge" in _problem(late))
        assert cockpit.state.robots["r"].closure == 0.0
        path.write_text(text)
        for browser in (first, second, late):
            assert becomes(lambda browser=browser: _problem(browser) == "")
        assert cockpit.state.edition == 2


def test_a_client_may_name_what_is_gone_until_it_knows(robot):
    arm, scara = (arrange({"r": robot(name)}) for name in ("planar_3r", "scara"))
    now = [arm]
    hub = Hub(arm, lambda command: None, lambda number: hello_message(now[0], "t", number))
    connection = Line()
    client = hub.join(connection)
    now[0] = scara
    hub.exchange(scara)
    (gone,) = set(arm.robots["r"].nodes[-1:]) - set(scara.robots["r"].nodes) or {arm.robots["r"].joints[-1] + "x"}
    hub.receive(client, f'{{"type": "pin", "robot": "r", "node": "{gone}"}}')
    assert connection.closed is None
    client.unacknowledged = (client.met, 0.0)
    hub.receive(client, f'{{"type": "ack", "frame": {client.met}}}')
    hub.receive(client, f'{{"type": "pin", "robot": "r", "node": "{gone}"}}')
    assert "Unknown node" in connection.closed[1]
    assert [message["type"] for message in connection.told] == ["hello", "hello"]


def test_a_setup_that_can_not_be_driven_is_reported_and_the_session_goes_on(robot):
    setup = arrange({"r": robot("planar_3r")})
    with SessionRunner(setup, own_process=False) as runner:
        bad = replace(setup, devices=(Device("x", "path:spiral", robot="r", node="tool"),), switches=())
        runner.exchange(bad, 1)
        assert becomes(lambda: runner.state is not None and runner.state.refused is not None)
        assert runner.state.refused[0] == 1
        assert "spiral" in runner.state.refused[1]
        runner.exchange(setup, 2)
        assert becomes(lambda: runner.state.edition == 2)
        assert runner.state.refused is None
        assert runner.waiting == 0


def _hellos(browser):
    return [message for message in browser.told if message["type"] == "hello"]


def _problem(browser):
    problems = [message["text"] for message in browser.told if message["type"] == "problem"]
    return problems[-1] if problems else ""
