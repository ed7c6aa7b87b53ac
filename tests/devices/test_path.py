"""Scripted paths: inside the workspace, without a jump."""

from __future__ import annotations

import numpy as np
import pytest

from cinegen import Solver
from cinegen.devices import SHAPES, fitted
from cinegen.errors import UnknownNameError


@pytest.mark.parametrize("name", ["delta4", "delta4_linear", "gough", "tssm", "hybrid", "rx90", "planar_hybrid"])
def test_a_fitted_circle_is_followed_all_the_way_round(robot, name):
    mechanism = robot(name)
    path = fitted(mechanism, mechanism.nodes[-1])
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
    path = fitted(bar, "tool", "figure8")
    assert path.shape == "line"
    assert path.size > 0.0


@pytest.mark.parametrize("shape", SHAPES)
def test_paths_begin_at_home_and_never_jump(robot, shape):
    delta = robot("delta4")
    path = fitted(delta, "platform", shape)
    points = np.array([path.target(t).translation for t in np.arange(0.0, 12.0, 0.01)])
    assert points[0] == pytest.approx(path.home.translation, abs=1e-12)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 0.05 * path.size
    reach = np.linalg.norm(points - path.home.translation, axis=1).max()
    assert reach == pytest.approx(path.size, rel=0.2)


def test_the_delta_keeps_its_orientation_free_and_the_hexapod_holds_it(robot):
    assert fitted(robot("delta4"), "platform").rotation == 0
    assert fitted(robot("gough"), "platform").rotation == 3
    assert fitted(robot("planar_3r"), "tool").rotation == 3


def test_a_node_that_cant_move_gets_no_path(robot):
    assert fitted(robot("delta4"), "base").size == 0.0
    with pytest.raises(UnknownNameError):
        fitted(robot("delta4"), "nose")
