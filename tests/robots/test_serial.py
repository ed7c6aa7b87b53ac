"""The serial arms, and SR400 whose forearm a parallelogram moves, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from elementary import document, forward, length, limits, link, placed, product, shift, turn, values, wrapped
from scipy.spatial.transform import Rotation

import cinegen


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


def test_the_rx90s_orientation_is_the_product_of_its_table(robot):
    """alpha 0, 90, 0, -90, 90, -90, each before its theta, with scipy's rotations."""
    arm = robot("rx90")
    for q in random_configurations(arm, 200, seed=1):
        whole = Rotation.identity()
        for alpha, theta in zip((0, 90, 0, -90, 90, -90), angles(arm, q), strict=True):
            whole = whole * Rotation.from_euler("x", alpha, degrees=True) * Rotation.from_euler("z", theta)
        assert arm.placement(q, "tool").rotation == pytest.approx(whole.as_matrix(), abs=1e-13)


def test_the_rx90s_jacobian_vanishes_in_the_published_singularities(robot):
    """det J = (C3 D3 RL4 S5)(S23 RL4 - C2 D3), but for the sign: Khalil and Dombre, section 5.9."""
    arm = robot("rx90")
    d3, rl4 = of("rx90", 3, "d"), of("rx90", 4, "r")
    for q in random_configurations(arm, 200, seed=2):
        _, t2, t3, _, t5, _ = angles(arm, q)
        expected = d3 * rl4 * math.cos(t3) * math.sin(t5) * (math.sin(t2 + t3) * rl4 - math.cos(t2) * d3)
        assert abs(np.linalg.det(arm.jacobian(q, "tool"))) == pytest.approx(abs(expected), abs=1e-13)


# --- arm7, serial_5dof, two_arms ---------------------------------------------------------------------------------


def alternating(alphas: list[float], lengths: list[float], thetas: list[float]) -> np.ndarray:
    """Rx(alpha) Rz(theta) Tz(r), one after the other; degrees, m, rad."""
    steps = zip(alphas, lengths, thetas, strict=True)
    return product(*(product(turn("x", math.radians(a)), turn("z", t), shift("z", r)) for a, r, t in steps))


def test_the_arm_with_seven_joints_is_the_product_of_elementary_transforms(robot):
    """The maker's lengths stand here again, so that no slip of the file goes by."""
    arm = robot("arm7")
    for q in random_configurations(arm, 300, seed=0):
        expected = alternating(
            [0, -90, 90, 90, -90, -90, 90], [0.340, 0.0, 0.400, 0.0, 0.400, 0.0, 0.0], angles(arm, q)
        ) @ shift("z", 0.126)
        assert arm.placement(q, "tool").homogeneous == pytest.approx(expected, abs=1e-13)


def test_the_arm_with_seven_joints_has_a_wrist_whose_distance_the_elbow_alone_decides(robot):
    arm = robot("arm7")
    for q in random_configurations(arm, 100, seed=1):
        shoulder, wrist = (arm.placement(q, node).translation for node in ("link2", "link6"))
        assert shoulder == pytest.approx([0.0, 0.0, 0.340], abs=1e-15)
        elbow = angles(arm, q)[3]
        assert np.linalg.norm(wrist - shoulder) == pytest.approx(0.8 * math.cos(elbow / 2.0), abs=1e-13)


def test_the_elbow_of_the_arm_with_seven_joints_swings_while_its_tool_stands_still(robot):
    """Its one redundant motion: the Jacobian's null vector leaves the wrist's distance, so the elbow, alone."""
    arm = robot("arm7")
    for q in random_configurations(arm, 50, seed=2):
        _, sigma, vt = np.linalg.svd(arm.jacobian(q, "tool"))
        if sigma[-1] > 1e-3:
            assert vt[-1][arm.v_index("joint4")] == pytest.approx(0.0, abs=1e-9)


def test_the_serial_arm_of_five_joints_stays_in_its_vertical_plane(robot):
    arm = robot("serial_5dof")
    height, upper, fore, hand = (of("serial_5dof", n, p) for n, p in ((1, "r"), (3, "d"), (4, "d"), (20, "r")))
    for q in random_configurations(arm, 300, seed=0):
        t1, t2, t3, t4, t5 = angles(arm, q)
        t23, t234 = t2 + t3, t2 + t3 + t4
        out = upper * math.cos(t2) + fore * math.cos(t23) + hand * math.sin(t234)
        up = height + upper * math.sin(t2) + fore * math.sin(t23) - hand * math.cos(t234)
        rolled = product(turn("z", t1), turn("x", math.pi / 2), turn("z", t234), turn("x", math.pi / 2), turn("z", t5))
        there = arm.placement(q, "tool")
        assert there.translation == pytest.approx([out * math.cos(t1), out * math.sin(t1), up], abs=1e-13)
        assert there.rotation == pytest.approx(rolled[:3, :3], abs=1e-13)
        assert there.rotation[:, 2] @ [-math.sin(t1), math.cos(t1), 0.0] == pytest.approx(0.0, abs=1e-13)


