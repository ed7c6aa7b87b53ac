"""What is drawn is kept, handed to whoever looks, and written whole into one file."""

import base64
import re
import threading
from pathlib import Path

import numpy as np
import pinocchio as pin
import psutil
import pytest
import umsgpack
from browsers import Browser, becomes, get
from meshcat import Visualizer
from meshcat.geometry import Box, MeshLambertMaterial, Sphere, TriangularMeshGeometry

import cinegen
from cinegen.cockpit import Page, RobotScene, draw, title_of
from cinegen.cockpit.build_messages import NodePoses, hello_message, state_message
from cinegen.cockpit.page_state import moving_rows, page_state, shown_of
from cinegen.collision import load_scene, scene_of
from cinegen.session import Session, Setup, arrange, scene_setup
from cinegen.session import commands as c


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
        assert [geometry for (geometry,) in others] == [{**first, "data": {"attributes": {}}}] * (len(names) - 1)
        place[names[0]].delete()


def test_every_part_is_drawn_at_home(robot):
    page, delta = Page(), robot("delta4")
    RobotScene(page, {"delta": delta})
    sent = umsgpack.unpackb(page.scene()["/meshcat/cinegen/:delta/:platform", "set_transform", ""])
    home = delta.placement(delta.q_home, "platform").homogeneous
    assert pytest.approx(home) == np.reshape(sent["matrix"], (4, 4)).T
    paths = [path for path, kind, _ in page.scene() if kind == "set_object"]
    drawn = {path.split("/")[4] for path in paths if "/:delta/" in path}
    assert {":base", ":link1", ":link8", ":link14", ":platform"} <= drawn
    assert any("loop link5-link11" in path for path in paths)


# --- viewer -----------------------------------------------------------------------------------------------------------
# `cinegen.Viewer` shows configurations in meshcat's viewer, from a server that only this user reaches.


COMMAND = re.compile(r"octet-binary;base64,([\w+/=]+)")


@pytest.fixture
def viewer(robot):
    with cinegen.Viewer(robot("delta4")) as viewer:
        yield viewer


def shown(viewer):
    """The newest transform (4, 4) of each path."""
    commands = map(umsgpack.unpackb, map(base64.b64decode, COMMAND.findall(viewer.meshcat.static_html())))
    moves = (command for command in commands if command["type"] == "set_transform")
    return {move["path"]: np.reshape(move["matrix"], (4, 4)).T for move in moves}


def test_nodes_are_where_pinocchio_has_them_in_metres(viewer):
    mechanism = viewer.mechanism
    q = mechanism.q_home + 0.05
    viewer.display(q)
    model, data = mechanism.model, mechanism.model.createData()
    pin.framesForwardKinematics(model, data, q)
    transforms = shown(viewer)
    np.testing.assert_array_equal(transforms["/meshcat/cinegen"], np.eye(4))
    for node in mechanism.nodes:
        expected = data.oMf[model.getFrameId(node)].homogeneous
        np.testing.assert_allclose(transforms[f"/meshcat/cinegen/:{mechanism.name}/:{node}"], expected, atol=1e-12)


def test_own_objects_are_shown_beside_the_robot_and_configurations_of_another_size_are_refused(viewer):
    viewer.meshcat["ball"].set_object(Sphere(0.1))
    viewer.meshcat["ball"].set_transform(pin.SE3(np.eye(3), np.ones(3)).homogeneous)
    np.testing.assert_array_equal(shown(viewer)["/meshcat/ball"][:3, 3], np.ones(3))
    with pytest.raises(cinegen.CinegenError, match="15 numbers"):
        viewer.display(np.zeros(3))


def test_its_server_is_for_this_machine_and_its_commands_for_this_user_and_nothing_is_left_of_it(viewer):
    port = int(viewer.meshcat.url().split(":")[2].split("/")[0])
    listening = [conn.laddr for conn in psutil.Process().net_connections() if conn.status == psutil.CONN_LISTEN]
    assert {ip for ip, bound in listening if bound == port} == {"127.0.0.1"}
    socket = Path(viewer.meshcat.window.zmq_url.removeprefix("ipc://"))
    assert socket.parent.stat().st_mode & 0o077 == 0
    for _ in range(2):
        viewer.stop()  # again: nothing happens
    assert not socket.parent.exists()
    assert "cinegen viewer" not in [thread.name for thread in threading.enumerate()]


