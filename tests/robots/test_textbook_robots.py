"""The planar robots against what plane geometry says of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from elementary import (
    angle_between,
    at,
    document,
    forward,
    length,
    limits,
    link,
    local,
    placed,
    turn,
    values,
    within_limits,
    wrapped,
)
from scipy.spatial.transform import Rotation

import cinegen


def rz(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def direction(angle: float) -> np.ndarray:
    return np.array([math.cos(angle), math.sin(angle)])


def d_of(name: str, number: int) -> float:
    text = document(name)
    return length(text, link(text, number).parameters.d)


def in_plane(mechanism, q: np.ndarray, node: str = "tool") -> tuple[np.ndarray, float]:
    """Where a node is in the plane and how it is turned; it must be in the plane."""
    m = mechanism.placement(q, node).homogeneous
    assert m[2] == pytest.approx([0.0, 0.0, 1.0, 0.0], abs=1e-15)
    return m[:2, 3], math.atan2(m[1, 0], m[0, 0])


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

CRANK, COUPLER, GROUND, ROCKER = (d_of("four_bar", number) for number in (2, 4, 3, 5))


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


def same_angles(found: dict[str, float], expected: dict[str, float], close: float) -> bool:
    return all(abs(wrapped(found[joint] - expected[joint])) <= close for joint in expected)


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
    crank = first = float(solver.q[bar.q_index("joint1")])
    rocker = []
    for _ in range(400):
        crank += 0.06
        task.target = pin.SE3(pin.utils.rotate("z", crank), np.zeros(3))
        step = solver.step()
        found = values(bar, step.q)
        assert found["joint1"] == pytest.approx(crank, abs=1e-3)  # within one tick
        assert same_angles(found, four_bar(found["joint1"], 1.0), 1e-9)
        assert within_limits(bar, step.q)
        rocker.append(found["joint3"])
    assert crank - first > 3.5 * 2.0 * math.pi
    extremes = [math.acos((GROUND**2 + ROCKER**2 - (COUPLER + sign * CRANK) ** 2) / (2 * GROUND * ROCKER))
                for sign in (1.0, -1.0)]  # fmt: skip
    assert min(rocker) == pytest.approx(math.pi - max(extremes), abs=2e-3)
    assert max(rocker) == pytest.approx(math.pi - min(extremes), abs=2e-3)


# --- serial -----------------------------------------------------------------------------------------------------------
# The serial arms, and SR400 whose forearm a parallelogram moves, against closed forms.


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


# --- hybrid -----------------------------------------------------------------------------------------------------------
# The hybrid: a tripod with three legs (3-RPS) that carries a wrist.
#
# K.-M. Lee and D. K. Shah, "Kinematic analysis of a three-degrees-of-freedom in-parallel actuated manipulator", IEEE
# Journal of Robotics and Automation 4, 1988: each leg stays in the vertical plane of its hinge, which ties three of the
# plate's six coordinates to the others.


TEXT = document("hybrid")
PLATE = length(TEXT, link(TEXT, 12).parameters.d)


def closed(mechanism) -> list[np.ndarray]:
    return [mechanism.q_home] + [q for seed in range(20) for q in mechanism.random_closed(5, seed)]


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
#
# All 21 joints follow from the platform's pose too: with w the way of a leg in the frame of its universal joint, before
# it turns, the last axis is (cos t1 sin t2, sin t1 sin t2, -cos t2), since both turns come behind a Rx(90) each.


LEGS = tuple(f"joint{n}" for n in (3, 9, 12, 15, 18, 21))
NAMES = ("gough", "tssm")


@dataclass(frozen=True)
class Platform:
    """Joint centres of the six legs, (6, 3) each, m: on the base in the world, on the platform in its frame."""

    base: np.ndarray
    platform: np.ndarray

    def legs(self, pose: np.ndarray) -> np.ndarray:
        """(6,) lengths of the legs, the platform at a (4, 4) pose."""
        return np.linalg.norm(self.platform @ pose[:3, :3].T + pose[:3, 3] - self.base, axis=1)


@cache
def geometry(name: str) -> Platform:
    """From the parameters of the RAFF file."""
    text = document(name)
    robot = text.robot()
    home = placed(text, robot, {})
    first = {6: 1, **{int(leg[5:]): int(leg[5:]) - 2 for leg in LEGS[1:]}}  # where a leg's end and its begin are
    ends = [(6, 6), *((loop.first, loop.second) for loop in robot.loops)]
    centre = np.linalg.inv(home["platform"])
    return Platform(
        base=np.array([home[robot.nodes[first[leg]].node][:3, 3] for leg, _ in ends]),
        platform=np.array([(centre @ home[robot.nodes[on].node])[:3, 3] for _, on in ends]),
    )


def spherical(way: np.ndarray) -> tuple[float, float]:
    """t1 and t2 of Rz(t1) Rx(90) Rz(t2) Rx(90) whose last axis points along `way`; t2 in (0, pi)."""
    return math.atan2(way[1], way[0]), math.acos(-way[2] / float(np.linalg.norm(way)))


def inverse(name: str, pose: np.ndarray) -> dict[str, float]:
    """All 21 joints from the platform's pose."""
    text = document(name)
    robot, shape = text.robot(), geometry(name)
    feet = placed(text, robot, {f"joint{n}": 0.0 for n in range(1, 22)})
    found = {}
    for leg, foot, end in zip(LEGS, shape.base, shape.platform, strict=True):
        n = int(leg[5:])
        way = pose[:3, :3] @ end + pose[:3, 3] - foot
        t1, t2 = spherical(feet[f"link{n - 2}"][:3, :3].T @ way)
        found |= {f"joint{n - 2}": t1, f"joint{n - 1}": t2, leg: float(np.linalg.norm(way))}
    top = placed(text, robot, found)
    wanted = pose @ np.linalg.inv(local(text, link(text, 30)))  # link 6
    turned = top["link3"][:3, :3].T @ wanted[:3, :3]
    turned = local(text, link(text, 4), 0.0)[:3, :3].T @ turned
    t4, t5 = spherical(turned[:, 2])
    rest = np.linalg.inv(turn("z", t4) @ turn("x", math.pi / 2) @ turn("z", t5) @ turn("x", math.pi / 2))[:3, :3]
    last = rest @ turned
    return found | {"joint4": t4, "joint5": t5, "joint6": math.atan2(last[1, 0], last[0, 0])}


