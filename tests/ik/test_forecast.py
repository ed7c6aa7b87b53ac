"""What lies ahead against closed forms, and against what then happens."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_openings import pin_screws
from planar import ROCKER, two_r
from scipy.optimize import brentq
from small_robots import two_bars
from ticking import ticked

import cinegen
from cinegen import CinegenError, Solver, forecast_motion
from cinegen.ik import EventKind, LimitMargin, LookAhead, Posture
from cinegen.tolerances import NEAR_SINGULAR

DT = 0.01
A, B = 0.4, 0.3
seeds = st.integers(0, 2**32 - 1)
ROBOTS = ["planar_3r", "arm7", "five_bar", "delta4", "hybrid", "sr400"]


def _kinds(forecast):
    return [event.kind for event in forecast.events]


def _first(forecast, kind):
    return next(event for event in forecast.events if event.kind is kind)


# --- type 1 ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("how", "dt"), [("target", None), ("twist", DT), ("twist", 3 * DT)])
def test_when_an_arm_is_stretched(how, dt):
    """Its end goes straight out at a constant speed: the law of cosines tells the elbow, and so the singular value."""
    arm, speed, ran = cinegen.load(two_bars((20, 60), (1000 * A, 1000 * B))), 0.05, 5
    solver = Solver(arm, DT)
    task = solver.add_task("tool", rotation=0, axes="world")
    begin = task.target.translation.copy()
    out = begin / np.linalg.norm(begin)
    if how == "twist":
        task.twist = [*(speed * out), 0.0, 0.0, 0.0]
    for tick in range(1, ran + 1):
        if how == "target":
            task.target.translation = begin + speed * tick * DT * out
        solver.step()
    forecast = forecast_motion(solver, 3.0, dt)
    distance = np.linalg.norm(begin) + speed * ran * DT

    def elbow(time):
        return math.acos((max(distance + speed * time, 0.0) ** 2 - A**2 - B**2) / (2.0 * A * B))

    def sigma(time):
        return np.linalg.svd(two_r(A, B, 0.0, elbow(time)) / arm.length, compute_uv=False)[1]

    stretched = (A + B - distance) / speed
    near = brentq(lambda time: NEAR_SINGULAR - sigma(time), 0.0, stretched)
    event = _first(forecast, EventKind.TYPE_1)
    assert event.time == pytest.approx(near, abs=0.2 * (dt or 0.03))
    assert event.sigma == NEAR_SINGULAR
    assert _first(forecast_motion(solver, 3.0, dt, threshold=2.0 * NEAR_SINGULAR), EventKind.TYPE_1).time < event.time
    assert event.q[1] == pytest.approx(elbow(near), abs=2e-2)
    before = forecast.times < near
    assert forecast.sigma_min[before] == pytest.approx([sigma(time) for time in forecast.times[before]], abs=4e-3)
    assert forecast.sigma_min[-1] < 0.2 * NEAR_SINGULAR
    assert np.isinf(forecast.passive_sigma_min).all()
    assert _kinds(forecast_motion(solver, 0.9 * near)) == []
    expected = [] if how == "target" else _kinds(forecast_motion(solver, 3.0))
    assert _kinds(forecast_motion(solver, 3.0, moving=False)) == expected


# --- type 2 ----------------------------------------------------------------------------------------------------------


def _pins(crank, side):
    """(4, 2) of a four-bar: of its crank (0.12 m) at the base, of the coupler (0.36 m) at both ends, and of the rocker
    (0.24 m) at the base, (0.4, 0). Two circles meet."""
    end = 0.12 * np.array([math.cos(crank), math.sin(crank)])
    apart = np.array([0.4, 0.0]) - end
    far = float(np.linalg.norm(apart))
    along = (0.36**2 - 0.24**2 + far**2) / (2.0 * far)
    across = side * math.sqrt(0.36**2 - along**2)
    return np.array([[0.0, 0.0], end, end + (along * apart + across * np.array([-apart[1], apart[0]])) / far, [0.4, 0]])


@pytest.mark.parametrize("dt", [DT, 0.05])
def test_when_a_four_bar_meets_its_dead_point(dt):
    """The rocker is actuated, and the crank rotates evenly. A dead point is passed, not only approached: it is found
    however low the threshold."""
    bar = cinegen.load(ROCKER)
    solver = Solver(bar, DT)
    task = solver.add_task("link1", translation=0, rotation=1)
    task.twist = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]  # rad/s
    start = bar.q_home[bar.q_index("joint1")]
    met = bar.placement(bar.q_home, "frame4").translation[:2]
    side = next(s for s in (1.0, -1.0) if _pins(start, s)[2] == pytest.approx(met))

    def sigma(time):
        """Smallest singular value of the three passive pins, with the sign of the area between them."""
        passive = pin_screws(_pins(start + time, side), _pins(start, side))[:, :3]
        return math.copysign(np.linalg.svd(passive, compute_uv=False)[2], np.linalg.det(passive))

    sign = math.copysign(1.0, sigma(0.0))
    for threshold in (NEAR_SINGULAR, 1e-3, 1e-9):

        def left(time, threshold=threshold):
            return threshold - sign * sigma(time)

        time = brentq(left, 0.0, 2.0)
        assert left(time) == pytest.approx(0.0, abs=1e-9)  # there is one
        event = _first(forecast_motion(solver, 2.5, dt, passive_threshold=threshold), EventKind.TYPE_2)
        assert event.time == pytest.approx(time, abs=0.05 * dt)
        assert event.sigma == threshold
        assert event.q[bar.q_index("joint1")] == pytest.approx(start + time, abs=0.05 * dt)
        assert bar.closure(event.q) < 1e-12


# --- limits ----------------------------------------------------------------------------------------------------------

SWING = """
  robot r { base { }
    link 1 { parameters { theta 10 } type 2 pred 0 limits { -20 70 } }
    frame 2 { parameters { d 300 } pred 1 name "tool" } }"""


@pytest.fixture
def swing(raff):
    """`swing(q=[0.1])`: a solver of one bar, and a task that rotates it."""

    def made(**options):
        solver = Solver(raff(SWING), DT, **options)
        return solver, solver.add_task("tool", translation=0, rotation=1)

    return made


@pytest.mark.parametrize(("speed", "bound", "dt"), [(0.5, 70, None), (-0.3, -20, DT), (1.4, 70, 0.07)])
def test_when_a_joint_meets_its_limit(swing, speed, bound, dt):
    solver, task = swing()
    task.twist = [0.0, 0.0, 0.0, 0.0, 0.0, speed]
    time = math.radians(bound - 10) / speed
    for _ in range(2):
        forecast = forecast_motion(solver, 3.0, dt)
        event = _first(forecast, EventKind.LIMIT)
        assert event.time == pytest.approx(time, abs=1e-9)
        assert event.joint == "joint1"
        assert event.q == pytest.approx(math.radians(bound), abs=1e-15)
        assert _kinds(forecast) == [EventKind.LIMIT, EventKind.STOPPED]
        ticked(solver, 5)
        time -= 5 * DT


def test_a_joint_that_is_held_by_its_limit_is_said_at_once(swing):
    solver, task = swing(q=[math.radians(70)])
    task.twist = [0.0, 0.0, 0.0, 0.0, 0.0, 0.5]
    events = [(event.kind, event.time) for event in forecast_motion(solver, 1.0).events]
    assert events == [(EventKind.LIMIT, 0.0), (EventKind.STOPPED, 0.0)]
    task.twist = [0.0, 0.0, 0.0, 0.0, 0.0, -0.5]  # it stands there, but is not held
    assert forecast_motion(solver, 1.0).events == ()


def test_a_joint_that_leaves_its_limit_meets_it_again():
    """Along the chord between two points that differ in the angle of the second joint alone."""
    arm = cinegen.load(two_bars((20, 90), words=("limits { -90 20 }", "")))
    begin, end = (arm.placement(np.radians([20.0, elbow]), "tool").translation for elbow in (90.0, 20.0))
    solver = Solver(arm, DT)
    solver.add_task("tool", rotation=0, axes="world").twist = [*(end - begin), 0.0, 0.0, 0.0]  # there after a second
    (event,) = forecast_motion(solver, 1.1, 1e-3).events
    assert (event.kind, event.joint, event.time) == (EventKind.LIMIT, "joint1", pytest.approx(1.0, abs=1e-3))


# --- what then happens -----------------------------------------------------------------------------------------------


def test_a_limit_that_holds_for_long_is_said_once(robot):
    """While a joint is pressed against its limit, closing the loops moves it off by a hair now and then."""
    bar = robot("five_bar")
    solver = Solver(bar, 1 / 240)
    solver.add_task("tool", rotation=0).twist = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]
    forecast = forecast_motion(solver, 4.0)
    met = forecast.events[1].q
    assert met[bar.q_index("joint2")] in (*bar.limits.lower, *bar.limits.upper)
    assert bar.closure(met) < 1e-12
    events = [(event.kind, event.joint) for event in forecast.events]
    assert events == [(EventKind.TYPE_1, None), (EventKind.LIMIT, "joint2")]


def _play(solver, seed, each=lambda tick: None):
    """Ticks with targets and twists at random; all configurations."""
    rng, mechanism, path = np.random.default_rng(seed), solver.mechanism, []
    task, move = solver.add_task(mechanism.end), 0.1 * solver.mechanism.length * rng.normal(size=3)
    for tick in range(30):
        if tick == 10:
            other = solver.add_task(mechanism.nodes[-2], rotation=int(rng.integers(0, 4)), weight=0.3)
        if tick == 20:
            task.twist, other.weight = 0.2 * rng.normal(size=6), 2.0
        if task.twist is None:
            task.target.translation += move * solver.dt
        each(tick)
        path.append(solver.step().q)
    return np.array(path)


@settings(max_examples=30)
@given(seeds, st.sampled_from(ROBOTS), st.sampled_from([None, 5.0]))
def test_looking_ahead_changes_nothing(robot, seed, name, acceleration):
    """Not a bit of the ticks that follow; and what is foreseen does not depend on what was foreseen before."""
    options = {"gain": -np.log(0.2) / DT, "acceleration": acceleration}
    looking, other = (Solver(robot(name), DT, **options) for _ in range(2))
    look_ahead = LookAhead(looking.mechanism, DT)

    def look(tick):
        look_ahead.copy(looking, moving=tick % 2 == 0)
        look_ahead.forecast(0.05 + 0.01 * (tick % 3))

    assert np.array_equal(_play(looking, seed, look), _play(other, seed))
    look_ahead.copy(looking)
    forecast, expected = look_ahead.forecast(0.2), forecast_motion(other, 0.2)
    assert np.array_equal(forecast.q, expected.q)
    assert np.array_equal(forecast.sigma_min, expected.sigma_min)
    assert np.array_equal(forecast.passive_sigma_min, expected.passive_sigma_min)


@settings(max_examples=30)
@given(seeds, st.sampled_from(ROBOTS))
def test_with_the_solvers_own_dt_it_says_exactly_what_will_happen(robot, seed, name):
    mechanism, rng = robot(name), np.random.default_rng(seed)
    solver = Solver(mechanism, DT, gain=-np.log(0.3) / DT, acceleration=30.0)
    if name == "arm7":
        solver.objectives = [Posture(mechanism.q_home + 0.3), LimitMargin()]
    solver.damping_threshold = 0.2
    solver.add_task(mechanism.nodes[-2], weights=(1, 0.2, 1, 0, 1, 0.5), weight=0.3)
    task = solver.add_task(mechanism.end, rotation=0)
    task.target.translation += 0.05 * mechanism.length * rng.normal(size=3)
    for _ in ("target", "twist"):
        ticked(solver, 4)
        forecast = forecast_motion(solver, 0.3, DT)
        assert np.array_equal(forecast.q, [solver.q, *(solver.step().q for _ in range(30))])
        task.twist = 0.2 * rng.normal(size=6)


@settings(max_examples=30)
@given(seeds, st.sampled_from(ROBOTS))
def test_targets_go_on_as_they_moved(robot, seed, name):
    mechanism, rng = robot(name), np.random.default_rng(seed)
    linear, angular = 0.1 * mechanism.length * rng.normal(size=3), 0.3 * rng.normal(size=3)
    solver = Solver(mechanism, DT)
    task = solver.add_task(mechanism.end)
    begin = task.target.copy()

    def step(tick):
        time = tick * DT
        task.target = pin.SE3(pin.exp3(angular * time) @ begin.rotation, begin.translation + linear * time)
        return solver.step().q

    for tick in range(1, 6):
        step(tick)
    forecast = forecast_motion(solver, 0.3, DT)
    assert forecast.q == pytest.approx(np.array([solver.q, *(step(tick) for tick in range(6, 36))]), abs=1e-7)


@settings(max_examples=12)
@given(seeds, st.sampled_from(ROBOTS))
def test_singular_values_are_those_of_the_path(robot, seed, name):
    mechanism, rng = robot(name), np.random.default_rng(seed)
    solver = Solver(mechanism, DT)
    task = solver.add_task(mechanism.end, axes="world", rotation=int(rng.choice([0, 3])))
    task.twist = 0.3 * mechanism.length * rng.normal(size=6)
    forecast = forecast_motion(solver, 0.5)
    for q, sigma, passive in zip(forecast.q, forecast.sigma_min, forecast.passive_sigma_min, strict=True):
        fresh = Solver(mechanism, DT, q=q)
        fresh.add_task(mechanism.end, axes="world", rotation=task.rotation)
        step = fresh.step()
        assert step.lost_dof.sigma == pytest.approx(sigma, abs=1e-9)
        assert passive == (pytest.approx(step.uncontrolled_dof.sigma, abs=1e-9) if mechanism.is_constrained else np.inf)


def test_a_coarser_tick_makes_good_as_much_in_the_same_time(swing):
    solver, task = swing(gain=-np.log(0.95) / DT)
    task.target.rotation = task.target.rotation @ pin.exp3(np.array([0.0, 0.0, 0.1]))
    left = 0.1 * 0.95 ** (np.arange(11) * 10)
    assert math.radians(10) + 0.1 - forecast_motion(solver, 1.0, 10 * DT).q[:, 0] == pytest.approx(left, abs=1e-9)


def test_a_leap_of_a_target_and_the_end_of_a_twist_do_not_go_on(robot):
    delta = robot("delta4")
    solver = Solver(delta, DT)
    task = solver.add_task("platform")
    solver.step()
    task.target.translation += [0.0, 0.0, 0.9]
    solver.step()
    assert np.array_equal(forecast_motion(solver, 0.5).q, forecast_motion(solver, 0.5, moving=False).q)
    task.twist = [0.2, 0.0, 0.0, 0.0, 0.0, 0.0]
    step = ticked(solver, 50)
    task.target = delta.placement(step.q, "platform")  # stop
    assert np.array_equal(forecast_motion(solver, 0.5).q, forecast_motion(solver, 0.5, moving=False).q)


# --- what can't be followed ------------------------------------------------------------------------------------------


def test_tasks_that_are_invalid_are_left_out(robot):
    forecasts = []
    for wrong in ({}, {"target": None}, {"weight": 0.0}, {"twist": "x"}):
        solver = Solver(robot("arm7"), DT)
        if wrong:
            setattr(solver.add_task("link3"), *wrong.popitem())
        solver.add_task("tool").twist = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]
        forecasts.append(forecast_motion(solver, 1.0).q)
    assert all(np.array_equal(forecast, forecasts[0]) for forecast in forecasts[1:])


def test_times_that_make_no_sense_are_refused(robot):
    solver = Solver(robot("arm7"), DT)
    for seconds, dt in ((0.0, None), (-1.0, None), (math.nan, None), (math.inf, None), (1.0, 0.0), (1.0, math.nan)):
        with pytest.raises(CinegenError, match="positive"):
            forecast_motion(solver, seconds, dt)


def test_its_ticks_are_bounded_and_end_where_asked(robot):
    solver = Solver(robot("arm7"), DT)
    for seconds, ticks in ((0.004, 1), (0.01, 1), (0.05, 5), (0.055, 6), (1.0, 100), (1.3, 100), (1e3, 100)):
        forecast = forecast_motion(solver, seconds)
        assert len(forecast.times) == len(forecast.q) == ticks + 1
        assert forecast.times[-1] == pytest.approx(max(seconds, ticks * DT))
    assert len(forecast_motion(solver, 3.0, 0.02).times) == 151


def test_it_reads_well(raff):
    arm = raff(SWING)
    solver = Solver(arm, DT)
    solver.add_task("tool", translation=0, rotation=1).twist = [0.0, 0.0, 0.0, 0.0, 0.0, 0.5]
    forecast = forecast_motion(solver, 2.5)
    assert repr(forecast).startswith("<Forecast of 2.5 s: in 2.09 s: joint1 meets its limit; in 2.1")
    assert "joint1 meets its limit" in forecast._repr_html_()
