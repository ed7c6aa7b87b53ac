"""Joint limits as a file declares them, and which joints of a configuration are beyond theirs.

The limits below are written into the description, in degrees and mm; expected values are computed from those by hand.
"""

import math

import numpy as np
import pytest
from small_robots import four_bar
from urdf_text import joint_at, links, robot

import cinegen
import raff2urdf
from raff2urdf.loops.home import close_within

ARM = """robot r { base { }
  link 1 { type 2 pred 0 limits { -30 90 } }
  link 2 { parameters { d 100 } type 1 pred 1 limits { -50 200 } }
  link 3 { parameters { d 100 } type 2 pred 2 } }"""


@pytest.fixture
def arm(raff):
    return raff(ARM)


@pytest.mark.parametrize(("values", "expected"), [
    ({}, {}),
    ({"joint1": math.radians(91)}, {"joint1": math.radians(90)}),
    ({"joint2": 0.21}, {"joint2": 0.2}),
    ({"joint1": math.radians(89), "joint2": 0.19}, {}),
    ({"joint2": 0.3, "joint1": -3.0}, {"joint1": math.radians(-30), "joint2": 0.2}),
    ({"joint3": 1e3}, {}),
])  # fmt: skip
def test_a_joint_beyond_either_limit_is_reported_with_that_limit_in_file_order(arm, values, expected):
    exceeded = arm.limits.exceeded(arm.configuration(values))
    assert list(exceeded) == list(expected)
    assert exceeded == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("value", "sign"), [(0.2, 1.0), (-0.05, -1.0)])
def test_rounding_widens_both_limits_by_that_much_and_no_more(arm, value, sign):
    for by, expected in ((0.5e-6, {}), (2e-6, {"joint2"})):
        q = arm.configuration({"joint2": value + sign * by})
        assert set(arm.limits.exceeded(q)) == {"joint2"}
        assert set(arm.limits.exceeded(q, rounding=1e-6)) == set(expected)


@pytest.mark.parametrize(("degrees", "expected"), [
    (90 + 360, {}),
    (-30 - 720, {}),
    (95, {"joint1": 90}),
    (325, {"joint1": -30}),  # = -35
])  # fmt: skip
def test_a_revolute_joint_is_outside_where_no_whole_turn_brings_it_within(arm, degrees, expected):
    q = arm.configuration({"joint1": math.radians(degrees)})
    in_radians = {joint: math.radians(at) for joint, at in expected.items()}
    assert arm.limits.outside(q) == pytest.approx(in_radians, abs=1e-12)


def test_whole_turns_are_taken_from_revolute_joints_with_limits_only(arm):
    q = arm.configuration({"joint1": 0.5 + 2.0 * math.pi, "joint2": 0.1 + 2.0 * math.pi, "joint3": 0.7 + 2.0 * math.pi})
    expected = arm.configuration({"joint1": 0.5, "joint2": 0.1 + 2.0 * math.pi, "joint3": 0.7 + 2.0 * math.pi})
    assert arm.limits.unwound(q) == pytest.approx(expected, abs=1e-12)
    assert list(arm.limits.outside(q)) == ["joint2"]


def test_limits_are_a_mapping_with_arrays_in_the_order_of_q_and_v(arm):
    assert list(arm.limits) == list(arm.joints)
    with pytest.raises(KeyError, match="no joint 'joint4': did you mean 'joint"):
        arm.limits["joint4"]
    assert "joint4" not in arm.limits
    for joint, (lower, upper, velocity, effort) in arm.limits.items():
        i, j = arm.q_index(joint), arm.v_index(joint)
        assert (lower, upper) == (arm.limits.lower[i], arm.limits.upper[i])
        assert (velocity, effort) == (arm.limits.velocity[j], arm.limits.effort[j]) == (math.inf, math.inf)
    with pytest.raises(ValueError, match="read-only"):
        arm.limits.upper[0] = 1.0
    assert repr(arm.limits) == "<Limits of 3 joints>"


def test_limits_of_velocity_and_effort_are_those_of_a_urdf_and_infinite_where_it_says_0_or_nothing():
    limits = ('effort="0.5" velocity="0.3"', 'effort="0" velocity="0"', 'effort="1e9"')
    inside = [f'<limit lower="-1" upper="1" {limit}/>' for limit in limits]
    joints = [joint_at(f"j{k}", f"l{k}", f"l{k + 1}", inside=inside[k], kind="revolute") for k in range(3)]
    bounds = cinegen.load(robot(links("l0", "l1", "l2", "l3"), *joints)).limits
    nothing = (-1, 1, math.inf, math.inf)
    assert [tuple(bounds[joint]) for joint in bounds] == [(-1, 1, 0.3, 0.5), nothing, nothing]


