"""A person with a headset at the real page: an emulated one in a real browser drives real sessions."""

import numpy as np
import pytest
from headset import Headset, needs_emulator
from tabs import becomes, grab, held, place, rests

RIGHT, LEFT = (0.15, 1.35, -0.3), (-0.16, 1.03, -0.6)
POINT = (0.1, 0.2, 0.3)
EXACT = 2e-5  # m: a task that follows, of robots of a metre or more

pytestmark = needs_emulator


@pytest.fixture
def page_with_headset(tab):
    """`page_with_headset(cockpit)`: a page, and the headset that its browser has."""

    def opened(session):
        headsets = []
        page = tab(session, prepare=lambda page: headsets.append(Headset(page)))
        return page, *headsets

    return opened


@pytest.fixture
def worn(cockpit, page_with_headset):
    """`worn("delta4")`: a robot's session, its page, and a headset that shows it, with both controllers in front."""

    def open_worn(*names):
        session = cockpit(*names, follow=None)
        page, headset = page_with_headset(session)
        headset.enter()
        headset.put("right", RIGHT)
        headset.put("left", LEFT)
        return session, page, headset

    return open_worn


def grasp(session, page, headset, side, name, node, strength=0.75, button="trigger"):
    """Point at a node and press a button; the task, once there is one."""
    headset.aim(side, name, node)
    before = {task.id for task in held(session, name)}
    headset.press(side, strength, button)
    assert becomes(page, lambda: {task.id for task in held(session, name)} - before)
    return next(task for task in held(session, name) if task.id not in before)


def test_a_controller_takes_a_part_drags_it_and_lets_it_go_and_the_page_comes_back(cockpit, page_with_headset):
    session = cockpit("delta4", follow=None)
    page, headset = page_with_headset(session)
    appearance = "[cockpit.viewer.scene.matrix.toArray(), cockpit.viewer.camera.matrixWorld.toArray(), \
        cockpit.viewer.renderer.domElement.width, cockpit.viewer.scene.background.getHex()]"
    page.evaluate("cockpit.view.setCamera(cockpit.view.cameraNumbers())")  # as a person who moves it
    before = page.evaluate(appearance)
    headset.enter()
    assert page.get_attribute("html", "data-headset") == "immersive-vr"
    headset.put("right", RIGHT)
    task = grasp(session, page, headset, "right", "delta4", "link5")
    start = place(session, "delta4", "link5", task.offset.translation)
    assert task.weight == pytest.approx(2.0)  # three quarters pressed: 4 ** 0.5
    headset.press("right", 0.25)
    assert becomes(page, lambda: held(session, "delta4")[0].weight == 0.5)
    headset.put("right", np.add(RIGHT, [0.03, 0.02, 0.02]))  # in the room, y is up, and the user looks along -z
    expected = start + np.array([0.03, -0.02, 0.02]) / headset.scale()  # z is up

    def off():
        return np.linalg.norm(place(session, "delta4", "link5", task.offset.translation) - expected)

    assert becomes(page, lambda: off() < EXACT)
    assert session.state.robots["delta4"].closure < 1e-10
    assert becomes(page, lambda: headset.panel()["label"] == "following")
    headset.press("right", 0.0)
    assert becomes(page, lambda: not held(session, "delta4"))
    rests(page, session, 1e-7)
    assert off() < EXACT
    page.evaluate("cockpit.presentation.end()")
    assert becomes(page, lambda: page.get_attribute("html", "data-headset") is None)
    assert becomes(page, lambda: np.allclose(np.hstack(page.evaluate(appearance)), np.hstack(before), atol=1e-9))
    grab(page, session, "delta4", "link5")  # by the mouse


