"""Obstacles in the page: what is drawn of them, and what the page is told."""

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
import umsgpack

from cinegen.cockpit import Page, draw, title_of
from cinegen.cockpit.build_messages import NodePoses, hello_message, state_message
from cinegen.cockpit.surfaces import surface_of
from cinegen.collision import load_scene, scene_of
from cinegen.collision.convex_hull import hull
from cinegen.session import Session, scene_setup

POLE = {"name": "pole", "kind": "capsule", "radius": 0.03, "length": 1.0, "point": [0.45, 0.25, 0.5]}
FLOOR = {"name": "floor", "kind": "half_space", "normal": [0, 0, 1], "point": [0, 0, -0.05]}


@pytest.fixture
def setup(robot):
    said = {"robot": "arm7.raff", "goal": {"point": [0.3, 0.3, 0.3]}, "obstacle": [POLE, FLOOR]}
    return scene_setup(scene_of(said, mechanism=robot("arm7")))


@pytest.mark.parametrize(("radius", "length"), [(0.1, 0.5), (1.0, 1e-3)])
def test_a_capsule_is_drawn_with_its_round_ends(radius, length):
    points, faces = surface_of(pin.GeometryObject("", 0, pin.SE3.Identity(), coal.Capsule(radius, length)))
    beyond = points - np.stack([0.0 * points[:, 0], 0.0 * points[:, 1], points[:, 2].clip(-length / 2, length / 2)], 1)
    assert np.linalg.norm(beyond, axis=1) == pytest.approx(radius)
    assert np.ptp(points[:, 2]) == pytest.approx(length + 2.0 * radius)
    mesh = trimesh.Trimesh(points, faces)
    mesh.update_faces(mesh.nondegenerate_faces())  # a ring at each end is a point
    assert mesh.is_watertight
    volume = np.pi * radius**2 * (length + 4.0 / 3.0 * radius)
    assert mesh.volume == pytest.approx(volume, rel=0.03)  # above 0: seen from outside


def test_a_hull_is_drawn_with_all_its_faces_turned_outwards():
    points = np.random.default_rng(0).normal(size=(30, 3))
    corners, faces = surface_of(pin.GeometryObject("", 0, pin.SE3.Identity(), hull(points).shape))
    mesh = trimesh.Trimesh(corners, faces)
    mesh.merge_vertices()
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(trimesh.convex.convex_hull(points).volume)


def test_the_page_is_told_what_is_an_obstacle_and_its_title_names_robots_only(setup):
    hello = hello_message(setup, title_of(setup), 1)
    assert title_of(setup) == "arm7"
    assert [robot.name for robot in hello.robots] == ["arm7"]
    assert {one.name: one.mobility for one in hello.obstacles} == {"pole": 6, "floor": 0}
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
    found = {(path, kind): command for (path, kind, _), command in page.scene().items() if "attached" in path}
    (path,) = {path for path, kind in found if kind == "set_object"}
    assert path.startswith("/meshcat/cinegen/:arm7/:tool/attached a-bar")  # moves as the tool does
    at = next(command for (_, kind), command in found.items() if kind == "set_transform")
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