def test_whether_configurations_are_within_limits_is_told_of_many_at_once(arm):
    inside, at, outside = (arm.configuration({"joint2": value}) for value in (0.0, 0.2, 0.2 + 2e-9))
    assert arm.limits.within(np.array([inside, at, outside])).tolist() == [True, True, False]
    assert arm.limits.within(outside, rounding=1e-8)
    assert not arm.limits.within(at, rounding=-1e-6)


# --- home within limits -----------------------------------------------------------------------------------------------
# Home: closed within all limits wherever such a configuration exists, near to what the file says.


def hinge(name: str, low: float, high: float) -> str:
    return f'<joint name="{name}" type="hinge" axis="0 1 0" range="{low} {high}"/>'


def limited(low: float, high: float, start: float = 60.0) -> str:
    """A four-bar whose rocker has limits, degrees."""
    return four_bar((start, -40, 100), (100, 300, 300, 250), ("", "", f"limits {{ {low} {high} }}"))


def test_another_branch_is_taken_where_the_one_as_written_is_beyond_a_limit():
    free = cinegen.load(limited(-179.0, 179.0))
    near = np.degrees(free.q_home[free.q_index("joint3")])
    assert near > 0.0
    below = cinegen.load(limited(-170.0, -10.0))
    assert below.closure(below.q_home) <= 1e-12
    assert -170.0 <= np.degrees(below.q_home[below.q_index("joint3")]) <= -10.0
    (note,) = [note for note in below.source.notes if "home was moved" in note]
    assert f"joint3 ({near:.4g} deg, limit -10)" in note


def test_what_cannot_be_met_is_named_joint_by_joint():
    with pytest.warns(cinegen.CinegenWarning, match=r"no configuration was found .* joint3 \([\d.]+ deg, limit 3\)"):
        mechanism = cinegen.load(limited(-3.0, 3.0))
    assert mechanism.closure(mechanism.q_home) <= 1e-12


@pytest.mark.parametrize("name", ["delta4", "gough", "belt_five_bar"])
def test_any_box_of_limits_around_a_closed_configuration_holds_home(robot, name):
    """Limits are drawn around random closed configurations, home is written outside them."""
    mechanism = robot(name)
    system, rng = mechanism.structure.system, np.random.default_rng(5)
    at, columns = mechanism.structure.scalar_joints
    for inside in mechanism.random_closed(6, seed=2):
        margin = rng.uniform(0.0, 0.4, (2, len(inside)))
        lower, upper = inside - margin[0], inside + margin[1]
        scalars = dict(zip(at.tolist(), columns.tolist(), strict=True))
        q = close_within(system, mechanism.q_home, mechanism.q_home, lower, upper, scalars)
        assert np.all((q[at] >= lower[at]) & (q[at] <= upper[at]))
        assert mechanism.closure(q) <= 1e-12


def test_joints_of_a_tree_begin_at_the_nearest_value_within_their_limits():
    """A hand whose fingers start below their lower limits: in an MJCF at 0."""
    text = f"""<mujoco><compiler angle="degree"/><worldbody><body name="palm">{hinge("swing", -90, 90)}
      <geom size="0.1"/><body name="femur">{hinge("femur", 9.74, 120)}<geom size="0.1"/>
      <body name="knee">{hinge("knee", -100, -20)}<geom size="0.1"/></body></body></body></worldbody></mujoco>"""
    hand = cinegen.load(text)
    assert dict(hand.limits.exceeded(hand.q_home)) == {}
    assert np.degrees(hand.q_home) == pytest.approx([0.0, 9.74, -20.0])
    (note,) = [note for note in hand.source.notes if "home was moved" in note]
    assert "femur (0 deg, limit 9.74), knee (0 deg, limit -20)" in note


def test_raff2urdf_writes_the_same_home(tmp_path):
    (tmp_path / "bars.raff").write_text(limited(-170.0, -10.0), encoding="utf-8")
    with pytest.warns(raff2urdf.RaffWarning, match="home 100 of link 3 is outside its limits"):
        (made,) = raff2urdf.convert(tmp_path / "bars.raff", tmp_path)
    assert cinegen.load(made.file).q_home == pytest.approx(cinegen.load(limited(-170.0, -10.0)).q_home, abs=1e-9)
