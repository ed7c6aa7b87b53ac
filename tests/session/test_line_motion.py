"""Robots go to configurations as a person would drag them."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import cinegen
from cinegen.session import Session, Setup
from cinegen.session.commands import MoveTo
from cinegen.session.motion import LineMotion

DT = 2e-3
ROOM = {"delta4": 0.4, "arm7": 0.5}  # rad or lengths that motors go, on one branch
LONGEST = 0.02  # rad or lengths that a joint goes in a tick: nothing jumps


def gone(mechanism, q, goal, node):
    """All configurations on the way, and what there was to say."""
    visit, passed = LineMotion(mechanism, q, goal, node, DT), [q]
    while (here := visit.advance(DT)) is not None:
        passed.append(here)
        assert len(passed) < 60.0 / DT
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
    points = np.array([delta.placement(one, "platform").translation for one in passed])
    along = (end - start) / np.linalg.norm(end - start)
    aside = (points - start) - np.outer((points - start) @ along, along)
    assert np.linalg.norm(aside, axis=1).max() < 1e-3 * delta.length
    speed = np.linalg.norm(np.diff(points, axis=0), axis=1) / DT
    assert speed[:3].max() < 0.1 * speed.max()
    assert speed.max() < 1.5 * delta.length


def test_another_assembly_mode_is_come_to_at_once_and_said(robot):
    bars = robot("five_bar")
    here, there = list(cinegen.assembly_modes(bars))[:2]
    passed, trouble = gone(bars, here, there, "tool")
    assert passed[-1].tolist() == there.tolist()
    assert "moved there without a path" in trouble
    assert max(bars.closure(q) for q in passed) < 1e-9
    assert np.sort(steps(bars, passed))[-2] < LONGEST  # but for that one


@pytest.mark.parametrize(("wrong", "words"), [(0.1, "open loops"), (None, "numbers")])
def test_what_can_not_be_is_said_and_nothing_moves(robot, wrong, words):
    delta = robot("delta4")
    session = Session(Setup({"delta4": delta}))
    q = delta.q_home + wrong if wrong is not None else delta.q_home[:-1]
    session.obey(MoveTo("delta4", "platform", tuple(q.tolist())))
    for _ in range(20):
        session.tick()
    assert words in session.state().notices[-1].text
    assert session.state().robots["delta4"].q == pytest.approx(delta.q_home)
    assert session.state().undo == 0
    session.close()
