"""Ranges for who gives none: they hold what can be reached."""

import math

import numpy as np
import pytest

from cinegen.workspace import MapError
from cinegen.workspace.default_range import default_range


@pytest.mark.parametrize("name", ["delta4", "planar_3r", "rx90"])
def test_what_is_reached_from_home_lies_in_the_range_of_each_coordinate_that_can_change(robot, name):
    mechanism = robot(name)
    low, high = mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit
    places = [
        mechanism.placement(q, mechanism.end).translation
        for q in (mechanism.q_home, *mechanism.random_closed(60, seed=5))
        if ((q >= low) & (q <= high)).all()
    ]
    assert len(places) > 1
    for k, coordinate in enumerate("xyz"):
        values = np.array(places)[:, k]
        if np.ptp(values) < 1e-9:
            with pytest.raises(MapError, match=f"can't move along {coordinate}"):
                default_range(mechanism, coordinate)
            continue
        first, last = default_range(mechanism, coordinate)
        assert first <= values.min()
        assert values.max() <= last
        assert f"{first:.4g}" == f"{first}".removesuffix(".0")  # easily read


def test_a_range_is_little_wider_than_what_is_reached(robot):
    """Links of 400, 300 and 200 mm: a disc of 0.9 m."""
    for coordinate in "xy":
        low, high = default_range(robot("planar_3r"), coordinate)
        assert -1.0 <= low <= high <= 1.0
    assert default_range(robot("planar_3r"), "x")[1] >= 0.9


def test_motors_go_as_far_as_their_limits_or_half_a_turn(robot):
    five_bar = robot("five_bar")
    assert default_range(five_bar, "joint1") == pytest.approx((math.radians(60.0), math.radians(200.0)))