def random_pose(name: str, rng: np.random.Generator, far: float, turned: float) -> np.ndarray:
    home = placed(document(name), document(name).robot(), {})["platform"]
    pose = home.copy()
    pose[:3, 3] += rng.uniform(-far, far, 3)
    pose[:3, :3] = Rotation.from_rotvec(rng.uniform(-turned, turned, 3)).as_matrix() @ pose[:3, :3]
    return pose


REACH = {"gough": 0.25, "tssm": 0.005}  # m


@pytest.mark.parametrize("name", NAMES)
def test_the_closed_form_of_all_joints_closes_every_loop_at_random_poses(robot, name):
    mechanism, rng = robot(name), np.random.default_rng(1)
    for _ in range(80):
        pose = random_pose(name, rng, REACH[name], 0.6)
        q = mechanism.configuration(inverse(name, pose))
        assert mechanism.closure(q) <= 1e-12
        assert mechanism.placement(q, "platform").homogeneous == pytest.approx(pose, abs=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_dragged_to_random_poses_all_joints_are_where_the_closed_form_says(robot, name):
    mechanism, rng, arrived = robot(name), np.random.default_rng(2), 0
    low, high = mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit
    while arrived < 15:
        pose = random_pose(name, rng, 0.6 * REACH[name], 0.25)
        goal = mechanism.configuration(inverse(name, pose))
        if not ((goal > low + 0.01 * mechanism.scale).all() and (goal < high - 0.01 * mechanism.scale).all()):
            continue
        solver = cinegen.Solver(mechanism, dt=0.2)
        solver.add_task("platform", pin.SE3(pose))
        for _ in range(200):
            step = solver.step()
            if max(step.errors[0][0] / mechanism.length, step.errors[0][1]) <= 1e-10:
                break
        assert np.abs(wrapped((step.q - goal) / mechanism.scale)).max() <= 1e-8, step.status
        arrived += 1


# --- delta4 -----------------------------------------------------------------------------------------------------------
# The MiniDelta against the closed form of the delta.
#
# R. Clavel, "Delta, a fast robot with parallel geometry", Int. symposium on Industrial Robots, 1988: the platform keeps
# its orientation, so that each arm is a triangle of its own. Seen from arm i, with P the platform's centre turned by
# -gamma_i, the wrist is at P + (p, 0, 0), the elbow on a circle (the upper arm turns about the shoulder), and the
# forearm is the distance between them.


SHOULDERS = ("joint1", "joint6", "joint12")
FIRST = (1, 6, 12)


@dataclass(frozen=True)
class Delta:
    """A delta's lengths (m): of base and platform radius, upper arm and forearm; the arms' angles."""

    base: float
    platform: float
    upper: float
    forearm: float
    gammas: tuple[float, ...]

    @classmethod
    def of(cls, name: str) -> Delta:
        """The lengths that robots/<name>.raff gives, the same in all three arms."""
        text = document(name)

        def all_three(numbers, parameter):
            (value,) = {getattr(link(text, n).parameters, parameter) for n in numbers}
            return length(text, value)

        return cls(
            base=all_three(FIRST, "d"),
            platform=length(text, link(text, 20).parameters.d),
            upper=all_three([n + 1 for n in FIRST], "d"),
            forearm=all_three([n + 3 for n in FIRST], "d"),
            gammas=tuple(math.radians(link(text, n).parameters.gamma) for n in FIRST),
        )

    def inverse(self, position: np.ndarray) -> np.ndarray | None:
        """Motors (rad) that bring the platform there, elbows outside; None: out of reach.

        |wrist - elbow| = forearm is w_x cos + w_z sin = k.
        """
        motors = []
        for gamma in self.gammas:  # the wrist, seen from its arm, the shoulder's axis at the origin
            w = turn("z", -gamma)[:3, :3] @ position + [self.platform - self.base, 0.0, 0.0]
            k = (w @ w + self.upper**2 - self.forearm**2) / (2.0 * self.upper)
            h = math.hypot(w[0], w[2])
            if abs(k) >= h:
                return None
            angle = math.atan2(w[2], w[0]) + math.acos(k / h)
            motors.append((angle + math.pi) % (2.0 * math.pi) - math.pi)
        return np.array(motors)


REGION = (-2.5, -2.5, -5.0), (2.5, 2.5, -0.5)  # m, where positions are drawn from
STEP = 0.5  # rad between two forward solutions on the way


def reachable(count: int, seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Random positions within the motors' limits, with the motors' values."""
    delta, rng = Delta.of("delta4"), np.random.default_rng(seed)
    low, high = np.radians(link(document("delta4"), 1).limits)
    found = []
    while len(found) < count:
        position = rng.uniform(*REGION)
        motors = delta.inverse(position)
        if motors is not None and (motors >= low).all() and (motors <= high).all():
            found.append((position, motors))
    return found


def test_motors_set_by_the_closed_form_bring_the_platform_there_with_its_orientation_kept(robot):
    """The way there leads from home through closed configurations."""
    mechanism = robot("delta4")
    upright = mechanism.placement(mechanism.q_home, "platform").rotation
    assert upright == pytest.approx(np.eye(3), abs=1e-9)
    for position, motors in reachable(150, seed=0):
        q = forward(mechanism, mechanism.q_home, motors, STEP)
        there = mechanism.placement(q, "platform")
        assert there.translation == pytest.approx(position, abs=1e-9)
        assert angle_between(upright, there.rotation) <= 1e-9
        assert np.array_equal(at(mechanism, q, SHOULDERS), motors)
