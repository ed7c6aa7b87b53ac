"""Limits that a program sets while a solver runs: obeyed from the next tick on, and restored."""

import bipeds
import numpy as np
import pinocchio as pin
import pytest

import cinegen
from cinegen import Solver
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.ik import State
from cinegen.model.plausible import ImplausibleError

DT = 1.0 / 240.0
ROUNDING = 1.0 + 1e-7

ONE_JOINT = """robot r { base { }
  link 1 { parameters { theta 0 } type 2 pred 0 limits { -60 60 } }
  frame 2 { parameters { d 1000 } pred 1 name "tool" } }"""


@pytest.fixture
def biped(tmp_path):
    (tmp_path / "biped.urdf").write_text(bipeds.URDF)
    return cinegen.load(tmp_path / "biped.urdf")


def dragged(mechanism, by, **options):
    """A solver whose end is to move, without rotations."""
    solver = Solver(mechanism, DT, **options)
    task = solver.add_task(mechanism.end, rotation=0)
    task.target = pin.SE3(task.target.rotation, task.target.translation + by * mechanism.length)
    return solver


def fastest(solver, ticks=30):
    """Greatest speeds (nv,) in some ticks."""
    return np.max([np.abs(solver.step().v) for _ in range(ticks)], axis=0)


def test_a_velocity_limit_holds_from_the_next_tick_on_and_the_others_follow_in_proportion(robot):
    mechanism = robot("arm7")
    solver, other = dragged(mechanism, 0.3), dragged(mechanism, 0.3)
    j = int(np.argmax(np.abs(other.step().v)))
    name = mechanism.columns[j]
    solver.velocity_limits[name] = 0.05
    assert solver.velocity_limits[name] == 0.05
    step = solver.step()
    assert step.limiting_joint == name
    assert 0.05 / ROUNDING < abs(step.v[j]) <= 0.05
    assert np.abs(step.v / step.v[j] - other.v / other.v[j]).max() < 1e-9
    assert fastest(solver)[j] <= 0.05
    solver.velocity_limits = None
    assert solver.velocity_limits[name] == mechanism.limits[name].velocity
    assert fastest(solver)[j] > 0.06


def test_limits_that_are_restored_leave_no_trace(robot):
    mechanism = robot("gough")
    solver, other = dragged(mechanism, 0.05), dragged(mechanism, 0.05)
    name = mechanism.actuated[0]
    solver.velocity_limits = 1e-3
    solver.acceleration_limits = {name: 0.1}
    solver.position_limits[name] = (-1e-9, 1e-9) if not mechanism.is_prismatic(name) else (0.0, 9.0)
    del solver.position_limits[name]
    solver.acceleration_limits[name] = None
    solver.velocity_limits = None
    for _ in range(20):
        assert (solver.step().q == other.step().q).all()


def test_a_mapping_replaces_all_limits_and_an_entry_one(robot):
    mechanism = robot("arm7")
    solver = Solver(mechanism, DT)
    solver.velocity_limits = {"joint1": 0.5, "joint2": 0.25}
    solver.velocity_limits["joint3"] = 0.125
    model = mechanism.limits["joint4"].velocity
    assert [solver.velocity_limits[name] for name in ("joint1", "joint2", "joint3", "joint4")] == [
        0.5, 0.25, 0.125, model,
    ]  # fmt: skip
    solver.velocity_limits = {"joint2": 0.4}
    assert dict(solver.velocity_limits) == {
        name: 0.4 if name == "joint2" else mechanism.limits[name].velocity for name in mechanism.joints
    }
    solver.velocity_limits = 0.3
    assert set(solver.velocity_limits.values()) == {0.3}


def test_accelerations_are_limited_from_the_next_tick_on(robot):
    mechanism = robot("arm7")
    solver = dragged(mechanism, 0.3)
    solver.acceleration_limits = dict.fromkeys(mechanism.joints, 2.0)
    v = np.zeros(7)
    for _ in range(40):
        step = solver.step()
        assert np.abs(step.v - v).max() <= 2.0 * DT * ROUNDING
        v = step.v
    assert solver.acceleration_limits["joint1"] == 2.0
    other = dragged(mechanism, 0.3, acceleration=2.0)
    for _ in range(40):
        expected = other.step()
    assert (step.q == expected.q).all()
    solver.acceleration_limits = None
    assert np.abs(solver.step().v - v).max() > 2.0 * DT


def test_a_robot_that_is_put_elsewhere_begins_at_rest(robot):
    mechanism = robot("arm7")
    solver = dragged(mechanism, 0.3)
    solver.acceleration_limits = 2.0
    fastest(solver, 60)
    solver.q = solver.q
    assert 0.0 < np.abs(solver.step().v).max() <= 2.0 * DT * ROUNDING


def test_a_joint_beyond_a_new_position_limit_moves_back_only(raff):
    """The plane's angle of the target is the joint's."""
    mechanism = raff(ONE_JOINT)
    solver = Solver(mechanism, DT)
    name = mechanism.joints[0]
    solver.position_limits[name] = (0.2, 0.5)
    assert solver.position_limits[name] == (0.2, 0.5)
    task = solver.add_task("tool", rotation=0)
    task.target = turned(-0.3)
    for _ in range(5):
        assert solver.step().q[0] == 0.0
    assert solver.step().saturated == (name,)
    task.target = turned(0.4)
    q = [solver.step().q[0] for _ in range(100)]
    assert (np.diff(q) >= 0.0).all()
    assert abs(q[-1] - 0.4) < 1e-6
    task.target = turned(0.0)
    assert np.array([solver.step().q[0] for _ in range(100)]).min() == 0.2
    solver.position_limits = None
    for _ in range(100):
        solver.step()
    assert abs(solver.q[0]) < 1e-6


