"""Changes of assembly mode, judged by the closed form of a planar 3-RPR: poses, leg lengths, and the determinant of the
legs' lines, whose sign distinguishes the two sides of its singularities."""

import itertools
import re

import numpy as np
import pytest
from cusp_platform import LEGS, LENGTHS, determinant, legs, pose_of, scene
from paths import along

from cinegen.collision import PlanningError, scene_of
from cinegen.planning import Planner, PlanStatus, change_mode, plan
from cinegen.tolerances import NEAR_SINGULAR

SECONDS = 240.0  # of a search that takes some seconds on an idle machine
MODES = {  # x and y (10 mm), angle (deg) of the six modes, and the sign of the determinant
    (-5.4957, -13.9355, -2.712): 1.0,
    (-8.7266, 12.1757, -56.549): -1.0,
    (-13.4199, -6.6562, 33.557): -1.0,
    (14.6739, -3.0126, 122.206): 1.0,
    (-14.8961, 1.5830, 14.055): 1.0,
    (14.9201, -1.3379, 57.413): -1.0,
}


def dense(mechanism, path, step=0.01):
    """Configurations along a path, loops closed, no further apart than a step (rad and characteristic lengths)."""
    return (mechanism.close(q) for q in along(mechanism, path, step))


def open_by(mechanism, q):
    """How far legs 2 and 3 are from the platform at q, m, by Pinocchio."""
    pairs = ("frame20", "frame22"), ("frame21", "frame23")
    ends = [[mechanism.placement(q, node).translation for node in pair] for pair in pairs]
    return max(float(np.linalg.norm(a - b)) for a, b in ends)


def check_path(change, mechanism, sides):
    """Assert what holds for every path: it begins at the start, ends in the mode that is reported, has no jump, is
    closed, and its determinant is positive and negative as `sides`; return the determinants (n,)."""
    path = change.plan.path
    assert np.array_equal(path[0], change.plan.scene.start)
    index = [mechanism.q_index(name) for name in LEGS]
    assert path[-1][index] == pytest.approx(LENGTHS, abs=1e-8)
    reached = pose_of(mechanism, change.modes[change.mode])
    assert pose_of(mechanism, path[-1]) == pytest.approx(reached, abs=1e-8)
    assert np.abs(pose_of(mechanism, path[0]) - reached).max() > 0.1
    along = list(dense(mechanism, path))
    assert max(mechanism.distance(a, b) for a, b in itertools.pairwise(along)) < 0.05
    for q in along:
        assert open_by(mechanism, q) < 1e-10
        assert q[index] == pytest.approx(np.linalg.norm(legs(pose_of(mechanism, q))[0], axis=1), abs=1e-8)
        assert mechanism.limits.within(q)
    found_sides = np.array([determinant(mechanism, q) for q in along])
    assert set(np.sign(found_sides)) == sides
    return found_sides


def test_the_modes_are_those_of_the_actuated_joints(root):
    longer = 1.02 * LENGTHS
    mechanism = (task := scene(root)).mechanism
    index = [mechanism.q_index(name) for name in LEGS]
    modes = change_mode(task, longer, seconds=1e-3).modes
    assert len(modes) > 1
    assert all(q[index] == pytest.approx(longer) for q in modes)


def test_a_mode_is_changed_without_a_singularity_also_with_a_leg_locked(root):
    """As in the sections of joint space that the literature draws."""
    mechanism = (task := scene(root)).mechanism
    change = change_mode(task, locked=[LEGS[0]], seconds=SECONDS)
    assert change.plan.status is PlanStatus.REACHED
    assert change
    sides = check_path(change, mechanism, {1.0})
    assert sides.min() > 0.1 * determinant(mechanism, mechanism.q_home)
    assert np.ptp(change.plan.path[:, mechanism.q_index(LEGS[0])]) < 1e-12
    assert change.crossed == ()
    structure = mechanism.structure
    matrices = [structure.passive_matrix(q) for q in dense(mechanism, change.plan.path)]
    sigmas = np.linalg.svd(matrices, compute_uv=False)[:, structure.passive_rank + structure.screws.cut - 1]
    assert 0.5 * NEAR_SINGULAR < change.sigma_bound <= min(sigmas)
    assert change.sigma >= NEAR_SINGULAR
    assert str(change) == f"reached: assembly mode {change.mode + 1} of 6, without a singularity of type 2"


