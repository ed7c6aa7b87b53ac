"""Singularities against closed forms: which direction is lost, which motion is gained."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loop_openings import Openings
from planar import ROCKER, two_r
from scipy.linalg import qr
from small_robots import four_bar, two_bars
from ticking import pull, ticked

import cinegen
from cinegen import FrameTask, PersistentSolver, Solver, Status, inverse_kinematics
from cinegen.ik import persistent
from cinegen.ik.branch import passes_toggle

DT = 0.01
seeds = st.integers(0, 2**32 - 1)
ROBOTS = ["planar_3r", "serial_5dof", "arm7", "five_bar", "delta4", "hybrid", "sr400"]
LOOPED = ["five_bar", "planar_hybrid", "delta4", "gough", "hybrid", "sr400"]


def _unit(mechanism):
    return np.array([mechanism.length] * 3 + [1.0] * 3)


def _world(mechanism, q, node):
    """(6, nv) Jacobian of a node in the world's axes."""
    turn = np.kron(np.eye(2), mechanism.placement(q, node).rotation)
    return turn @ mechanism.jacobian(q, node)


# --- type 1 ----------------------------------------------------------------------------------------------------------


def test_a_two_r_arm_loses_what_its_closed_form_says():
    a, b = 0.4, 0.3
    arm = cinegen.load(two_bars((30, 40), (400, 300)))
    for second in (0.6, 0.1, 1e-3, 1e-6, -0.4, math.pi - 0.2):
        q = arm.configuration({"joint1": 0.7, "joint2": second})
        solver = Solver(arm, DT, q=q)
        solver.add_task("tool", rotation=0)
        step = solver.step()
        expected = np.linalg.svd(two_r(a, b, 0.7, second) / arm.length, compute_uv=False)
        assert step.singular_values == pytest.approx(expected, abs=1e-12)
        assert step.lost_dof.sigma == pytest.approx(expected[1], abs=1e-12)


@given(seeds, st.sampled_from(ROBOTS))
def test_along_the_weakest_joint_direction_pulls_move_by_sigma(robot, seed, name):
    """J v = sigma t, loops closed to first order, both of unit length; nothing moves the tasks less."""
    mechanism = robot(name)
    q = mechanism.random_closed(1, seed)[-1]
    solver = Solver(mechanism, DT, q=q)
    solver.add_task(mechanism.end)
    step = solver.step()
    lost, unit = step.lost_dof, _unit(mechanism)
    jacobian = _world(mechanism, step.q, mechanism.end)
    assert jacobian @ lost.joints / unit == pytest.approx(lost.sigma * lost.twists[0] / unit, abs=1e-9)
    mechanism.structure.system.evaluate(step.q)
    cut = mechanism.structure.system.cut_rates() @ (lost.joints / mechanism.scale)
    assert np.linalg.norm([*(lost.joints / mechanism.scale), *cut]) == pytest.approx(1.0)
    assert np.linalg.norm(lost.twists[0] / unit) == pytest.approx(1.0)
    if mechanism.is_constrained:
        assert mechanism.loop_jacobian(step.q) @ lost.joints == pytest.approx(0.0, abs=1e-9)
    assert lost.sigma == pytest.approx(step.singular_values[-1], abs=1e-9)


@given(seeds)
def test_several_pulls_of_any_weight_share_one_direction(robot, seed):
    mechanism, rng = robot("hybrid"), np.random.default_rng(seed)
    nodes, weights = ("tool", "link2"), rng.uniform(0.2, 5.0, 2)
    solver = Solver(mechanism, DT, q=mechanism.random_closed(1, seed)[-1])
    for node, weight in zip(nodes, weights, strict=True):
        solver.add_task(node, weight=weight, axes=str(rng.choice(["target", "world", "tool"])))
    step = solver.step()
    lost, unit = step.lost_dof, _unit(mechanism)
    total = 0.0
    for node, weight, twist in zip(nodes, weights / weights.max(), lost.twists, strict=True):
        moved = _world(mechanism, step.q, node) @ lost.joints
        assert moved / unit == pytest.approx(lost.sigma * twist / unit, abs=1e-9)
        total += np.linalg.norm(weight * twist / unit) ** 2
    assert total == pytest.approx(1.0)