# --- obstacles in page ------------------------------------------------------------------------------------------------
# Obstacles in the page: what is drawn of them, and what the page is told.


POLE = {"name": "pole", "kind": "capsule", "radius": 0.03, "length": 1.0, "point": [0.45, 0.25, 0.5]}
FLOOR = {"name": "floor", "kind": "half_space", "normal": [0, 0, 1], "point": [0, 0, -0.05]}


def test_the_page_is_told_what_is_an_obstacle_and_its_title_names_robots_only(robot):
    said = {"robot": "arm7.raff", "goal": {"point": [0.3, 0.3, 0.3]}, "obstacle": [POLE, FLOOR]}
    setup = scene_setup(scene_of(said, mechanism=robot("arm7")))
    hello = hello_message(setup, title_of(setup), 1)
    assert title_of(setup) == "arm7"
    assert [robot.name for robot in hello.robots] == ["arm7"]
    assert {obstacle.name: obstacle.mobility for obstacle in hello.obstacles} == {"pole": 6, "floor": 0}
    assert hello.obstacles[0].length == hello.robots[0].length  # marks on it are as large as on the robot
    session = Session(setup)
    message = state_message(session.state(), NodePoses(setup.robots), {})
    session.close()
    assert message.obstacles["pole"][:3] == pytest.approx([0.45, 0.25, 0.5])
    assert message.statuses["pole"].name == "IDLE"


def test_attached_objects_are_drawn_on_the_node_that_holds_them(robot):
    bar = {"name": "a/bar", "kind": "box", "size": [0.04, 0.04, 0.3], "point": [0.0, 0.0, 0.2]}
    said = {"robot": "arm7.raff", "goal": {"point": [0.3, 0.3, 0.3]}, "obstacle": [POLE], "attached": [bar]}
    setup, page = scene_setup(scene_of(said, mechanism=robot("arm7"))), Page()
    draw(page, setup)
    commands = {(path, kind): command for (path, kind, _), command in page.scene().items() if "attached" in path}
    (path,) = {path for path, kind in commands if kind == "set_object"}
    assert path.startswith("/meshcat/cinegen/:arm7/:tool/attached a-bar")  # moves as the tool does
    at = next(command for (_, kind), command in commands.items() if kind == "set_transform")
    matrix = np.reshape(umsgpack.unpackb(at)["matrix"], (4, 4)).T  # by columns
    assert matrix[:3, 3] == pytest.approx([0.0, 0.0, 0.2])


def test_robot_obstacles_and_goal_are_in_the_page_where_the_scene_has_them(root):
    scene = load_scene(root / "robots" / "scenes" / "disc.toml")
    setup, page = scene_setup(scene), Page()
    draw(page, setup)
    paths = {path for path, kind, _ in page.scene() if kind == "set_object"}
    assert any(path.startswith("/meshcat/cinegen/:disc/:disc/") for path in paths)
    assert "/meshcat/cinegen/:planar_3r/goal/ball" in paths
    assert not any("disc/disc/triad" in path for path in paths)


# --- node axes --------------------------------------------------------------------------------------------------------
# The axes of joints that the page is told of are those about or along which the nodes move.


@pytest.mark.parametrize("name", ["rx90", "delta4", "scara", "gough", "planetary_gear"])
def test_a_node_moves_about_its_axis_through_its_origin(robot, name):
    mechanism, step = robot(name), 1e-6
    (described,) = hello_message(Setup({name: mechanism}), name, 1).robots
    moved = [node for node in described.nodes if node.joint is not None]
    assert {node.joint for node in moved} == set(mechanism.joints)
    assert [loop.name for loop in described.loops] == [loop.name for loop in mechanism.loops]
    assert all(node.axis is None for node in described.nodes if node.joint is None)
    for node in moved:
        q, change = mechanism.q_home, np.zeros(mechanism.model.nv)
        change[mechanism.model.joints[mechanism.model.getJointId(node.joint)].idx_v] = step
        before, after = (mechanism.placement(config, node.name) for config in (q, mechanism.integrate(q, change)))
        twist = pin.log6(before.actInv(after)).vector / step  # in the node's frame
        expected = [*node.axis, 0, 0, 0] if mechanism.is_prismatic(node.joint) else [0, 0, 0, *node.axis]
        assert twist == pytest.approx(np.array(expected), abs=1e-5)