def test_a_mode_on_the_other_side_is_reached_through_a_singularity_that_is_reported(root):
    mechanism = (task := scene(root)).mechanism
    other = next(k for k, q in enumerate(change_mode(task, seconds=1e-3).modes) if determinant(mechanism, q) < 0.0)
    mode_change = change_mode(task, mode=other, singular="cross", seconds=2.0)
    assert mode_change.mode == other
    around, through = mode_change.plan.attempts
    assert (around.status, through.status) == (PlanStatus.TIME_LIMIT, PlanStatus.REACHED)
    assert len(around.path) == 1
    assert "no proof" in around.reason
    sides = check_path(mode_change, mechanism, {1.0, -1.0})
    changes = np.count_nonzero(np.diff(np.sign(sides)))
    assert len(mode_change.crossed) == changes
    assert mode_change.sigma_bound == 0.0
    for crossed in mode_change.crossed:
        assert crossed.sigma < 1e-6
        assert abs(determinant(mechanism, crossed.q)) < 1e-6 * np.abs(sides).max()
        begin, end = mode_change.plan.path[crossed.segment : crossed.segment + 2]
        assert determinant(mechanism, begin) * determinant(mechanism, end) < 0.0
    assert re.search(r"through (a singularity|\d+ singularities) of type 2", str(mode_change))


def test_a_plan_to_a_pose_keeps_to_its_side_of_the_singularities(root):
    goal = (-0.02, -0.16, 0.3)
    task = scene(root, goal={"point": goal[:2], "angle": goal[2]})
    mechanism = task.mechanism
    planned = plan(task, seconds=SECONDS)
    assert planned
    assert pose_of(mechanism, planned.path[-1]) == pytest.approx(goal, abs=1e-4)
    side = np.sign(determinant(mechanism, task.start))
    assert all(np.sign(determinant(mechanism, q)) == side for q in dense(mechanism, planned.path))


def test_a_plan_does_not_reach_a_pose_on_the_other_side(root):
    x, y, angle = next(mode for mode, sign in MODES.items() if sign < 0.0)
    task = scene(root, goal={"point": [x / 100, y / 100], "angle": np.radians(angle)})
    planned = plan(task, seconds=0.7, planner=Planner.RRT_CONNECT)
    assert planned.status is PlanStatus.TIME_LIMIT
    along = [determinant(task.mechanism, q) for trial in planned.attempts for q in dense(task.mechanism, trial.path)]
    assert min(along) > 0.0


def test_modes_outside_limits_are_no_goals(root):
    """The five-bar's other mode has its elbows on the other side, beyond their limits."""
    change = change_mode(scene_of({"robot": str(root / "robots/five_bar.raff"), "goal": {"point": [0.0, 0.4]}}))
    assert change.plan.status is PlanStatus.OUT_OF_REACH
    assert len(change.modes) == 2
    assert "within limits" in change.plan.reason


@pytest.mark.parametrize(
    ("keys", "wrong", "message"),
    [
        ({"path": {"line": [1, 0, 0]}}, {}, "remove them \\(path\\)"),
        ({"weights": {LEGS[0]: 5.0}}, {}, "weights"),
        ({}, {"singular": "maybe"}, "singular must be one of 'avoid', 'cross', not 'maybe'"),
        ({}, {"margin": 0.0}, "margin must be above 0"),
        ({}, {"seed": -1}, "seed must be 0 or above"),
        ({}, {"mode": 6}, "there is no assembly mode 7: there are 6"),
    ],
)
def test_what_is_not_obeyed_and_wrong_arguments_are_refused(root, keys, wrong, message):
    with pytest.raises(PlanningError, match=message):
        change_mode(scene(root, **keys), **wrong)
