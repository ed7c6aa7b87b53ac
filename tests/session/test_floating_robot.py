"""A robot with a floating base in a session: drags move it as a whole, pins hold what they pin."""

import bipeds
import numpy as np
import pytest
from leading import run

import cinegen
from cinegen.session import Session, arrange
from cinegen.session import commands as c


@pytest.fixture
def session(tmp_path, closing):
    path = tmp_path / "biped.urdf"
    path.write_text(bipeds.URDF)
    return lambda **options: closing(Session(arrange({"biped": cinegen.load(path, **options)})))


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
    state = run(one, 3.0).robots["biped"]
    assert state.status.name == "FOLLOWING"
    np.testing.assert_allclose(at(one, "trunk").translation, goal, atol=1e-7)
    for node, pose in feet.items():
        assert at(one, node).isApprox(pose, 1e-7)
    np.testing.assert_array_equal(run(one, 0.01, c.EndDrag()).robots["biped"].q, state.q)


def test_home_brings_the_base_back_too(session):
    one = session()
    trunk = at(one, "trunk")
    drag(one, "trunk", np.array([0.5, 0.2, 0.1]))
    run(one, 1.0)
    assert not at(one, "trunk").isApprox(trunk, 1e-3)
    run(one, 0.01, c.EndDrag())
    one.obey(c.MoveHome("biped"))
    while one.robots["biped"].motion is not None:
        one.tick()
    assert at(one, "trunk").isApprox(trunk, 1e-9)
