"""Limits of position, velocity and acceleration: never crossed, rested at without trembling, left again at once."""

import bipeds
import numpy as np
import pinocchio as pin
import pytest
from test_barriers import Objective
from ticking import away, pull, ticked

import cinegen
from cinegen import Solver, Status
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.ik import State
from cinegen.model.plausible import ImplausibleError
from cinegen.tolerances import NEAR_SINGULAR

DT = 1 / 240
FREE = ["arm7"]
CLOSED = ["five_bar", "delta4", "sr400"]
ROUNDING = 1.0 + 1e-7

ONE_JOINT = """robot r { base { }
  link 1 { parameters { theta 0 } type 2 pred 0 limits { -60 60 } }
  frame 2 { parameters { d 1000 } pred 1 name "tool" } }"""


def turned(angle: float) -> pin.SE3:
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3))


def allowed(mechanism, acceleration: float) -> dict[str, float]:
    """The same for all joints, in rad/s^2 and lengths/s^2."""
    return {joint: acceleration * mechanism.scale[mechanism.v_index(joint)] for joint in mechanism.joints}


def worst_acceleration(solver, mechanism, acceleration, ticks, act=lambda tick: None) -> float:
    """Of all these ticks, from rest, as a part of what is allowed."""
    v, worst = np.zeros(mechanism.model.nv), 0.0
    for tick in range(ticks):
        act(tick)
        step = solver.step()
        worst = max(worst, float(np.abs((step.v - v) / mechanism.scale).max()) / solver.dt / acceleration)
        v = step.v
    return worst


# --- acceleration ------------------------------------------------------------------------------------------------


def test_a_joint_brakes_before_its_limit_and_ends_on_it(raff):
    """To the last tick: the room that braking takes, s + (s - a) + ..., ends with a part of a."""
    arm = raff(ONE_JOINT)
    for acceleration in (0.5, 2.0, 7.3, 40.0):
        solver = Solver(arm, 0.01, acceleration=acceleration)
        solver.add_task("tool", turned(3.0), translation=0)
        assert worst_acceleration(solver, arm, acceleration, 600) <= ROUNDING
        assert solver.q[0] == arm.model.upperPositionLimit[0]


@pytest.mark.parametrize("name", FREE + CLOSED)
@pytest.mark.parametrize("every", [1, 60])
@pytest.mark.parametrize(("acceleration", "rounding"), [(3.0, ROUNDING), (None, 1.0 + 1e-12)])
def test_all_limits_are_kept_however_the_target_leaps(robot, name, every, acceleration, rounding):
    """Also where loops drive a joint against its limit: all joints that they tie together brake in time. They are made
    use of, from the start; of acceleration a closed robot has a reserve for what closes its loops again."""
    mechanism = robot(name)
    node, limits = mechanism.nodes[-1], mechanism.limits
    fastest, rates = 0.0, []
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        v = np.zeros(mechanism.model.nv)
        solver = Solver(mechanism, DT, acceleration=acceleration and allowed(mechanism, acceleration))
        task = solver.add_task(node, rotation=0)
        for tick in range(400):
            if tick % every == 0:
                task.target = away(mechanism, node, rng, float(rng.choice([0.1, 1.0, 10.0])))
            step = solver.step()
            rates.append(float(np.abs((step.v - v) / mechanism.scale).max()) / DT)
            assert (step.q >= limits.lower).all()
            assert (step.q <= limits.upper).all()
            assert (np.abs(step.v) <= limits.velocity * rounding).all()
            assert step.closure <= 1e-10
            v, fastest = step.v, max(fastest, float((np.abs(step.v) / limits.velocity).max()))
    if acceleration:
        assert max(rates) <= acceleration * ROUNDING
        assert max(rates[:20]) > acceleration * (0.975 if mechanism.is_constrained else 0.999)
    else:
        assert fastest > 0.97


def test_braking_that_closing_loops_adds_to_is_scaled_to_the_limit(robot):
    """Where nothing but braking is left, what closes the loops would exceed the limit."""
    mechanism, rng = robot("planar_hybrid"), np.random.default_rng(31)
    node, solver = mechanism.nodes[-1], Solver(mechanism, 0.05, acceleration=allowed(mechanism, 1.0))
    task = solver.add_task(node, rotation=0)

    def leap(tick):
        if tick % 10 == 0:
            task.target = away(mechanism, node, rng, 0.5)

    assert worst_acceleration(solver, mechanism, 1.0, 30, leap) <= ROUNDING


