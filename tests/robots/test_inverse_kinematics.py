"""Point-to-point inverse kinematics: every pose that is known to be reachable is found, inside limits, loops closed.

Poses are made forwards: motors at random within their limits, loops closed by Gauss and Newton (another code than the
search uses), and kept where all joints are within theirs.
"""

import math
import sysconfig
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from elementary import angle_between
from hypothesis import given, settings
from hypothesis import strategies as st

import cinegen

pytestmark = pytest.mark.filterwarnings("ignore:.*should mimic another joint")  # the panda's second finger

ROBOTS = Path(__file__).parents[2] / "robots"
EXAMPLES = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
CLOSED = ("delta4", "five_bar", "gough", "hybrid", "planar_hybrid", "sr400")
SERIAL = ("arm7", "planar_3r", "rx90")


@cache
def mechanism_of(name: str) -> cinegen.Mechanism:
    if name == "panda":
        return cinegen.load(EXAMPLES / "panda_description/urdf/panda.urdf")
    return cinegen.load(ROBOTS / f"{name}.raff")


def end_of(mechanism: cinegen.Mechanism) -> str:
    ends = [node for node in ("panda_hand", "platform") if node in mechanism.nodes]
    return ends[0] if ends else mechanism.nodes[-1]


def limits_of(mechanism: cinegen.Mechanism) -> tuple[np.ndarray, np.ndarray]:
    return mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit


def within(mechanism: cinegen.Mechanism, q: np.ndarray) -> bool:
    low, high = limits_of(mechanism)
    return bool((q >= low - 1e-9).all() and (q <= high + 1e-9).all())


def configurations(mechanism: cinegen.Mechanism, count: int, seed: int) -> list[np.ndarray]:
    """Closed and within limits."""
    rng, found = np.random.default_rng(seed), []
    low, high = limits_of(mechanism)
    while len(found) < count:
        q = mechanism.q_home.copy()
        for joint in mechanism.actuated:
            i = mechanism.q_index(joint)
            reach = mechanism.length if mechanism.is_prismatic(joint) else math.pi
            q[i] = rng.uniform(max(low[i], q[i] - reach), min(high[i], q[i] + reach))
        try:
            q = mechanism.close(q, locked=mechanism.actuated)
        except cinegen.ClosureError:
            continue
        if within(mechanism, q):
            found.append(q)
    return found


@pytest.mark.parametrize(("name", "count"), [("panda", 100), *((name, 20) for name in (*SERIAL, *CLOSED))])
def test_every_reachable_pose_is_found(name: str, count: int) -> None:
    mechanism = mechanism_of(name)
    node = end_of(mechanism)
    for known in configurations(mechanism, count, seed=11):
        target = mechanism.placement(known, node)
        reached = cinegen.inverse_kinematics(mechanism, {node: target})
        assert reached, reached
        there = mechanism.placement(reached.q, node)
        assert np.linalg.norm(there.translation - target.translation) <= 1e-6
        assert angle_between(there.rotation, target.rotation) <= 1e-6
        assert mechanism.closure(reached.q) <= 1e-10
        assert within(mechanism, reached.q)


@pytest.mark.parametrize("name", ["arm7", "gough"])
def test_out_of_reach_it_says_what_was_tried_and_stays_whole(name: str) -> None:
    mechanism = mechanism_of(name)
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
    assert within(mechanism, reached.q)


@given(st.integers(0, 3), st.integers(0, 3), st.integers(0, 10**6))
@settings(deadline=None, max_examples=30)
def test_only_what_a_pull_holds_is_brought_there(translation: int, rotation: int, seed: int) -> None:
    mechanism = mechanism_of("rx90")
    node = end_of(mechanism)
    rng = np.random.default_rng(seed)
    low, high = limits_of(mechanism)
    target = mechanism.placement(rng.uniform(low, high), node)
    task = cinegen.FrameTask(node, target, translation, rotation)
    reached = cinegen.inverse_kinematics(mechanism, [task])
    assert reached
    straight, turn = task.errors(mechanism.placement(reached.q, node))
    assert np.abs(np.concatenate([straight, turn])).max(initial=0.0) <= 1e-6


def test_what_makes_no_sense_is_refused() -> None:
    mechanism = mechanism_of("rx90")
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
