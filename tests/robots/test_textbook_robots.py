"""The planar robots against what plane geometry says of them."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from elementary import at, document, length, limits, link, placed, turn, values, within_limits, wrapped

import cinegen


def rz(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def direction(angle: float) -> np.ndarray:
    return np.array([math.cos(angle), math.sin(angle)])


def of(name: str, number: int, parameter: str) -> float:
    """A length (m) of a robot's file."""
    text = document(name)
    return length(text, getattr(link(text, number).parameters, parameter))


def in_plane(mechanism, q: np.ndarray, node: str = "tool") -> tuple[np.ndarray, float]:
    """Where a node is in the plane and how it is turned; it must be in the plane."""
    m = mechanism.placement(q, node).homogeneous
    assert m[2] == pytest.approx([0.0, 0.0, 1.0, 0.0], abs=1e-15)
    return m[:2, 3], math.atan2(m[1, 0], m[0, 0])


def closed(mechanism) -> list[np.ndarray]:
    return [mechanism.q_home] + [q for seed in range(20) for q in mechanism.random_closed(5, seed)]


# --- planar_hybrid: figure 9 -------------------------------------------------------------------------------------

JOINTS = tuple(f"joint{i}" for i in range(1, 8))


def figure_9(arm, q: np.ndarray) -> np.ndarray:
    """The extended Jacobian's rows x, y, rz of tool and loop, columns by joint number."""
    matrix = arm.extended_jacobian(q, ["tool"]).compact()
    loop = arm.loops[0].name
    assert matrix.rows == tuple((owner, row) for owner in ("tool", loop) for row in ("x", "y", "rz"))
    return np.asarray(matrix)[:, [matrix.columns.index(joint) for joint in JOINTS]]


def test_the_hybrids_extended_jacobian_is_what_plane_geometry_says(robot):
    """A turning joint moves a point at right angles to the way from its axis; the loop's rows are those of its second
    end less those of its first (the figure has the same signs)."""
    arm = robot("planar_hybrid")
    for q in arm.random_closed(50, seed=3):
        matrix = figure_9(arm, q)
        axes = {joint: arm.placement(q, f"link{joint[5:]}").translation[:2] for joint in JOINTS}
        expected = np.zeros((6, 7))
        for rows, node, signs in (
            (slice(0, 3), "tool", dict.fromkeys(("joint1", "joint2", "joint3", "joint7"), 1.0)),
            (slice(3, 6), arm.loops[0].first, {"joint2": -1, "joint3": -1, "joint4": 1, "joint5": 1, "joint6": 1}),
        ):
            point, turned = in_plane(arm, q, node)
            for joint, sign in signs.items():
                arm_of = point - axes[joint]
                linear = rz(turned).T @ np.array([-arm_of[1], arm_of[0]])
                expected[rows, JOINTS.index(joint)] = sign * np.array([*linear, 1.0])
        assert matrix == pytest.approx(expected, abs=1e-11)


# --- four_bar ----------------------------------------------------------------------------------------------------

CRANK, COUPLER, GROUND, ROCKER = (of("four_bar", number, "d") for number in (2, 4, 3, 5))


def four_bar(crank: float, side: float) -> dict[str, float]:
    """All joints from the crank: the pin between coupler and rocker is where two circles meet."""
    knee, pivot = CRANK * direction(crank), np.array([GROUND, 0.0])
    far = float(np.linalg.norm(pivot - knee))
    along, x = (COUPLER**2 - ROCKER**2 + far**2) / (2.0 * far), (pivot - knee) / far
    coupler = along * x + side * math.sqrt(COUPLER**2 - along**2) * np.array([-x[1], x[0]])
    rocker = knee + coupler - pivot
    return {
        "joint1": crank,
        "joint2": float(wrapped(math.atan2(coupler[1], coupler[0]) - crank)),
        "joint3": math.atan2(rocker[1], rocker[0]),
    }


def same_angles(q_by_name: dict[str, float], expected: dict[str, float], close: float) -> bool:
    return all(abs(wrapped(q_by_name[joint] - expected[joint])) <= close for joint in expected)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_four_bar_is_closed_where_two_circles_meet_on_both_branches(robot, side):
    bar = robot("four_bar")
    rng = np.random.default_rng(0)
    for crank in np.linspace(-math.pi, math.pi, 181):
        expected = four_bar(crank, side)
        q = bar.configuration(expected)
        assert bar.closure(q) <= 1e-12
        rough = bar.configuration({j: expected[j] + rng.normal(0.0, 0.03) for j in ("joint2", "joint3")}, q)
        assert same_angles(values(bar, bar.close(rough, locked=["joint1"])), expected, 1e-9)


def test_the_solver_turns_the_crank_several_times_without_leaving_the_branch(robot):
    bar = robot("four_bar")
    solver = cinegen.Solver(bar, dt=1 / 60)
    task = solver.add_task("link1", translation=0, rotation=1)
    crank = float(solver.q[bar.q_index("joint1")])
    for _ in range(400):
        crank += 0.06
        task.target = pin.SE3(pin.utils.rotate("z", crank), np.zeros(3))
        step = solver.step()
        q_by_name = values(bar, step.q)
        assert q_by_name["joint1"] == pytest.approx(crank, abs=1e-3)  # within one tick
        assert same_angles(q_by_name, four_bar(q_by_name["joint1"], 1.0), 1e-9)
        assert within_limits(bar, step.q)


