"""A robot among obstacles, in the hand: it keeps clear, obstacles push it, what goes by itself hits nothing."""

import itertools
import pickle
import re

import coal
import numpy as np
import pinocchio as pin
import pytest
from clearings import to_shape
from hypothesis import given
from hypothesis import strategies as st

from cinegen.collision import load_scene, scene_of
from cinegen.collision.body import PlacedShape
from cinegen.collision.convex_hull import hull
from cinegen.collision.links import link_bodies
from cinegen.collision.obstacle_kinds import HEIGHT
from cinegen.collision.triangle_mesh import tree_of
from cinegen.mission import MissionError, MissionRecorder, Recording, RobotSample
from cinegen.mission.drawn_obstacle import DrawnObstacle, DrawnShape
from cinegen.model.motion_limits import motion_limits
from cinegen.session import Session, scene_setup
from cinegen.session import commands as c
from cinegen.session.decoding import decode_command
from cinegen.session.driven_obstacle import DrivenObstacle
from cinegen.session.scene_setup import SceneAppearance
from cinegen.typed_json import decoder, encode

SAFETY = 0.02
POLE = {"name": "pole", "kind": "capsule", "radius": 0.03, "length": 1.0, "point": [0.45, 0.25, 0.5]}
FLOOR = {"name": "floor", "kind": "half_space", "normal": [0, 0, 1], "point": [0, 0, -0.05]}


@pytest.fixture
def session(robot, closing):
    """`session("arm7", POLE)`: a session with a robot among these obstacles."""

    def open_session(name, *obstacles, record=None, rate=250.0, **keys):
        mechanism = robot(name)
        said = {"robot": f"{name}.raff", "goal": {"point": [0.0, 0.0, 0.0]}, "safety": SAFETY, **keys}
        scene = scene_of({**said, "obstacle": list(obstacles)}, mechanism=mechanism)
        return closing(Session(scene_setup(scene, record=record, rate=rate)))

    return open_session


def measured(session, name, shapes):
    """How far the robot is from obstacles in a state of the session, by coal on what is drawn."""
    mechanism = session.setup.robots[name]
    links = [body.as_described for body in link_bodies(mechanism)]
    return lambda state: min(
        to_shape(mechanism, links, state.robots[name].q, shape, state.obstacles[obstacle].pose)
        for obstacle, shape in shapes.items()
    )


def run(session, ticks, *said):
    for command in said:
        session.obey(command)
    for _ in range(ticks):
        session.tick()
    return session.state()


def lead(session, way, each=3, seen=None):
    """Leads the hand along points; calls `seen` with the state after every tick."""
    for point in way:
        session.obey(c.MoveDrag(tuple(point)))
        for _ in range(each):
            session.tick()
            if seen is not None:
                seen(session.state())


def point(session, name, node):
    body = session.obstacles[name] if name in session.obstacles else session.robots[name]
    return body.placement(node).translation.copy()


def line(begin, end, count):
    return np.linspace(begin, end, count + 1)[1:]


def test_an_obstacle_that_is_dragged_pushes_the_robot_never_touches_it_and_both_go_back_by_undo(session):
    live_session = session("arm7", POLE)
    far = measured(live_session, "arm7", {"pole": coal.Capsule(0.03, 1.0)})
    at_rest = live_session.state().robots["arm7"].q
    begin = point(live_session, "pole", "pole")
    least, statuses = [], set()

    def seen(state):
        least.append(far(state))
        statuses.add(state.robots["arm7"].status)

    live_session.obey(c.StartDrag("pole", "pole", (0.0, 0.0, 0.1)))
    up = np.array([0.0, 0.0, 0.1])
    lead(live_session, line(begin + up, begin + up + np.array([-0.1, -0.25, 0.0]), 100), each=2, seen=seen)
    for _ in range(120):  # it yields within its limits of acceleration: the pole arrives later than the pointer
        seen(run(live_session, 1))
    assert np.abs(live_session.state().robots["arm7"].q - at_rest).max() > 0.1  # it has yielded
    assert ("PUSHED", "pushed by 'pole'") in {(status.name, status.label) for status in statuses}
    assert min(least) > 0.5 * SAFETY
    assert np.linalg.norm(point(live_session, "pole", "pole") - begin - [-0.1, -0.25, 0.0]) < 5e-3
    turned = live_session.obstacles["pole"].pose.rotation
    assert np.allclose(turned, np.eye(3), atol=1e-6)  # dragged, it is not turned
    run(live_session, 5, c.EndDrag())
    state = run(live_session, 750, c.Undo())
    assert np.allclose(state.robots["arm7"].q, at_rest, atol=1e-9)
    assert np.allclose(state.obstacles["pole"].pose.translation, begin, atol=1e-9)