@pytest.mark.slow
def test_two_hands_that_hold_the_world_scale_and_rotate_it(worn):
    angle = 0.4
    _, page, headset = worn("five_bar")
    before = headset.scale(), headset.at(POINT)
    for side, x in (("left", -0.1), ("right", 0.1)):
        page.evaluate(f"device.controllers.{side}.quaternion.set(0.7071, 0, 0, 0.7071)")  # they point at the sky
        headset.put(side, (x, 1.2, -0.4))
        headset.press(side, 1.0)
    assert page.evaluate("cockpit.state.tasks.length") == 0
    grips = "cockpit.presentation.hands.all.map((hand) => hand.grip.toArray())"
    first = np.array(page.evaluate(grips))
    for side, way in (("left", -1.0), ("right", 1.0)):
        headset.put(side, (0.2 * way * np.cos(angle), 1.2, -0.4 - 0.2 * way * np.sin(angle)))
    after = headset.scale()
    last = np.array(page.evaluate(grips))
    was, now = (complex(*(ends[1] - ends[0])[[0, 2]]) for ends in (first, last))  # in the horizontal plane
    assert abs(now / was) == pytest.approx(2.0, rel=0.05)  # the grips are beside the origins of the rays
    assert after == pytest.approx(abs(now / was) * before[0], rel=1e-6)
    shift = now / was * complex(*(before[1] - first[0])[[0, 2]])  # what was between the hands stays there
    height = abs(now / was) * (before[1] - first.mean(axis=0))[1]
    expected = last[0][0] + shift.real, last.mean(axis=0)[1] + height, last[0][2] + shift.imag
    assert headset.at(POINT) == pytest.approx(expected, abs=1e-6)
    for side in ("left", "right"):
        headset.press(side, 0.0)
    headset.put("left", LEFT)
    assert headset.scale() == after


@pytest.mark.slow
def test_one_user_has_a_browser_and_one_a_headset(worn, tab):
    session, page, headset = worn("delta4")
    seated = tab(session)
    assert not seated.is_visible("#enter-vr")
    assert not seated.is_visible("#enter-ar")
    assert session.hub.rate == pytest.approx(90.0)
    task = grasp(session, page, headset, "right", "delta4", "link5")
    headset.put("right", np.add(RIGHT, [0.0, -0.03, 0.0]))
    rests(page, session, 1e-7)
    shown = "cockpit.state.tasks.map((task) => task.position).flat()"
    at = place(session, "delta4", "link5", task.offset.translation)
    assert becomes(seated, lambda: np.allclose(seated.evaluate(shown), at, atol=1e-6))
    assert seated.get_attribute("html", "data-control") == "other"
    seated.click("#take-control")
    assert becomes(page, lambda: page.get_attribute("html", "data-control") == "other")
    assert becomes(page, lambda: not held(session, "delta4"))
    headset.press("right", 0.0)
    headset.aim("right", "delta4", "link5")
    headset.press("right", 1.0)
    assert "Press A or X to take it" in headset.panel()["lines"][1]
    assert not held(session, "delta4")
    headset.press("right", 0.0)
    headset.press("right", 1.0, "a-button")
    assert becomes(page, lambda: page.get_attribute("html", "data-control") == "mine")
    headset.press("right", 0.0, "a-button")
    grasp(session, page, headset, "right", "delta4", "link5")
    page.evaluate("cockpit.presentation.end()")
    assert becomes(seated, lambda: not held(session, "delta4"))  # who takes off the headset lets go
    assert becomes(seated, lambda: session.hub.rate == 60.0)


@pytest.mark.slow
def test_a_hand_pinches_parts_and_the_room_is_behind_them_in_augmented_reality(cockpit, page_with_headset):
    session = cockpit("five_bar", follow=None)
    page, headset = page_with_headset(session)
    page.evaluate("device.primaryInputMode = 'hand'")
    headset.enter("ar")
    assert page.get_attribute("html", "data-headset") == "immersive-ar"
    assert page.evaluate("cockpit.viewer.scene.background") is None
    headset.put("right", RIGHT, hand=True)
    headset.aim("right", "five_bar", "link4")
    page.evaluate("device.hands.right.updatePinchValue(1)")
    assert becomes(page, lambda: held(session, "five_bar"))
    assert held(session, "five_bar")[0].weight == 1.0  # a pinch has no strength
    page.evaluate("device.hands.right.updatePinchValue(0)")
    assert becomes(page, lambda: not held(session, "five_bar"))
    page.evaluate("cockpit.presentation.end()")
    assert becomes(page, lambda: page.evaluate("cockpit.viewer.scene.background !== null"))
