"""ScriptedSensor paths: inside the workspace, without a jump."""

from __future__ import annotations

import numpy as np
import pytest

from cinegen import Solver
from cinegen.devices import SHAPES, fit_path
from cinegen.errors import UnknownNameError


@pytest.mark.parametrize("name", ["delta4", "delta4_linear", "gough", "tssm", "hybrid", "rx90", "planar_hybrid"])
def test_a_fitted_circle_is_followed_all_the_way_round(robot, name):
    mechanism = robot(name)
    path = fit_path(mechanism, mechanism.nodes[-1])
    assert path.shape == "circle"
    assert path.size > 0.02 * mechanism.length
    solver = Solver(mechanism, 0.01)
    task = solver.add_task(path.node, path.home, rotation=path.rotation)
    for tick in range(900):
        task.target = path.target(0.01 * tick)
        step = solver.step()
        assert step.errors[0][0] < 2e-3 * mechanism.length
        assert step.closure <= 1e-12


def test_a_node_with_one_freedom_gets_a_line(robot):
    bar = robot("four_bar")
    path = fit_path(bar, "tool", "figure8")
    assert path.shape == "line"
    assert path.size > 0.0


@pytest.mark.parametrize("shape", SHAPES)
def test_paths_begin_at_home_and_never_jump(robot, shape):
    delta = robot("delta4")
    path = fit_path(delta, "platform", shape)
    points = np.array([path.target(t).translation for t in np.arange(0.0, 12.0, 0.01)])
    assert points[0] == pytest.approx(path.home.translation, abs=1e-12)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 0.05 * path.size
    reach = np.linalg.norm(points - path.home.translation, axis=1).max()
    assert reach == pytest.approx(path.size, rel=0.2)


def test_the_delta_keeps_its_orientation_free_and_the_hexapod_holds_it(robot):
    assert fit_path(robot("delta4"), "platform").rotation == 0
    assert fit_path(robot("gough"), "platform").rotation == 3
    assert fit_path(robot("planar_3r"), "tool").rotation == 3


def test_a_node_that_cant_move_gets_no_path(robot):
    assert fit_path(robot("delta4"), "base").size == 0.0
    with pytest.raises(UnknownNameError):
        fit_path(robot("delta4"), "nose")