# --- type 2 ----------------------------------------------------------------------------------------------------------


def test_a_four_bar_driven_by_its_rocker_has_a_dead_point():
    bar = cinegen.load(ROCKER)
    a, b, c, d = 0.12, 0.36, 0.24, 0.4
    crank = math.acos(((a + b) ** 2 + d**2 - c**2) / (2 * (a + b) * d))  # stretched: the law of cosines
    rocker = math.pi - math.acos((c**2 + d**2 - (a + b) ** 2) / (2 * c * d))
    q = bar.close(bar.configuration({"joint1": crank, "joint2": 0.0, "joint3": rocker}))
    assert bar.closure(q) < 1e-12
    step = Solver(bar, DT, q=q).step()
    gained = step.uncontrolled_dof
    assert gained.sigma < 1e-6  # closing leaves the square root of rounding
    # crank and coupler buckle, the rocker stands: the pin stays where it is to first order
    expected = {"joint1": b, "joint2": -(a + b), "joint3": 0.0}
    size = math.hypot(*expected.values(), a)  # and the cut pin's
    for joint, value in expected.items():
        assert abs(gained.joints[bar.v_index(joint)]) == pytest.approx(abs(value) / size, abs=1e-6)
    assert gained.joints[bar.v_index("joint1")] * gained.joints[bar.v_index("joint2")] < 0.0
    assert bar.loop_jacobian(q) @ gained.joints == pytest.approx(0.0, abs=1e-6)
    for h in (1e-2, 1e-3):  # moved along it with the motor held, loops open by its square only
        assert bar.closure(pin.integrate(bar.model, q, h * gained.joints)) < 2.0 * h * h


@given(seeds, st.sampled_from(LOOPED))
def test_along_the_gained_motion_loops_open_by_sigma(robot, seed, name):
    mechanism = robot(name)
    q = mechanism.random_closed(1, seed)[-1]
    step = Solver(mechanism, DT, q=q).step()
    gained = step.uncontrolled_dof
    motors = [mechanism.v_index(joint) for joint in mechanism.actuated]
    assert not gained.joints[motors].any()
    assert gained.sigma == pytest.approx(step.passive_singular_values[-1])
    opened = Openings(mechanism).matrix(q)
    cut = opened.shape[1] - mechanism.model.nv
    assert len(step.passive_singular_values) == mechanism.loop_rank + cut  # the actuated joints determine all
    passive = np.delete(opened, motors, axis=1)
    values = np.linalg.svd(passive, compute_uv=False)
    assert step.passive_singular_values == pytest.approx(values[: mechanism.loop_rank + cut], abs=1e-9)
    of_joints, of_cut = np.split(opened, [mechanism.model.nv], axis=1)
    joints = gained.joints / mechanism.scale
    # the cut joints follow so that |K x| = sigma |x| is least
    follow = -np.linalg.solve(of_cut.T @ of_cut - gained.sigma**2 * np.eye(cut), of_cut.T @ of_joints @ joints)
    assert np.linalg.norm([*joints, *follow]) == pytest.approx(1.0)
    assert np.linalg.norm(of_joints @ joints + of_cut @ follow) == pytest.approx(gained.sigma, abs=1e-9)


def test_a_joint_that_no_motor_determines_is_no_singularity():
    """A coupler's end with a link hanging from it, without a motor: idle everywhere, so nothing is gained there."""
    hanging = "link 6 { parameters { d 100 } type 2 pred 2 actuated 0 }\n"
    idle, bar = cinegen.load(ROCKER.replace("frame 4 {", f"{hanging}frame 4 {{")), cinegen.load(ROCKER)
    assert len(idle.structure.passive_columns) == 3
    assert idle.structure.passive_rank == 2
    q = Solver(idle, DT).step()
    assert q.passive_singular_values == pytest.approx(Solver(bar, DT).step().passive_singular_values)
    assert q.uncontrolled_dof.joints[idle.v_index("joint6")] == pytest.approx(0.0, abs=1e-12)