# --- serial -----------------------------------------------------------------------------------------------------------
# The serial arms, and SR400 whose forearm a parallelogram moves, against closed forms.


def random_configurations(mechanism, count: int, seed: int) -> list[np.ndarray]:
    low, high = limits(mechanism, mechanism.joints)
    drawn = np.random.default_rng(seed).uniform(low, high, (count, len(low)))
    return [mechanism.configuration(dict(zip(mechanism.joints, values, strict=True))) for values in drawn]


def angles(mechanism, q: np.ndarray) -> list[float]:
    """The joints' values, joint1 first."""
    named = values(mechanism, q)
    return [named[joint] for joint in sorted(named, key=lambda name: int(name[5:]))]


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


def test_the_sr400s_parallelogram_obeys_its_closed_form(robot):
    """theta3 = 90 - theta2 + theta7, theta8 = theta2 - theta7, theta9 = 180 - theta2 + theta7: W. Khalil and E. Dombre,
    chapter 7."""
    arm = robot("sr400")
    for q in closed(arm):
        t = values(arm, q)
        lean = t["joint7"] - t["joint2"]
        for joint, expected in (("joint3", math.pi / 2 + lean), ("joint8", -lean), ("joint9", math.pi + lean)):
            assert abs(wrapped(t[joint] - expected)) <= 1e-11


# --- hybrid -----------------------------------------------------------------------------------------------------------
# The hybrid: a tripod with three legs (3-RPS) that carries a wrist.
#
# K.-M. Lee and D. K. Shah, "Kinematic analysis of a three-degrees-of-freedom in-parallel actuated manipulator", IEEE
# Journal of Robotics and Automation 4, 1988: each leg stays in the vertical plane of its hinge, which ties three of the
# plate's six coordinates to the others.


PLATE = of("hybrid", 12, "d")


def test_the_plate_drifts_as_lee_and_shahs_constraints_say(robot):
    """With u, v the plate's x and y axes: u_y = v_x, p_x = h (u_x - v_y) / 2, p_y = -h u_y."""
    hybrid = robot("hybrid")
    for q in closed(hybrid):
        plate = hybrid.placement(q, "plate")
        u, v, p = plate.rotation[:, 0], plate.rotation[:, 1], plate.translation
        assert u[1] == pytest.approx(v[0], abs=1e-10)
        assert p[0] == pytest.approx(PLATE * (u[0] - v[1]) / 2.0, abs=1e-10)
        assert p[1] == pytest.approx(-PLATE * u[1], abs=1e-10)


# --- gough ------------------------------------------------------------------------------------------------------------
# The six-legged platforms against their inverse kinematics, which is closed form: a leg is as long as the way from its
# joint on the base to its joint on the platform.


LEGS = tuple(f"joint{n}" for n in (3, 9, 12, 15, 18, 21))


def leg_ends(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Joint centres of the six legs, (6, 3) each, m, from the parameters of the RAFF file: on the base in the world, on
    the platform in its frame."""
    text = document(name)
    robot = text.robot()
    home = placed(text, robot, {})
    first = {6: 1, **{int(leg[5:]): int(leg[5:]) - 2 for leg in LEGS[1:]}}  # where a leg's end and its begin are
    ends = [(6, 6), *((loop.first, loop.second) for loop in robot.loops)]
    centre = np.linalg.inv(home["platform"])
    base = [home[robot.nodes[first[leg]].node][:3, 3] for leg, _ in ends]
    return np.array(base), np.array([(centre @ home[robot.nodes[on].node])[:3, 3] for _, on in ends])


@pytest.mark.parametrize("name", ["gough", "tssm"])
def test_legs_are_as_long_as_the_closed_form_says(robot, name):
    hexapod = robot(name)
    base, platform = leg_ends(name)
    for q in closed(hexapod):
        pose = hexapod.placement(q, "platform")
        lengths = np.linalg.norm(platform @ pose.rotation.T + pose.translation - base, axis=1)
        assert at(hexapod, q, LEGS) == pytest.approx(lengths, abs=1e-11)


# --- delta4 -----------------------------------------------------------------------------------------------------------
# The MiniDelta against the closed form of the delta.
#
# R. Clavel, "Delta, a fast robot with parallel geometry", Int. symposium on Industrial Robots, 1988: the platform keeps
# its orientation, so that each arm is a triangle of its own. Seen from arm i, with P the platform's centre turned by
# -gamma_i, the wrist is at P + (p, 0, 0), the elbow on a circle (the upper arm turns about the shoulder), and the
# forearm is the distance between them.


def test_each_arm_of_the_delta_is_a_triangle_and_the_platform_keeps_its_orientation(robot):
    delta, text = robot("delta4"), document("delta4")
    radius = of("delta4", 20, "d")
    for q in closed(delta):
        platform = delta.placement(q, "platform")
        assert platform.rotation == pytest.approx(np.eye(3), abs=1e-9)
        for number in (1, 6, 12):
            away = turn("z", -math.radians(link(text, number).parameters.gamma))[:3, :3] @ platform.translation
            shoulder = q[delta.q_index(f"joint{number}")]
            upper, forearm = of("delta4", number + 1, "d"), of("delta4", number + 3, "d")
            elbow = upper * np.array([math.cos(shoulder), 0.0, math.sin(shoulder)])
            elbow[0] += of("delta4", number, "d") - radius
            assert np.linalg.norm(away - elbow) == pytest.approx(forearm, abs=1e-9)
