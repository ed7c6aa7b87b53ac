"""Five-bars by plane geometry (`tests/helpers/five_bar.py`): synthesis against elementary optima.

With coincident base joints, at a distance r from them and with the half angle b between the outer bars, the singular
values are r / sqrt(2) and r tan(b) / sqrt(2). So the condition number depends on r alone. By the law of cosines its
largest value over r0..r1 is least for inner bars of (r0 + r1) / 2 and outer bars of sqrt(inner^2 + r0 r1): there it is
(r0 + r1) / 2 / sqrt(r0 r1) at r0, r1 and sqrt(r0 r1).
"""

import numpy as np
import pytest
from five_bar import FiveBar

import cinegen
from cinegen.design import Parameters, synthesize

RECTANGLE = np.stack(np.meshgrid(np.linspace(-0.15, 0.15, 61), np.linspace(0.3, 0.5, 41)), -1).reshape(-1, 2)
TASK = {
    "parameters": {"link2.d": "150..500mm", "link5.d": "200..700mm"},
    "ties": ["link2.d = link4.d", "link5.d = tool.d"],
    "reach": {"x": "-150..150mm", "y": "300..500mm"},
    "objective": [{"minimise": "condition"}],
    "constraints": {"joint_limits": False},
    "starts": 1,
}


def optimum_with_coincident_base_joints() -> tuple[float, float, float]:
    """Return inner bar, outer bar and condition number."""
    nearest, farthest = np.linalg.norm(RECTANGLE, axis=1).min(), np.linalg.norm(RECTANGLE, axis=1).max()
    inner = (nearest + farthest) / 2.0
    return inner, float(np.sqrt(inner**2 + nearest * farthest)), float(inner / np.sqrt(nearest * farthest))


# --- the geometry alone -----------------------------------------------------------------------------------------


def test_closed_forms_of_coincident_base_joints():
    inner, outer, worst = optimum_with_coincident_base_joints()
    nearby = {(a, b): FiveBar(inner + a, outer + b, 1e-9).condition(RECTANGLE).max()
              for a in (-1e-3, 0.0, 1e-3) for b in (-1e-3, 0.0, 1e-3)}  # fmt: skip
    assert nearby[0.0, 0.0] == pytest.approx(worst, abs=1e-7)
    assert min(nearby, key=nearby.get) == (0.0, 0.0)


def test_speeds_of_the_tool_by_differences():
    robot, at = FiveBar(0.25, 0.4, 0.15), np.array([[0.05, 0.42]])
    step, angles = 1e-6, []
    for change in ([step, 0], [-step, 0], [0, step], [0, -step]):
        elbows = robot.elbows(at + change)[0] - np.array([[-robot.half, 0.0], [robot.half, 0.0]])
        angles.append(np.arctan2(elbows[:, 1], elbows[:, 0]))
    by_point = np.stack([angles[0] - angles[1], angles[2] - angles[3]], axis=1) / (2.0 * step)
    speeds = 1.0 / np.linalg.svd(by_point, compute_uv=False)[::-1]
    np.testing.assert_allclose(robot.singular_values(at)[0], speeds, rtol=1e-8)


# --- the synthesis ----------------------------------------------------------------------------------------------


def test_condition_of_the_written_five_bar():
    found = synthesize("five_bar", TASK)
    inner, outer = found.p
    best = FiveBar(inner, outer, 0.15).condition(RECTANGLE).max()
    assert found.before[0] == pytest.approx(FiveBar(0.25, 0.4, 0.15).condition(RECTANGLE).max(), rel=1e-6)
    assert best == pytest.approx(found.values[0], rel=2e-4)  # on a grid that is finer than the optimiser's
    assert found.check.condition <= best
    nearby = np.stack(np.meshgrid(*[np.linspace(-0.02, 0.02, 9)] * 2), -1).reshape(-1, 2)
    anywhere = np.stack(np.meshgrid(np.linspace(0.15, 0.5, 11), np.linspace(0.2, 0.7, 11)), -1).reshape(-1, 2)
    for a, b in [*(nearby + found.p), *anywhere]:
        assert FiveBar(a, b, 0.15).condition(RECTANGLE).max() >= best * (1.0 - 2e-4)


def test_five_bar_with_coincident_base_joints(tmp_path):
    path = tmp_path / "coincident.raff"
    path.write_text(Parameters("five_bar", "link3.d", "link1.d = -1*link3.d").with_values([0.0]), encoding="utf-8")
    assert np.linalg.norm(cinegen.load(path).placement(cinegen.load(path).q_home, "link1").translation) < 1e-12
    found = synthesize(path, TASK)
    inner, outer, worst = optimum_with_coincident_base_joints()
    np.testing.assert_allclose(found.p, [inner, outer], rtol=1e-5)  # the grid has no point at sqrt(r0 r1)
    assert worst * (1.0 - 1e-5) < found.values[0] <= worst  # of fewer points
    assert found.check.condition <= worst * (1.0 + 1e-5)


# --- the largest circle -----------------------------------------------------------------------------------------
