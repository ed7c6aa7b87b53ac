"""Objects that a robot holds: their clearance, by coal and Pinocchio alone, and their scenes."""

import json

import coal
import numpy as np
import pinocchio as pin
import pytest
from paths import along

import cinegen
from cinegen.collision import SceneError, clearance_of, scene_of
from cinegen.collision.mesh_check import MeshCheck
from cinegen.planning import PlanStatus, plan

SIDES, ALONG = [0.04, 0.04, 0.3], [0.0, 0.0, 0.2]
BAR = {"name": "bar", "kind": "box", "size": SIDES, "point": ALONG}
WALL = {"name": "wall", "kind": "box", "size": [0.5, 0.04, 0.45], "point": [0.55, 0.0, 0.225]}


@pytest.fixture(scope="module")
def arm():
    return cinegen.load("arm7")


def scene(arm, *attached, goal=None, obstacles=(), **more):
    values = {"goal": goal or {"point": [0.5, 0.3, 0.5]}, "obstacle": list(obstacles), "attached": list(attached)}
    return scene_of(values | more, mechanism=arm)


def held_to_wall(arm, q):
    """The distance of the bar from the wall, m."""
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, q)
    pose = data.oMf[arm.frame_id(arm.end)] * pin.SE3(np.eye(3), np.array(ALONG))
    there = coal.Transform3s(pose.rotation, pose.translation)
    wall = coal.Transform3s(np.eye(3), np.array(WALL["point"]))
    result = coal.DistanceResult()
    return coal.distance(coal.Box(*SIDES), there, coal.Box(*WALL["size"]), wall, coal.DistanceRequest(), result)


def test_a_held_object_that_stands_on_a_table_is_lifted_if_they_may_touch(arm):
    """The lower end of the bar is 1 mm inside of the board under it, which the arm itself may not touch."""
    start = {"joints": {"joint1": -0.6, "joint2": 0.5, "joint4": -1.2, "joint6": 0.7}}
    end = scene(arm, BAR, start=start).start
    tip = (arm.placement(end, arm.end) * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.35]))).translation
    down = arm.placement(end, arm.end).rotation[:, 2]
    board = {"name": "board", "kind": "box", "size": [0.05, 0.05, 0.02], "point": (tip + 0.009 * down).tolist()}
    board["rpy"] = pin.rpy.matrixToRpy(arm.placement(end, arm.end).rotation).tolist()
    asked = {"goal": {"joints": {"joint1": 0.2}}, "obstacles": [board, WALL], "start": start, "safety": 0.005}
    refused = plan(scene(arm, BAR, **asked))
    assert refused.status is PlanStatus.START_IN_COLLISION
    assert "if they may touch, add 'board' to touches of 'bar'" in refused.reason
    allowed = scene(arm, BAR | {"touches": ["board"]}, **asked)
    found = plan(allowed, seconds=60.0)
    assert found
    assert min(held_to_wall(arm, q) for q in along(arm, found.path, 0.02)) >= 0.005 - 1e-6
    names = {frozenset(clearance_of(allowed).names(pair)) for pair in clearance_of(allowed).every_pair}
    assert frozenset(("bar", "board")) not in names
    assert {frozenset(("bar", "wall")), frozenset((arm.end, "wall"))} & names
    assert any("board" in pair for pair in names)
    assert json.loads(json.dumps(allowed.document()))["attached"][0]["touches"] == ["board"]


def test_a_held_object_is_as_far_from_a_wall_as_coal_measures(arm):
    clearance = clearance_of(scene(arm, BAR, obstacles=[WALL]), is_exact=True)
    names = [clearance.names(pair) for pair in clearance.every_pair]
    pair, rng = names.index(("bar", "wall")), np.random.default_rng(0)
    for _ in range(20):
        q = rng.uniform(arm.model.lowerPositionLimit, arm.model.upperPositionLimit)
        truth = held_to_wall(arm, q)
        found = clearance.distances(q)[pair]
        assert found == pytest.approx(truth, abs=1e-5) if truth > 0.0 else found <= 1e-9


def test_what_is_attached_is_written_and_read_again(arm):
    ball = {"name": "ball", "kind": "sphere", "radius": 0.05, "node": arm.nodes[-2], "touches": [arm.end]}
    before = scene(arm, BAR, ball, {"kind": "sphere", "radius": 0.01, "point": [0, 0, 1]})
    after = scene_of(json.loads(json.dumps(before.document())), mechanism=arm)
    assert after.document() == before.document()
    assert [one.name for one in after.attached] == ["bar", "ball", "attached 3"]
    assert [one.node for one in after.attached] == [arm.end, arm.nodes[-2], arm.end]
    assert clearance_of(after).least(arm.q_home) == clearance_of(before).least(arm.q_home)


@pytest.mark.parametrize(
    ("attached", "message"),
    [
        ({"node": "hand"}, "attached 1 'bar': node 'hand' is not a node of"),
        ({"touches": ["finger"]}, "touches 'finger' is not a node of"),
        ({"name": "wall"}, "name 'wall' is used by another object or node"),
        ({"kind": "half_space", "normal": [0, 0, 1], "size": None}, "'half_space' is unbounded: it can't be attached"),
        ({"weight": 3}, "unknown key 'weight'"),
    ],
)
def test_what_is_wrong_with_an_attached_object_is_reported(arm, attached, message):
    values = {key: value for key, value in (BAR | attached).items() if value is not None}
    with pytest.raises(SceneError, match=message):
        scene(arm, values, obstacles=[WALL])


def test_a_held_object_collides_with_other_links_except_those_that_touch_it(arm):
    rod = BAR | {"size": [0.02, 0.02, 1.0], "point": [0, 0, 0]}  # through the links behind the hand
    refused = plan(scene(arm, rod))
    assert refused.status is PlanStatus.START_IN_COLLISION
    assert "touches of 'bar'" in refused.reason
    assert MeshCheck(scene(arm, rod)).contact(arm.q_home).count("bar") == 1
    free = scene(arm, rod | {"touches": list(arm.nodes)})
    assert not MeshCheck(free).contact(arm.q_home)
    assert clearance_of(free).least(arm.q_home) >= clearance_of(scene(arm)).least(arm.q_home) - 1e-9
