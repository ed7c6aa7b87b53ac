"""The planar robots against what plane geometry says of them."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from elementary import at, document, length, limits, link, values, within_limits, wrapped

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


def circles(a: np.ndarray, ra: float, b: np.ndarray, rb: float, side: float) -> np.ndarray | None:
    """Where two circles meet: the point to the left (side 1) or right (-1) of the way from a to b; None: nowhere."""
    way = b - a
    far = float(np.linalg.norm(way))
    along = (ra * ra - rb * rb + far * far) / (2.0 * far)
    squared = ra * ra - along * along
    if squared < 0.0:
        return None
    x = way / far
    return a + along * x + side * math.sqrt(squared) * np.array([-x[1], x[0]])


# --- planar_3r ---------------------------------------------------------------------------------------------------


def test_the_planar_arm_of_three_joints_is_dragged_to_what_its_closed_form_inverts(robot):
    """Wrist = tool less the last link; the elbow's angle by the law of cosines, on either side."""
    arm = robot("planar_3r")
    l1, l2, l3 = (d_of("planar_3r", number) for number in (2, 3, 20))
    rng = np.random.default_rng(1)
    solver = cinegen.Solver(arm, dt=1.0)
    task = solver.add_task("tool")
    for _ in range(40):
        angles = at(arm, solver.q, arm.joints) + rng.uniform(-0.8, 0.8, 3)
        angles = np.clip(angles, [-2.5, 0.3, -2.4], [2.5, 2.4, 2.4])
        task.target = arm.placement(arm.configuration(dict(zip(arm.joints, angles, strict=True))), "tool")
        for _ in range(300):
            step = solver.step()
            if max(step.errors[0]) <= 1e-11:
                break
        assert max(step.errors[0]) <= 1e-9, step.status
        found = at(arm, step.q, arm.joints)
        wrist = task.target.translation[:2] - l3 * task.target.rotation[:2, 0]
        elbow = math.copysign(math.acos((wrist @ wrist - l1 * l1 - l2 * l2) / (2.0 * l1 * l2)), found[1])
        shoulder = math.atan2(wrist[1], wrist[0]) - math.atan2(l2 * math.sin(elbow), l1 + l2 * math.cos(elbow))
        last = math.atan2(task.target.rotation[1, 0], task.target.rotation[0, 0]) - shoulder - elbow
        assert np.abs(wrapped(found - np.array([shoulder, elbow, last]))).max() <= 1e-8


# --- planar_hybrid: figure 9 -------------------------------------------------------------------------------------

JOINTS = tuple(f"joint{i}" for i in range(1, 8))
FIGURE_9 = np.array(  # of Flueckiger, Piguet and Baur: which joint (column) has a part in which row
    [
        [1, 1, 1, 0, 0, 0, 1],
        [1, 1, 1, 0, 0, 0, 1],
        [1, 1, 1, 0, 0, 0, 1],
        [0, 1, 1, 1, 1, 1, 0],
        [0, 1, 1, 1, 1, 1, 0],
        [0, 1, 1, 1, 1, 1, 0],
    ],
    dtype=bool,
)


def figure_9(arm, q: np.ndarray) -> np.ndarray:
    """The extended Jacobian's rows x, y, rz of tool and loop, columns by joint number."""
    matrix = arm.extended_jacobian(q, ["tool"]).compact()
    loop = arm.loops[0].name
    assert matrix.rows == tuple((owner, row) for owner in ("tool", loop) for row in ("x", "y", "rz"))
    return np.asarray(matrix)[:, [matrix.columns.index(joint) for joint in JOINTS]]


def test_the_hybrids_extended_jacobian_has_exactly_the_zeros_of_figure_9(robot):
    arm = robot("planar_hybrid")
    assert arm.extended_jacobian(arm.q_home, ["tool"]).shape == (12, 7)
    seen = np.zeros((6, 7), dtype=bool)
    for q in [arm.q_home, *arm.random_closed(50, seed=9)]:
        matrix = figure_9(arm, q)
        assert not matrix[~FIGURE_9].any()
        seen |= np.abs(matrix) > 1e-6
    assert np.array_equal(seen, FIGURE_9)


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
    pin_at = circles(knee, COUPLER, pivot, ROCKER, side)
    coupler, rocker = pin_at - knee, pin_at - pivot
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


# --- five_bar ----------------------------------------------------------------------------------------------------

LEFT, RIGHT = (np.array([d_of("five_bar", number), 0.0]) for number in (1, 3))
INNER, OUTER = (d_of("five_bar", 2), d_of("five_bar", 4)), (d_of("five_bar", 20), d_of("five_bar", 5))


def five_bar(left: float, right: float, side: float) -> dict[str, float] | None:
    """All joints from the motors; None where the outer bars don't reach each other."""
    knees = [base + inner * direction(angle) for base, inner, angle in zip((LEFT, RIGHT), INNER, (left, right),
                                                                           strict=True)]  # fmt: skip
    tool = circles(knees[0], OUTER[0], knees[1], OUTER[1], side)
    return None if tool is None else _five_bar_through(tool, left, right, knees)


def _five_bar_through(tool, left, right, knees):
    ways = [tool - knee for knee in knees]
    angles = [math.atan2(way[1], way[0]) for way in ways]
    return {
        "joint1": left,
        "joint2": float(wrapped(angles[0] - left)),
        "joint3": right,
        "joint4": float(wrapped(angles[1] - right)),
        "joint5": float(wrapped(angles[0] - angles[1])),  # the pin coincides with the left arm's end, axes and all
    }


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_five_bar_is_closed_where_two_circles_meet_on_both_branches(robot, side):
    linkage = robot("five_bar")
    low, high = limits(linkage, ("joint1", "joint3"))
    rng = np.random.default_rng(0)
    reached = 0
    for left in np.linspace(low[0], high[0], 25):
        for right in np.linspace(low[1], high[1], 25):
            expected = five_bar(left, right, side)
            if expected is None:
                continue
            q = linkage.configuration(expected)
            assert linkage.closure(q) <= 1e-12
            knee_to_knee = abs(math.sin(expected["joint5"]))
            if knee_to_knee > 0.3:  # far enough from where both branches meet
                passive = ("joint2", "joint4", "joint5")
                rough = linkage.configuration({j: expected[j] + rng.normal(0.0, 0.03) for j in passive}, q)
                found = values(linkage, linkage.close(rough, locked=linkage.actuated))
                assert same_angles(found, expected, 1e-9)
                reached += 1
    assert reached > 300