def turned(angle):
    rotation = pin.exp3(np.array([0.0, 0.0, angle]))
    return pin.SE3(rotation, rotation @ [1.0, 0.0, 0.0])


def test_a_wider_limit_than_the_model_s_is_used(raff):
    mechanism = raff(ONE_JOINT)
    solver = Solver(mechanism, DT)
    solver.position_limits[mechanism.joints[0]] = (-2.0, 2.0)
    solver.add_task("tool", rotation=0).target = turned(1.5)
    for _ in range(200):
        step = solver.step()
    assert abs(step.q[0] - 1.5) < 1e-6


def test_a_floating_base_has_limits_of_velocity_and_acceleration(biped):
    solver = Solver(biped, DT)
    feet = [solver.add_task(node) for node in bipeds.FEET]
    for task in feet:
        task.target = pin.SE3(task.target.rotation, task.target.translation + np.array([0.3, 0.1, 0.2]))
    solver.velocity_limits["base"] = (0.02, 0.01, 0.03, 0.1, 0.2, 0.3)
    assert solver.velocity_limits[biped.base] == (0.02, 0.01, 0.03, 0.1, 0.2, 0.3)
    found = fastest(solver)[:6]
    assert (found <= np.array([0.02, 0.01, 0.03, 0.1, 0.2, 0.3])).all()
    assert found.max() > 0.005
    solver.velocity_limits["base"] = 0.004
    assert solver.velocity_limits["base"] == (0.004,) * 6
    assert fastest(solver)[:6].max() <= 0.004
    solver.velocity_limits = None
    solver.acceleration_limits["base"] = 0.5
    v = solver.v
    for _ in range(30):
        step = solver.step()
        assert np.abs(step.v - v)[:6].max() <= 0.5 * DT * ROUNDING
        v = step.v


def test_objectives_see_the_present_limits_and_locks(robot):
    mechanism, seen = robot("arm7"), list[State]()

    class Watch:
        def velocity(self, state):
            seen.append(state)
            return np.zeros(7)

    solver = Solver(mechanism, DT)
    solver.objectives = [Watch()]
    solver.step()
    assert seen[-1].mechanism is mechanism
    solver.position_limits["joint2"] = (-0.25, 0.5)
    solver.lock("joint1")
    solver.step()
    assert seen[-1].mechanism.limits["joint2"][:2] == (-0.25, 0.5)
    assert seen[-1].mechanism.held == ("joint1",)
    solver.unlock()
    solver.position_limits = None
    solver.step()
    assert seen[-1].mechanism is mechanism


def test_a_change_of_dt_keeps_limits_per_second(robot):
    mechanism = robot("arm7")
    solver = dragged(mechanism, 0.3)
    solver.velocity_limits = 0.05
    solver.step()
    solver.dt = 0.01
    assert 0.05 / ROUNDING < fastest(solver, 3).max() <= 0.05


@pytest.mark.parametrize(
    ("prop", "joint", "value", "error", "message"),
    [
        ("velocity_limits", "joint1", 0.0, CinegenError, r"must be positive, not 0.0: lock\('joint1'\)"),
        ("velocity_limits", "joint1", np.nan, CinegenError, "must be positive"),
        (
            "velocity_limits",
            "joint1",
            "fast",
            CinegenError,
            r"velocity_limits\['joint1'\] takes one number, not 'fast'",
        ),
        ("velocity_limits", "joint1", (1.0, 2.0), CinegenError, "takes one number"),
        ("velocity_limits", "joint11", 1.0, UnknownNameError, "did you mean 'joint1'"),
        ("velocity_limits", "base", 1.0, CinegenError, "does not float"),
        ("acceleration_limits", "joint1", -1.0, CinegenError, "must be positive"),
        ("position_limits", "joint1", (1.0, 0.5), CinegenError, r"takes \(lower, upper\) in rad or m"),
        ("position_limits", "joint1", 1.0, CinegenError, r"takes \(lower, upper\)"),
        ("position_limits", "joint1", (-90.0, 90.0), ImplausibleError, "did you mean"),
        ("joint_weights", "joint1", np.inf, CinegenError, "must be positive and finite"),
    ],
)
def test_what_is_no_limit_is_an_error_that_changes_nothing(robot, prop, joint, value, error, message):
    solver = Solver(robot("arm7"), DT)
    before = dict(getattr(solver, prop))
    with pytest.raises(error, match=message):
        getattr(solver, prop)[joint] = value
    with pytest.raises(error, match=message):
        setattr(solver, prop, {"joint2": (0.0, 1.0) if prop == "position_limits" else 1.0, joint: value})
    assert dict(getattr(solver, prop)) == before


def test_a_speed_in_degrees_is_noticed(robot):
    mechanism = robot("rx90")
    name = next(name for name in mechanism.joints if np.isfinite(mechanism.limits[name].velocity))
    most, solver = mechanism.limits[name].velocity, Solver(mechanism, DT)
    solver.velocity_limits[name] = 2.0 * most
    with pytest.raises(ImplausibleError, match=r"did you mean .* degrees/s"):
        solver.velocity_limits[name] = np.degrees(0.9 * most)


def test_a_base_has_no_limits_of_position(biped):
    with pytest.raises(CinegenError, match="is not one number, and has no limits of position: lock it"):
        Solver(biped, DT).position_limits["base"] = (0.0, 1.0)
