"""A robot with a floating base in a session: drags move it as a whole, pins hold what they pin."""

from __future__ import annotations

import bipeds
import numpy as np
import pytest

import cinegen
from cinegen.session import Session, arrange
from cinegen.session import commands as c

DT = 1e-3


@pytest.fixture(params=["urdf", "xml"])
def session(request, tmp_path):
    opened = []

    def open_session(**options):
        path = tmp_path / f"biped.{request.param}"
        path.write_text(bipeds.URDF if request.param == "urdf" else bipeds.MJCF)
        opened.append(Session(arrange({"biped": cinegen.load(path, **options)})))
        return opened[-1]

    yield open_session
    for one in opened:
        one.close()


def run(session, seconds, *commands):
    for command in commands:
        session.obey(command)
    for _ in range(round(seconds / DT)):
        session.tick()
    return session.state().robots["biped"]


def drag(session, node, by):
    """Drag a node, with its orientation, by a vector (m); return where it should be."""
    goal = session.robots["biped"].placement(node).translation + by
    session.obey(c.StartDrag("biped", node, None, rotation=True))
    session.obey(c.MoveDrag(tuple(goal)))
    return goal


def at(session, node):
    return session.robots["biped"].placement(node)


def test_pinned_feet_stay_where_they_are_while_the_trunk_is_dragged(session):
    one = session()
    feet = {node: at(one, node) for node in bipeds.FEET}
    for node in bipeds.FEET:
        one.obey(c.Pin("biped", node))
    goal = drag(one, "trunk", np.array([0.03, 0.02, -0.1]))
    state = run(one, 3.0)
    assert state.status.name == "FOLLOWING"
    np.testing.assert_allclose(at(one, "trunk").translation, goal, atol=1e-7)
    for node, pose in feet.items():
        assert at(one, node).isApprox(pose, 1e-7)
    np.testing.assert_array_equal(run(one, 0.01, c.EndDrag()).q, state.q)


def test_a_hand_takes_the_robot_along_unless_its_base_is_loaded_as_fixed(session):
    far = np.array([1.5, 0.0, 0.5])
    free, held = session(), session(fixed_base=True)
    for one, reaches in ((free, True), (held, False)):
        trunk, goal = at(one, "trunk"), drag(one, "hand", far)
        run(one, 3.0)
        gap = np.linalg.norm(at(one, "hand").translation - goal)
        assert bool(gap < 1e-6) is reaches
        assert at(one, "trunk").isApprox(trunk, 1e-12) is (not reaches)


def test_home_brings_the_base_back_too(session):
    one = session()
    trunk = at(one, "trunk")
    drag(one, "trunk", np.array([0.5, 0.2, 0.1]))
    run(one, 1.0)
    assert not at(one, "trunk").isApprox(trunk, 1e-3)
    run(one, 0.01, c.EndDrag())
    run(one, 40.0, c.MoveHome("biped"))
    assert at(one, "trunk").isApprox(trunk, 1e-9)