def test_let_go_on_its_way_a_robot_brakes(robot):
    for name in ("rx90", "delta4"):
        mechanism, rng = robot(name), np.random.default_rng(6)
        node = mechanism.nodes[-1]
        solver = Solver(mechanism, DT, acceleration=allowed(mechanism, 3.0))
        task = solver.add_task(node, away(mechanism, node, rng, 0.5), rotation=0)
        before = ticked(solver, 30)
        solver.remove_task(task)
        ticks = 0
        while np.abs(before.v).max() > 0.0:
            step = solver.step()
            assert step.status is Status.IDLE
            assert np.abs((step.v - before.v) / mechanism.scale).max() / DT <= 3.0 * 1.01
            assert step.closure <= 1e-10
            before, ticks = step, ticks + 1
        assert 10 < ticks < 60


def test_the_joint_whose_acceleration_is_the_limit_is_named(raff):
    arm = raff(ONE_JOINT)
    solver = Solver(arm, 0.01, acceleration={"joint1": 2.0})
    solver.add_task("tool", turned(0.9), translation=0)
    step = solver.step()
    assert step.limiting_joint == "joint1"
    assert step.v[0] == pytest.approx(0.02)
    assert step.saturated == ()
    assert step.status is Status.FOLLOWING


# --- velocity ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CLOSED)
def test_closing_the_loops_costs_no_speed(robot, name):
    """It adds second-order motion to a step, which is shortened by that and no more."""
    mechanism, rng = robot(name), np.random.default_rng(5)
    node, limit, at_speed = mechanism.nodes[-1], mechanism.model.upperVelocityLimit, 0
    for _ in range(5):
        solver = Solver(mechanism, DT)
        solver.add_task(node, away(mechanism, node, rng, 0.3), rotation=0)
        for _ in range(20):
            step = solver.step()
            if step.status is Status.FOLLOWING and step.speed_scale < 1.0 and not step.saturated:
                assert (np.abs(step.v) / limit).max() > 0.995
                at_speed += 1
    assert at_speed > 20


# --- position ----------------------------------------------------------------------------------------------------

WALLS = [("serial_5dof", [0.0, 0.0, -9.0]), ("five_bar", [0.0, 9.0, 0.0]), ("delta4", [1.0, 0.0, -9.0])]


@pytest.mark.parametrize(("name", "direction"), WALLS)
def test_pressed_against_a_wall_a_robot_rests_on_its_limits_and_leaves_them_at_once(robot, name, direction):
    mechanism = robot(name)
    model, node = mechanism.model, mechanism.nodes[-1]
    solver = Solver(mechanism, 1 / 60)
    home = mechanism.placement(mechanism.q_home, node)
    task = solver.add_task(node, rotation=0)
    task.target = pin.SE3(home.rotation, home.translation + mechanism.length * np.array(direction))
    way = 0.0
    for tick in range(4000):
        step = solver.step()
        assert (step.q >= model.lowerPositionLimit).all()
        assert (step.q <= model.upperPositionLimit).all()
        way += float(np.abs(step.v / mechanism.scale).sum()) * solver.dt * (tick >= 3000)
    assert way < 1e-3
    for joint in step.saturated:
        i = mechanism.q_index(joint)
        low, high = model.lowerPositionLimit[i], model.upperPositionLimit[i]
        assert min(step.q[i] - low, high - step.q[i]) == pytest.approx(0.0, abs=1e-12)
    start, task.target = mechanism.placement(step.q, node), home
    step = solver.step()
    after = mechanism.placement(step.q, node)
    nearer = np.linalg.norm(start.translation - home.translation) - np.linalg.norm(after.translation - home.translation)
    if name == "five_bar":  # its wall is near a singularity, in the direction back: this motion is damped
        assert step.singular_values[-1] < 0.5 * NEAR_SINGULAR
        assert nearer > 4e-4 * mechanism.length
    else:
        assert nearer > 1e-3 * mechanism.length
    step = ticked(solver, 1500)
    assert step.status is Status.FOLLOWING
    assert step.errors[0][0] < 1e-6 * mechanism.length


def test_without_limits_of_acceleration_a_joint_of_a_loop_is_at_its_limit_in_one_tick(robot):
    bar = robot("four_bar")
    crank = bar.q_index(bar.actuated[0])
    beyond, limit = bar.q_home.copy(), bar.q_home[crank] + 1e-3
    beyond[crank] += 0.1
    solver = Solver(bar, DT)
    solver.position_limits[bar.actuated[0]] = (-9.0, limit)
    solver.add_task(bar.end, bar.placement(bar.close(beyond, locked=bar.actuated), bar.end), rotation=0)
    assert solver.step().q[crank] == limit


# --- limits at run time -----------------------------------------------------------------------------------------------
# Limits that a program sets while a solver runs: obeyed from the next tick on, and restored.


@pytest.fixture
def biped():
    return cinegen.load(bipeds.URDF)


