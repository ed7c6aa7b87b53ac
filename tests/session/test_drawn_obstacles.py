"""Obstacles of a session: their shapes, how they move, and how recordings keep them."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cinegen.collision import scene_of
from cinegen.collision.body import PlacedShape
from cinegen.collision.convex_hull import hull
from cinegen.collision.obstacle_kinds import HEIGHT
from cinegen.collision.triangle_mesh import tree_of
from cinegen.mission import MissionError, MissionRecorder, Recording, RobotSample
from cinegen.mission.drawn_obstacle import DrawnObstacle, DrawnShape
from cinegen.session import scene_setup
from cinegen.session.driven_obstacle import DrivenObstacle
from cinegen.session.scene_setup import SceneAppearance
from cinegen.typed_json import decoder, encode

sizes = st.floats(1e-3, 10.0)
seeds = st.integers(0, 2**31)
shapes = st.one_of(
    st.tuples(sizes, sizes, sizes).map(lambda sides: coal.Box(np.array(sides))),
    sizes.map(coal.Sphere),
    st.tuples(sizes, sizes).map(lambda numbers: coal.Cylinder(*numbers)),
    st.tuples(sizes, sizes).map(lambda numbers: coal.Capsule(*numbers)),
    seeds.map(lambda seed: hull(np.random.default_rng(seed).normal(size=(12, 3))).shape),
    seeds.map(lambda seed: tree_of(np.random.default_rng(seed).normal(size=(9, 3)), np.arange(9).reshape(3, 3))),
)


@pytest.fixture
def scene(robot):
    def make(name, *obstacles):
        return scene_of({"goal": {"point": [0.1, 0.1]}, "obstacle": list(obstacles)}, mechanism=robot(name))

    return make


def support(solid, direction):
    """How far a solid reaches along a direction."""
    ball = coal.Sphere(1e-3)
    far = 1e3 * direction
    result = coal.DistanceResult()
    here = coal.Transform3s(solid.placement.rotation, solid.placement.translation)
    coal.distance(ball, coal.Transform3s(np.eye(3), far), solid.shape, here, coal.DistanceRequest(), result)
    return result.min_distance


@given(shape=shapes, seed=seeds)
def test_what_is_written_of_a_shape_reads_back(shape, seed):
    rng = np.random.default_rng(seed)
    placement = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    written = encode(DrawnShape.of(PlacedShape(placement, shape)))
    found = decoder(DrawnShape, DrawnShape).decode(written).placed()
    assert type(found.shape) is type(shape)
    for direction in rng.normal(size=(5, 3)):
        unit = direction / np.linalg.norm(direction)
        assert support(found, unit) == pytest.approx(support(PlacedShape(placement, shape), unit), abs=1e-6)


def test_an_obstacle_moves_freely_in_space_in_the_plane_of_a_planar_robot_and_a_half_space_not_at_all(scene):
    ball, wall = {"kind": "sphere", "radius": 0.1}, {"kind": "half_space", "normal": [0, 1, 0], "point": [0, -1]}
    for name, dof in (("arm7", [6, 0]), ("planar_3r", [3, 0])):
        drawn = scene_setup(scene(name, ball, wall)).obstacles
        assert [one.dof for one in drawn.values()] == dof
        assert [DrivenObstacle(key, one, 0.01).mechanism.mobility for key, one in drawn.items()] == dof


def test_what_is_drawn_in_the_plane_is_flat_where_the_robot_moves_in_it(scene):
    flat = [
        {"name": "disc", "kind": "disc", "radius": 0.1, "point": [0.5, 0.5]},
        {"name": "sides", "kind": "box", "size": [0.1, 0.2], "point": [0.5, 0.8]},
        {"name": "corners", "kind": "polygon", "points": [[0, 0], [0.1, 0], [0, 0.2]], "point": [1.0, 0.5]},
        {"name": "tall", "kind": "disc", "radius": 0.1, "height": 0.7, "point": [1.0, 1.0]},
    ]

    def heights(made):
        appearance, up = SceneAppearance(made), np.array([0.0, 0.0, 1.0])
        drawn = [appearance.obstacle(obstacle).shapes[0].placed() for obstacle in made.obstacles]
        return [2e3 - 2e-3 - support(solid, up) - support(solid, -up) for solid in drawn]

    planar, spatial = scene("planar_3r", *flat), scene("arm7", *flat)
    height = heights(planar)[0]
    assert height < planar.mechanism.length
    assert heights(planar) == pytest.approx([height, height, height, 0.7], abs=1e-4)
    assert heights(spatial) == pytest.approx([HEIGHT, HEIGHT, HEIGHT, 0.7], abs=1e-4)


def test_a_recording_keeps_the_poses_of_obstacles(robot, tmp_path):
    arm, path = robot("planar_3r"), tmp_path / "run.jsonl"
    ball = DrawnObstacle((DrawnShape.of(PlacedShape(pin.SE3.Identity(), coal.Sphere(0.1))),), pin.SE3.Identity(), 3)
    there = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.4), np.array([0.2, 0.0, 0.0]))
    with MissionRecorder(path, {"arm": arm}, obstacles={"ball": ball}) as recorder:
        for time, pose in ((0.0, pin.SE3.Identity()), (1.0, there), (2.0, there)):
            recorder.write(time, {"arm": RobotSample(arm.q_home, "IDLE")}, {"ball": pose})
    assert path.read_text().count('"ball"') == 2  # in the first line, and where it moved
    recording = Recording.load(path)
    assert recording.obstacles["ball"].dof == 3
    assert recording.placements_at(0.5)["ball"].isApprox(pin.SE3.Interpolate(pin.SE3.Identity(), there, 0.5))
    assert recording.placements_at(9.0)["ball"].isApprox(there)
    path.write_text(path.read_text().replace('"obstacles":{"ball":[', '"obstacles":{"bell":['))
    with pytest.raises(MissionError, match=r"jsonl:3: obstacle 'bell' is not in the first line"):
        Recording.load(path)
