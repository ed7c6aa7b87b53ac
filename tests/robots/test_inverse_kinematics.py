"""Point-to-point inverse kinematics: every pose that is known to be reachable is found, inside limits, loops closed.

Poses are made forwards: motors at random within their limits, loops closed by Gauss and Newton (another code than the
search uses), and kept where all joints are within theirs.
"""

import math
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from elementary import angle_between
from example_robots import PANDA, load
from hypothesis import given, settings
from hypothesis import strategies as st

import cinegen

CLOSED = ("delta4", "five_bar", "gough", "hybrid", "planar_hybrid", "sr400")
SERIAL = ("arm7", "planar_3r", "rx90")


def end_of(mechanism: cinegen.Mechanism) -> str:
    return "panda_hand" if "panda_hand" in mechanism.nodes else mechanism.nodes[-1]


def configurations(mechanism: cinegen.Mechanism, count: int, seed: int) -> list[np.ndarray]:
    """Closed and within limits."""
    rng, samples = np.random.default_rng(seed), []
    low, high = mechanism.limits.lower, mechanism.limits.upper
    while len(samples) < count:
        q = mechanism.q_home.copy()
        for joint in mechanism.actuated:
            i = mechanism.q_index(joint)
            reach = mechanism.length if mechanism.is_prismatic(joint) else math.pi
            q[i] = rng.uniform(max(low[i], q[i] - reach), min(high[i], q[i] + reach))
        try:
            q = mechanism.close(q, locked=mechanism.actuated)
        except cinegen.ClosureError:
            continue
        if mechanism.limits.within(q, 1e-9):
            samples.append(q)
    return samples


@pytest.mark.parametrize(("name", "count"), [(PANDA, 100), *((name, 20) for name in (*SERIAL, *CLOSED))])
def test_every_reachable_pose_is_found(name: str, count: int) -> None:
    mechanism = load(name)
    node = end_of(mechanism)
    for known in configurations(mechanism, count, seed=11):
        target = mechanism.placement(known, node)
        reached = cinegen.inverse_kinematics(mechanism, {node: target})
        assert reached, reached
        pose = mechanism.placement(reached.q, node)
        assert np.linalg.norm(pose.translation - target.translation) <= 1e-6
        assert angle_between(pose.rotation, target.rotation) <= 1e-6
        assert mechanism.closure(reached.q) <= 1e-10
        assert mechanism.limits.within(reached.q, 1e-9)


@pytest.mark.parametrize("name", ["arm7", "five_bar"])
def test_from_nearby_the_nearby_solution_is_taken(name: str) -> None:
    mechanism = load(name)
    node = end_of(mechanism)
    low, high = mechanism.limits.lower, mechanism.limits.upper
    for known in configurations(mechanism, 10, seed=4):
        if min((known - low).min(), (high - known).min()) < 0.1:
            continue
        reached = cinegen.inverse_kinematics(mechanism, {node: mechanism.placement(known, node)}, known + 1e-3)
        assert reached.starts == 1
        assert np.abs(reached.q - known).max() < 0.05


def test_where_a_planar_arm_reaches_is_a_disc() -> None:
    mechanism = load("planar_3r")
    node = end_of(mechanism)
    links = [mechanism.placement(mechanism.q_home, n).translation for n in (*mechanism.nodes[1:4], node)]
    reach = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(links))
    base = links[0]
    for direction in np.linspace(-0.5, 0.5, 7):
        way = np.array([math.cos(direction), math.sin(direction), 0.0])
        for part, reachable in ((0.999, True), (1.00001, False), (1.001, False)):
            target = pin.SE3(np.eye(3), base + part * reach * way)
            reached = cinegen.inverse_kinematics(mechanism, [cinegen.FrameTask(node, target, 3, 0)], limits=False)
            assert bool(reached) == reachable
            if not reachable:
                assert reached.errors[0][0] == pytest.approx((part - 1.0) * reach, rel=1e-3)


@pytest.mark.parametrize("name", ["arm7", "gough"])
def test_out_of_reach_it_says_what_was_tried_and_stays_whole(name: str) -> None:
    mechanism = load(name)
    node = end_of(mechanism)
    far = mechanism.placement(mechanism.q_home, node)
    far.translation = far.translation + np.array([0.0, 0.0, 20.0 * mechanism.length])
    reached = cinegen.inverse_kinematics(mechanism, {node: far}, starts=12)
    assert not reached
    assert not reached.found
    assert reached.starts == 12
    assert "12 starts" in str(reached)
    assert reached.errors[0][0] > 10.0 * mechanism.length
    assert mechanism.closure(reached.q) <= 1e-10
    assert mechanism.limits.within(reached.q, 1e-9)


@given(st.integers(0, 3), st.integers(0, 3), st.integers(0, 10**6))
@settings(max_examples=30)
def test_only_what_a_pull_holds_is_brought_there(translation: int, rotation: int, seed: int) -> None:
    mechanism = load("rx90")
    node = end_of(mechanism)
    rng = np.random.default_rng(seed)
    low, high = mechanism.limits.lower, mechanism.limits.upper
    target = mechanism.placement(rng.uniform(low, high), node)
    task = cinegen.FrameTask(node, target, translation, rotation)
    reached = cinegen.inverse_kinematics(mechanism, [task])
    assert reached
    straight, turn = task.errors(mechanism.placement(reached.q, node))
    assert np.abs(np.concatenate([straight, turn])).max(initial=0.0) <= 1e-6


def test_what_was_asked_before_makes_no_difference() -> None:
    """Not even where starts at random are needed."""
    mechanism = load(PANDA)
    poses = [mechanism.placement(q, "panda_hand") for q in configurations(mechanism, 60, seed=12)]
    first = [cinegen.inverse_kinematics(mechanism, {"panda_hand": pose}, seed=3) for pose in poses]
    assert max(reached.starts for reached in first) > 9
    for pose, before in reversed(list(zip(poses, first, strict=True))):
        again = cinegen.inverse_kinematics(mechanism, {"panda_hand": pose}, seed=3)
        np.testing.assert_array_equal(again.q, before.q)


def test_what_makes_no_sense_is_refused() -> None:
    mechanism = load("rx90")
    node = end_of(mechanism)
    good = mechanism.placement(mechanism.q_home, node)
    bad = good.copy()
    bad.translation = np.array([np.nan, 0.0, 0.0])
    for targets, options, message in (
        ({}, {}, "at least one node"),
        ({node: bad}, {}, "finite"),
        ({node: "there"}, {}, "finite"),
        ({"nowhere": good}, {}, "nowhere"),
        ({node: good}, {"starts": 0}, "above 0"),
        ({node: good}, {"q": np.zeros(99)}, "99"),
    ):
        with pytest.raises(cinegen.CinegenError, match=message):
            cinegen.inverse_kinematics(mechanism, targets, **options)
