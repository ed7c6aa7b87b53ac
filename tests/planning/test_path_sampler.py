"""RRT-Connect: ways that are clear all along, where vortices find none too, and over what loops leave."""

import contextlib
import itertools
import math
import re
import time

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from paths import along
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.collision import clearance_of, load_scene, scene_of
from cinegen.collision.clearance import Clearance
from cinegen.planning import Planner, PlanStatus, plan
from cinegen.planning.clear_motion import clear_motion
from cinegen.planning.sampling.path_sampler import PathSampler


def walls(*corners):
    """Boxes, 0.1 m thick, from corner to corner."""
    boxes = []
    for i, (a, b) in enumerate(itertools.pairwise(np.array(corners, dtype=float))):
        size = [float(np.linalg.norm(b - a)) + 0.1, 0.1]
        angle = math.atan2(b[1] - a[1], b[0] - a[0])
        middle = ((a + b) / 2).tolist()
        boxes.append({"name": f"wall {i}", "kind": "box", "size": size, "point": middle, "angle": angle})
    return boxes


SPIRAL = walls((1, 1), (2, 1), (2, 2), (0, 2), (0, 0), (3, 0), (3, 3), (-1, 3), (-1, -1), (4, -1))


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
    values = {"mobile": {"radius": 0.15}, "safety": 0.05, "start": {"point": [1.0, 1.5]}, "goal": {"point": [5.0, 1.0]}}
    scene = scene_of(values | {"obstacle": SPIRAL})
    clearance, outcomes = clearance_of(scene), []
    for turn in (600.0, 1e-4):
        sampler = PathSampler(scene, clearance, [np.array([5.0, 1.0])], 0, is_alternating=True)
        assert sampler.method == "RRT-Connect and LBKPIECE"
        while not sampler.search(time.monotonic() + turn):
            pass
        outcomes.append((sampler.method, sampler.path))
    (method, path), (other, again) = outcomes
    assert method == other
    assert np.array_equal(path, again)


# --- loops -----------------------------------------------------------------------------------------------------------


def test_a_crank_and_its_coupler_turn_with_the_loop_closed(robot):
    """One freedom, and joints without limits that the loop turns too."""
    mechanism = robot("four_bar")
    q_goal = mechanism.q_home.copy()
    for _ in range(20):
        q_goal[mechanism.q_index("joint1")] += 0.1
        q_goal = mechanism.close(q_goal, locked=["joint1"])
    goal = mechanism.placement(q_goal, "tool").translation[:2].tolist()
    scene = scene_of({"node": "tool", "safety": 0.002, "goal": {"point": goal}}, mechanism=mechanism)
    planned = plan(scene, planner=Planner.RRT_CONNECT)
    assert planned.status is PlanStatus.REACHED
    assert max(mechanism.closure(q) for q in planned.path) < 1e-9
    assert planned.path[-1] == pytest.approx(q_goal, abs=1e-3)
    assert planned.clearance >= 0.002


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
