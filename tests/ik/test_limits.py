"""Limits of position, velocity and acceleration: never crossed, rested at without trembling, left again at once."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from cinegen import Solver, Status
from cinegen.tolerances import NEAR_SINGULAR

DT = 1 / 240
FREE = ["planar_3r", "rx90", "serial_5dof", "arm7"]
CLOSED = ["five_bar", "planar_hybrid", "delta4", "gough", "tssm", "sr400"]
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


def accelerations(solver, mechanism, acceleration, ticks, act=lambda tick: None) -> np.ndarray:
    """(ticks,) the largest of each tick, from rest, as a part of what is allowed."""
    v, found = np.zeros(mechanism.model.nv), []
    for tick in range(ticks):
        act(tick)
        step = solver.step()
        found.append(float(np.abs((step.v - v) / mechanism.scale).max()) / solver.dt / acceleration)
        v = step.v
    return np.array(found)


def worst_acceleration(solver, mechanism, acceleration, ticks, act=lambda tick: None) -> float:
    """Of all these ticks."""
    return accelerations(solver, mechanism, acceleration, ticks, act).max()


# --- acceleration ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FREE)
def test_a_robot_starts_no_faster_than_its_acceleration_allows(robot, name):
    mechanism, rng = robot(name), np.random.default_rng(0)
    for _ in range(10):
        solver = Solver(mechanism, DT, acceleration=allowed(mechanism, 3.0))
        solver.add_task("tool", away(mechanism, "tool", rng, 3.0), rotation=0)
        assert 0.999 < worst_acceleration(solver, mechanism, 3.0, 20) <= ROUNDING


@pytest.mark.parametrize("name", CLOSED)
def test_so_does_a_closed_one_with_a_reserve_for_what_closes_its_loops_again(robot, name):
    mechanism, rng = robot(name), np.random.default_rng(0)
    node = mechanism.nodes[-1]
    for _ in range(10):
        solver = Solver(mechanism, DT, acceleration=allowed(mechanism, 3.0))
        solver.add_task(node, away(mechanism, node, rng, 3.0), rotation=0)
        assert 0.975 < worst_acceleration(solver, mechanism, 3.0, 20) <= ROUNDING


def test_a_joint_stops_at_its_target_within_its_acceleration(raff):
    arm = raff(ONE_JOINT)
    solver = Solver(arm, 0.01, acceleration=2.0)
    solver.add_task("tool", turned(0.5), translation=0)
    assert worst_acceleration(solver, arm, 2.0, 400) <= ROUNDING
    assert solver.q[0] == pytest.approx(0.5, abs=1e-9)


def test_a_joint_turns_round_within_its_acceleration(raff):
    arm = raff(ONE_JOINT)
    solver = Solver(arm, 0.01, acceleration=2.0)
    task = solver.add_task("tool", turned(0.9), translation=0)

    def turn_round(tick):
        if tick == 20:  # on its way
            task.target = turned(-0.9)

    assert worst_acceleration(solver, arm, 2.0, 60, turn_round) <= ROUNDING


def test_a_joint_brakes_before_its_limit_and_ends_on_it(raff):
    """To the last tick: the room that braking takes, s + (s - a) + ..., ends with a part of a."""
    arm = raff(ONE_JOINT)
    for acceleration in (0.5, 2.0, 7.3, 40.0):
        solver = Solver(arm, 0.01, acceleration=acceleration)
        solver.add_task("tool", turned(3.0), translation=0)
        assert worst_acceleration(solver, arm, acceleration, 600) <= ROUNDING
        assert solver.q[0] == arm.model.upperPositionLimit[0]


def test_a_joint_brakes_before_its_limit_whatever_the_others_do(raff):
    """The first joint goes on and on; that must be no leave for the second one to go on, too."""
    arm = raff("""robot r { base { }
      link 1 { parameters { theta 0 } type 2 pred 0 }
      link 2 { parameters { theta 0 d 1000 } type 2 pred 1 limits { -60 60 } }
      frame 3 { parameters { d 1000 } pred 2 name "tool" } }""")
    solver = Solver(arm, 0.01, acceleration=2.0)
    first, second = solver.add_task("link1", translation=0), solver.add_task("tool", translation=0)

    def lead(tick):
        ahead = solver.q[0] + 1.0
        first.target, second.target = turned(ahead), turned(ahead + solver.q[1] + 1.0)

    assert worst_acceleration(solver, arm, 2.0, 160, lead) <= ROUNDING


def while_the_target_leaps(mechanism, every: int, seed: int = 1) -> np.ndarray:
    rng, node = np.random.default_rng(seed), mechanism.nodes[-1]
    solver = Solver(mechanism, DT, acceleration=allowed(mechanism, 3.0))
    task = solver.add_task(node, rotation=0)

    def leap(tick):
        if tick % every == 0:
            task.target = away(mechanism, node, rng, float(rng.choice([0.1, 1.0, 10.0])))

    return accelerations(solver, mechanism, 3.0, 600, leap)


@pytest.mark.parametrize("name", FREE + CLOSED)
@pytest.mark.parametrize("every", [1, 60])
def test_accelerations_are_kept_however_the_target_leaps(robot, name, every):
    """Also where loops drive a joint against its limit: all joints that they tie together brake in time."""
    found = np.array([while_the_target_leaps(robot(name), every, seed) for seed in range(1, 6)])
    assert found.max() <= ROUNDING


@pytest.mark.parametrize("name", ["delta4", "gough", "five_bar", "hybrid"])
def test_a_robot_that_is_pulled_against_its_limits_brakes_before_them(robot, name):
    """It neither stops at once nor is refused a step."""
    mechanism, rng, against = robot(name), np.random.default_rng(1), 0
    for _ in range(6):
        solver = Solver(mechanism, DT, acceleration=allowed(mechanism, 10.0))
        solver.add_task(mechanism.end, away(mechanism, mechanism.end, rng, 3.0), rotation=0)
        v = np.zeros(mechanism.model.nv)
        for _ in range(400):
            step = solver.step()
            assert step.status is not Status.REFUSED
            assert np.abs((step.v - v) / mechanism.scale).max() / DT <= 10.0 * ROUNDING
            v = step.v
        against += bool(step.saturated)
    assert against >= 3


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


@pytest.mark.parametrize("name", FREE + CLOSED)
def test_with_limits_of_acceleration_all_other_limits_are_kept(robot, name):
    mechanism, rng = robot(name), np.random.default_rng(2)
    model, node = mechanism.model, mechanism.nodes[-1]
    solver = Solver(mechanism, DT, acceleration=allowed(mechanism, 5.0))
    task = solver.add_task(node, rotation=0)
    for tick in range(600):
        if tick % 40 == 0:
            task.target = away(mechanism, node, rng, float(rng.choice([0.1, 1.0, 10.0])))
        step = solver.step()
        assert (step.q >= model.lowerPositionLimit).all()
        assert (step.q <= model.upperPositionLimit).all()
        assert (np.abs(step.v) <= model.upperVelocityLimit * ROUNDING).all()
        assert step.closure <= 1e-10


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
    for tick in range(800):
        if tick % (40 if tick < 400 else 1) == 0:
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


@pytest.mark.parametrize("name", ["gough", "hybrid"])
def test_a_step_of_limited_acceleration_is_soon_within_its_limit_of_speed(robot, name):
    """What braking leaves of it is not shortened; what is beyond is shortened by as much more."""
    mechanism, rng = robot(name), np.random.default_rng(0)
    solver = Solver(mechanism, 1 / 240, acceleration=5.0)
    task, tries = solver.add_task(mechanism.end, rotation=0), []
    home = task.target.translation.copy()
    for tick in range(900):
        if tick % 150 == 0:
            way = rng.normal(size=3)
            task.target.translation = home + 0.3 * mechanism.length * way / np.linalg.norm(way)
        solver.step()
        tries.append(solver._memory.tries)
    assert np.mean(np.array(tries) >= 5) < 0.04


@pytest.mark.parametrize("name", FREE + CLOSED)
def test_under_a_limit_of_speed_the_tool_keeps_its_direction(robot, name):
    """The same task at a tick so long that nothing is too fast, and at a short one."""
    mechanism, rng = robot(name), np.random.default_rng(4)
    node, slowed = mechanism.nodes[-1], 0
    for _ in range(20):
        target = away(mechanism, node, rng, 0.02)
        tool = []
        for dt in (100.0, 1e-4):
            solver = Solver(mechanism, dt)
            solver.add_task(node, target, rotation=0)
            step = solver.step()
            if step.saturated:
                break
            before, after = (mechanism.placement(q, node).translation for q in (mechanism.q_home, step.q))
            tool.append((after - before) / np.linalg.norm(after - before))
        if len(tool) < 2:
            continue
        assert step.speed_scale < 1.0
        limit = mechanism.model.upperVelocityLimit
        assert step.limiting_joint == mechanism.columns[int(np.argmax(np.abs(step.v) / limit))]
        # the long step bends by what is of second order in its length
        assert tool[1] == pytest.approx(tool[0], abs=0.1)
        slowed += 1
    assert slowed


@pytest.mark.parametrize("name", ["planar_3r", "rx90", "arm7", "planar_hybrid", "delta4", "gough"])
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
        slowed += step.speed_scale < 1.0
        gone = mechanism.placement(step.q, node).translation - home
        assert np.linalg.norm(np.cross(gone, way)) / np.linalg.norm(way) < 3e-3 * np.linalg.norm(way)
    assert slowed > 3
    assert np.linalg.norm(gone - way) < 1e-9 * mechanism.length


# --- position ----------------------------------------------------------------------------------------------------

WALLS = [("serial_5dof", [0.0, 0.0, -9.0]), ("planar_3r", [-9.0, -1.0, 0.0]), ("five_bar", [0.0, 9.0, 0.0])]
WALLS += [("planar_hybrid", [9.0, -9.0, 0.0]), ("delta4", [1.0, 0.0, -9.0])]


def pressed(mechanism, direction):
    """A solver whose tool is pulled far beyond a wall, and the task."""
    node = mechanism.nodes[-1]
    solver = Solver(mechanism, 1 / 60)
    home = mechanism.placement(mechanism.q_home, node)
    task = solver.add_task(node, rotation=0)
    task.target = pin.SE3(home.rotation, home.translation + mechanism.length * np.array(direction))
    return solver, task


@pytest.mark.parametrize(("name", "direction"), WALLS)
def test_pressed_against_a_wall_a_robot_rests_on_its_limits(robot, name, direction):
    mechanism = robot(name)
    solver, _ = pressed(mechanism, direction)
    for _ in range(3000):
        step = solver.step()
        assert (step.q >= mechanism.model.lowerPositionLimit).all()
        assert (step.q <= mechanism.model.upperPositionLimit).all()
    way = 0.0
    for _ in range(3000):
        way += float(np.abs(solver.step().v / mechanism.scale).sum()) * solver.dt
    assert way < 1e-3


@pytest.mark.parametrize(("name", "direction"), [WALLS[0], WALLS[2]])
def test_for_a_hundred_thousand_ticks_it_does_not_tremble(robot, name, direction):
    mechanism = robot(name)
    solver, _ = pressed(mechanism, direction)
    for _ in range(50_000):
        solver.step()
    begin, way = solver.q, 0.0
    for _ in range(50_000):
        step = solver.step()
        way += float(np.abs(step.v).sum())
    assert way * solver.dt < 1e-6
    assert step.status is Status.AT_LIMIT
    assert step.q == pytest.approx(begin, abs=1e-6)
    for joint in step.saturated:
        i = mechanism.q_index(joint)
        low, high = mechanism.model.lowerPositionLimit[i], mechanism.model.upperPositionLimit[i]
        assert min(step.q[i] - low, high - step.q[i]) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("name", "direction"), WALLS)
def test_a_wall_is_left_in_the_first_tick_that_pulls_away_from_it(robot, name, direction):
    mechanism = robot(name)
    solver, task = pressed(mechanism, direction)
    for _ in range(1500):
        step = solver.step()
    node = mechanism.nodes[-1]
    here, home = (mechanism.placement(q, node) for q in (step.q, mechanism.q_home))
    task.target = home
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


def test_the_joint_that_holds_the_motion_is_named_and_the_one_that_leaves_is_not(raff):
    arm = raff(ONE_JOINT)
    solver = Solver(arm, 0.01)
    task = solver.add_task("tool", turned(2.0), translation=0)
    for _ in range(20):
        step = solver.step()
    assert step.saturated == ("joint1",)
    assert step.status is Status.AT_LIMIT
    assert step.q[0] == arm.model.upperPositionLimit[0]
    task.target = turned(0.0)
    step = solver.step()
    assert step.saturated == ()
    assert step.v[0] < 0.0


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
