"""`ForwardKinematics`: motors are followed on one branch, however far they jump."""

import itertools
import pickle
from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize
from elementary import at
from hypothesis import given, settings
from hypothesis import strategies as st
from slow_motion import walk
from small_robots import four_bar

import cinegen
from cinegen.model import ForwardKinematics

SOME = ("delta4", "five_bar", "hybrid")
seeds = st.integers(0, 2**32 - 1)


def slowly(mechanism: cinegen.Mechanism, q: np.ndarray, goal: np.ndarray) -> np.ndarray | None:
    """Where a slow motion from q (nq,) to the motors' goal ends; None where it meets a singularity."""
    scale = mechanism.scale[[mechanism.v_index(joint) for joint in mechanism.actuated]]
    steps = np.ceil(np.abs((goal - at(mechanism, q, mechanism.actuated)) / scale).max() / 0.01)
    walked = walk(mechanism, q, goal, max(1, int(steps)))
    return None if walked is None else walked[-1]


@pytest.mark.parametrize("name", SOME)
@settings(max_examples=8)
@given(seed=seeds)
def test_a_jump_ends_where_a_slow_motion_does(robot, name, seed):
    mechanism, rng = robot(name), np.random.default_rng(seed)
    motion = ForwardKinematics(mechanism)
    units = mechanism.scale[[mechanism.v_index(joint) for joint in mechanism.actuated]]
    arrived = 0
    for size in (1e-4, 0.03, 0.3, 0.3, 1.0):
        before = motion.q
        goal = at(mechanism, before, mechanism.actuated) + size * rng.uniform(-1.0, 1.0, len(units)) * units
        expected = slowly(mechanism, before, goal)
        try:
            q = motion.move(dict(zip(mechanism.actuated, goal, strict=True)))
        except cinegen.ClosureError:
            assert expected is None
            assert np.array_equal(motion.q, before)
            continue
        arrived += 1
        assert np.array_equal(at(mechanism, q, mechanism.actuated), goal)
        assert mechanism.closure(q) <= 1e-12
        if expected is None:
            motion.q = before
        else:
            assert q == pytest.approx(expected, abs=1e-9)
            assert q == pytest.approx(mechanism.close(q, mechanism.actuated), abs=1e-9)
    assert arrived >= 2


def area(mechanism: cinegen.Mechanism, q: np.ndarray, corners: tuple[str, str, str]) -> float:
    """Of the triangle of three nodes in the plane, m^2: positive where they go round to the left."""
    a, b, c = (mechanism.placement(q, node).translation for node in corners)
    return float(np.cross(b - a, c - a)[2]) / 2.0


def test_those_that_are_not_named_stay_and_nothing_moves_where_it_fails(robot):
    delta = robot("delta4")
    motion = ForwardKinematics(delta)
    q = motion.move({"joint1": 0.1})
    again = motion.move({"joint6": 0.2})
    assert again[delta.q_index("joint1")] == 0.1
    assert again[delta.q_index("joint12")] == delta.q_home[delta.q_index("joint12")]
    for values, says in (
        ({"joint6": 0.3, "jont1": 0.0}, "no joint 'jont1': did you mean 'joint1'"),
        ({"joint6": 0.3, "joint2": 0.0}, "joint 'joint2' is passive.*joint1, joint6, joint12"),
        ({"joint6": 0.3, "joint1": float("nan")}, "'joint1' is not a finite number: nan"),
        ({"joint6": 0.3, "joint1": "0.1"}, "'joint1' is not a finite number: '0.1'"),
        ({"joint6": 0.3, "joint1": True}, "'joint1' is not a finite number: True"),
        ({"joint6": 0.3, "joint1": None}, "'joint1' is not a finite number: None"),
        ({"joint6": 0.3, "joint1": 10**400}, "'joint1' is not a finite number: 1000"),
        ({"joint6": 0.3, "joint1": 1e7}, "would move from 0.1 to 1e[+]07 at once"),
        ({"joint6": 0.3, "joint1": 3.1}, "can't reach these values on this branch: the motion ends at joint1 [12][.]"),
    ):
        with pytest.raises(cinegen.CinegenError, match=says):
            motion.move(values)
        assert np.array_equal(motion.q, again)
        assert np.array_equal(motion.move({}), again)
    assert motion.move({"joint6": q[delta.q_index("joint6")]}) == pytest.approx(q, abs=1e-12)