@pytest.fixture(scope="module")
def two_arms(root):
    return {name: cinegen.load(root / "robots" / "two_arms.raff", name) for name in ("left", "right")}


def test_the_left_arm_stands_at_the_origin_and_is_an_rx90_on_a_pillar(two_arms):
    arm = two_arms["left"]
    pillar, d3, rl4, hand = (
        of("two_arms", n, p, "left") for n, p in ((1, "r"), (3, "d"), (4, "r"), (20, "r"))
    )  # fmt: skip
    assert arm.placement(arm.q_home, "base").homogeneous == pytest.approx(np.eye(4), abs=0.0)
    for q in random_configurations(arm, 300, seed=0):
        expected = shift("z", pillar) @ rx90(angles(arm, q), d3, rl4) @ shift("z", hand)
        assert arm.placement(q, "tool").homogeneous == pytest.approx(expected, abs=1e-13)


def test_the_right_arm_stands_a_metre_away_and_turned_and_moves_like_a_scara(two_arms):
    arm = two_arms["right"]
    base = shift("x", 1.0) @ turn("z", math.radians(165.0))
    assert arm.placement(arm.q_home, "base").homogeneous == pytest.approx(base, abs=1e-15)
    height, l1, l2, hand = (of("two_arms", n, p, "right") for n, p in ((1, "r"), (2, "d"), (3, "d"), (20, "r")))
    for q in random_configurations(arm, 300, seed=0):
        t1, t2, quill, t4 = angles(arm, q)
        expected = product(
            base,
            shift("z", height - quill - hand),
            turn("z", t1),
            shift("x", l1),
            turn("z", t2),
            shift("x", l2),
            turn("z", -t4),
            turn("x", math.pi),
        )
        assert arm.placement(q, "tool").homogeneous == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize("name", ["arm7", "rx90", "serial_5dof", "planar_3r"])
def test_every_node_of_a_serial_arm_is_where_the_product_of_its_parameters_puts_it(robot, name):
    arm, text = robot(name), document(name)
    for q in random_configurations(arm, 50, seed=4):
        for node, expected in placed(text, text.robot(), values(arm, q)).items():
            assert arm.placement(q, node).homogeneous == pytest.approx(expected, abs=1e-13)


# --- sr400 -------------------------------------------------------------------------------------------------------


def test_the_sr400_has_mobility_6_and_a_loop_of_6_rows_and_rank_3(robot):
    arm = robot("sr400")
    assert len(arm.joints) == 9
    assert arm.mobility == 6
    assert arm.loop_jacobian(arm.q_home).shape == (6, 9)
    assert arm.loop_rank == 3
    assert arm.actuated == tuple(f"joint{n}" for n in (1, 2, 4, 5, 6, 7))


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


def test_opposite_links_of_the_sr400s_parallelogram_stay_parallel(robot):
    arm = robot("sr400")
    for q in sr400_closed(arm, 100, seed=1):
        corners = [arm.placement(q, node).translation for node in ("link2", "link3", "frame10", "link8")]
        upper, bracket = corners[1] - corners[0], corners[2] - corners[1]
        rod, lever = corners[2] - corners[3], corners[3] - corners[0]
        assert rod == pytest.approx(upper, abs=1e-11)
        assert lever == pytest.approx(bracket, abs=1e-11)


def test_the_sr400s_forearm_keeps_its_slope_while_the_upper_arm_moves(robot):
    """The tool's closed form, with the slope of the forearm theta2 + theta3 = 90 + theta7."""
    arm = robot("sr400")
    d2, d3, d4, rl4, hand = (of("sr400", n, p) for n, p in ((2, "d"), (3, "d"), (4, "d"), (4, "r"), (20, "r")))
    for q in sr400_closed(arm, 100, seed=2):
        t = values(arm, q)
        expected = product(
            turn("z", t["joint1"]),
            shift("x", d2),
            turn("x", -math.pi / 2),
            turn("z", t["joint2"]),
            shift("x", d3),
            turn("z", math.pi / 2 + t["joint7"] - t["joint2"]),
            shift("x", d4),
            turn("x", -math.pi / 2),
            shift("z", rl4),
            turn("z", t["joint4"]),
            turn("x", math.pi / 2),
            turn("z", t["joint5"]),
            turn("x", -math.pi / 2),
            turn("z", t["joint6"]),
            shift("z", hand),
        )
        assert arm.placement(q, "tool").homogeneous == pytest.approx(expected, abs=1e-11)


def test_the_sr400_dragged_anywhere_stays_a_parallelogram(robot):
    arm = robot("sr400")
    rng = np.random.default_rng(3)
    solver = cinegen.Solver(arm, dt=1 / 60)
    task = solver.add_task("tool")
    home = arm.placement(arm.q_home, "tool")
    for tick in range(600):
        if tick % 40 == 0:
            task.target = home.copy()
            task.target.translation = home.translation + rng.normal(0.0, 1.0, 3)
        t = values(arm, solver.step().q)
        assert abs(wrapped(t["joint3"] - (math.pi / 2 - t["joint2"] + t["joint7"]))) <= 1e-9