def test_home_stops_before_it_hits_and_says_what(session):
    live_session = session("arm7", {**POLE, "point": [5.0, 5.0, 0.5]})
    begin = live_session.state().robots["arm7"].q
    run(live_session, 0, c.MoveJoint("arm7", "joint1", 1.2))
    run(live_session, 500, c.EndJointMotion())
    assert abs(live_session.state().robots["arm7"].q[0] - begin[0]) > 0.5
    middle = (point(live_session, "arm7", "link5") + np.array([0.6, 0.04, 0.47])) / 2.0  # where the forearm comes by
    run(live_session, 0, c.StartDrag("pole", "pole", (0, 0, 0)))
    lead(live_session, [[middle[0] * 1.15, middle[1] * 1.15, 0.45]], each=125)
    run(live_session, 5, c.EndDrag())
    far = measured(live_session, "arm7", {"pole": coal.Capsule(0.03, 1.0)})
    live_session.obey(c.MoveHome("arm7"))
    least = [far(run(live_session, 1)) for _ in range(700)]
    state = live_session.state()
    assert min(least) >= SAFETY
    assert state.moving is None
    assert np.abs(state.robots["arm7"].q - begin).max() > 0.1
    notice = state.notices[-1]
    assert notice.warning
    assert notice.text.startswith("arm7: '")
    assert notice.text.endswith("would hit 'pole'")


def test_a_motor_that_is_led_into_an_obstacle_stays_before_it(session):
    live_session = session("arm7", POLE)
    far = measured(live_session, "arm7", {"pole": coal.Capsule(0.03, 1.0)})
    live_session.obey(c.MoveJoint("arm7", "joint1", 3.0))
    least = [far(run(live_session, 1)) for _ in range(250)]
    assert min(least) >= SAFETY
    status = live_session.state().robots["arm7"].status
    assert status.name == "JOINTS"
    assert status.label.endswith("would hit 'pole'")
    live_session.obey(c.MoveJoint("arm7", "joint1", -0.5))  # a slider that moves on tries again
    assert run(live_session, 400).robots["arm7"].q[0] == pytest.approx(-0.5)


@pytest.mark.parametrize(
    ("name", "joint", "moved"), [("arm7", "joint2", (0.5, -0.3, 0.4, 0.2)), ("delta4", "joint1", (0.2, 0.1, 0.15))]
)
def test_motions_of_joints_home_and_to_a_configuration_obey_the_limits_of_acceleration(session, name, joint, moved):
    """Also where one replaces the other on its way, and a drag that, and where one begins while the robot moves."""
    live_session = session(name, {**POLE, "point": [5.0, 5.0, 0.5]}, rate=240.0)
    mechanism, robot = live_session.setup.robots[name], live_session.robots[name]
    begin, q, goal = robot.q, [robot.q], robot.q.copy()
    for other, change in zip(mechanism.actuated, moved, strict=False):
        goal[mechanism.q_index(other)] += change
    goal = mechanism.close(goal, mechanism.actuated)
    at, drag = begin[mechanism.q_index(joint)], c.StartDrag(name, mechanism.end, (0, 0, 0))
    for command, ticks in (
        (c.MoveJoint(name, joint, at + 0.4), 40),
        (c.MoveJoint(name, joint, at - 0.2), 20),
        (c.MoveHome(name), 15),
        (drag, 20),
        (c.MoveHome(name), None),
        (c.MoveTo(name, mechanism.end, tuple(goal)), 60),
        (drag, 10),
        (c.MoveTo(name, mechanism.end, tuple(goal)), None),
    ):
        live_session.obey(command)
        while ticks is None or ticks > 0:
            live_session.tick()
            q.append(robot.q)
            ticks = None if ticks is None else ticks - 1
            if ticks is None and robot.motion is None:
                break
        if isinstance(command, c.MoveHome) and ticks is None:
            assert robot.q == pytest.approx(begin, abs=1e-9)
    assert q[-1] == pytest.approx(goal, abs=1e-6)
    v = np.array([mechanism.difference(a, b) for a, b in itertools.pairwise(q)]) * 240.0
    columns = [mechanism.v_index(actuator) for actuator in mechanism.actuated]
    changes = np.abs(np.diff(np.vstack([0.0 * v[:1], v]), axis=0))[:, columns] * 240.0
    assert (changes <= motion_limits(mechanism).acceleration[columns] * (1.0 + 1e-6)).all()
    assert changes.max() > 5.0
    assert max(map(mechanism.closure, q)) <= 1e-9


