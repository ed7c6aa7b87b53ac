"""ScriptedSensor paths: inside the workspace, without a jump."""

import numpy as np
import pytest
from urdf_text import UrdfJoint, urdf_text

from cinegen import Solver, load
from cinegen.devices import SHAPES, fit_path
from cinegen.errors import UnknownNameError


def test_a_fitted_circle_is_followed_all_the_way_round(robot):
    mechanism = robot("delta4")
    path = fit_path(mechanism, mechanism.nodes[-1])
    assert path.shape == "circle"
    assert path.size > 0.02 * mechanism.length
    lag, _, gap = follow(mechanism, path, 9.0)
    assert lag < 2e-3 * mechanism.length
    assert gap <= 1e-12


def follow(mechanism, path, seconds):
    """Largest lag (m), speed of a joint (rad/s or m/s) and gap, while the node follows the path from the start."""
    solver = Solver(mechanism, 0.01)
    task = solver.add_task(path.node, rotation=path.rotation)
    lag = speed = gap = 0.0
    for tick in range(round(100 * seconds)):
        task.target = path.target(0.01 * tick)
        step = solver.step()
        lag, speed, gap = max(lag, step.errors[0][0]), max(speed, np.abs(step.v).max()), max(gap, step.closure)
    return lag, speed, gap


def test_the_crank_of_a_four_bar_revolves(robot):
    bar = robot("four_bar")
    path = fit_path(bar, "tool", "figure8")
    assert path.shape == "sweep"
    assert path.closed
    assert path.size > 0.25  # m: all that the tool can reach
    assert path.target(0.0).isApprox(bar.placement(bar.q_home, "tool"), 1e-9)
    lag, speed, _ = follow(bar, path, 2.0 * path.period)
    assert lag < 1e-3 * bar.length
    assert speed < 3.0


def test_a_joint_with_limits_moves_to_and_fro_between_them_and_keeps_its_velocity_limit():
    joint = UrdfJoint("hinge", "base", "arm", limit=(-0.5, 2.0), velocity=0.4)
    hinge = load(urdf_text([joint, UrdfJoint("end", "arm", "tip", "0.5 0 0", kind="fixed")]))
    path = fit_path(hinge, "tip")
    assert not path.closed
    angles = [np.arctan2(*path.target(t).translation[1::-1]) for t in np.arange(0.0, 2.0 * path.period, 0.02)]
    assert angles[0] == pytest.approx(0.0, abs=1e-12)
    assert -0.5 <= min(angles) < -0.3
    assert 1.8 < max(angles) <= 2.0
    assert np.abs(np.diff(angles)).max() / 0.02 <= 0.4
    lag, speed, _ = follow(hinge, path, 2.0 * path.period)
    assert lag < 1e-6
    assert speed <= 0.4 + 1e-9


@pytest.mark.parametrize("shape", SHAPES)
def test_paths_begin_at_home_and_never_jump(robot, shape):
    delta = robot("delta4")
    path = fit_path(delta, "platform", shape)
    points = np.array([path.target(t).translation for t in np.arange(0.0, 12.0, 0.01)])
    assert points[0] == pytest.approx(path.home.translation, abs=1e-12)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() < 0.05 * path.size
    reach = np.linalg.norm(points - path.home.translation, axis=1).max()
    assert reach == pytest.approx(path.size, rel=0.2)
    assert path.target(12.0 + path.period).isApprox(path.target(12.0), 1e-9)


def test_the_delta_keeps_its_orientation_free_and_the_hexapod_holds_it(robot):
    assert fit_path(robot("delta4"), "platform").rotation == 0
    assert fit_path(robot("gough"), "platform").rotation == 3
    assert fit_path(robot("planar_3r"), "tool").rotation == 3


def test_a_node_that_cant_move_gets_no_path(robot):
    assert fit_path(robot("delta4"), "base").size == 0.0
    with pytest.raises(UnknownNameError):
        fit_path(robot("delta4"), "nose")
