"""ReachBounds: least and largest distances across one joint are bounds, and are attained."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cinegen.workspace.reach_bounds import ReachBounds, _prismatic_bounds, _revolute_bounds

VECTORS = st.tuples(*(st.floats(-2.0, 2.0) for _ in range(3))).map(np.array)
AXES = VECTORS.filter(lambda v: np.linalg.norm(v) > 0.1).map(lambda v: v / np.linalg.norm(v))
RANGES = st.tuples(st.floats(-7.0, 7.0), st.floats(0.0, 8.0)).map(lambda r: (r[0], r[0] + r[1]))


def turned(axis, angles, w):
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    return w * c + np.cross(axis, w) * s + axis * (axis @ w) * (1.0 - c)


@given(AXES, VECTORS, VECTORS, RANGES)
def test_distances_across_a_joint_that_turns(axis, u, w, between):
    seen = np.linalg.norm(turned(axis, np.linspace(*between, 2000), w) - u, axis=1)
    least, most = _revolute_bounds(axis, u, w, *between)
    assert (least, most) == pytest.approx((seen.min(), seen.max()), abs=1e-2)
    assert least <= seen.min() + 1e-7
    assert most >= seen.max() - 1e-7


@given(AXES, VECTORS, RANGES)
def test_distances_across_a_joint_that_slides(axis, away, between):
    seen = np.linalg.norm(np.linspace(*between, 2000)[:, None] * axis - away, axis=1)
    least, most = _prismatic_bounds(axis, away, *between)
    assert (least, most) == pytest.approx((seen.min(), seen.max()), abs=1e-2)
    assert least <= seen.min() + 1e-9
    assert most >= seen.max() - 1e-9


def test_what_has_no_limits_has_no_largest_distance():
    assert _prismatic_bounds(np.eye(3)[0], np.array([0.3, 0.4, 0.0]), -math.inf, math.inf) == pytest.approx(
        (0.4, math.inf)
    )
    assert _revolute_bounds(
        np.eye(3)[2], np.array([0.3, 0.0, 0.0]), np.array([0.0, 0.5, 0.0]), -math.inf, math.inf
    ) == (pytest.approx((0.2, 0.8)))


CARRIAGE = """
robot carriage {
  base { }
  link 1 { parameters { r 400.0 } type 1 pred 0 limits { 200.0 700.0 } }
  link 2 { parameters { d 300.0 theta 90.0 } type 2 pred 1 limits { 60.0 120.0 } }
  frame 20 { name "tool" parameters { d 400.0 } pred 2 }
  constraint { frame 20 sensor ( 0 1 ) }
}
sensor 1 { port "/dev/null" translation 3 rotation 3 }
"""


def test_a_slide_before_a_turn(raff):
    """From the base's origin: 300 aside and 200 to 700 up to the second joint, then 400."""
    bounds = ReachBounds(raff(CARRIAGE), "tool", True, 3)
    assert bounds.outer[0] == pytest.approx(math.hypot(0.3, 0.7), abs=1e-8)
    assert bounds.inner[0] == pytest.approx(math.hypot(0.3, 0.2), abs=1e-8)
    radius = ReachBounds(raff(CARRIAGE), "tool").radius((0.0, 0.0, 0.0))
    assert math.hypot(0.5, 0.7) <= radius <= math.hypot(0.3, 0.7) + 0.4 + 1e-8
    assert ReachBounds(raff(CARRIAGE), "tool").radius((0.0, 1.0, 0.0)) == pytest.approx(1.0 + radius)
    for axis in range(3):
        assert ReachBounds(raff(CARRIAGE), "tool").interval(axis) == pytest.approx((-radius, radius))


def test_the_base_stays_where_it_is(robot):
    assert ReachBounds(robot("rx90"), "base").interval(0) == (-math.inf, math.inf)
    assert not ReachBounds(robot("rx90"), "base").exclude(np.ones((2, 3)), np.eye(3)[None]).any()
