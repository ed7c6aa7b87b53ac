"""Two hands at one session: two pointers drag two parts, or two points of one part; each begins and ends by itself."""

import numpy as np
import pinocchio as pin
import pytest
from leading import run

from cinegen.session import commands as c

pytestmark = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")


def at(session, name, node, point=(0.0, 0.0, 0.0)):
    return session.robots[name].placement(node).act(np.array(point))


def test_two_pointers_drag_two_robots_and_each_ends_by_itself(session):
    one = session("delta4", "rx90")
    goals = {"delta4": np.array([0.05, 0.0, -0.1]), "rx90": np.array([-0.05, 0.04, -0.06])}
    nodes = {"delta4": "platform", "rx90": "tool"}
    for pointer, name in enumerate(goals):
        goals[name] += at(one, name, nodes[name])
        one.obey(c.StartDrag(name, nodes[name], (0, 0, 0), pointer=pointer))
        one.obey(c.MoveDrag(tuple(goals[name]), pointer=pointer))
    state = run(one, 1.0)
    for name, goal in goals.items():
        assert np.linalg.norm(at(one, name, nodes[name]) - goal) < 1e-6
    assert state.robots["delta4"].closure < 1e-11
    state = run(one, 0.01, c.EndDrag(pointer=0))
    assert [len(state.robots[name].tasks) for name in goals] == [0, 1]
    further = goals["rx90"] + [0.0, 0.0, 0.03]
    state = run(one, 0.5, c.MoveDrag((9.0, 9.0, 9.0), pointer=0), c.MoveDrag(tuple(further), pointer=1))
    assert np.linalg.norm(at(one, "delta4", "platform") - goals["delta4"]) < 1e-6  # its drag has ended
    assert np.linalg.norm(at(one, "rx90", "tool") - further) < 1e-6
    assert run(one, 0.01, c.EndDrag()).robots["rx90"].tasks == ()  # all of them


def test_two_pointers_on_one_part_rotate_it(session):
    """Targets of a rigid motion (0.3 rad about the tool's z): two points and their distance determine it but for a
    rotation about the line through both."""
    one = session("rx90")
    points = np.array([[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]])
    goal = one.robots["rx90"].placement("tool") * pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.3])), np.zeros(3))
    for pointer, point in enumerate(points):
        one.obey(c.StartDrag("rx90", "tool", tuple(point), pointer=pointer))
        one.obey(c.MoveDrag(tuple(goal.act(point)), pointer=pointer))
    state = run(one, 1.5)
    assert [(task.source, task.node) for task in state.robots["rx90"].tasks] == [("pointer", "tool")] * 2
    for point in points:
        assert np.linalg.norm(at(one, "rx90", "tool", point) - goal.act(point)) < 1e-6
    line = one.robots["rx90"].placement("tool").rotation[:, 0]
    assert np.linalg.norm(line - goal.rotation[:, 0]) < 1e-6


def test_both_drags_are_one_undo_step(session):
    one = session("delta4", "rx90")
    home = {name: robot.q for name, robot in one.state().robots.items()}
    for pointer, (name, node) in enumerate((("delta4", "platform"), ("rx90", "tool"))):
        goal = at(one, name, node) + np.array([0.03, 0.0, -0.03])
        one.obey(c.StartDrag(name, node, (0, 0, 0), pointer=pointer))
        one.obey(c.MoveDrag(tuple(goal), pointer=pointer))
    run(one, 0.5)
    run(one, 0.2, c.EndDrag(pointer=1))
    state = run(one, 0.1, c.EndDrag(pointer=0))
    assert state.undo == 1
    assert all(np.abs(state.robots[name].q - home[name]).max() > 1e-3 for name in home)
    state = run(one, 2.0, c.Undo())
    assert all(np.abs(state.robots[name].q - home[name]).max() < 1e-9 for name in home)
