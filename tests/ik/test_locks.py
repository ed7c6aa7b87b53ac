"""Locked joints: the motion is that of the model in which they are fixed."""

from dataclasses import replace

import bipeds
import numpy as np
import pinocchio as pin
import pytest
from lxml import etree
from ticking import of_pinocchio, pull, ticked

import cinegen
from cinegen import CinegenError, PersistentSolver, Solver, Status, forecast_motion, inverse_kinematics
from cinegen.errors import ClosureError, UnknownNameError
from cinegen.ik import Posture
from cinegen.model.build import build

DT = 1.0 / 240.0

LOCKED = [
    ("arm7", ["joint1", "joint7"]),
    ("five_bar", ["joint1"]),
    ("gough", ["joint3", "joint9"]),
    ("hybrid", ["joint1"]),
    ("scara", ["joint1"]),
]


def fixed(mechanism, joints, q):
    """The mechanism with these joints made fixed joints of its URDF, where q (nq,) has them; measured by the same
    characteristic length."""
    urdf = etree.fromstring(mechanism.source.urdf.encode())
    for joint in urdf.iter("joint"):
        if joint.get("name") not in joints:
            continue
        value, axis = q[mechanism.q_index(joint.get("name"))], np.array(joint.find("axis").get("xyz").split(), float)
        by = axis / np.linalg.norm(axis) * value
        slides = mechanism.is_prismatic(joint.get("name"))
        moved = pin.SE3(np.eye(3), by) if slides else pin.SE3(pin.exp3(by), np.zeros(3))
        origin = joint.find("origin")
        xyz, rpy = ([float(x) for x in origin.get(name, "0 0 0").split()] for name in ("xyz", "rpy"))
        placed = pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz)) * moved
        origin.set("xyz", " ".join(map(repr, placed.translation.tolist())))
        origin.set("rpy", " ".join(map(repr, pin.rpy.matrixToRpy(placed.rotation).tolist())))
        joint.set("type", "fixed")
    constraints = dict(mechanism.source.constraints or {})
    entries = constraints.get("joints", [{"name": name} for name in mechanism.joints])
    constraints["joints"] = [
        {**entry, "home": float(q[mechanism.q_index(entry["name"])]), "actuated": entry["name"] in mechanism.actuated}
        for entry in entries
        if entry["name"] not in joints
    ]
    source = mechanism.source._replace(urdf=etree.tostring(urdf).decode(), constraints=constraints)
    return replace(build(*source), length=mechanism.length)


def bent(mechanism):
    """A closed configuration (nq,) away from home."""
    rng = np.random.default_rng(3)
    solver = Solver(mechanism, DT)
    pull(solver, mechanism.end, 0.1 * mechanism.length * rng.normal(size=3), rotation=0)
    ticked(solver, 20)
    return solver.q


def values(mechanism, q, joints):
    return np.array([q[mechanism.q_index(name)] for name in joints])


def move(task, by):
    task.target = pin.SE3(task.target.rotation, task.target.translation + np.asarray(by))


def carried(mechanism, q, reference):
    """The same configuration of another model of it."""
    return reference.configuration(dict(zip(reference.joints, values(mechanism, q, reference.joints), strict=True)))


def set_out(robot, name, joints, rotation):
    """A solver with locked joints and one of the model in which they are fixed, on the way to the same target."""
    mechanism = robot(name)
    q = bent(mechanism)
    reference = fixed(mechanism, joints, q)
    solver, other = Solver(mechanism, DT, q), Solver(reference, DT, carried(mechanism, q, reference))
    solver.lock(*joints)
    away = 0.1 * mechanism.length * np.random.default_rng(5).normal(size=3)
    for twin in (solver, other):
        pull(twin, mechanism.end, away, rotation=rotation)
    return solver, other, mechanism, reference


@pytest.mark.parametrize("rotation", [0, 3])
@pytest.mark.parametrize(("name", "joints"), LOCKED)
def test_each_tick_with_locks_is_that_of_the_model_in_which_the_joints_are_fixed(robot, name, joints, rotation):
    solver, other, mechanism, reference = set_out(robot, name, joints, rotation)
    assert solver.locked == tuple(joints)
    start = values(mechanism, solver.q, joints)
    for tick in range(40):
        step, expected = solver.step(), other.step()
        assert step.status is expected.status
        if np.abs(expected.v / reference.scale).max() * DT < 1e-5:  # near an optimum rounding decides
            assert tick >= 5
            break
        assert np.abs(carried(mechanism, step.q, reference) - expected.q).max(initial=0.0) <= 1e-12
        assert len(step.singular_values) == len(expected.singular_values)
        assert np.abs(step.singular_values - expected.singular_values).max(initial=0.0) <= 1e-12
        if tick == 0 and mechanism.is_constrained:
            assert step.loop_singular_values == pytest.approx(expected.loop_singular_values, abs=1e-12)
            assert step.passive_singular_values == pytest.approx(expected.passive_singular_values, abs=1e-12)
            assert step.uncontrolled_dof.sigma == pytest.approx(expected.uncontrolled_dof.sigma, abs=1e-12)
        assert (values(mechanism, step.q, joints) == start).all()
        solver.q, other.q = step.q, carried(mechanism, step.q, reference)  # at rest near the target rounding grows


