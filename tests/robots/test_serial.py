"""The serial arms, and SR400 whose forearm a parallelogram moves, against closed forms."""

import math

import numpy as np
import pytest
from elementary import document, forward, length, limits, link, values, wrapped


def random_configurations(mechanism, count: int, seed: int) -> list[np.ndarray]:
    low, high = limits(mechanism, mechanism.joints)
    rng = np.random.default_rng(seed)
    return [
        mechanism.configuration(dict(zip(mechanism.joints, rng.uniform(low, high), strict=True))) for _ in range(count)
    ]


def angles(mechanism, q: np.ndarray) -> list[float]:
    """The joints' values, joint1 first."""
    named = values(mechanism, q)
    return [named[joint] for joint in sorted(named, key=lambda name: int(name[5:]))]


def of(name: str, number: int, parameter: str, robot: str | None = None) -> float:
    """A length (m) of a robot's file."""
    text = document(name)
    return length(text, getattr(link(text, number, robot).parameters, parameter))


# --- rx90 --------------------------------------------------------------------------------------------------------


def rx90(t: list[float], d3: float, rl4: float) -> np.ndarray:
    """Staubli RX-90, 0T6 as published: W. Khalil and E. Dombre, "Modeling, identification and control of robots",
    section 3.3, example 3.1: columns s, n, a and P."""
    c1, c4, c5, c6 = (math.cos(t[i]) for i in (0, 3, 4, 5))
    s1, s4, s5, s6 = (math.sin(t[i]) for i in (0, 3, 4, 5))
    c2, s2, c23, s23 = math.cos(t[1]), math.sin(t[1]), math.cos(t[1] + t[2]), math.sin(t[1] + t[2])
    sx = c1 * (c23 * (c4 * c5 * c6 - s4 * s6) - s23 * s5 * c6) - s1 * (s4 * c5 * c6 + c4 * s6)
    sy = s1 * (c23 * (c4 * c5 * c6 - s4 * s6) - s23 * s5 * c6) + c1 * (s4 * c5 * c6 + c4 * s6)
    sz = s23 * (c4 * c5 * c6 - s4 * s6) + c23 * s5 * c6
    nx = c1 * (-c23 * (c4 * c5 * s6 + s4 * c6) + s23 * s5 * s6) + s1 * (s4 * c5 * s6 - c4 * c6)
    ny = s1 * (-c23 * (c4 * c5 * s6 + s4 * c6) + s23 * s5 * s6) - c1 * (s4 * c5 * s6 - c4 * c6)
    nz = -s23 * (c4 * c5 * s6 + s4 * c6) - c23 * s5 * s6
    ax = -c1 * (c23 * c4 * s5 + s23 * c5) + s1 * s4 * s5
    ay = -s1 * (c23 * c4 * s5 + s23 * c5) - c1 * s4 * s5
    az = -s23 * c4 * s5 + c23 * c5
    px, py, pz = -c1 * (s23 * rl4 - c2 * d3), -s1 * (s23 * rl4 - c2 * d3), c23 * rl4 + s2 * d3
    return np.array([[sx, nx, ax, px], [sy, ny, ay, py], [sz, nz, az, pz], [0.0, 0.0, 0.0, 1.0]])


def test_the_rx90_is_where_the_published_closed_form_says(robot):
    arm = robot("rx90")
    d3, rl4 = of("rx90", 3, "d"), of("rx90", 4, "r")
    for q in random_configurations(arm, 500, seed=0):
        expected = rx90(angles(arm, q), d3, rl4)
        assert arm.placement(q, "link6").homogeneous == pytest.approx(expected, abs=1e-13)
        assert np.array_equal(arm.placement(q, "tool").homogeneous, arm.placement(q, "link6").homogeneous)


def test_the_rx90s_jacobian_vanishes_in_the_published_singularities(robot):
    """det J = (C3 D3 RL4 S5)(S23 RL4 - C2 D3), but for the sign: Khalil and Dombre, section 5.9."""
    arm = robot("rx90")
    d3, rl4 = of("rx90", 3, "d"), of("rx90", 4, "r")
    for q in random_configurations(arm, 200, seed=2):
        _, t2, t3, _, t5, _ = angles(arm, q)
        expected = d3 * rl4 * math.cos(t3) * math.sin(t5) * (math.sin(t2 + t3) * rl4 - math.cos(t2) * d3)
        assert abs(np.linalg.det(arm.jacobian(q, "tool"))) == pytest.approx(abs(expected), abs=1e-13)


# --- sr400 -------------------------------------------------------------------------------------------------------


def sr400_closed(arm, count: int, seed: int) -> list[np.ndarray]:
    """Closed configurations: all motors random, within their limits and those of the parallelogram."""
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        goal = rng.uniform(*limits(arm, arm.actuated))
        motors = dict(zip(arm.actuated, goal, strict=True))
        if abs(math.pi / 2 - motors["joint2"] + motors["joint7"]) < math.radians(75.0):  # theta3's limits
            found.append(forward(arm, arm.q_home, goal, longest=0.5))
    return found


def test_the_sr400s_parallelogram_obeys_its_closed_form(robot):
    """theta3 = 90 - theta2 + theta7, theta8 = theta2 - theta7, theta9 = 180 - theta2 + theta7: W. Khalil and E. Dombre,
    chapter 7."""
    arm = robot("sr400")
    for q in sr400_closed(arm, 200, seed=0):
        t = values(arm, q)
        lean = t["joint7"] - t["joint2"]
        for joint, expected in (("joint3", math.pi / 2 + lean), ("joint8", -lean), ("joint9", math.pi + lean)):
            assert abs(wrapped(t[joint] - expected)) <= 1e-11
