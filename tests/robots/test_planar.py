"""The planar robots against what plane geometry says of them."""

import math

import numpy as np
import pinocchio as pin
import pytest
from elementary import document, length, link, values, within_limits, wrapped

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