def test_values_do_not_change_with_later_ticks(robot):
    delta = robot("delta4")
    solver = Solver(delta, DT)
    task = solver.add_task("platform")
    step = solver.step()

    def read():
        return np.r_[step.lost_dof.joints, step.uncontrolled_dof.joints, step.passive_singular_values]

    before = read()
    task.target.translation += [0.2, 0.1, -0.1]
    solver.step()
    assert np.array_equal(before, read())


# --- bifurcation ------------------------------------------------------------------------------------------------------
# A flat parallelogram: two branches of closed configurations meet, and most velocities that its Jacobian allows belong
# to neither.


@pytest.fixture
def flat():
    words = ("velocity 20 actuated 1", "velocity 20", "velocity 20")
    return cinegen.load(four_bar((0, 0, 0), (300, 500, 500, 300), words))


def drag(flat, dt, node, to, count=400):
    solver = cinegen.Solver(flat, dt, q=np.zeros(3))
    task = solver.add_task(node, rotation=0)
    task.target = pin.SE3(np.eye(3), np.array(to))
    return solver, [solver.step() for _ in range(count)]


@pytest.mark.parametrize("dt", [1e-2, 4e-3])
@pytest.mark.parametrize(("node", "to"), [("frame4", (0.64, -0.12, 0.0)), ("link2", (0.38, -0.17, 0.0))])
def test_it_is_left_along_a_branch_within_the_limits_of_velocity(flat, dt, node, to, monkeypatch):
    solver, steps = drag(flat, dt, node, to)
    q = np.zeros(3)
    for step in steps:
        assert step.status is not Status.REFUSED
        assert step.closure <= 1e-10
        assert flat.closure(step.q) <= 1e-10
        assert (step.q - q) / dt == pytest.approx(step.v, abs=1e-9)
        assert np.abs(step.v).max() <= np.radians(20.0) + 1e-9
        q = step.q
    assert q == pytest.approx(solver.q, abs=0.0)
    assert np.abs(q).max() > 0.05
    monkeypatch.setattr(cinegen.Solver, "_leave_bifurcation", lambda self: None)
    assert {step.status for step in drag(flat, dt, node, to, 20)[1]} == {Status.REFUSED}


# --- slowing down -----------------------------------------------------------------------------------------------------
# Where loops don't close even after braking, a robot with limits of acceleration slows down in some ticks; it stopped
# at once before, at any speed.


MOVING = [  # acceleration, period, configuration, velocities: passive joints are near their limits, at speed
    (3.204, 0.05, [3.48995211, -2.48454798, 1.24917948, 1.85432657, -2.09810192], [0.337, -0.112, 0.194, -0.078, 0.11]),
    (1.219, 0.1, [1.46108826, -0.18966074, 1.75656009, 0.08889345, -0.57402602], [0.049, -0.054, 0.145, -0.211, 0.061]),
    (3.234, 0.05, [2.78157794, -2.67829267, 0.08590642, 2.7826502, -2.76527136], [-0.979, -0.067, -1.87, 1.15, -0.324]),
]  # fmt: skip
AIMS = [(-0.115, 0.314, 0.0), (6.368, 0.673, 0.0), (0.172, 0.953, 0.0)]


@pytest.mark.parametrize(("moving", "aim"), [*zip(MOVING, AIMS, strict=True)])
def test_it_slows_down_where_loops_do_not_close_after_braking(robot, moving, aim):
    acceleration, dt, q, v = moving
    mechanism = robot("five_bar")
    solver = cinegen.Solver(mechanism, dt, q=mechanism.close(np.array(q)), acceleration=acceleration)
    solver.add_task(mechanism.end, pin.SE3(np.eye(3), np.array(aim)), rotation=0)
    solver._memory.last[:] = np.array(v) * dt / mechanism.scale
    before = np.abs(v).max()
    step = solver.step()
    assert step.status is not Status.REFUSED
    assert 0.0 < np.abs(step.v).max() < before
    assert step.v @ np.array(v) > 0.0  # not back
    for _ in range(30):
        assert mechanism.closure(step.q) <= 1e-10
        assert mechanism.limits.within(step.q)
        assert (np.abs(step.v) <= mechanism.limits.velocity * (1.0 + 1e-9)).all()
        step = solver.step()


