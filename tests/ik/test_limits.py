"""Limits of position, velocity and acceleration: never crossed, rested at without trembling, left again at once."""

import numpy as np
import pinocchio as pin
import pytest

from cinegen import Solver, Status
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


def away(mechanism, node, rng, lengths) -> pin.SE3:
    """In a random direction from home."""
    home, way = mechanism.placement(mechanism.q_home, node), rng.normal(size=3)
    return pin.SE3(home.rotation, home.translation + lengths * mechanism.length * way / np.linalg.norm(way))


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


@pytest.mark.parametrize("name", FREE + CLOSED)
def test_a_robot_starts_no_faster_than_its_acceleration_allows(robot, name):
    """A closed one has a reserve for what closes its loops again."""
    mechanism, rng = robot(name), np.random.default_rng(0)
    for _ in range(5):
        solver = Solver(mechanism, DT, acceleration=allowed(mechanism, 3.0))
        solver.add_task(mechanism.nodes[-1], away(mechanism, mechanism.nodes[-1], rng, 3.0), rotation=0)
        least = 0.975 if mechanism.is_constrained else 0.999
        assert least < worst_acceleration(solver, mechanism, 3.0, 20) <= ROUNDING


def test_a_joint_turns_round_and_stops_at_its_target_within_its_acceleration(raff):
    arm = raff(ONE_JOINT)
    solver = Solver(arm, 0.01, acceleration=2.0)
    task = solver.add_task("tool", turned(0.9), translation=0)

    def turn_round(tick):
        if tick == 20:  # on its way
            task.target = turned(-0.5)

    assert worst_acceleration(solver, arm, 2.0, 400, turn_round) <= ROUNDING
    assert solver.q[0] == pytest.approx(-0.5, abs=1e-9)


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
def test_all_limits_are_kept_however_the_target_leaps(robot, name, every):
    """Also where loops drive a joint against its limit: all joints that they tie together brake in time."""
    mechanism = robot(name)
    model, node = mechanism.model, mechanism.nodes[-1]
    for seed in (1, 2):
        rng, v = np.random.default_rng(seed), np.zeros(model.nv)
        solver = Solver(mechanism, DT, acceleration=allowed(mechanism, 3.0))
        task = solver.add_task(node, rotation=0)
        for tick in range(400):
            if tick % every == 0:
                task.target = away(mechanism, node, rng, float(rng.choice([0.1, 1.0, 10.0])))
            step = solver.step()
            assert np.abs((step.v - v) / mechanism.scale).max() / DT <= 3.0 * ROUNDING
            assert (step.q >= model.lowerPositionLimit).all()
            assert (step.q <= model.upperPositionLimit).all()
            assert (np.abs(step.v) <= model.upperVelocityLimit * ROUNDING).all()
            assert step.closure <= 1e-10
            v = step.v


def test_let_go_on_its_way_a_robot_brakes(robot):
    for name in ("rx90", "delta4"):
        mechanism, rng = robot(name), np.random.default_rng(6)
        node = mechanism.nodes[-1]
        solver = Solver(mechanism, DT, acceleration=allowed(mechanism, 3.0))
        task = solver.add_task(node, away(mechanism, node, rng, 0.5), rotation=0)
        for _ in range(30):
            before = solver.step()
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


@pytest.mark.parametrize("name", FREE + CLOSED)
def test_velocities_are_kept_to_rounding_however_the_target_jumps(robot, name):
    mechanism, rng = robot(name), np.random.default_rng(3)
    node, limit = mechanism.nodes[-1], mechanism.model.upperVelocityLimit
    solver = Solver(mechanism, DT)
    task = solver.add_task(node, rotation=0)
    fastest = 0.0
    for tick in range(400):
        if tick % (40 if tick < 200 else 1) == 0:
            task.target = away(mechanism, node, rng, float(rng.choice([0.1, 1.0, 10.0])))
        step = solver.step()
        assert (np.abs(step.v) <= limit * (1.0 + 1e-12)).all()
        fastest = max(fastest, float((np.abs(step.v) / limit).max()))
    assert fastest > 0.97  # and made use of


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


@pytest.mark.parametrize("name", ["planar_3r", "arm7", "planar_hybrid", "delta4"])
def test_slowed_down_the_tool_goes_straight_to_its_target(robot, name):
    mechanism = robot(name)
    node = mechanism.nodes[-1]
    there = mechanism.random_closed(1, seed=5)[0]
    home = mechanism.placement(mechanism.q_home, node).translation
    way = mechanism.placement(there, node).translation - home
    way *= 0.05 * mechanism.length / np.linalg.norm(way)
    solver = Solver(mechanism, 1e-3)
    solver.add_task(node, pin.SE3(mechanism.placement(mechanism.q_home, node).rotation, home + way), rotation=0)
    slowed = 0
    for _ in range(400):
        step = solver.step()
        if step.speed_scale < 1.0:
            part = np.abs(step.v) / mechanism.model.upperVelocityLimit
            assert part[mechanism.columns.index(step.limiting_joint)] > 0.999 * part.max()
            slowed += 1
        gone = mechanism.placement(step.q, node).translation - home
        assert np.linalg.norm(np.cross(gone, way)) / np.linalg.norm(way) < 3e-3 * np.linalg.norm(way)
    assert slowed > 3
    assert np.linalg.norm(gone - way) < 1e-9 * mechanism.length


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
    here, task.target = mechanism.placement(step.q, node), home
    step = solver.step()
    there = mechanism.placement(step.q, node)
    nearer = np.linalg.norm(here.translation - home.translation) - np.linalg.norm(there.translation - home.translation)
    if name == "five_bar":  # its wall is near a singularity, in the direction back: this motion is damped
        assert step.singular_values[-1] < 0.5 * NEAR_SINGULAR
        assert nearer > 4e-4 * mechanism.length
    else:
        assert nearer > 1e-3 * mechanism.length
    for _ in range(1500):
        step = solver.step()
    assert step.status is Status.FOLLOWING
    assert step.errors[0][0] < 1e-6 * mechanism.length


def test_a_robot_that_begins_beyond_a_limit_comes_back_and_goes_no_further(raff):
    arm = raff(ONE_JOINT)
    solver = Solver(arm, 0.01, q=[1.2])
    task = solver.add_task("tool", turned(3.0), translation=0)
    for _ in range(20):
        assert solver.step().q[0] <= 1.2
    task.target = turned(0.5)
    for _ in range(20):
        step = solver.step()
    assert step.q[0] == pytest.approx(0.5)