@pytest.mark.parametrize(("name", "joints"), [("arm7", ["joint4"]), ("gough", ["joint9", "joint12"])])
def test_a_motion_with_locks_and_an_objective_is_that_of_the_model_in_which_the_joints_are_fixed(robot, name, joints):
    solver, other, mechanism, reference = set_out(robot, name, joints, 0)
    solver.objectives = [Posture(rate=1.0)]
    other.objectives = [Posture(carried(mechanism, mechanism.q_home, reference), rate=1.0)]
    for _ in range(60):
        step, expected = solver.step(), other.step()
        assert step.status is expected.status
        assert np.abs(carried(mechanism, step.q, reference) - expected.q).max() <= 1e-12


@pytest.mark.parametrize("word", ["base", "its name"])
def test_a_locked_base_equals_the_model_with_a_fixed_base(word):
    mechanism, reference = cinegen.load(bipeds.URDF), cinegen.load(bipeds.URDF, fixed_base=True)
    reference = replace(reference, length=mechanism.length)
    q = mechanism.q_home
    solver, other = Solver(mechanism, DT), Solver(reference, DT, q[7:])
    solver.lock("base" if word == "base" else mechanism.base)
    assert solver.locked == (mechanism.base,)
    for twin in (solver, other):
        pull(twin, bipeds.FEET[0], [0.05, 0.0, 0.1], rotation=0)
    for _ in range(60):
        step, expected = solver.step(), other.step()
        assert step.status is expected.status
        assert np.abs(step.q[7:] - expected.q).max() <= 1e-12
        assert (step.q[:7] == q[:7]).all()


def test_a_mechanism_whose_lock_leaves_no_motion_stays(robot):
    mechanism = robot("four_bar")
    solver = Solver(mechanism, DT)
    solver.lock(mechanism.actuated[0])
    pull(solver, mechanism.end, [0.01, 0.01, 0.0], rotation=0)
    step = ticked(solver, 5)
    assert (step.q == mechanism.q_home).all()
    assert step.status is Status.OUT_OF_REACH
    assert len(step.singular_values) == 0


@pytest.mark.parametrize("name", ["arm7", "gough"])
def test_a_solver_that_was_unlocked_moves_as_if_it_had_never_been_locked(robot, name):
    mechanism = robot(name)
    solver, other = Solver(mechanism, DT), Solver(mechanism, DT)
    solver.lock(*mechanism.actuated[:2])
    solver.step()
    solver.unlock()
    assert solver.locked == ()
    for twin in (solver, other):
        pull(twin, mechanism.end, 0.05 * mechanism.length)
    for _ in range(20):
        assert (solver.step().q == other.step().q).all()


def test_a_joint_stops_at_once_when_it_is_locked_while_it_moves(robot):
    mechanism = robot("arm7")
    solver = Solver(mechanism, DT, acceleration=2.0)
    pull(solver, mechanism.end, -0.5, rotation=0)
    ticked(solver, 30)
    name = mechanism.joints[int(np.argmax(np.abs(solver.v)))]
    solver.lock(name)
    before = solver.q[mechanism.q_index(name)]
    v = solver.v
    for _ in range(30):
        step = solver.step()
        assert step.q[mechanism.q_index(name)] == before
        others = np.arange(7) != mechanism.v_index(name)
        assert np.abs(step.v - v)[others].max() <= 2.0 * DT * (1.0 + 1e-7)
        v = step.v


def test_setting_q_moves_locked_joints_and_locks_them_there(robot):
    mechanism = robot("gough")
    q = bent(mechanism)
    solver = Solver(mechanism, DT)
    solver.lock("joint3")
    solver.q = q
    task = pull(solver, mechanism.end, 0.05 * mechanism.length)
    for _ in range(20):
        assert solver.step().q[mechanism.q_index("joint3")] == q[mechanism.q_index("joint3")]
    other = Solver(mechanism, DT, q)
    other.lock("joint3")
    other.add_task(mechanism.end).target = task.target
    ticked(other, 20)
    assert (other.q == solver.q).all()


def test_a_copy_and_a_forecast_know_the_locks(robot):
    mechanism = robot("arm7")
    solver, twin = Solver(mechanism, DT), Solver(mechanism, DT)
    solver.lock("joint2")
    solver.velocity_limits["joint3"] = 0.1
    pull(solver, mechanism.end, -0.2, rotation=0)
    solver.step()
    twin.copy_state(solver)
    assert twin.locked == ("joint2",)
    assert twin.velocity_limits["joint3"] == 0.1
    assert (twin.step().q == solver.step().q).all()
    solver.unlock()
    twin.copy_state(solver)
    assert (twin.step().q == solver.step().q).all()
    solver.lock("joint2")
    ahead = forecast_motion(solver, 0.2)
    assert np.ptp(ahead.q[:, mechanism.q_index("joint2")]) == 0.0