# --- branch -----------------------------------------------------------------------------------------------------------
# Toggles of the actuated joints: reported by the step that passes one, and not passed if the branch is kept.


TICK = 1.0 / 240.0


def side(mechanism, q):
    """On which side of the line between its elbows the tool of the five-bar linkage is, by Pinocchio's kinematics: the
    sign changes at a type 2 singularity."""
    data, model = mechanism.model.createData(), mechanism.model
    pin.forwardKinematics(model, data, q)
    passive = [model.getJointId(joint) for joint in mechanism.joints if joint not in mechanism.actuated]
    legs = [j for j in passive if model.names[model.parents[j]] in mechanism.actuated]  # at the elbows
    left, right = (data.oMi[j].translation for j in legs)
    tool = mechanism.placement(q, mechanism.end).translation
    return float(np.sign(np.cross(left - tool, right - tool)[2]))


@pytest.fixture
def five_bar(robot):
    return robot("five_bar")


def dragged_through(mechanism, solver):
    """Drag the tool through the line between the elbows to where it is in the other assembly mode."""
    goal = max(cinegen.assembly_modes(mechanism), key=lambda q: mechanism.distance(q, mechanism.q_home))
    solver.position_limits = dict.fromkeys(mechanism.joints, (-np.inf, np.inf))
    task = next(iter(solver.tasks), None) or solver.add_task(mechanism.end, rotation=0)
    start, end = (mechanism.placement(q, mechanism.end).translation for q in (mechanism.q_home, goal))
    steps = []
    for part in np.linspace(0.0, 1.0, 300):
        task.target = pin.SE3(task.target.rotation, start + part * (end - start))
        steps.append(solver.step())
    return steps


def test_the_step_that_passes_a_toggle_says_so_and_no_other(five_bar):
    solver = Solver(five_bar, TICK)
    q, changed, turned = solver.q, 0, 0
    for step in dragged_through(five_bar, solver):
        passed = side(five_bar, q) != side(five_bar, step.q)
        assert step.branch_changed == passed
        changed, turned, q = changed + step.branch_changed, turned + passed, step.q
    assert changed == turned == 1


@pytest.mark.parametrize("kind", [Solver, PersistentSolver])
def test_a_branch_that_is_kept_is_not_left(five_bar, kind):
    solver = kind(five_bar, TICK, keep_branch=True)
    before = side(five_bar, solver.q)
    steps = dragged_through(five_bar, solver)
    assert all(side(five_bar, step.q) == before for step in steps)
    assert not any(step.branch_changed for step in steps)
    assert any(step.status is Status.BARRED for step in steps)
    assert max(step.closure for step in steps) < 1e-10
    task = solver.tasks[0]
    task.target = five_bar.placement(five_bar.q_home, five_bar.end)
    step = ticked(solver, 600)
    assert step.errors[0][0] < 1e-6  # it goes back
    solver.keep_branch = False
    assert any(step.branch_changed for step in dragged_through(five_bar, solver))


@pytest.mark.parametrize("name", ["gough", "sr400", "arm7", "delta4"])
def test_where_no_toggle_is_near_a_kept_branch_changes_nothing(robot, name):
    mechanism = robot(name)
    solver, other = Solver(mechanism, TICK, keep_branch=True), Solver(mechanism, TICK)
    for twin in (solver, other):
        pull(twin, mechanism.end, 0.03 * mechanism.length, rotation=0)
    for _ in range(20):
        step = solver.step()
        assert (step.q == other.step().q).all()
        assert not step.branch_changed


