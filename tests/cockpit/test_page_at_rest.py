"""What pages are sent: nothing while nothing moves, and little while something does."""

import numpy as np
import pytest
from browsers import Browser, becomes

from cinegen.cockpit.build_messages import NodePoses, hello_message, state_message
from cinegen.cockpit.page_state import moving_rows, page_state, shown_of
from cinegen.session import Session, arrange
from cinegen.session import commands as c

LARGEST = 1000
"""Bytes of a state of a Gough platform that is dragged."""


@pytest.fixture
def cockpit(cockpit):
    return cockpit("gough")


@pytest.fixture
def page(cockpit):
    """A page at rest."""
    page = Browser(cockpit.url, path="page")
    assert becomes(lambda: page.report and page.report["rate"]["at_rest"])
    return page


def test_pages_are_sent_nothing_at_rest_and_programs_the_time(cockpit):
    pages, program = [Browser(cockpit.url, path="page") for _ in range(2)], Browser(cockpit.url)
    assert becomes(lambda: all(browser.report and browser.report["rate"]["at_rest"] for browser in pages))
    received, time = [browser.received for browser in pages], program.state["time"]
    assert becomes(lambda: program.state["time"] > time + 1.0)
    assert [browser.received for browser in pages] == received


def test_pages_at_rest_see_at_once_who_has_control_and_who_is_there(cockpit, page):
    other = Browser(cockpit.url, path="page")
    assert becomes(lambda: other.told)
    other.say("request_control", on=True)
    assert becomes(lambda: page.state["controller"] == other.told[0]["client"])
    other.say("set_user", name="Ada", colour=1)
    assert becomes(lambda: [user["name"] for user in page.users] == ["Ada"])
    other.leave()
    assert becomes(lambda: page.state["controller"] is None and page.users == [])


def test_reactions_that_are_asked_for_at_rest_come(page):
    assert page.report["robots"]["gough"]["reactions"] is None
    page.say("request_reactions", on=True)
    assert becomes(lambda: page.report["robots"]["gough"]["reactions"])
    page.say("request_control", on=True)
    assert becomes(lambda: page.state["controller"] is not None)


def test_a_drag_from_rest_is_seen_by_pages(page):
    page.say("start_drag", robot="gough", node="platform", point=[0, 0, 0])
    assert becomes(lambda: page.state["tasks"])
    x, y, z = page.state["tasks"][0]["position"]
    page.say("move_drag", position=[x, y, z - 0.05])
    assert becomes(lambda: page.state["tasks"][0]["position"][2] == pytest.approx(z - 0.05, abs=1e-6))


@pytest.mark.parametrize("name", ["gough", "planetary_gear", "sr400"])
def test_a_page_gets_the_poses_of_all_nodes(robot, name):
    """Those that a state has and those that follow from placements are where Pinocchio has them."""
    mechanism = robot(name)
    setup = arrange({name: mechanism})
    session, poses, hello = Session(setup), NodePoses(setup.robots), hello_message(setup, "", 1)
    session.obey(c.StartDrag(name, mechanism.end, (0.01, 0.0, 0.0)))
    session.obey(c.MoveDrag((0.1, 0.2, 0.5)))
    for _ in range(50):
        session.tick()
    state = state_message(session.state(), poses, {})
    message = page_state(state, shown_of(state, moving_rows(hello)))
    packed = message[8 + int.from_bytes(message[4:8], "little") :]
    sent = np.frombuffer(packed, [("position", "<f4", 3), ("turn", "<i2", 4)])
    rows = np.array(state.poses[name]).reshape(-1, 7)
    (description,) = hello.robots
    moving = [0, *(i for i, node in enumerate(description.nodes, 1) if node.joint is not None)]
    assert sent["position"] == pytest.approx(rows[moving, :3], abs=1e-6)
    assert sent["turn"] / 32767 == pytest.approx(rows[moving, 3:], abs=2e-5)
    expected = poses.of(name, session.robots[name].q)
    for node in description.nodes:
        if node.placement is not None:
            above = expected[node.parent] if node.parent else None
            relative = expected[node.name] if above is None else above.actInv(expected[node.name])
            assert relative.translation == pytest.approx(node.placement[:3], abs=1e-8)


def test_a_state_of_a_platform_that_is_dragged_is_small(robot):
    mechanism = robot("gough")
    setup = arrange({"gough": mechanism})
    session, rows = Session(setup), moving_rows(hello_message(setup, "", 1))
    session.obey(c.StartDrag("gough", "platform", (0.01, 0.02, 0.0)))
    session.obey(c.MoveDrag((0.05, 0.03, 1.0)))
    for _ in range(100):
        session.tick()
    state = state_message(session.state(), NodePoses(setup.robots), {})
    assert len(state.tasks) == 1
    assert len(page_state(state, shown_of(state, rows))) <= LARGEST
