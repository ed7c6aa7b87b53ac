"""Motions of robots that wait for what is in their path, those that go back as they came, and their trace."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cinegen
from cinegen.session import commands as c
from cinegen.session.commands import MoveTo
from cinegen.session.motion import ConfigurationMotion, LineMotion, Retrace
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
    while (q_next := moving.advance(DT)) is not None:
        if tick % 45 < 40 and blocked < 300:
            moving.block(q, "the wall")
            blocked += 1
        else:
            q = q_next
        tick += 1
        assert tick < 2000
    assert (moving.problem, blocked) == ("", 300)
    assert q == pytest.approx(goal, abs=1e-9)


def test_undo_goes_back_along_the_way_and_not_straight(session):
    """The tool was led round two sides of a square."""
    session = session("planar_3r")
    arm = session.setup.robots["planar_3r"]
    begin = arm.placement(arm.q_home, "tool").translation

    def run(ticks):
        track = []
        for _ in range(ticks):
            session.tick()
            track.append(session.state().robots["planar_3r"].q)
        return track

    session.obey(c.StartDrag("planar_3r", "tool", (0.0, 0.0, 0.0)))
    outward = []
    for side in ([-0.25, 0.0, 0.0], [-0.25, 0.25, 0.0]):
        session.obey(c.MoveDrag(tuple(begin + side)))
        outward += run(600)
    session.obey(c.EndDrag())
    run(20)
    session.obey(c.Undo())
    back = run(3000)
    assert back[-1] == pytest.approx(arm.q_home, abs=1e-9)
    way = np.array(outward[::10])
    assert max(np.abs(way - q).max(axis=1).min() for q in back) < 0.03
    straight = 0.5 * (outward[-1] + arm.q_home)
    assert np.abs(way - straight).max(axis=1).min() > 0.1


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


# --- line motion ------------------------------------------------------------------------------------------------------
# Robots go to configurations as a person would drag them.


LINE_DT = 2e-3
ROOM = {"delta4": 0.4, "arm7": 0.5}  # rad or lengths that motors go, on one branch
LONGEST = 0.02  # rad or lengths that a joint goes in a tick: nothing jumps


def gone(mechanism, q, goal, node):
    """All configurations on the way, and what there was to say."""
    visit, passed = LineMotion(mechanism, q, goal, node, LINE_DT), [q]
    while (q_next := visit.advance(LINE_DT)) is not None:
        passed.append(q_next)
        assert len(passed) < 60.0 / LINE_DT
    return np.array(passed), visit.problem


def steps(mechanism, passed):
    return [np.abs(pin.difference(mechanism.model, a, b) / mechanism.scale).max() for a, b in pairwise(passed)]


parts = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6)


@pytest.mark.parametrize("name", ROOM)
@given(parts=parts)
@settings(max_examples=16)
def test_it_comes_there_without_a_jump_and_loops_are_never_open(robot, name, parts):
    """To where motors at random lead from home."""
    mechanism = robot(name)
    forward = cinegen.model.ForwardKinematics(mechanism)
    units = (mechanism.scale[mechanism.v_index(joint)] for joint in mechanism.actuated)
    goal = forward.move({
        joint: mechanism.q_home[mechanism.q_index(joint)] + ROOM[name] * unit * part
        for joint, unit, part in zip(mechanism.actuated, units, [*parts, 0.0], strict=False)
    })  # fmt: skip
    passed, trouble = gone(mechanism, mechanism.q_home, goal, mechanism.end)
    assert trouble == ""
    assert passed[-1].tolist() == goal.tolist()
    assert max(mechanism.closure(q) for q in passed[::5]) < 1e-9
    assert max(steps(mechanism, passed)) < LONGEST


def test_the_node_goes_straight_and_slowly_at_first_and_last(robot):
    delta = robot("delta4")
    q = delta.q_home
    start = delta.placement(q, "platform").translation
    goal = cinegen.model.ForwardKinematics(delta).move({"joint1": 0.5, "joint6": -0.2, "joint12": -0.3})
    end = delta.placement(goal, "platform").translation
    passed, _ = gone(delta, q, goal, "platform")
    points = np.array([delta.placement(row, "platform").translation for row in passed])
    along = (end - start) / np.linalg.norm(end - start)
    aside = (points - start) - np.outer((points - start) @ along, along)
    assert np.linalg.norm(aside, axis=1).max() < 1e-3 * delta.length
    speed = np.linalg.norm(np.diff(points, axis=0), axis=1) / LINE_DT
    assert speed[:3].max() < 0.1 * speed.max()
    assert speed.max() < 1.5 * delta.length


def test_another_assembly_mode_is_come_to_at_once_and_said(robot):
    bars = robot("five_bar")
    start, goal = list(cinegen.assembly_modes(bars))[:2]
    passed, trouble = gone(bars, start, goal, "tool")
    assert passed[-1].tolist() == goal.tolist()
    assert "moved there without a path" in trouble
    assert max(bars.closure(q) for q in passed) < 1e-9
    assert np.sort(steps(bars, passed))[-2] < LONGEST  # but for that one


def test_what_blocks_a_motion_along_a_line_at_its_end_is_said(robot):
    arm = robot("planar_3r")
    passed, _ = gone(arm, arm.q_home, arm.q_home + 0.4, "tool")
    moving, tick = LineMotion(arm, arm.q_home, arm.q_home + 0.4, "tool", LINE_DT), 0
    while moving.advance(LINE_DT) is not None:
        tick += 1
        if tick > len(passed) - 5:
            moving.block(passed[-5], "the wall")
    assert moving.problem == "the wall"


@pytest.mark.parametrize(("wrong", "words"), [(0.1, "open loops"), (None, "numbers")])
def test_what_can_not_be_is_said_and_nothing_moves(session, robot, wrong, words):
    session = session("delta4")
    delta = robot("delta4")
    q = delta.q_home + wrong if wrong is not None else delta.q_home[:-1]
    session.obey(MoveTo("delta4", "platform", tuple(q.tolist())))
    for _ in range(20):
        session.tick()
    assert words in session.state().notices[-1].text
    assert session.state().robots["delta4"].q == pytest.approx(delta.q_home)
    assert session.state().undo == 0
