"""Attributes that are set between two ticks: they take effect at the next one, and misspelt ones are errors."""

import numpy as np
import pinocchio as pin
import pytest

from cinegen import CinegenError, Solver, Status
from cinegen.ik import LimitMargin, Manipulability, Posture

DT = 1.0 / 240.0
POINT = np.array([0.0, 0.03, 0.02])
TURNED = pin.SE3(pin.exp3(np.array([0.1, -0.2, 0.3])), POINT)


def _run(solver, ticks=300):
    for _ in range(ticks):
        step = solver.step()
    return step


@pytest.fixture
def arm(robot):
    """A solver that has ticked, and its task; somewhere where the arm is not singular."""
    mechanism = robot("arm7")
    solver = Solver(mechanism, DT, mechanism.random_closed(1, seed=3)[0])
    task = solver.add_task(mechanism.nodes[-1])
    _run(solver, 3)
    return solver, task


def _gap(solver, task, node, offset):
    """How far (m) a frame on a node is from a task's target."""
    here = solver.mechanism.placement(solver.q, node) * offset
    return float(np.linalg.norm(here.translation - task.target.translation))


@pytest.mark.parametrize("offset", [POINT, POINT.tolist(), TURNED])
def test_an_offset_takes_effect_at_the_next_tick(arm, offset):
    solver, task = arm
    node, before = solver.mechanism.nodes[-1], solver.q
    task.offset = offset
    assert solver.step().errors[0][0] > 0.0
    assert not np.array_equal(solver.q, before)
    pose = offset if isinstance(offset, pin.SE3) else pin.SE3(np.eye(3), POINT)
    assert _run(solver).status is Status.FOLLOWING
    assert (solver.mechanism.placement(solver.q, node) * pose).isApprox(task.target, 1e-8)
    assert task.offset.isApprox(pose)
    q = solver.q
    solver.remove_task(solver.add_task(solver.mechanism.nodes[1], rotation=0))  # another task: no jump
    assert np.abs(solver.step().q - q).max() < 1e-9


def test_another_node_follows_from_the_next_tick_on(arm):
    solver, task = arm
    mechanism = solver.mechanism
    node = mechanism.nodes[-2]
    here = mechanism.placement(solver.q, node)
    task.rotation, task.node = 0, node
    goal = pin.SE3(here.rotation, here.translation + np.array([0.0, 0.01, -0.01]))
    task.target = goal
    assert _run(solver).status is Status.FOLLOWING
    assert (task.node, task.frame) == (node, mechanism.frame_id(node))
    assert _gap(solver, task, node, pin.SE3.Identity()) < 1e-8


def test_axes_take_effect_at_the_next_tick(arm):
    """Of the translations only that along x counts: of the world, then of the target."""
    solver, task = arm
    mechanism, node = solver.mechanism, solver.mechanism.nodes[-1]
    task.weights = (1, 0, 0, 0, 0, 0)
    turned = pin.SE3(pin.exp3(np.array([0.3, -1.2, 0.4])), mechanism.placement(solver.q, node).translation + POINT)
    task.target = turned
    for axes in ("world", "target", mechanism.nodes[1]):
        task.axes = axes
        assert task.axes == axes
        _run(solver)
        gap = turned.translation - mechanism.placement(solver.q, node).translation
        rotation = {"world": np.eye(3), "target": turned.rotation}.get(axes)
        rotation = mechanism.placement(solver.q, axes).rotation if rotation is None else rotation
        assert abs(rotation[:, 0] @ gap) < 1e-8


@pytest.mark.parametrize(
    ("name", "wrong"),
    [("offset", "here"), ("offset", (1.0, 2.0)), ("offset", (0.0, np.nan, 0.0)), ("node", "nowhere"), ("node", []),
     ("axes", "nowhere"), ("axes", np.zeros(3)), ("node", None)],
)  # fmt: skip
def test_a_wrong_value_is_kept_and_reported_until_it_is_corrected(arm, name, wrong):
    solver, task = arm
    good, q = getattr(task, name), solver.q
    setattr(task, name, wrong)
    step = solver.step()
    assert step.status is Status.BAD_TARGET
    assert np.isnan(step.errors[0]).all()
    assert np.isnan(task.error).all()
    assert np.array_equal(step.q, q)
    task.target = task.target  # another value that is good does not hide it
    assert not task.is_valid()
    assert not task.copy().is_valid()
    setattr(task, name, good)
    assert task.is_valid()
    assert solver.step().status is Status.FOLLOWING


def test_a_twist_begins_again_where_another_frame_follows(arm):
    """Its directions of zero velocity keep the frame where it is, not where the last frame was."""
    solver, task = arm
    task.twist = np.zeros(6)
    _run(solver, 3)
    q = solver.q
    task.offset = POINT
    assert np.abs(_run(solver, 5).q - q).max() < 1e-9


def test_misspelt_attributes_are_errors(arm, robot):
    solver, task = arm
    for thing, name in ((solver, "gian"), (solver, "objective"), (task, "taget"), (task, "wieght"),
                        (Posture(), "rat"), (LimitMargin(), "margn"), (Manipulability(), "nodes")):  # fmt: skip
        with pytest.raises(AttributeError, match=name):
            setattr(thing, name, 1.0)
    with pytest.raises(AttributeError, match="frame"):
        task.frame = 3  # it is the node's


# --- objectives --------------------------------------------------------------------------------------------------


def _same_velocity(solver, changed, made):
    state = solver.state
    return np.allclose(changed.velocity(state), made.velocity(state), atol=1e-12)


def test_what_is_set_of_an_objective_takes_effect_at_once(robot):
    arm = robot("arm7")
    solver = Solver(arm, DT, arm.random_closed(1, seed=7)[0])
    joint, away = arm.joints[1], arm.random_closed(2, seed=8)[1]
    posture, margin, far = Posture(), LimitMargin(), Manipulability()
    for one in (posture, margin, far):
        one.velocity(solver.state)
    posture.joints, posture.q, posture.rate = {joint: 2.0}, away.tolist(), 3.0
    assert _same_velocity(solver, posture, Posture(away, {joint: 1.0}, 3.0))  # weights are relative
    assert not _same_velocity(solver, posture, Posture())
    margin.margin, margin.joints = 0.5, joint
    assert _same_velocity(solver, margin, LimitMargin(0.5, joint))
    assert not _same_velocity(solver, margin, LimitMargin())
    far.node, far.rotation = arm.end, 0
    assert _same_velocity(solver, far, Manipulability(arm.end, rotation=0))


@pytest.mark.parametrize(
    ("thing", "name", "wrong"),
    [(Posture(), "rate", 0.0), (Posture(), "joints", {"joint1": -1.0}), (LimitMargin(), "margin", 0.7),
     (Manipulability(), "translation", 4), (Manipulability(), "rotation", -1)],
)  # fmt: skip
def test_wrong_values_of_objectives_are_refused_as_arguments_are(thing, name, wrong):
    before = getattr(thing, name)
    with pytest.raises(CinegenError):
        setattr(thing, name, wrong)
    assert getattr(thing, name) == before