@pytest.mark.parametrize("name", ["gough", "delta4", "five_bar", "planar_hybrid"])
def test_the_sign_is_that_of_the_determinant_where_the_jacobian_is_square(robot, name):
    """Of independent rows, which Gaussian elimination chooses at the first configuration."""
    mechanism = robot(name)
    rng, q = np.random.default_rng(4), mechanism.q_home
    columns = mechanism.structure.passive_columns
    kept = None
    for _ in range(60):
        step = rng.normal(size=mechanism.model.nv)
        jacobian = mechanism.loop_jacobian(q)
        motion = step - np.linalg.pinv(jacobian, rcond=1e-9) @ (jacobian @ step)
        q_next = mechanism.close(mechanism.integrate(q, 0.05 * motion / np.abs(motion).max() * mechanism.scale))
        before, after = (mechanism.loop_jacobian(x)[:, columns] for x in (q, q_next))
        if kept is None:
            _, r, order = qr(before.T, pivoting=True)
            kept = order[: np.count_nonzero(np.abs(np.diag(r)) > 1e-9 * abs(r[0, 0]))]
            assert len(kept) == len(columns)
        signs = np.linalg.slogdet(before[kept])[0] * np.linalg.slogdet(after[kept])[0]
        assert passes_toggle(mechanism, q, q_next) == (signs < 0.0)
        q = q_next


# --- persistent -------------------------------------------------------------------------------------------------------
# A dead end whose way out is known: a planar arm whose first joint is limited, and the other of its two postures.


ARM = two_bars((20, 60), words=("limits { -30 30 }", ""))
THERE = np.radians([10.0, -60.0])
"""The tool is reached with the elbow on the other side only: by the law of cosines the posture with the elbow as it is
has the first joint at -41 degrees."""


def dead_end(solver_of, arm):
    solver = solver_of(arm, 0.02)
    task = solver.add_task("tool", rotation=0, axes="world")
    task.target = arm.placement(THERE, "tool")
    return solver, task


def test_a_solver_stays_at_the_limit_and_a_persistent_one_goes_round():
    arm = cinegen.load(ARM)
    solver, _ = dead_end(Solver, arm)
    step = ticked(solver, 400)
    assert step.status is Status.AT_LIMIT
    assert step.q[0] == pytest.approx(math.radians(-30))
    persistent, _ = dead_end(PersistentSolver, arm)
    seen = set()
    for _ in range(400):
        step = persistent.step()
        seen.add(step.status)
        assert abs(step.q[0]) <= math.radians(30) + 1e-9
    assert step.status is Status.FOLLOWING
    assert step.q == pytest.approx(THERE, abs=1e-6)
    assert Status.DETOUR in seen


def test_a_persistent_solver_searches_once_for_what_is_out_of_reach(monkeypatch):
    searched = []
    monkeypatch.setattr(persistent, "inverse_kinematics", lambda _, tasks, **__: searched.append(tasks))
    solver, task = dead_end(PersistentSolver, cinegen.load(ARM))
    assert ticked(solver, 400).status is Status.AT_LIMIT
    assert len(searched) == 1
    task.target = pin.SE3(np.eye(3), 1.1 * task.target.translation)
    ticked(solver, 400)
    assert len(searched) == 2


def test_levels_of_tasks_leave_a_dead_end_by_another_start():
    arm = cinegen.load(ARM)
    tasks = [FrameTask("tool", arm.placement(THERE, "tool"), rotation=0)]
    tasks.append(FrameTask("link1", arm.placement(THERE, "link1"), priority=1))
    result = inverse_kinematics(arm, tasks)
    assert result
    assert result.starts > 1
    assert result.q == pytest.approx(THERE, abs=1e-6)


def test_beside_a_task_that_follows_a_twist_nothing_is_looked_for():
    persistent, _ = dead_end(PersistentSolver, cinegen.load(ARM))
    persistent.add_task("link1", translation=0, rotation=1, weight=1e-6).twist = np.zeros(6)
    statuses = {persistent.step().status for _ in range(400)}
    assert Status.DETOUR not in statuses


def test_a_target_that_is_moved_ends_the_detour():
    """The tasks take over at once, and lead to a target that the arm reaches as it is."""
    arm = cinegen.load(ARM)
    persistent, task = dead_end(PersistentSolver, arm)
    near = arm.placement(arm.q_home, "tool")
    while persistent.step().status is not Status.DETOUR:
        assert persistent.q[1] > 0.0
    task.target = near
    for _ in range(400):
        step = persistent.step()
        assert step.status is not Status.DETOUR
    assert step.q == pytest.approx(arm.q_home, abs=1e-6)
