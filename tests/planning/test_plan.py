"""`plan`: one entry with one time limit; goals of joints, locked joints, and paths that are shortened."""

import itertools
import math
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from paths import along

import cinegen
from cinegen.collision import PlanningError, SceneError, clearance_of, load_scene, scene_of
from cinegen.planning import PlanStatus, plan
from cinegen.planning.sampling.shortcuts import shortened

READY = {f"panda_joint{i}": value for i, value in enumerate((0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785), 1)}
AIM = {**READY, "panda_joint1": 1.9, "panda_joint4": -1.6}
POST = {"name": "post", "kind": "cylinder", "radius": 0.05, "length": 0.8, "point": [0.25, 0.25, 0.4]}


@pytest.fixture(scope="module")
def panda():
    robots = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
    return cinegen.load(robots / "panda_description/urdf/panda.urdf")


@pytest.fixture(scope="module")
def around_post(panda):
    """A scene whose goal are the values of seven joints; fingers are partly open."""
    start = {**READY, "panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}
    values = {"node": "panda_hand", "start": {"joints": start}, "goal": {"joints": AIM}, "obstacle": [POST]}
    return scene_of(values, mechanism=panda)


def trap(**more):
    """A mobile robot in a U, open to the side away from its goal."""
    walls = [([1.0, 0.0], [0.1, 2.1]), ([0.0, 1.0], [2.0, 0.1]), ([0.0, -1.0], [2.0, 0.1])]
    boxes = [{"kind": "box", "size": size, "point": point} for point, size in walls]
    return scene_of({"mobile": {"radius": 0.1}, "goal": {"point": [2.0, 0.0]}, "obstacle": boxes, **more})


def length(scene, path):
    return float(np.linalg.norm(np.diff(path, axis=0) / scene.mechanism.scale, axis=1).sum())


# --- one entry, one time limit ------------------------------------------------------------------------------------


def test_a_trap_that_stops_vortices_is_left_by_sampling_without_being_asked():
    scene = trap()
    assert not plan(scene, planner="vortex")
    texts = []
    found = plan(scene, report=texts.append)
    assert found.status is PlanStatus.REACHED
    assert found.attempts[-1].strategy in ("RRT-Connect", "LBKPIECE")
    assert found.attempts[0].status in (PlanStatus.INTERRUPTED, PlanStatus.STUCK, PlanStatus.CIRCLED)
    assert any(text.endswith(", in turn with RRT-Connect and LBKPIECE") for text in texts)
    assert found.clearance >= scene.safety
    # a rope around the U, whose walls end at x = -1 and 1.05 and y = 1.05, 0.11 m from it
    corners = [
        (0.0, 0.0),
        (-1.0, 0.84),
        (-1.11, 0.95),
        (-1.11, 1.05),
        (-1.0, 1.16),
        (1.05, 1.16),
        (1.16, 1.05),
        (2.0, 0.0),
    ]
    rope = sum(math.dist(*ends) for ends in itertools.pairwise(corners))
    assert found.length < 1.05 * rope


def test_a_cell_without_a_door_ends_at_the_time_limit():
    cell = [{"kind": "box", "size": size, "point": point} for point, size in (
        ([0.0, 1.0], [2.1, 0.1]), ([0.0, -1.0], [2.1, 0.1]), ([1.0, 0.0], [0.1, 2.1]), ([-1.0, 0.0], [0.1, 2.1])
    )]  # fmt: skip
    scene = scene_of({"mobile": {"radius": 0.1}, "goal": {"point": [2.0, 0.0]}, "obstacle": cell})
    found = plan(scene, seconds=0.5)
    assert not found
    assert found.status is PlanStatus.TIME_LIMIT
    assert "RRT-Connect and LBKPIECE found no path in 0.5 s" in found.reason
    assert np.array_equal(found.path, scene.start[None])


def test_where_nothing_is_in_between_joints_move_straight(panda):
    scene = scene_of({"node": "panda_hand", "start": {"joints": READY}, "goal": {"joints": AIM}}, mechanism=panda)
    found = plan(scene)
    assert [one.strategy for one in found.attempts] == ["all joints straight to the goal"]
    assert found.field is None
    straight = found.path[0] + np.linspace(0.0, 1.0, len(found.path))[:, None] * (found.path[-1] - found.path[0])
    assert found.path == pytest.approx(straight, abs=1e-9)


@pytest.mark.parametrize(
    ("keys", "reason"),
    [({"seconds": 0.0}, "seconds"), ({"seconds": math.nan}, "seconds"), ({"seed": -1}, "seed"),
     ({"planner": "magic"}, "auto, vortex, rrtconnect")],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(keys, reason):
    with pytest.raises(PlanningError, match=reason):
        plan(trap(), **keys)


def test_without_ompl_the_reason_names_what_was_not_tried(monkeypatch):
    monkeypatch.setattr("cinegen.planning.planner.find_spec", lambda name: None)
    found = plan(trap())
    assert not found
    assert "no configurations were sampled: " in found.reason
    assert 'install "cinegen[sampling]"' in found.reason


# --- joint values -------------------------------------------------------------------------------------------------


def test_joint_values_are_reached_exactly_around_a_post_and_fingers_do_not_move(around_post):
    mechanism = around_post.mechanism
    found = plan(around_post)
    assert found.status is PlanStatus.REACHED
    assert found.attempts[-1].strategy != "all joints straight to the goal"
    assert mechanism.values(found.path[-1]) == pytest.approx(
        {**AIM, "panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}, abs=1e-9
    )
    fingers = found.path[:, [mechanism.q_index(f"panda_finger_joint{i}") for i in (1, 2)]]
    assert (fingers == 0.02).all()
    assert found.clearance >= around_post.safety
    assert (found.clearances >= found.clearance).all()


def test_joints_that_do_not_move_the_node_are_locked_by_default(panda, root):
    assert scene_of({"node": "panda_hand", "goal": {"point": [0.5, 0, 0.5]}}, mechanism=panda).locked == (
        "panda_finger_joint1", "panda_finger_joint2",
    )  # fmt: skip
    tip = scene_of({"node": "panda_leftfinger", "goal": {"point": [0.5, 0, 0.5]}}, mechanism=panda)
    assert tip.locked == ()  # the fingers are coupled
    free = scene_of({"node": "panda_hand", "locked": [], "goal": {"point": [0.5, 0, 0.5]}}, mechanism=panda)
    assert free.locked == ()
    assert scene_of(free.document(), mechanism=panda).locked == ()
    goal = scene_of({"node": "panda_hand", "goal": {"joints": {"panda_finger_joint1": 0.01}}}, mechanism=panda)
    assert goal.locked == ()


def test_some_joint_values_leave_the_others_free(root):
    """At the start's value of joint1 the arm would be inside a disc at the goal."""
    post = {"kind": "disc", "radius": 0.1, "point": [0.6, 0.55]}
    values = {"node": "tool", "start": {"joints": {"joint1": 0.0}}, "goal": {"joints": {"joint3": 1.0}}}
    scene = scene_of(values | {"robot": "robots/planar_3r.raff", "obstacle": [post]}, root)
    found = plan(scene)
    assert found.status is PlanStatus.REACHED
    assert scene.mechanism.values(found.path[-1])["joint3"] == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"goal": {"joints": {"panda_joint9": 0.0}}}, "'panda_joint9' is not a joint"),
        ({"goal": {"joints": {"panda_joint4": 1.0}}}, "its limits are"),
        ({"goal": {"joints": READY}, "locked": ["panda_joint1"]}, "also a joint of the goal"),
        ({"goal": {"joints": READY}, "locked": ["panda_jiont1"]}, "did you mean 'panda_joint1'"),
    ],
)
def test_goals_and_locks_that_make_no_sense_are_refused(panda, values, reason):
    with pytest.raises(SceneError, match=reason):
        scene_of({"node": "panda_hand", "start": {"joints": READY}, **values}, mechanism=panda)


