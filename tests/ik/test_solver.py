"""The solver as one who tasks on a robot meets it."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ticking import ticked

from cinegen import CinegenError, Solver, Status, inverse_kinematics, load
from cinegen.ik import LimitMargin, Manipulability, Posture

DT = 0.01


@pytest.mark.parametrize("name", ["delta4", "gough", "hybrid", "arm7"])
def test_a_target_within_reach_is_reached_exactly(robot, name):
    mechanism = robot(name)
    lower, upper = mechanism.model.lowerPositionLimit, mechanism.model.upperPositionLimit
    inside = [q for q in mechanism.random_closed(60, seed=5) if (q > lower).all() and (q < upper).all()][:4]
    assert inside
    node = mechanism.nodes[-1]
    for q in inside:
        solver = Solver(mechanism, DT)
        target = mechanism.placement(q, node)
        home = mechanism.placement(mechanism.q_home, node)
        near = pin.SE3.Interpolate(home, target, 0.3) if not mechanism.is_constrained else target
        solver.add_task(node, near)
        step = ticked(solver, 600)
        assert step.errors[0][0] < 1e-9 * max(1.0, mechanism.length)
        assert step.errors[0][1] < 1e-9
        assert step.status is Status.FOLLOWING
        assert step.closure <= 1e-12


# --- attributes -------------------------------------------------------------------------------------------------------
# Attributes that are set between two ticks: they take effect at the next one, and misspelt ones are errors.


TICK = 1.0 / 240.0
POINT = np.array([0.0, 0.03, 0.02])
TURNED = pin.SE3(pin.exp3(np.array([0.1, -0.2, 0.3])), POINT)


@pytest.fixture
def arm(robot):
    """A solver that has ticked, and its task; somewhere where the arm is not singular."""
    mechanism = robot("arm7")
    solver = Solver(mechanism, TICK, mechanism.random_closed(1, seed=3)[0])
    task = solver.add_task(mechanism.nodes[-1])
    ticked(solver, 3)
    return solver, task


@pytest.mark.parametrize("offset", [POINT, POINT.tolist(), TURNED])
def test_an_offset_takes_effect_at_the_next_tick(arm, offset):
    solver, task = arm
    node, before = solver.mechanism.nodes[-1], solver.q
    task.offset = offset
    assert solver.step().errors[0][0] > 0.0
    assert not np.array_equal(solver.q, before)
    pose = offset if isinstance(offset, pin.SE3) else pin.SE3(np.eye(3), POINT)
    assert ticked(solver, 300).status is Status.FOLLOWING
    assert (solver.mechanism.placement(solver.q, node) * pose).isApprox(task.target, 1e-8)
    assert task.offset.isApprox(pose)
    q = solver.q
    solver.remove_task(solver.add_task(solver.mechanism.nodes[1], rotation=0))  # another task: no jump
    assert np.abs(solver.step().q - q).max() < 1e-9


def test_another_node_follows_from_the_next_tick_on(arm):
    solver, task = arm
    mechanism = solver.mechanism
    node = mechanism.nodes[-2]
    pose = mechanism.placement(solver.q, node)
    task.rotation, task.node = 0, node
    goal = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.01, -0.01]))
    task.target = goal
    assert ticked(solver, 300).status is Status.FOLLOWING
    assert (task.node, task.frame) == (node, mechanism.frame_id(node))
    assert mechanism.placement(solver.q, node).translation == pytest.approx(goal.translation, abs=5e-9)


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
        ticked(solver, 300)
        gap = turned.translation - mechanism.placement(solver.q, node).translation
        rotation = {"world": np.eye(3), "target": turned.rotation}.get(axes)
        rotation = mechanism.placement(solver.q, axes).rotation if rotation is None else rotation
        assert abs(rotation[:, 0] @ gap) < 1e-8


def test_a_twist_begins_again_where_another_frame_follows_and_at_a_configuration_that_is_set(arm):
    """Its directions of zero velocity keep the frame where it is, not where the last frame was."""
    solver, task = arm
    task.twist = np.zeros(6)
    ticked(solver, 3)
    for changed, name, value in ((task, "offset", POINT), (solver, "q", solver.q + 0.1)):
        setattr(changed, name, value)
        q = solver.q
        assert np.abs(ticked(solver, 5).q - q).max() < 1e-9


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
    solver = Solver(arm, TICK, arm.random_closed(1, seed=7)[0])
    joint, away = arm.joints[1], arm.random_closed(2, seed=8)[1]
    posture, margin, far = Posture(), LimitMargin(), Manipulability()
    for objective in (posture, margin, far):
        objective.velocity(solver.state)
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
    [(Posture(), "rate", 0.0), (Posture(), "rate", math.nan), (Posture(), "joints", {"joint1": -1.0}),
     (LimitMargin(), "margin", 0.7), (Manipulability(), "translation", 4), (Manipulability(), "rotation", -1)],
)  # fmt: skip
def test_wrong_values_of_objectives_are_refused_as_arguments_are(thing, name, wrong):
    before = getattr(thing, name)
    with pytest.raises(CinegenError):
        setattr(thing, name, wrong)
    with pytest.raises(CinegenError):
        type(thing)(**{name: wrong})
    assert getattr(thing, name) == before


# --- settings ---------------------------------------------------------------------------------------------------------
# Gain, damping and period, set while a robot moves.


ARM, FOUR_BAR = load("robots/planar_3r.raff"), load("robots/four_bar.raff")
END = ARM.nodes[-1]


def _pulled(near=None):
    """An arm pulled outwards near where it is stretched, one tick on: its step, and how far that went."""
    q = ARM.configuration(dict(zip(ARM.joints, (0.3, 0.02, 0.02), strict=True)))
    solver = Solver(ARM, 0.01, q=q)
    if near is not None:
        solver.damping_threshold = near
    task = solver.add_task(END, translation=2, rotation=0)
    task.target = task.target * pin.SE3(np.eye(3), np.array([0.0, -1e-4, 0.0]))
    before = ARM.placement(q, END).translation
    step = solver.step()
    return step, float(np.linalg.norm(ARM.placement(step.q, END).translation - before))


@given(st.floats(1.0, 1000.0))
def test_errors_decay_exponentially_at_the_gain(gain):
    solver = Solver(ARM, 0.01)
    solver.gain = gain
    task = solver.add_task(END, rotation=0, translation=2)
    task.target = task.target * pin.SE3(np.eye(3), np.array([1e-5, 0.0, 0.0]))
    assert solver.gain == gain
    assert solver.step().errors[0][0] == pytest.approx(math.exp(-0.01 * gain) * 1e-5, abs=1e-9)


def test_damping_sets_in_below_the_value_that_is_set():
    sigma = _pulled()[0].singular_values[-1]
    assert 1e-3 < sigma < 0.1
    lively, usual, calm = (_pulled(near)[1] for near in (0.5 * sigma, 2.0 * sigma, 0.3))
    assert calm < usual < lively
    assert lively == pytest.approx(1e-4, rel=1e-2)  # not damped at all


@pytest.mark.parametrize("value", [0.0, -1.0, 1.5, math.nan])
def test_invalid_settings_are_refused_and_nothing_changes(value):
    solver = Solver(ARM, 0.01, gain=50.0)
    if value != 1.5:
        with pytest.raises(CinegenError, match="gain"):
            solver.gain = value
    with pytest.raises(CinegenError, match="damping"):
        solver.damping_threshold = value
    assert (solver.gain, solver.damping_threshold) == (50.0, 0.05)


def test_a_gentle_pull_is_followed_to_the_end_and_never_said_to_be_out_of_reach():
    solver = Solver(ARM, 0.001, gain=20.0)
    task = solver.add_task(END, translation=2, rotation=0)
    task.target = task.target * pin.SE3(np.eye(3), np.array([0.01, 0.01, 0.0]))
    statuses = {solver.step().status for _ in range(2000)}
    assert statuses == {Status.FOLLOWING}
    assert solver.step().errors[0][0] < 1e-6 * ARM.length


# --- the period ------------------------------------------------------------------------------------------------------


SLOW, FAST = 1.0 / 60.0, 1e-3


def aside(task, step):
    task.target = task.target * pin.SE3(np.eye(3), np.array([0.0, step, 0.0]))


@pytest.mark.parametrize("name", ["planar_3r", "delta4"])
@pytest.mark.parametrize("accelerated", [False, True])
@pytest.mark.parametrize(("before", "after"), [(SLOW, FAST), (FAST, SLOW)])
def test_ticks_go_on_as_those_of_a_solver_with_the_new_period(robot, name, accelerated, before, after):
    mechanism = robot(name)
    acceleration = 5.0 if accelerated else None
    solver = Solver(mechanism, before, gain=20.0, acceleration=acceleration)
    task, speed = solver.add_task(mechanism.end, rotation=0), 0.05 * mechanism.length
    for _ in range(20):
        aside(task, speed * before)
        solver.step()
    other = Solver(mechanism, after, gain=20.0, acceleration=acceleration)
    other.copy_state(solver)
    v = solver.v
    solver.dt = after
    assert solver.v == pytest.approx(v, rel=1e-12)
    for _ in range(5):
        for twin in (solver, other):
            aside(twin.tasks[0], speed * after)
        step, expected = solver.step(), other.step()
        assert step.q == pytest.approx(expected.q, abs=1e-12)
        assert step.v == pytest.approx(expected.v, rel=1e-9, abs=1e-12)


def test_limits_that_are_lifted_stay_lifted(robot):
    solver = Solver(robot("planar_3r"), SLOW)
    solver.lift_limits(position=False)
    solver.dt = FAST
    assert np.isinf(solver._memory.longest_step).all()


# --- units ------------------------------------------------------------------------------------------------------------
# Numbers that a program can't mean: degrees for radians, mm for m, a rate for a period, a flag for a number.


FAR = pin.SE3(np.eye(3), np.array([300.0, 0.0, 0.0]))
DEGREES = [90.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(("mistake", "remedy"), [
    (lambda solver: Solver(solver.mechanism, 0.0), "dt"),
    (lambda solver: Solver(solver.mechanism, DT, gain=0.0), "gain"),
    (lambda solver: Solver(FOUR_BAR, DT, q=FOUR_BAR.q_home + 0.1), "open"),
    (lambda solver: solver.add_task("tol"), "did you mean 'tool'"),
    (lambda solver: solver.add_task("tool", translation=4), "0 to 3"),
    (lambda solver: solver.add_task("tool", np.eye(4)), "SE3"),
    (lambda solver: Solver(solver.mechanism, 240), "1/240"),
    (lambda solver: setattr(solver, "dt", 240.0), "1/240"),
    (lambda solver: setattr(solver, "q", DEGREES), "90 degrees, which are 1.571 rad"),
    (lambda solver: Solver(solver.mechanism, 0.01, DEGREES), "90 degrees, which are 1.571 rad"),
    (lambda solver: solver.add_task("tool", offset=FAR), "300 mm"),
    (lambda solver: solver.add_task("tool", FAR), "300 mm"),
    (lambda solver: solver.add_task("tool", rotation=True), "0 to 3 translations and rotations, not 3 and True"),
    (lambda solver: solver.remove_task("tool"), "a task that add_task returned"),
    (lambda solver: inverse_kinematics(solver.mechanism, {"tool": FAR}), "300 mm"),
    (
        lambda solver: inverse_kinematics(solver.mechanism, {"tool": pin.SE3.Identity()}, DEGREES),
        "90 degrees, which are 1.571 rad",
    ),
])  # fmt: skip
def test_what_cannot_be_meant_is_an_error_with_the_remedy(robot, mistake, remedy):
    solver = Solver(robot("arm7"), 1 / 240)
    with pytest.raises(CinegenError, match=remedy):
        mistake(solver)
    assert not solver.tasks
    assert np.array_equal(solver.q, solver.mechanism.q_home)