def dragged(mechanism, by, **options):
    """A solver whose end is to move, without rotations."""
    solver = Solver(mechanism, DT, **options)
    pull(solver, mechanism.end, by * mechanism.length, rotation=0)
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
    of_model = {name: mechanism.limits[name].velocity for name in mechanism.joints}
    solver.velocity_limits = {"joint1": 0.5, "joint2": 0.25}
    solver.velocity_limits["joint3"] = 0.125
    assert dict(solver.velocity_limits) == of_model | {"joint1": 0.5, "joint2": 0.25, "joint3": 0.125}
    solver.velocity_limits = {"joint2": 0.4}
    assert dict(solver.velocity_limits) == of_model | {"joint2": 0.4}
    solver.velocity_limits = 0.3
    assert set(solver.velocity_limits.values()) == {0.3}


def test_accelerations_are_limited_from_the_next_tick_on(robot):
    mechanism = robot("arm7")
    solver = dragged(mechanism, 0.3)
    solver.acceleration_limits = dict.fromkeys(mechanism.joints, 2.0)
    assert solver.acceleration_limits["joint1"] == 2.0
    step = ticked(solver, 40)
    assert (step.q == ticked(dragged(mechanism, 0.3, acceleration=2.0), 40).q).all()
    solver.acceleration_limits = None
    assert np.abs(solver.step().v - step.v).max() > 2.0 * DT


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
    task = solver.add_task("tool", translation=0)
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
    ticked(solver, 100)
    assert abs(solver.q[0]) < 1e-6
    solver.position_limits[name], task.target = (-2.0, 2.0), turned(1.5)  # wider than the model's
    assert abs(ticked(solver, 200).q[0] - 1.5) < 1e-6


def test_a_floating_base_has_limits_of_velocity_and_acceleration(biped):
    solver = Solver(biped, DT)
    feet = [solver.add_task(node) for node in bipeds.FEET]
    for task in feet:
        task.target = pin.SE3(task.target.rotation, task.target.translation + np.array([0.3, 0.1, 0.2]))
    solver.velocity_limits["base"] = (0.02, 0.01, 0.03, 0.1, 0.2, 0.3)
    assert solver.velocity_limits[biped.base] == (0.02, 0.01, 0.03, 0.1, 0.2, 0.3)
    speeds = fastest(solver)[:6]
    assert (speeds <= np.array([0.02, 0.01, 0.03, 0.1, 0.2, 0.3])).all()
    assert speeds.max() > 0.005
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

    def watch(state):
        seen.append(state)
        return np.zeros(7)

    solver = Solver(mechanism, DT)
    solver.objectives = [Objective(watch)]
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


@pytest.mark.parametrize(("prop", "joint", "value", "error", "message"), [
    ("velocity_limits", "joint1", 0.0, CinegenError, r"must be positive, not 0.0: lock\('joint1'\)"),
    ("velocity_limits", "joint1", np.nan, CinegenError, "must be positive"),
    ("velocity_limits", "joint1", "fast", CinegenError, r"_limits\['joint1'\] takes one number, not 'fast'"),
    ("velocity_limits", "joint1", (1.0, 2.0), CinegenError, "takes one number"),
    ("velocity_limits", "joint1", 88.0, ImplausibleError, r"did you mean .* degrees/s"),
    ("velocity_limits", "joint11", 1.0, UnknownNameError, "did you mean 'joint1'"),
    ("velocity_limits", "base", 1.0, CinegenError, "does not float"),
    ("acceleration_limits", "joint1", -1.0, CinegenError, "must be positive"),
    ("position_limits", "joint1", (1.0, 0.5), CinegenError, r"takes \(lower, upper\) in rad or m"),
    ("position_limits", "joint1", 1.0, CinegenError, r"takes \(lower, upper\)"),
    ("position_limits", "joint1", (-90.0, 90.0), ImplausibleError, "did you mean"),
    ("joint_weights", "joint1", np.inf, CinegenError, "must be positive and finite"),
])  # fmt: skip
def test_what_is_no_limit_is_an_error_that_changes_nothing(robot, prop, joint, value, error, message):
    solver = Solver(robot("arm7"), DT)
    before = dict(getattr(solver, prop))
    with pytest.raises(error, match=message):
        getattr(solver, prop)[joint] = value
    with pytest.raises(error, match=message):
        setattr(solver, prop, {"joint2": (0.0, 1.0) if prop == "position_limits" else 1.0, joint: value})
    assert dict(getattr(solver, prop)) == before


def test_a_base_has_no_limits_of_position(biped):
    with pytest.raises(CinegenError, match="is not one number, and has no limits of position: lock it"):
        Solver(biped, DT).position_limits["base"] = (0.0, 1.0)
