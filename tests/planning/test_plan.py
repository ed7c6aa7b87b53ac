"""`plan`: one entry with one time limit; goals of joints, locked joints, and paths that are shortened."""

import contextlib
import itertools
import math
import re
import time

import numpy as np
import pinocchio as pin
import pytest
from cusp_platform import configuration, determinant, scene
from example_robots import PANDA, PANDA_READY, load
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from paths import along
from small_robots import parallelogram
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.collision import PlanningError, SceneError, clearance_of, load_scene, scene_for, scene_of
from cinegen.collision.clearance import Clearance
from cinegen.planning import Planner, PlanStatus, plan
from cinegen.planning.attraction import ConfigurationAttraction
from cinegen.planning.clear_motion import clear_motion
from cinegen.planning.sampling.path_sampler import PathSampler
from cinegen.planning.sampling.shortcuts import shortened

AIM = {**PANDA_READY, "panda_joint1": 1.9, "panda_joint4": -1.6}
POST = {"name": "post", "kind": "cylinder", "radius": 0.05, "length": 0.8, "point": [0.25, 0.25, 0.4]}


def trap(walls=3):
    """A mobile robot in a U, open to the side away from its goal, or between four walls."""
    middles = [(1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (-1.0, 0.0)][:walls]
    boxes = [{"kind": "box", "size": [0.1, 2.1] if x else [2.0, 0.1], "point": [x, y]} for x, y in middles]
    return scene_of({"mobile": {"radius": 0.1}, "goal": {"point": [2.0, 0.0]}, "obstacle": boxes})


def panda(**values):
    """A scene of its hand."""
    return scene_of({"node": "panda_hand", "goal": {"joints": AIM}, **values}, mechanism=load(PANDA))


def length(scene, path):
    return float(np.linalg.norm(np.diff(path, axis=0) / scene.mechanism.scale, axis=1).sum())


# --- one entry, one time limit ------------------------------------------------------------------------------------


def test_a_trap_that_stops_vortices_is_left_by_sampling_without_being_asked():
    scene = trap()
    assert not plan(scene, planner="vortex")
    texts = []
    planned = plan(scene, report=texts.append)
    assert planned.status is PlanStatus.REACHED
    assert planned.attempts[-1].strategy in ("RRT-Connect", "LBKPIECE")
    assert planned.attempts[0].status in (PlanStatus.INTERRUPTED, PlanStatus.STUCK, PlanStatus.CIRCLED)
    assert any(text.endswith(", in turn with RRT-Connect and LBKPIECE") for text in texts)
    assert planned.clearance >= scene.safety
    # a rope around the U, whose walls end at x = -1 and 1.05 and y = 1.05, 0.11 m from it
    corners = [(0, 0), (-1, 0.84), (-1.11, 0.95), (-1.11, 1.05), (-1, 1.16), (1.05, 1.16), (1.16, 1.05), (2, 0)]
    rope = sum(math.dist(*ends) for ends in itertools.pairwise(corners))
    assert planned.length < 1.05 * rope


def test_a_cell_without_a_door_ends_at_the_time_limit():
    scene = trap(4)
    planned = plan(scene, seconds=0.5)
    assert not planned
    assert planned.status is PlanStatus.TIME_LIMIT
    assert "RRT-Connect and LBKPIECE found no path in 0.5 s" in planned.reason
    assert np.array_equal(planned.path, scene.start[None])


@pytest.mark.parametrize("name", ["planar_3r", "arm7"])
def test_steps_to_a_configuration_are_short_and_end_there(name):
    mechanism = cinegen.load(name)
    goal = mechanism.close(mechanism.q_home + 0.3)
    attraction = ConfigurationAttraction(mechanism, goal, "to a goal")
    path = attraction.rollout(mechanism.q_home, 40)
    steps = [mechanism.distance(a, b) for a, b in itertools.pairwise([mechanism.q_home, *path])]
    assert 0.05 < max(steps) <= 0.06 + 1e-6
    assert attraction.remaining(path[-1]) < 1e-6


def test_where_nothing_is_in_between_joints_move_straight():
    direct = plan(panda(start={"joints": PANDA_READY}))
    assert [attempt.strategy for attempt in direct.attempts] == ["all joints straight to the goal"]
    assert direct.field is None
    straight = direct.path[0] + np.linspace(0.0, 1.0, len(direct.path))[:, None] * (direct.path[-1] - direct.path[0])
    assert direct.path == pytest.approx(straight, abs=1e-9)


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
    planned = plan(trap())
    assert not planned
    assert "no configurations were sampled: " in planned.reason
    assert 'install "cinegen[sampling]"' in planned.reason


# --- joint values -------------------------------------------------------------------------------------------------


def test_joint_values_are_reached_exactly_around_a_post_and_fingers_do_not_move():
    start = {**PANDA_READY, "panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}  # fingers are partly open
    around_post = panda(start={"joints": start}, obstacle=[POST])
    mechanism = around_post.mechanism
    planned = plan(around_post)
    assert planned.status is PlanStatus.REACHED
    assert planned.attempts[-1].strategy != "all joints straight to the goal"
    end = {**AIM, "panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}
    assert mechanism.values(planned.path[-1]) == pytest.approx(end, abs=1e-9)
    fingers = planned.path[:, [mechanism.q_index(f"panda_finger_joint{i}") for i in (1, 2)]]
    assert (fingers == 0.02).all()
    assert planned.clearance >= around_post.safety
    assert (planned.clearances >= planned.clearance).all()


def test_joint_values_are_reached_exactly_from_a_start_within_their_tolerance():
    mechanism = cinegen.load("planar_3r")
    end = mechanism.values(mechanism.q_home + 5e-5)
    planned = plan(scene_of({"goal": {"joints": end}}, mechanism=mechanism), planner="vortex")
    assert planned.status is PlanStatus.REACHED
    assert mechanism.values(planned.path[-1]) == pytest.approx(end, abs=1e-12)


def test_a_coupled_robot_that_moves_by_little_is_planned(raff):
    small = raff("""robot cam {
      link 1 { type 2 pred 0 parameters { theta 1.5 } limits { 0 3 } actuated 1 }
      link 2 { type 1 pred 0 parameters { d 100 r 10 } limits { 0 20 } }
      coupling { link 2 link 1 lead 2400 }
    }""")
    ends = {"start": {"joints": {"joint1": 0.02}}, "goal": {"joints": {"joint1": 0.04}}}
    assert plan(scene_of(ends, mechanism=small)).status is PlanStatus.REACHED


def test_joints_that_do_not_move_the_node_are_locked_by_default():
    goal = {"point": [0.5, 0, 0.5]}
    assert panda(goal=goal).locked == ("panda_finger_joint1", "panda_finger_joint2")
    assert panda(goal=goal, node="panda_leftfinger").locked == ()  # the fingers are coupled
    free = panda(goal=goal, locked=[])
    assert free.locked == scene_of(free.document(), mechanism=load(PANDA)).locked == ()
    assert panda(goal={"joints": {"panda_finger_joint1": 0.01}}).locked == ()


def test_some_joint_values_leave_the_others_free(root):
    """At the start's value of joint1 the arm would be inside a disc at the goal."""
    post = {"kind": "disc", "radius": 0.1, "point": [0.6, 0.55]}
    values = {"node": "tool", "start": {"joints": {"joint1": 0.0}}, "goal": {"joints": {"joint3": 1.0}}}
    scene = scene_of(values | {"robot": "robots/planar_3r.raff", "obstacle": [post]}, root)
    planned = plan(scene)
    assert planned.status is PlanStatus.REACHED
    assert scene.mechanism.values(planned.path[-1])["joint3"] == pytest.approx(1.0, abs=1e-4)


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


def test_links_that_cannot_separate_are_no_collision():
    """A closed gripper: its fingers are nearer to each other than the safety distance, and stay so."""
    closed = {**PANDA_READY, "panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    scene = panda(start={"joints": closed})
    assert clearance_of(scene).least(scene.start) < 0.01
    assert plan(scene).status is PlanStatus.REACHED


# --- plan of a mechanism ----------------------------------------------------------------------------------------------
# `plan(mechanism, goal)`: scenes without a file.


BALL = {"name": "ball", "kind": "sphere", "radius": 0.05, "point": [0.4, 0.0, 0.3]}


@pytest.fixture(scope="module")
def arm():
    return cinegen.load("arm7")


def test_one_line_plans_to_a_point_a_pose_and_joint_values(arm):
    end = arm.configuration({"joint1": 0.5, "joint2": 0.4, "joint4": -1.0})
    pose = arm.placement(end, arm.end)
    to_point = cinegen.plan(arm, pose.translation)
    assert arm.placement(to_point.path[-1], arm.end).translation == pytest.approx(pose.translation, abs=1e-3)
    to_pose = cinegen.plan(arm, goal=pose)
    off = pin.log6(arm.placement(to_pose.path[-1], arm.end).actInv(pose)).vector
    assert off == pytest.approx(np.zeros(6), abs=1e-3)
    to_joints = cinegen.plan(arm, {"joint1": 0.5}, start=end, obstacles=[BALL])
    assert to_joints.path[0] == pytest.approx(end)
    assert to_joints.path[-1][arm.q_index("joint1")] == pytest.approx(0.5)
    assert [obstacle.name for obstacle in to_joints.scene.obstacles] == ["ball"]
    assert to_point.path[0] == pytest.approx(arm.q_home)


def test_other_keys_of_a_file_and_obstacles_of_a_scene_are_taken(arm):
    made = scene_of({"goal": {"point": [0, 0, 1]}, "obstacle": [BALL]}, mechanism=arm).obstacles[0]
    goal = {"point": [0.4, 0.2, 0.4], "tolerance": [0.1, 0.1, 0.1]}
    scene = scene_for(arm, goal, obstacles=[made, {**BALL, "name": "other"}], safety=0.02, locked=["joint3"])
    assert (scene.safety, scene.locked, scene.node) == (0.02, ("joint3",), arm.end)
    assert sorted(obstacle.name for obstacle in scene.obstacles) == ["ball", "other"]
    assert scene.tolerance == pytest.approx(0.1)
    with pytest.raises(SceneError, match="'ball' is the name of two"):
        scene_for(arm, goal, obstacles=[made, BALL])


def test_what_is_missing_or_given_twice_is_reported(arm):
    scene = scene_for(arm, [0.4, 0.2, 0.4])
    for robot_or_scene, keys, message in [
        (arm, {}, "goal is missing: write plan"),
        (scene, {"goal": [0, 0, 1]}, "give them only with a mechanism"),
        (arm, {"goal": [0, 0]}, "goal must be a pose"),
        (arm, {"goal": [0, 0, 1], "start": [0.0]}, "start must have 7 numbers"),
    ]:
        with pytest.raises(SceneError, match=message):
            plan(robot_or_scene, **keys)


# --- motions of closed mechanisms -------------------------------------------------------------------------------------
# Motions between configurations of a closed mechanism, judged by the closed form of a planar 3-RPR: the determinant of
# its legs' lines changes its sign where a motion passes a singularity of type 2, and only there.


FURTHEST = 0.15  # rad and characteristic lengths: between two configurations of a motion


@pytest.mark.parametrize(
    ("begin", "end", "is_clear"),
    [(60, 80, True), (60, 119, False), (60, 120, False), (60, 420, False), (90, 120, True)],
)
def test_a_parallelogram_is_not_led_through_its_flat_configuration(begin, end, is_clear):
    """All its bars are in line at 90 degrees, exactly in the middle of one motion. It may begin there;
    a whole revolution ends where it began."""
    mechanism = cinegen.load(parallelogram())
    ends = (mechanism.configuration({"drive": a, "pin": -a, "swing": a}) for a in np.radians([begin, end]))
    assert (clear_motion(Clearance(mechanism, [], []), *ends, 0.0) is not None) == is_clear


@pytest.mark.parametrize(("before", "after"), [(10.0, 10.0), (0.1, 3.0), (0.04, 0.06)])
def test_a_parallelogram_is_not_led_to_its_other_branch(before, after):
    """Where they cross, at 90 degrees, its determinant keeps its sign. With cranks of 1 and bars of 2, tan(b / 2) = -3
    tan(a / 2) is the other branch."""
    mechanism, a = cinegen.load(parallelogram()), math.radians(after)
    b, flat = -2.0 * math.atan(3.0 * math.tan(0.5 * a)), np.array([0.5, -0.5, 0.5]) * math.pi
    begin, end = flat - math.radians(before) * np.array([1.0, -1.0, 1.0]), flat + np.array([a, b, b])
    assert mechanism.closure(end) < 1e-12
    assert clear_motion(Clearance(mechanism, [], []), begin, end, 0.0) is None


def test_a_motion_ends_where_it_should_and_keeps_the_sign_of_the_determinant(root):
    """Also between two assembly modes: a motion never jumps from one to the other."""
    clearance = clearance_of(scene(root))
    mechanism, rng = clearance.mechanism, np.random.default_rng(0)
    kept = 0
    for _ in range(400):
        pose = rng.uniform([-0.2, -0.2, -np.pi], [0.2, 0.2, np.pi])
        other = pose + rng.normal(size=3) * [0.03, 0.03, 0.4]
        begin = configuration(mechanism, pose)
        end = configuration(mechanism, other, near=begin)
        motion = clear_motion(clearance, begin, end, 0.0)
        if motion is None:
            continue
        kept += 1
        assert np.array_equal(motion[0], begin)
        assert np.array_equal(motion[-1], end)
        signs = {np.sign(determinant(mechanism, q)) for q in motion}
        assert len(signs) == 1
        assert max(mechanism.distance(a, b) for a, b in itertools.pairwise(motion)) < FURTHEST
    assert kept > 100


# --- RRT-Connect ------------------------------------------------------------------------------------------------------
# RRT-Connect: ways that are clear all along, where vortices find none too, and over what loops leave.


# --- ways ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rod", "generic"])
def test_the_scenes_of_the_figures_are_solved(root, name):
    scene = load_scene(root / f"robots/scenes/{name}.toml")
    planned = plan(scene, planner=Planner.RRT_CONNECT)
    assert planned.status is PlanStatus.REACHED
    assert np.array_equal(planned.path[0], scene.start)
    off = scene.mechanism.placement(planned.path[-1], scene.node).translation - scene.goal.translation
    assert np.linalg.norm(off[: scene.translation]) < 1e-4
    assert planned.clearance >= scene.safety
    clearance = clearance_of(scene)
    assert min(clearance.least(q) for q in along(scene.mechanism, planned.path, 2e-3)) >= planned.clearance
    model = scene.mechanism.model
    assert ((planned.path >= model.lowerPositionLimit) & (planned.path <= model.upperPositionLimit)).all()


def test_a_joint_without_limits_goes_the_long_way_round(tmp_path):
    bar = '<collision><origin xyz="0.5 0 0"/><geometry><box size="1 0.02 0.02"/></geometry></collision>'
    turn = UrdfJoint("turn", "base", "arm", kind="continuous")
    end = UrdfJoint("end", "arm", "tip", "1 0 0", kind="fixed")
    (tmp_path / "hand.urdf").write_text(urdf_text([turn, end], {"arm": bar}))
    post = {"kind": "disc", "radius": 0.1, "point": [0.5 * math.cos(1.0), 0.5 * math.sin(1.0)]}
    aim = 2.5  # rad: the short way there leads through the post, the other is longer than half a turn
    goal = {"point": [math.cos(aim), math.sin(aim)]}
    scene = scene_of({"robot": "hand.urdf", "node": "tip", "goal": goal, "obstacle": [post]}, tmp_path)
    planned = plan(scene, planner=Planner.RRT_CONNECT)
    assert planned.status is PlanStatus.REACHED
    assert planned.path[-1, 0] == pytest.approx(aim - 2.0 * math.pi, abs=1e-4)
    assert planned.clearance >= scene.safety


def test_methods_in_turn_find_the_same_path_whenever_they_are_interrupted():
    scene = trap()
    clearance, outcomes = clearance_of(scene), []
    for turn in (600.0, 1e-4):
        sampler = PathSampler(scene, clearance, [np.array([2.0, 0.0])], 0, is_alternating=True)
        assert sampler.method == "RRT-Connect and LBKPIECE"
        while not sampler.search(time.monotonic() + turn):
            pass
        outcomes.append((sampler.method, sampler.path))
    (method, path), (other, again) = outcomes
    assert method == other
    assert np.array_equal(path, again)


# --- edges -----------------------------------------------------------------------------------------------------------

UNIT = st.floats(0.0, 1.0)


@pytest.fixture(scope="module")
def rod(root):
    """A scene, and the clearance in it."""
    scene = load_scene(root / "robots/scenes/rod.toml")
    return scene, clearance_of(scene)


@given(st.tuples(*6 * [UNIT]))
@settings(max_examples=80)
def test_an_edge_is_clear_all_along_and_none_is_where_something_is_too_near(rod, parts):
    scene, clearance = rod
    model = scene.mechanism.model
    low, high = model.lowerPositionLimit, model.upperPositionLimit
    begin, end = low + np.array(parts).reshape(2, 3) * (high - low)
    assume(np.abs(end - begin).max() > 1e-3)
    motion = clear_motion(clearance, begin, end, scene.safety)
    least = min(clearance.least(q) for q in along(scene.mechanism, [begin, end], 2e-3))
    assert (motion is None) == (clear_motion(clearance, end, begin, scene.safety) is None)
    if motion is None:
        assert least < scene.safety + 1e-3  # what it can't tell for sure within a hair's breadth, it refuses
        return
    assert least >= scene.safety
    assert np.array_equal(motion[[0, -1]], [begin, end])
    part = (motion - begin) @ (end - begin) / ((end - begin) @ (end - begin))
    assert (np.diff(part) > 0.0).all()
    assert motion == pytest.approx(begin + part[:, None] * (end - begin))


def test_an_edge_never_leads_to_another_assembly_mode(root):
    """Two modes with motors that stand alike: between them loops would have to open."""
    text = (root / "robots/five_bar.raff").read_text()
    mechanism, rng = cinegen.load(re.sub(r"limits \{.*?\}", "", text)), np.random.default_rng(0)
    home, modes = mechanism.q_home, []
    motors = {name: home[mechanism.q_index(name)] for name in mechanism.actuated}
    while len(modes) < 10:
        with contextlib.suppress(cinegen.ClosureError):
            guess = mechanism.configuration(motors, rng.uniform(-math.pi, math.pi, len(home)))
            modes.append(mechanism.close(guess, locked=mechanism.actuated))
    other = max(modes, key=lambda q: np.abs(np.sin((q - home) / 2.0)).max())
    other = home + np.remainder(other - home + math.pi, 2.0 * math.pi) - math.pi
    assert mechanism.closure(other) < 1e-9
    assert np.abs(other - home).max() > 1.0  # without motors, there is a way from one to the other
    clearance = Clearance(mechanism, [], [])
    assert clear_motion(clearance, home, other, 0.0) is None
    assert clear_motion(clearance, home, mechanism.close(home + 0.05), 0.0) is not None