def test_it_begins_on_the_branch_that_it_is_given(robot):
    bar = robot("four_bar")
    crank, coupler, rocker = (bar.q_home[bar.q_index(joint)] for joint in ("joint1", "joint2", "joint3"))
    away = bar.placement(bar.q_home, "link3").translation - bar.placement(bar.q_home, "link2").translation
    twice = 2.0 * np.arctan2(away[1], away[0])  # coupler and rocker, mirrored at the line between their feet
    other = bar.configuration({"joint2": twice - (crank + coupler) - crank, "joint3": twice - rocker})
    other = bar.close(other, ["joint1"])
    corners = ("link2", "link3", "frame5")
    assert area(bar, other, corners) == pytest.approx(-area(bar, bar.q_home, corners))
    motion = ForwardKinematics(bar, other)
    for i in range(1, 32):
        q = motion.move({"joint1": crank + 0.7 * i})
        assert area(bar, q, corners) * area(bar, other, corners) > 0.0
    assert np.array_equal(motion.move({"joint1": other[bar.q_index("joint1")]}), motion.q)
    assert np.cos(motion.q - other) == pytest.approx(np.ones(3), abs=1e-12)
    copied = pickle.loads(pickle.dumps(motion))
    assert np.array_equal(copied.q, motion.q)
    assert copied.move({"joint1": 1.0}) == pytest.approx(motion.move({"joint1": 1.0}), abs=1e-12)
    with pytest.raises(cinegen.CinegenError, match="open by"):
        motion.q = bar.q_home + 0.1


def test_a_mechanism_in_micrometres_moves_as_its_twin_in_metres():
    """All thresholds are parts of the characteristic length."""
    small, large = (cinegen.load(four_bar(lengths=size * np.array([120, 400, 360, 240]))) for size in (1e-6, 1e3))
    motion, other = ForwardKinematics(small), ForwardKinematics(large)
    for crank in (0.9, 2.0, 9.0, -4.0):
        assert motion.move({"joint1": crank}) == pytest.approx(other.move({"joint1": crank}), abs=1e-9)


@pytest.mark.parametrize("name", ["hybrid", "delta4_linear", "differential_wrist", "rx90"])
def test_rates_are_derivatives_of_the_motion(robot, name):
    mechanism, h = robot(name), 1e-4
    rng, sizes = np.random.default_rng(0), [mechanism.scale[mechanism.v_index(joint)] for joint in mechanism.actuated]
    v, a = (rng.uniform(-0.3, 0.3, len(sizes)) * sizes for _ in range(2))
    rates = [dict(zip(mechanism.actuated, values.tolist(), strict=True)) for values in (v, a)]
    velocities, accelerations = ForwardKinematics(mechanism).rates(*rates)

    def away(t):
        values = at(mechanism, mechanism.q_home, mechanism.actuated) + v * t + 0.5 * a * t * t
        q = ForwardKinematics(mechanism).move(dict(zip(mechanism.actuated, values.tolist(), strict=True)))
        return mechanism.difference(start, q)

    start = ForwardKinematics(mechanism).move({})
    scale = mechanism.scale
    assert velocities / scale == pytest.approx((away(h) - away(-h)) / (2.0 * h) / scale, abs=1e-7)
    assert accelerations / scale == pytest.approx((away(h) + away(-h)) / h**2 / scale, abs=1e-5)


def test_rates_at_a_dead_centre_are_refused(robot):
    """The rocker of a four-bar drives it, where crank and coupler are in line: it can't go on."""
    bar = robot("four_bar")
    motion, rocker = ForwardKinematics(bar), bar.v_index("joint3")

    def rate(crank):
        motion.move({"joint1": crank})
        return motion.rates({"joint1": 1.0})[0][rocker]

    cranks = np.linspace(0.0, 6.0, 60)
    begin, end = next((a, b) for a, b in itertools.pairwise(cranks.tolist()) if rate(a) * rate(b) < 0.0)
    q = motion.move({"joint1": scipy.optimize.brentq(rate, begin, end, xtol=1e-14)})
    driven = ForwardKinematics(replace(bar, actuated=("joint3",)), q)
    with pytest.raises(cinegen.ClosureError, match="singular"):
        driven.rates({"joint3": 1.0})
    assert np.abs(driven.rates({"joint3": 0.0})[0]).max() == 0.0


def test_rates_that_are_wrong_are_told(robot):
    motion = ForwardKinematics(robot("four_bar"))
    for rates, says in (
        (({"joint2": 1.0},), "passive"),
        (({"crank": 1.0},), "no joint"),
        (({"joint1": 1.0}, {"joint1": np.inf}), "rate of joint 'joint1' is not a finite number: inf"),
    ):
        with pytest.raises(cinegen.CinegenError, match=says):
            motion.rates(*rates)
