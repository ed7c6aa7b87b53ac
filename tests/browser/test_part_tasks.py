"""Tasks that a hand gives at the real page: a part stays upright, looks at another, or is pinned to another."""

import numpy as np
import pinocchio as pin
import pytest
import two_armed
from tabs import becomes, find, grab, picture, place, rests

import cinegen
from cinegen.session import arrange


@pytest.fixture
def duo(cockpit):
    return cockpit(setup=arrange({"duo": cinegen.load(two_armed.URDF)}))


def pose(duo, node):
    return duo.setup.robots["duo"].placement(duo.state.robots["duo"].q, node)


def described(duo):
    return [task.description.__struct_config__.tag for task in duo.state.robots["duo"].described]


def select(page, node):
    page.mouse.click(*find(page, "duo", node)[:2])
    assert becomes(page, f"document.querySelector('#selection .name').textContent === '{node}'")


def drag(page, duo, node, by):
    """Drag a part that is selected, which is so again afterwards."""
    page.keyboard.press("Escape")  # the gizmo is in front of it
    x, y, _ = grab(page, duo, "duo", node)
    for part in np.linspace(0.2, 1.0, 5):
        page.mouse.move(x + part * by[0], y + part * by[1])
        page.wait_for_timeout(60)
    rests(page, duo)
    page.mouse.up()
    select(page, node)


def test_parts_stay_upright_look_at_others_and_are_pinned_together_by_the_mouse(duo, tab):
    page = tab(duo)
    select(page, "left_hand")
    page.click("#info")  # stays open
    page.click("#pin-to")
    assert page.inner_text("#choosing").startswith("Click the part that left_hand is pinned to")
    picture(page, "part_tasks_choosing")
    page.mouse.click(*find(page, "duo", "right_hand")[:2])
    assert becomes(page, lambda: described(duo) == ["relative_pose"])
    before, at = pose(duo, "right_hand").actInv(pose(duo, "left_hand")), place(duo, "duo", "left_hand")
    drag(page, duo, "left_hand", (-30, 70))
    now = pose(duo, "right_hand").actInv(pose(duo, "left_hand"))
    assert np.linalg.norm(place(duo, "duo", "left_hand") - at) > 0.02
    assert np.abs(pin.log6(before.actInv(now)).vector).max() < 1e-6
    chip = page.locator("#selection [data-described]")
    assert becomes(page, lambda: chip.inner_text() == "left_hand pinned to right_hand")
    picture(page, "part_tasks_pinned")
    chip.locator("button").click()
    assert becomes(page, lambda: described(duo) == [] and chip.count() == 0)

    page.click("#stay-upright")
    assert becomes(page, "document.getElementById('stay-upright').ariaPressed === 'true'")
    up = pose(duo, "left_hand").rotation[2]
    drag(page, duo, "left_hand", (-20, 40))
    assert pose(duo, "left_hand").rotation[2] == pytest.approx(up, abs=1e-6)
    page.click("#stay-upright")
    assert becomes(page, lambda: described(duo) == [] and chip.count() == 0)  # the buttons don't move any more

    page.click("#look-at")
    page.keyboard.press("Escape")
    assert not page.is_visible("#choosing")
    page.click("#look-at")
    x, y, *point = find(page, "duo", "right_hand")
    on_hand = pose(duo, "right_hand").actInv(np.array(point))
    page.mouse.click(x, y)
    assert becomes(page, lambda: duo.state.robots["duo"].described[:1] and duo.state.robots["duo"].described[0].reached)
    hand = pose(duo, "left_hand")
    away = pose(duo, "right_hand").act(on_hand) - hand.translation
    assert np.cross(hand.rotation[:, 2], away / np.linalg.norm(away)) == pytest.approx(np.zeros(3), abs=2e-3)
    picture(page, "part_tasks_looking")
    page.click("#undo")
    assert becomes(page, lambda: described(duo) == [] and chip.count() == 0)
    page.click("#pin-to")
    page.evaluate("cockpit.select('duo', 'right4')")  # as keys and the panel do
    assert becomes(page, lambda: described(duo) == ["relative_pose"])
    assert page.inner_text("#selection .name") == "left_hand"


def test_a_page_without_a_server_has_no_such_buttons(tab, page_of):
    page = tab(page_of("delta4"))
    page.evaluate("cockpit.select('delta4', 'platform')")
    assert page.is_visible("#pin")
    page.click("#info")
    assert page.is_visible("#axes")
    assert not any(page.is_visible(button) for button in ("#stay-upright", "#look-at", "#pin-to"))
    page.evaluate("cockpit.send({ type: 'add_task', robot: 'delta4', description: { kind: 'damping' } })")
    assert becomes(page, "document.getElementById('toasts').textContent.includes(\"can't do 'add_task'\")")
