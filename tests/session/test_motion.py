"""Motions of robots that wait for what is in their path, those that go back as they came, and their trace."""

from types import SimpleNamespace

import numpy as np
import pytest

from cinegen.session import Session, arrange
from cinegen.session import commands as c
from cinegen.session.motion import ConfigurationMotion, Retrace
from cinegen.session.undo import MotionTrace

DT = 0.01
KINDS = ("straight", "retrace")


def motion(kind, mechanism):
    goal = mechanism.q_home + 0.4
    if kind == "straight":
        return ConfigurationMotion(mechanism, mechanism.q_home, goal, "name", "label"), goal
    path = [mechanism.interpolate(mechanism.q_home, goal, part) for part in np.linspace(0.0, 1.0, 60)]
    return Retrace(path, 1.0 / 60.0, "name", "label"), goal


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_that_stays_blocked_ends_after_half_a_second_with_the_reason(robot, kind):
    arm = robot("planar_3r")
    moving, _ = motion(kind, arm)
    q, ticks = arm.q_home, 0
    while not moving.problem:
        assert moving.advance(DT) is not None
        moving.block(q, "the wall")
        ticks += 1
        assert ticks < 200
    assert moving.problem == "the wall"
    assert ticks * DT == pytest.approx(0.5, abs=DT)
    assert moving.advance(DT) is None


@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_that_is_blocked_now_and_then_arrives_however_long_that_takes(robot, kind):
    """It is blocked for 0.4 s at a time, three seconds in all."""
    arm = robot("planar_3r")
    moving, goal = motion(kind, arm)
    q, tick, blocked = arm.q_home, 0, 0
    while (here := moving.advance(DT)) is not None:
        if tick % 45 < 40 and blocked < 300:
            moving.block(q, "the wall")
            blocked += 1
        else:
            q = here
        tick += 1
        assert tick < 2000
    assert (moving.problem, blocked) == ("", 300)
    assert q == pytest.approx(goal, abs=1e-9)


def test_undo_goes_back_along_the_way_and_not_straight(robot):
    """The tool was led round two sides of a square."""
    session = Session(arrange({"planar_3r": robot("planar_3r")}))
    arm = session.setup.robots["planar_3r"]
    begin = arm.placement(arm.q_home, "tool").translation

    def run(ticks):
        found = []
        for _ in range(ticks):
            session.tick()
            found.append(session.state().robots["planar_3r"].q)
        return found

    session.obey(c.StartDrag("planar_3r", "tool", (0.0, 0.0, 0.0)))
    there = []
    for side in ([-0.25, 0.0, 0.0], [-0.25, 0.25, 0.0]):
        session.obey(c.MoveDrag(tuple(begin + side)))
        there += run(600)
    session.obey(c.EndDrag())
    run(20)
    session.obey(c.Undo())
    back = run(3000)
    assert back[-1] == pytest.approx(arm.q_home, abs=1e-9)
    way = np.array(there[::10])
    assert max(np.abs(way - q).max(axis=1).min() for q in back) < 0.03
    straight = 0.5 * (there[-1] + arm.q_home)
    assert np.abs(way - straight).max(axis=1).min() > 0.1
    session.close()


PERIOD = 0.02


@pytest.mark.parametrize("count", [1, 600, 601, 602, 1202, 5000])
def test_a_trace_of_any_length_begins_at_the_beginning_and_is_evenly_sampled(count):
    """The robot's one coordinate is the time since the undo step began, so that the trace says when each was taken."""
    robot, trace = SimpleNamespace(q=np.zeros(1)), MotionTrace(PERIOD)
    for tick in range(count):
        robot.q = np.array([tick * PERIOD])
        trace.note({"robot": robot})
    times = np.concatenate(trace.configurations["robot"])
    assert times == pytest.approx(trace.period * np.arange(len(times)), abs=1e-9)
    assert 0.0 <= robot.q[0] - times[-1] < trace.period - 1e-9
    assert min(count, 300) <= len(times) <= 600
