"""Pictures of joints over time."""

import itertools

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

import cinegen
from cinegen.collision import scene_for
from cinegen.planning import plan
from cinegen.planning.timed_path import timed_path
from cinegen.plotting import DrawingError, draw_joints


@pytest.mark.parametrize(("robot", "rows"), [("arm7", 2), ("scara", 3)])
def test_each_joint_that_moves_is_drawn_from_start_to_goal_within_limits(robot, rows):
    mechanism = cinegen.load(robot)
    middle = {name: np.mean(np.clip(mechanism.limits[name][:2], -1.0, 1.0)) for name in mechanism.actuated}
    home = mechanism.values(mechanism.q_home)
    goal = {name: 0.5 * (home[name] + value) + 0.01 for name, value in middle.items()}
    pairs = itertools.combinations(mechanism.nodes, 2)  # links that are drawn in each other
    found = plan(scene_for(mechanism, goal, allowed_collisions=[list(pair) for pair in pairs]), seconds=600.0)
    assert found
    motion, figure = timed_path(found), draw_joints(found)
    FigureCanvasAgg(figure).draw()
    assert len(figure.axes) == rows
    drawn = {line.get_label(): line for axes in figure.axes[:-1] for line in axes.lines}
    assert set(drawn) == set(mechanism.joints)  # passive ones, too
    for name, line in drawn.items():
        scale = 1.0 if mechanism.is_prismatic(name) else 180.0 / np.pi
        x, y = line.get_data()
        assert x[-1] == pytest.approx(motion.times[-1])
        assert y[[0, -1]] == pytest.approx(scale * found.path[[0, -1], mechanism.q_index(name)], abs=1e-6)
    rates = np.concatenate([line.get_ydata() for line in figure.axes[-1].lines[:-2]])
    assert 0.05 < np.abs(rates).max() < 1.0 + 1e-6
    assert f"{motion.times[-1]:.2f} s" in figure.get_suptitle()


def test_a_path_without_motion_is_not_drawn():
    mechanism = cinegen.load("planar_3r")
    with pytest.raises(DrawingError, match="no joint moves"):
        draw_joints(plan(mechanism, {"joint1": mechanism.values(mechanism.q_home)["joint1"]}))