def test_what_cannot_be_locked_is_an_error_that_changes_nothing(robot):
    mechanism = robot("arm7")
    solver = Solver(mechanism, DT)
    solver.lock("joint1")
    with pytest.raises(UnknownNameError, match="no joint 'joint11': did you mean 'joint1'"):
        solver.lock("joint2", "joint11")
    with pytest.raises(CinegenError, match=r"the base of .* does not float"):
        solver.lock("base")
    with pytest.raises(UnknownNameError):
        solver.unlock("elbow")
    assert solver.locked == ("joint1",)
    solver.lock("joint1")
    solver.unlock("joint2")
    assert solver.locked == ("joint1",)


# --- locked ik --------------------------------------------------------------------------------------------------------
# Locked joints in inverse kinematics and plans: they stay, and the others reach the target.


@pytest.mark.parametrize(
    ("name", "joints"), [("arm7", ["joint3"]), ("arm7", ["joint1", "joint5"]), ("gough", ["joint3"])]
)
def test_named_joints_stay_where_they_are(robot, name, joints):
    mechanism = robot(name)
    q, goal = mechanism.q_home, None
    for q_goal in mechanism.with_held(joints, q).random_closed(3):
        goal = of_pinocchio(mechanism, q_goal, mechanism.end)
        result = inverse_kinematics(mechanism, {mechanism.end: goal}, q, locked=joints, limits=False)
        assert result
        assert result.closure <= 1e-10
        for joint in joints:
            assert result.q[mechanism.q_index(joint)] == q[mechanism.q_index(joint)]
        error = pin.log6(goal.actInv(of_pinocchio(mechanism, result.q, mechanism.end))).vector
        assert np.abs(error).max() < 1e-6
    other = pin.SE3(goal.rotation, goal.translation + 0.3 * mechanism.length)
    missed = inverse_kinematics(mechanism, {mechanism.end: other}, q, locked=mechanism.joints, starts=2)
    assert not missed
    assert (missed.q == q).all()


def test_a_value_is_kept_and_loops_close_there(robot):
    mechanism = robot("gough")
    value = mechanism.q_home[mechanism.q_index("joint3")] + 0.02
    goal = mechanism.placement(mechanism.close(mechanism.configuration({"joint3": value}), ["joint3"]), mechanism.end)
    result = inverse_kinematics(mechanism, {mechanism.end: goal}, locked={"joint3": value})
    assert result
    assert result.q[mechanism.q_index("joint3")] == value
    assert result.closure <= 1e-10


def test_a_locked_base_stays_and_the_hand_reaches():
    mechanism = cinegen.load(bipeds.URDF)
    far = pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.8]))
    task = cinegen.FrameTask("hand", far, rotation=0)
    assert inverse_kinematics(mechanism, [task])
    assert not inverse_kinematics(mechanism, [task], locked=["base"], starts=5)
    near = of_pinocchio(mechanism, mechanism.configuration({"elbow": 0.7}), "hand")
    result = inverse_kinematics(mechanism, [cinegen.FrameTask("hand", near, rotation=0)], locked=["base"])
    assert result
    assert (result.q[:7] == mechanism.q_home[:7]).all()


def test_what_cannot_be_locked_is_an_error(robot):
    mechanism = robot("gough")
    goal = {mechanism.end: mechanism.placement(mechanism.q_home, mechanism.end)}
    with pytest.raises(UnknownNameError, match="did you mean 'joint3'"):
        inverse_kinematics(mechanism, goal, locked=["joint33"])
    with pytest.raises(CinegenError, match=r"such as \['joint3'\], not by one text"):
        inverse_kinematics(mechanism, goal, locked="joint3")
    with pytest.raises(ClosureError, match="can't be closed"):
        inverse_kinematics(mechanism, goal, locked={"joint3": 3.0, "joint9": 0.1})


def test_a_persistent_solver_does_not_search_for_what_its_locks_forbid(robot):
    mechanism = robot("arm7")
    solver = PersistentSolver(mechanism, 1 / 240)
    solver.lock("joint1")
    task = solver.add_task(mechanism.end, rotation=0)
    turned = pin.SE3(pin.exp3(np.array([0.0, 0.0, 2.0])), np.zeros(3)) * task.target
    task.target = pin.SE3(task.target.rotation, turned.translation)
    for _ in range(400):
        step = solver.step()
        assert step.q[mechanism.q_index("joint1")] == mechanism.q_home[mechanism.q_index("joint1")]
    assert step.status is not cinegen.Status.DETOUR