def test_a_disc_that_moves_by_itself_keeps_clear_too(root, closing):
    live_session = closing(Session(scene_setup(load_scene(root / "robots" / "scenes" / "discs.toml"), rate=250.0)))
    scene = live_session.setup.avoidance.scene
    begin = point(live_session, "mobile", "mobile")
    run(live_session, 0, c.StartDrag("mobile", "mobile", (0, 0, 0)))
    least = []

    def seen(state):
        centre = live_session.robots["mobile"].placement("mobile").translation
        least.extend(
            np.linalg.norm(centre - obstacle.placement.translation) - obstacle.written["radius"] - scene.mobile
            for obstacle in scene.obstacles
        )

    lead(live_session, line(begin, scene.goal.translation, 200), each=2, seen=seen)
    assert min(least) >= scene.safety
    assert min(least) < 3.0 * scene.safety


def test_names_that_mean_something_to_the_page_or_are_taken_are_changed(session):
    live = session("arm7", {**POLE, "name": "arm7"}, {**FLOOR, "name": "shelf/left\nside"}, {**POLE, "name": "ends'"})
    assert list(live.robots) == ["arm7"]
    assert list(live.obstacles) == ["arm7'", "shelf-left side", "ends'"]
    assert decode_command('{"type": "pin", "robot": "arm7\'", "node": "arm7\'"}', live.setup) == c.Pin("arm7'", "arm7'")
    copied = pickle.loads(pickle.dumps(live.setup))
    assert list(copied.obstacles) == list(live.obstacles)
    assert copied.avoidance.scene.safety == SAFETY


def test_where_something_is_in_an_obstacle_at_the_beginning_it_is_said(session):
    live_session = session("arm7", {**POLE, "point": [0.24, 0.09, 0.5]})
    status = run(live_session, 5).robots["arm7"].status
    assert status.name == "TOUCHING"
    assert re.fullmatch("'link.*touches 'pole'", status.label)


# --- drawn obstacles --------------------------------------------------------------------------------------------------
# Obstacles of a session: their shapes, how they move, and how recordings keep them.


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
    pose = coal.Transform3s(solid.placement.rotation, solid.placement.translation)
    coal.distance(ball, coal.Transform3s(np.eye(3), far), solid.shape, pose, coal.DistanceRequest(), result)
    return result.min_distance


@given(shape=shapes, seed=seeds)
def test_what_is_written_of_a_shape_reads_back(shape, seed):
    rng = np.random.default_rng(seed)
    placement = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    written = encode(DrawnShape.of(PlacedShape(placement, shape)))
    decoded = decoder(DrawnShape, DrawnShape).decode(written).placed()
    assert type(decoded.shape) is type(shape)
    for direction in rng.normal(size=(5, 3)):
        unit = direction / np.linalg.norm(direction)
        assert support(decoded, unit) == pytest.approx(support(PlacedShape(placement, shape), unit), abs=1e-6)


def test_an_obstacle_moves_freely_in_space_in_the_plane_of_a_planar_robot_and_a_half_space_not_at_all(scene):
    ball, wall = {"kind": "sphere", "radius": 0.1}, {"kind": "half_space", "normal": [0, 1, 0], "point": [0, -1]}
    for name, dof in (("arm7", [6, 0]), ("planar_3r", [3, 0])):
        drawn = scene_setup(scene(name, ball, wall)).obstacles
        assert [obstacle.dof for obstacle in drawn.values()] == dof
        assert [DrivenObstacle(key, obstacle, 0.01).mechanism.mobility for key, obstacle in drawn.items()] == dof


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
    moved = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.4), np.array([0.2, 0.0, 0.0]))
    with MissionRecorder(path, {"arm": arm}, obstacles={"ball": ball}) as recorder:
        for time, pose in ((0.0, pin.SE3.Identity()), (1.0, moved), (2.0, moved)):
            recorder.write(time, {"arm": RobotSample(arm.q_home, "IDLE")}, {"ball": pose})
    assert path.read_text().count('"ball"') == 2  # in the first line, and where it moved
    recording = Recording.load(path)
    assert recording.obstacles["ball"].dof == 3
    assert recording.placements_at(0.5)["ball"].isApprox(pin.SE3.Interpolate(pin.SE3.Identity(), moved, 0.5))
    assert recording.placements_at(9.0)["ball"].isApprox(moved)
    path.write_text(path.read_text().replace('"obstacles":{"ball":[', '"obstacles":{"bell":['))
    with pytest.raises(MissionError, match=r"jsonl:3: obstacle 'bell' is not in the first line"):
        Recording.load(path)