# --- shortcuts ----------------------------------------------------------------------------------------------------


def test_paths_of_vortices_become_shorter_and_stay_clear(root):
    scene = load_scene(root / "robots/scenes/rod.toml")
    raw, short = (plan(scene, planner="vortex", shorten=shorten, seconds=60.0) for shorten in (False, True))
    assert raw
    assert short
    assert length(scene, short.path) < length(scene, raw.path)
    assert np.array_equal(short.path[0], raw.path[0])
    assert short.path[-1] == pytest.approx(raw.path[-1], abs=1e-3)
    clearance = clearance_of(scene)
    assert min(clearance.least(q) for q in along(scene.mechanism, short.path, 2e-3)) >= scene.safety
    assert short.clearance >= scene.safety


def test_a_path_through_an_obstacle_is_not_shortened():
    disc = {"kind": "disc", "radius": 0.1, "point": [0.5, 0.5]}
    scene = scene_of({"mobile": {"radius": 0.0}, "goal": {"point": [1.0, 0.0]}, "obstacle": [disc]})
    assert shortened(clearance_of(scene), np.array([[0.0, 0.5], [1.0, 0.5]]), 0.01) is None


def test_links_that_cannot_separate_are_no_collision(panda):
    """A closed gripper: its fingers are nearer to each other than the safety distance, and stay so."""
    closed = {**READY, "panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    values = {"node": "panda_hand", "start": {"joints": closed}, "goal": {"joints": AIM}}
    assert clearance_of(scene_of(values, mechanism=panda)).least(panda.configuration(closed)) < 0.01
    found = plan(scene_of(values, mechanism=panda))
    assert found.status is PlanStatus.REACHED