# --- notebook ---------------------------------------------------------------------------------------------------------
# `cinegen.show`: a live page in a cell.


def test_a_cell_holds_the_live_page(robot):
    with cinegen.show(robot("delta4"), port=0) as shown:
        html = shown._repr_html_()
        url = re.search(r'src="([^"]+)"', html)[1]
        assert url == shown.url
        assert get(url)[0] == 200
        assert repr(shown) == f"<r1 at {url}>"
        browser = Browser(url)
        assert becomes(lambda: browser.state is not None)


# --- at rest ----------------------------------------------------------------------------------------------------------
# What pages are sent: nothing while nothing moves, and little while something does.


LARGEST = 1000
"""Bytes of a state of a Gough platform that is dragged."""


@pytest.fixture
def cockpit(cockpit):
    return cockpit("gough")


@pytest.fixture
def page(cockpit):
    """A page at rest."""
    page = Browser(cockpit.url, path="page")
    assert becomes(lambda: page.report and page.report["rate"]["at_rest"])
    return page


def test_pages_are_sent_nothing_at_rest_and_programs_the_time(cockpit):
    pages, program = [Browser(cockpit.url, path="page") for _ in range(2)], Browser(cockpit.url)
    assert becomes(lambda: all(browser.report and browser.report["rate"]["at_rest"] for browser in pages))
    received, time = [browser.received for browser in pages], program.state["time"]
    assert becomes(lambda: program.state["time"] > time + 1.0)
    assert [browser.received for browser in pages] == received


def test_pages_at_rest_see_at_once_who_has_control_and_who_is_there(cockpit, page):
    other = Browser(cockpit.url, path="page")
    assert becomes(lambda: other.told)
    other.say("request_control", on=True)
    assert becomes(lambda: page.state["controller"] == other.told[0]["client"])
    other.say("set_user", name="Ada", colour=1)
    assert becomes(lambda: [user["name"] for user in page.users] == ["Ada"])
    other.leave()
    assert becomes(lambda: page.state["controller"] is None and page.users == [])


def test_reactions_that_are_asked_for_at_rest_come(page):
    assert page.report["robots"]["gough"]["reactions"] is None
    page.say("request_reactions", on=True)
    assert becomes(lambda: page.report["robots"]["gough"]["reactions"])
    page.say("request_control", on=True)
    assert becomes(lambda: page.state["controller"] is not None)


@pytest.mark.parametrize("name", ["gough", "planetary_gear", "sr400"])
def test_a_page_gets_the_poses_of_all_nodes(robot, name):
    """Those that a state has and those that follow from placements are where Pinocchio has them."""
    mechanism = robot(name)
    setup = arrange({name: mechanism})
    session, poses, hello = Session(setup), NodePoses(setup.robots), hello_message(setup, "", 1)
    session.obey(c.StartDrag(name, mechanism.end, (0.01, 0.0, 0.0)))
    session.obey(c.MoveDrag((0.1, 0.2, 0.5)))
    for _ in range(50):
        session.tick()
    state = state_message(session.state(), poses, {})
    message = page_state(state, shown_of(state, moving_rows(hello)))
    assert len(message) <= LARGEST or name != "gough"
    packed = message[8 + int.from_bytes(message[4:8], "little") :]
    sent = np.frombuffer(packed, [("position", "<f4", 3), ("turn", "<i2", 4)])
    rows = np.array(state.poses[name]).reshape(-1, 7)
    (description,) = hello.robots
    moving = [0, *(i for i, node in enumerate(description.nodes, 1) if node.joint is not None)]
    assert sent["position"] == pytest.approx(rows[moving, :3], abs=1e-6)
    assert sent["turn"] / 32767 == pytest.approx(rows[moving, 3:], abs=2e-5)
    expected = poses.of(name, session.robots[name].q)
    for node in description.nodes:
        if node.placement is not None:
            above = expected[node.parent] if node.parent else None
            relative = expected[node.name] if above is None else above.actInv(expected[node.name])
            assert relative.translation == pytest.approx(node.placement[:3], abs=1e-8)
