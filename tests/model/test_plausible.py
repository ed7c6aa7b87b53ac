"""Numbers in the wrong unit are refused by the geometry of the robot; whatever may be meant is not."""

import math

import numpy as np
import pytest

from cinegen.model.plausible import ImplausibleError, check_joint, check_lengths, check_revolution, check_speed, reach


@pytest.mark.parametrize("name", ["arm7", "delta4", "four_bar", "gough"])
def test_no_node_gets_further_than_the_reach_and_the_reach_is_no_wild_guess(robot, name):
    mechanism = robot(name)
    far = max(
        float(np.linalg.norm(mechanism.placement(q, node).translation))
        for q in (mechanism.q_home, *mechanism.structure.samples)
        for node in mechanism.nodes
    )
    assert far <= reach(mechanism) * (1.0 + 1e-9)
    assert reach(mechanism) < 10.0 * far


@pytest.mark.parametrize("name", ["arm7", "delta4", "five_bar", "gough"])
def test_every_point_within_reach_is_accepted_in_m_and_refused_in_mm(robot, name):
    mechanism = robot(name)
    node = mechanism.end
    for q in mechanism.structure.samples:
        point = mechanism.placement(q, node).translation
        check_lengths(mechanism, "x", point.tolist())
        check_lengths(mechanism, "x", (5.0 * point).tolist())  # a map may be larger than the workspace
        if np.abs(point).max() > 0.05 * reach(mechanism):
            with pytest.raises(ImplausibleError, match=r"did you mean .* mm"):
                check_lengths(mechanism, "x", (1000.0 * point).tolist())


def test_joint_values_in_degrees_or_mm_are_refused_where_they_fit(robot):
    arm, hexapod = robot("planar_3r"), robot("gough")
    for degrees in (60.0, -120.0, 170.0):
        check_joint(arm, "joint1", [math.radians(degrees)])
        check_joint(arm, "joint1", [math.radians(degrees) + 2.0 * math.pi])  # a whole revolution is no other unit
        with pytest.raises(ImplausibleError, match=f"did you mean {degrees:g} degrees"):
            check_joint(arm, "joint1", [degrees])
    check_joint(arm, "joint1", [500.0])  # 500 degrees are beyond its limits, too
    check_joint(hexapod, "joint3", [0.9])
    check_joint(hexapod, "joint3", [1.4])  # beyond its limits, in m
    for millimetres in (900.0, 100.0):
        with pytest.raises(ImplausibleError, match=f"did you mean {millimetres:g} mm"):
            check_joint(hexapod, "joint3", [millimetres])
    check_speed(hexapod, "joint3", 0.2)
    with pytest.raises(ImplausibleError, match=r"did you mean 200 mm/s, which are 0\.2 m/s"):
        check_speed(hexapod, "joint3", 200.0)
    check_joint(robot("four_bar"), "joint1", [60.0])  # without limits


def test_an_orientation_range_of_more_than_a_revolution_is_refused():
    check_revolution("rz", -math.pi, math.pi)
    with pytest.raises(ImplausibleError, match=r"rz: -3438 deg to 3438 deg is more.*did you mean -60..60deg"):
        check_revolution("rz", -60.0, 60.0)
    with pytest.raises(ImplausibleError, match=r"more than one revolution$"):
        check_revolution("rz", 0.0, 4000.0)
