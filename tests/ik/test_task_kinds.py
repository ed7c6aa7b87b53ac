"""Kinds of tasks in Python, ranges, and tasks of a program's own."""

import re
import warnings

import numpy as np
import pinocchio as pin
import pytest
from test_kernel import load
from ticking import pull, ticked
from variants import FEWER

import cinegen
from cinegen import CinegenError, Solver, Status
from cinegen.ik import (
    AxisAlong,
    CenterOfMass,
    Damping,
    JointEquality,
    JointValues,
    LookAt,
    PinkTask,
    PointAtDistance,
    PointInPlane,
    PointOnLine,
    Range,
    RelativePose,
    State,
)
from cinegen.loops.motions import motions_of


def all_kinds(mechanism: cinegen.Mechanism) -> list:
    node, other = mechanism.nodes[-1], mechanism.nodes[len(mechanism.nodes) // 2]
    pose = pin.SE3(pin.exp3(np.array([0.3, 0.2, 1.0])), np.array([0.1, 0.2, 0.3]))
    joints = list(mechanism.joints)
    at = (0.1, -0.2, 0.3)
    return [
        RelativePose(node, other, pose), RelativePose(node, other, pose, rotation=False), CenterOfMass(at),
        CenterOfMass(at, "xy"), LookAt(node, (1.0, 2.0, 3.0), (1.0, 1.0, 0.0), at), LookAt(node, at, on=other),
        AxisAlong(node, (1.0, 2.0, 3.0)), AxisAlong(node, (0.0, 1.0, 1.0), on=other),
        PointOnLine(node, at, (1.0, 0.0, 1.0), at),
        PointInPlane(node, at, (1.0, 2.0, 2.0), at), PointAtDistance(node, at, 0.3, at),
        PointAtDistance(node, at, 0.3, on=other),
        JointValues({joints[0]: 0.3}, "m" if mechanism.is_prismatic(joints[0]) else "rad"),
        JointEquality({joints[0]: 1.0, joints[-1]: -2.0}, 0.1), Damping(),
    ]  # fmt: skip


@pytest.mark.parametrize("name", sorted(FEWER))
def test_jacobians_are_the_derivatives_of_errors(name):
    mechanism = load(name, None)
    closed = mechanism.random_closed(2, seed=4)
    opened = [mechanism.integrate(q, 0.1 * np.sin(np.arange(mechanism.model.nv))) for q in closed]
    for q in [*closed, *opened]:
        state = State(mechanism, q, 0.01)
        for task in all_kinds(mechanism):
            if isinstance(task, Damping) or (isinstance(task, CenterOfMass) and mechanism.massless):
                continue
            for column, unit in enumerate(np.eye(mechanism.model.nv)):
                ahead, behind = (State(mechanism, mechanism.integrate(q, h * unit), 0.01) for h in (1e-6, -1e-6))
                slope = (task.error(ahead) - task.error(behind)) / 2e-6
                assert task.jacobian(state)[:, column] == pytest.approx(slope, abs=1e-7), task


def test_every_kind_is_reached_and_changes_at_run_time():
    arm = load("arm7", "arm")
    state = State(arm, arm.q_home + 0.2, 0.01)
    tool = state.frame("tool")
    tasks = [
        RelativePose("tool", "link3", state.frame("tool", "link3")),
        LookAt("tool", tool.act(np.array([0.0, 0.0, 0.5]))),
        AxisAlong("tool", tool.rotation[:, 0], axis=(1.0, 0.0, 0.0)),
        PointOnLine("tool", tool.translation, (1.0, 2.0, 0.5)),
        PointInPlane("tool", tool.translation, (1.0, 0.0, 1.0)),
        PointAtDistance("tool", tool.act(np.array([0.1, 0.0, 0.0])), 0.1),
        JointValues({"joint2": state.q[1], "joint4": state.q[3]}),
        JointEquality({"joint2": 1.0, "joint4": -1.0}, state.q[1] - state.q[3]),
    ]
    for task in tasks:
        solver = Solver(arm, 0.01)
        solver.add_task(task)
        step = ticked(solver, 150)
        assert max(step.errors[0]) < 1e-9, task
        assert np.abs(task.error(solver.state)).max() < 1e-9
        solver.remove_task(task)
        assert solver.step().status is Status.IDLE
    solver.add_task(gaze := LookAt("tool", tool.act(np.array([0.3, 0.0, 0.2])), priority=1))
    worst = 0.0
    for tick in range(400):  # a target that moves
        gaze.point = tool.act(np.array([0.3, 0.3 * np.sin(tick / 50.0), 0.2]))
        step = solver.step()
        worst = max(worst, step.errors[0][1]) if tick > 100 else 0.0
    assert worst < 2e-4  # second order of a tick


def tower(count: int) -> cinegen.Mechanism:
    """Links on each other, each heavier than the one below, which bend about x and y by turns."""
    link = (
        '<link name="l{0}"><inertial><origin xyz="0 0 0.2"/><mass value="{1}"/><inertia ixx="1" iyy="1" izz="1" ixy="0"'
        ' ixz="0" iyz="0"/></inertial></link>'
        '<joint name="j{0}" type="revolute"><parent link="{2}"/><child link="l{0}"/>'
        '<origin xyz="0 0 0.4"/><axis xyz="{3}"/><limit lower="-2" upper="2" effort="1" velocity="9"/></joint>'
    )
    links = [link.format(i, i + 1, f"l{i - 1}" if i else "base", ("1 0 0", "0 1 0")[i % 2]) for i in range(count)]
    return cinegen.load(f'<robot name="r"><link name="base"/>{"".join(links)}</robot>')


def test_the_centre_of_mass_stays_over_a_point():
    stack = tower(6)
    solver = Solver(stack, 0.01)
    solver.add_task(CenterOfMass((0.0, 0.0, 0.0), "xy"))
    pull(solver, "l5", [0.4, 0.3, -0.4], rotation=0, priority=1)
    for _ in range(300):
        step = solver.step()
        assert step.errors[0][0] < 1e-9
    data = stack.model.createData()
    assert np.abs(pin.centerOfMass(stack.model, data, step.q)[:2]).max() < 1e-9
    assert step.errors[1][0] < 0.3


def test_damping_slows_and_the_rest_of_its_level_is_reached():
    arm, rates = load("arm7", "arm"), []
    for weight in (0.1, 10.0):
        solver = Solver(arm, 0.01)
        task = solver.add_task("tool", arm.placement(arm.q_home + 0.1, "tool"))
        solver.add_task(Damping(weight=weight))
        rates.append(float(np.abs(solver.step().v).max()))
        step = ticked(solver, 100 if weight < 1.0 else 3000)
        assert max(step.errors[0]) < 1e-3, task
    assert rates[1] < 0.5 * rates[0]


# --- ranges ----------------------------------------------------------------------------------------------------------


def test_a_cone_about_upright_is_never_left():
    arm = load("arm7", "arm")
    solver = Solver(arm, 0.01)
    tool = solver.add_task("tool")
    start, most = tool.target.copy(), np.radians(10.0)
    solver.add_task(Range(up := AxisAlong("tool", start.rotation[:, 2]), radius=most))
    angles = []
    for tick in range(800):
        w = 2.0 * np.pi * tick / 400.0
        turn = pin.exp3(np.radians(25.0) * np.array([np.cos(w), np.sin(w), 0.0]))
        way = 0.05 * np.array([np.sin(w), np.cos(w) - 1.0, 0.0])
        tool.target = pin.SE3(start.rotation @ turn, start.translation + way)
        solver.step()
        angles.append(float(np.linalg.norm(up.error(solver.state))))
    assert max(angles) < most + 1e-6
    assert np.mean(angles[100:]) > most - np.radians(0.1)  # along its edge


def test_a_height_above_a_floor_and_a_start_below_it():
    arm = load("arm7", "arm")
    solver = Solver(arm, 0.01)
    tool = solver.add_task("tool", rotation=0)
    height = PointInPlane("tool", (0.0, 0.0, tool.target.translation[2] + 0.05))
    floor = solver.add_task(Range(height, low=0.0))
    before = height.error(solver.state)[0]
    for _ in range(200):
        step = solver.step()
        now = height.error(solver.state)[0]
        assert now >= min(before, 0.0) - 1e-6
        before = now
    assert now == pytest.approx(0.0, abs=1e-6)
    assert step.status is Status.BARRED
    assert step.active_barriers == (0,)
    solver.remove_task(floor)
    step = ticked(solver, 200)
    assert step.errors[0][0] < 1e-9


@pytest.mark.parametrize(
    ("options", "says"),
    [({}, "low or high"), ({"low": 1, "high": 0}, "low must not exceed"), ({"radius": 0.0}, "radius must be above 0"),
     ({"low": np.nan}, "low must not exceed"), ({"low": 0, "radius": 1.0}, "low or high")],
)  # fmt: skip
def test_ranges_without_sense_are_errors(options, says):
    with pytest.raises(CinegenError, match=says):
        Range(PointInPlane("tool"), **options)


# --- one's own -------------------------------------------------------------------------------------------------------


class Distance:
    """The task of the how-to."""

    priority, weight = 0, 1.0

    def __init__(self, node, other, distance):
        self.node, self.other, self.distance = node, other, distance

    def error(self, state):
        apart = state.frame(self.node).translation - state.frame(self.other).translation
        return [np.linalg.norm(apart) - self.distance]

    def jacobian(self, state):
        apart = state.frame(self.node).translation - state.frame(self.other).translation
        relative = state.jacobian(self.node)[:3] - state.jacobian(self.other)[:3]
        return (apart / np.linalg.norm(apart))[None, :] @ relative


def test_the_jacobian_of_a_single_joint_has_one_column(raff):
    bar = raff('robot r { base { } link 1 { type 2 pred 0 } frame 2 { parameters { d 300 } pred 1 name "tool" } }')
    jacobian = State(bar, bar.q_home, 0.01).jacobian("tool")
    assert jacobian == pytest.approx(np.array([[0.0, 0.3, 0.0, 0.0, 0.0, 1.0]]).T)


class Bent:
    """Its square is r^2 - 2 r q + 4 q^2 at the joint's angle q, least at r / 4. From q = 0 its slope leads to r."""

    priority, weight, unit = 0, 1.0, "rad"
    reach = 0.05

    def error(self, state):
        return np.sqrt([self.reach**2 - 2.0 * self.reach * state.q[0] + 4.0 * state.q[0] ** 2])

    def jacobian(self, state):
        return [(4.0 * state.q - self.reach) / self.error(state)]


def test_a_step_that_loses_is_shortened_to_the_minimum_of_a_parabola(raff):
    bar = raff('robot r { base { } link 1 { type 2 pred 0 } frame 2 { parameters { d 300 } pred 1 name "tool" } }')
    solver = Solver(bar, 0.01)
    task = solver.add_task(Bent())
    step = solver.step()
    assert step.q == pytest.approx([task.reach / 4.0], rel=1e-9)
    assert step.errors[0][1] == pytest.approx(task.reach * np.sqrt(0.75), rel=1e-9)


def raises(state):
    raise RuntimeError("out of order")


@pytest.mark.parametrize(
    ("name", "broken", "says"),
    [("error", raises, "out of order"), ("jacobian", raises, "out of order"),
     ("error", lambda state: [1.0, 2.0], r"returned shape \(2,\): return \(1,\)"),
     ("error", lambda state: [np.nan], "not finite"), ("jacobian", lambda state: np.zeros((1, 2)), "return"),
     ("weight", 0.0, "positive"), ("priority", -1, "0 or more")],
)  # fmt: skip
def test_a_task_that_fails_is_left_out_of_the_tick_and_told(name, broken, says):
    arm = load("arm7", "arm")
    solver = Solver(arm, 0.01)
    distance, tool = solver.add_task(Distance("tool", "base", 0.6)), solver.add_task("tool", rotation=0)
    solver.step()
    good = getattr(distance, name)
    setattr(distance, name, broken)
    for _ in range(3):
        step = solver.step()
        assert step.status is Status.BAD_TARGET
        assert np.isnan(step.errors[0]).all()
        assert step.exceptions
        assert step.task_statuses[0] is Status.BAD_TARGET
        assert repr(distance) in step.problems[0]
        assert not step.problems[1]
    assert re.search(says, str(step.exceptions[0]))
    assert len(solver.exception_log.messages) == 1
    setattr(distance, name, good)
    solver.remove_task(tool)
    step = ticked(solver, 200)
    assert step.status is Status.FOLLOWING
    assert not step.exceptions


def test_what_is_no_task_is_an_error_when_it_is_added():
    solver = Solver(load("arm7", "arm"), 0.01)

    class Wrong(Distance):
        def jacobian(self, state):
            return -super().jacobian(state)

    with pytest.raises(CinegenError, match="wrong sign"):
        solver.add_task(Wrong("tool", "base", 0.6))
    for error in (0.0, [], np.zeros((2, 1))):
        wrong = Distance("tool", "base", 0.6)
        wrong.error = lambda state, error=error: error
        with pytest.raises(CinegenError, match=r"returned shape \(.*\): return \(m,\), m > 0"):
            solver.add_task(wrong)
    with pytest.raises(CinegenError, match="has no masses"):
        Solver(load("scara", None), 0.01).add_task(CenterOfMass((0.0, 0.0, 0.0)))
    for what in (object(), 3, None):
        with pytest.raises(CinegenError, match="priority, weight, error"):
            solver.add_task(what)
    task = solver.add_task(Distance("tool", "base", 0.6))
    with pytest.raises(CinegenError, match="already"):
        solver.add_task(task)
    with pytest.raises(CinegenError, match="can't fade"):
        solver.remove_task(task, seconds=1.0)
    solver.remove_task(task)
    assert solver.tasks == ()


@pytest.mark.parametrize(
    ("name", "wrong"),
    [("point", "here"), ("axis", (0, 0, 0)), ("point", (1, np.inf, 0)), ("weight", 0), ("priority", 0.5)],
)
def test_attributes_of_kinds_are_checked_when_they_are_set(name, wrong):
    task = LookAt("tool", (1.0, 0.0, 0.0))
    with pytest.raises(CinegenError, match=r"must be|0 or more"):
        setattr(task, name, wrong)
    with pytest.raises(AttributeError, match="node, point"):
        task.points = (1.0, 0.0, 0.0)


def test_copies_for_a_look_ahead_follow_bit_for_bit():
    arm = load("arm7", "arm")
    solver = Solver(arm, 0.01)
    tool = solver.add_task("tool", arm.placement(arm.q_home + 0.2, "tool"))
    solver.add_task(Distance("link4", "base", 0.5)).priority = 1
    ticked(solver, 5)
    forecast = cinegen.forecast_motion(solver, 0.2, dt=0.01, moving=False)
    assert np.array_equal(forecast.q[-1], [solver.step().q for _ in range(20)][-1])
    assert tool.priority == 0


def test_inverse_kinematics_takes_all_kinds_and_priorities():
    arm = load("arm7", "arm")
    state = State(arm, arm.q_home + 0.4, 0.01)
    pose = cinegen.FrameTask("tool", state.frame("tool"), frame=arm.frame_id("tool"))
    gaze = LookAt("link5", state.frame("link5").act(np.array([0.0, 0.0, 1.0])), priority=1)
    result = cinegen.inverse_kinematics(arm, [pose, gaze])
    assert result
    assert np.abs(result.errors).max() < 1e-9
    assert np.abs(gaze.error(State(arm, result.q, 0.01))).max() < 1e-9
    elbow = cinegen.FrameTask("link4", arm.placement(arm.q_home - 0.5, "link4"), rotation=0, priority=1)
    elbow.find_frame = arm.frame_id
    elbow.node = "link4"
    result = cinegen.inverse_kinematics(arm, [pose, elbow], starts=4)
    assert not result
    assert max(result.errors[0]) < 1e-9 < result.errors[1][0]
    with pytest.raises(CinegenError, match="kinds or priorities"):
        cinegen.inverse_kinematics(arm, [pose, gaze], all=True)


@pytest.mark.parametrize("name", ["arm7", "gough"])
def test_locked_joints_do_not_move_for_tasks_of_any_kind_and_level(name):
    mechanism = load(name, None)
    joint = mechanism.actuated[1]
    column, end = mechanism.v_index(joint), mechanism.end
    height = PointInPlane(end, mechanism.placement(mechanism.q_home, end).act(np.array([0.0, 0.0, 0.02])))
    solver = Solver(mechanism, 0.01)
    solver.add_task(height)
    solver.add_task(AxisAlong(end, (0.05, 0.0, 1.0), priority=1))
    solver.lock(joint)
    for _ in range(100):
        step = solver.step()
        assert step.v[column] == 0.0
        assert step.closure < 1e-9
    assert step.errors[0][0] < 1e-9
    result = cinegen.inverse_kinematics(mechanism, [height, AxisAlong(end, priority=1)], locked=[joint], starts=2)
    assert result.q[mechanism.q_index(joint)] == mechanism.q_home[mechanism.q_index(joint)]
    assert result.errors[0][0] < 1e-9


@pytest.mark.parametrize("name", ["arm7", "delta4"])
def test_singular_values_include_rows_of_python_and_leave_out_lower_levels(name):
    mechanism = load(name, None)
    end, q = mechanism.end, mechanism.q_home
    node = mechanism.nodes[-2]
    solver = Solver(mechanism, 0.01)
    solver.add_task(end, rotation=0)
    first = solver.step().singular_values
    solver.add_task(node, priority=1)
    assert solver.step().singular_values == pytest.approx(first, abs=1e-12)
    solver.q = q
    height = solver.add_task(PointInPlane(node, mechanism.placement(q, node).translation))
    step = solver.step()
    jacobian = State(mechanism, q, 0.01).jacobian(end)[:3]
    rows = np.vstack([jacobian, height.jacobian(State(mechanism, q, 0.01))]) / mechanism.length * mechanism.scale
    motions = motions_of(mechanism.structure.system, q, mechanism.loop_rank)
    expected = np.linalg.svd(rows @ motions, compute_uv=False)[: len(step.singular_values)]
    assert step.singular_values == pytest.approx(expected, abs=1e-9)
    assert step.lost_dof is None
    assert [task.priority for task in solver.frame_tasks] == [0, 1]


def test_a_state_stays_that_of_its_configuration():
    solver = Solver(load("arm7", "arm"), 0.01)
    solver.add_task(JointValues({"joint2": 1.5}))
    state = solver.state
    before = state.frame("tool")
    ticked(solver, 20)
    assert state.frame("tool") == before
    assert solver.state.frame("tool") != before


def test_tasks_that_change_their_priority_at_each_look_end_no_loop():
    class Restless(Distance):
        looks = 0

        @property
        def priority(self):
            Restless.looks += 1
            return Restless.looks % 3

    solver = Solver(load("arm7", "arm"), 0.01)
    solver.add_task(Restless("tool", "base", 0.6))
    solver.add_task("link4", rotation=0)
    for _ in range(30):
        assert np.isfinite(solver.step().q).all()


def test_units_of_joint_values_are_those_of_the_joints():
    gough = load("gough", None)
    leg = gough.actuated[0]
    solver = Solver(gough, 0.01)
    with pytest.raises(CinegenError, match="give unit=\\['m'\\]"):
        solver.add_task(JointValues({leg: 0.1}))
    solver.add_task(JointValues({leg: gough.q_home[gough.q_index(leg)] + 0.01}, unit="m"))
    step = ticked(solver, 100)
    assert step.errors[0] == (pytest.approx(0.0, abs=1e-9), 0.0)


def test_the_centre_of_mass_of_a_robot_of_more_than_a_hundred_joints():
    snake = tower(105)
    state = State(snake, snake.q_home, 0.01)
    task = CenterOfMass((0.0, 0.0, 0.0))
    whole = pin.centerOfMass(snake.model, snake.model.createData(), snake.q_home)
    assert task.error(state) == pytest.approx(whole, abs=1e-12)
    assert task.jacobian(state).shape == (3, 105)


# --- pink task --------------------------------------------------------------------------------------------------------
# Tasks of pink in a solver.


with warnings.catch_warnings():  # qpsolvers misses solvers that no task needs
    warnings.simplefilter("ignore")
    from pink import Configuration
    from pink.tasks import ComTask, FrameTask, JointCouplingTask, PostureTask, RelativeFrameTask


def test_a_frame_of_pink_moves_as_one_of_cinegen():
    arm = load("arm7", "arm")
    target, poses = arm.placement(arm.q_home + 0.2, "tool"), []
    for native in (False, True):
        solver = Solver(arm, 0.01)
        if native:
            solver.add_task("tool", target)
        else:
            task = FrameTask("tool", position_cost=1.0, orientation_cost=1.0)
            task.set_target(target)
            added = solver.add_task(PinkTask(task))
        step = ticked(solver, 100)
        assert max(step.errors[0]) < 1e-9
        poses.append(arm.placement(step.q, "tool").homogeneous)
    assert np.allclose(*poses, atol=1e-8)
    assert added.weight == 1.0
    configuration = Configuration(arm.model, arm.model.createData(), step.q)
    assert np.abs(task.compute_error(configuration)).max() < 1e-8  # by pink


def test_costs_are_weights_and_rows_of_cost_zero_are_left_out():
    arm = load("arm7", "arm")
    target = arm.placement(arm.q_home + 0.3, "tool")
    task = FrameTask("tool", position_cost=2.0, orientation_cost=0.0)
    task.set_target(target)
    solver = Solver(arm, 0.01)
    added = solver.add_task(PinkTask(task, priority=1))
    solver.add_task(PointInPlane("link4", arm.placement(arm.q_home + 0.3, "link4").translation))
    assert (added.weight, list(added.unit), added.error(solver.state).shape) == (2.0, ["m"] * 3, (3,))
    step = ticked(solver, 150)
    assert step.errors[0][1] == 0.0
    assert np.abs(arm.placement(step.q, "tool").translation - target.translation).max() < 1e-6
    assert step.errors[1][0] < 1e-9


@pytest.mark.parametrize("name", ["arm7", "delta4"])
def test_relative_poses_and_postures_of_pink_with_and_without_loops(name):
    mechanism = load(name, None)
    q = mechanism.random_closed(1, seed=5)[0]
    node, other = mechanism.end, mechanism.nodes[2]
    relative = RelativeFrameTask(node, other, position_cost=1.0, orientation_cost=1.0)
    relative.set_target(mechanism.placement(q, other).actInv(mechanism.placement(q, node)))
    posture = PostureTask(cost=1.0)
    posture.set_target(q)
    for task in (relative, posture):
        solver = Solver(mechanism, 0.01)
        solver.add_task(PinkTask(task))
        step = ticked(solver, 300)
        assert np.hypot(*step.errors[0]) < 1e-6
        assert step.closure < 1e-9


def test_what_a_solver_does_otherwise_is_an_error_with_the_remedy():
    frame = FrameTask("tool", position_cost=1.0, orientation_cost=1.0, lm_damping=1.0)
    with pytest.raises(CinegenError, match="lm_damping to 0"):
        PinkTask(frame)
    frame.lm_damping = 0.0
    frame.gain = 0.5
    with pytest.raises(CinegenError, match="set Solver"):
        PinkTask(frame)
    frame.gain = 1.0
    assert PinkTask(frame).priority == 0
    with pytest.raises(CinegenError, match="compute_error"):
        PinkTask(pin.SE3.Identity())
    arm = load("arm7", "arm")
    home = Configuration(arm.model, arm.model.createData(), arm.q_home)
    coupling = JointCouplingTask(["joint1", "joint2"], [1.0, -1.0], 1.0, home)
    with pytest.raises(CinegenError, match="give unit="):
        PinkTask(coupling)
    assert PinkTask(coupling, unit="rad").unit == "rad"
    assert PinkTask(ComTask(cost=[1.0, 1.0, 0.0])).unit == "m"
