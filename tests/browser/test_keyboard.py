"""A person without a pointer: keys select, move and rotate parts, and what happens is announced."""

import numpy as np
import pinocchio as pin
from tabs import becomes, held, place

FOCUSED = """() => {
  const { activeElement: one } = document;
  const { outlineStyle, outlineWidth } = getComputedStyle(one);
  const where = one.closest("header, #scene, #selection, #panel, footer");
  return one === document.body ? null : {
    where: where?.id || where?.tagName, name: one.id || one.textContent || one.getAttribute("aria-label"),
    ring: outlineStyle !== "none" && parseFloat(outlineWidth) >= 2,
  };
}"""


def announced(page):
    return page.locator("#announcer p").all_inner_texts()


def test_arrow_keys_move_a_part_and_are_undone(opened):
    session, page = opened("delta4", follow=None)
    home = session.state.robots["delta4"].q
    page.locator("#scene canvas").focus()
    page.keyboard.press("Shift+N")  # the last part
    assert becomes(page, lambda: "platform" in page.inner_text("#selection"))
    start = place(session, "delta4", "platform")
    step = 0.02  # m: a hundredth of the characteristic length, 4.04 m, down to 1, 2 or 5 times a power of ten
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    page.keyboard.press("Alt+ArrowUp")
    assert becomes(page, lambda: held(session, "delta4"))
    page.keyboard.press("Shift+ArrowDown")
    page.keyboard.press("PageDown")
    wanted = start + step * np.array([3.0, 0.1, -2.0])
    assert becomes(page, lambda: np.abs(place(session, "delta4", "platform") - wanted).max() < 1e-4)
    x, y, z = (f"{'minus ' if value < 0 else ''}{abs(1000 * value):.1f} millimetres" for value in wanted)
    assert becomes(page, lambda: f"platform: x {x}, y {y}, z {z}" in announced(page))  # the keys rest: the drag ends
    assert becomes(page, lambda: not session.state.robots["delta4"].tasks)
    assert session.state.robots["delta4"].closure < 1e-10
    assert session.state.undo == 1  # all of it is one step
    page.keyboard.press("Control+z")
    assert becomes(page, lambda: np.abs(session.state.robots["delta4"].q - home).max() < 1e-9)
    page.keyboard.down("ArrowRight")
    assert becomes(page, lambda: held(session, "delta4"))
    page.keyboard.press("Escape")
    assert becomes(page, lambda: not session.state.robots["delta4"].tasks)
    page.keyboard.up("ArrowRight")
    page.keyboard.press("Escape")  # selects nothing: arrows rotate the view
    before = page.evaluate("cockpit.viewer.camera.matrixWorld.toArray()")
    page.keyboard.press("ArrowLeft")
    assert becomes(page, lambda: page.evaluate("cockpit.viewer.camera.matrixWorld.toArray()") != before)
    page.keyboard.press(" ")
    assert becomes(page, lambda: session.state.paused)
    assert not session.state.robots["delta4"].tasks


def test_rotations_and_the_order_of_focus_without_a_server(robot, tab, page_of):
    mechanism = robot("rx90")
    page = tab(page_of("rx90"))
    page.keyboard.press("t")
    order = []
    for _ in range(80):
        page.keyboard.press("Tab")
        order.append(page.evaluate(FOCUSED))
        if order[-1] is None:
            break
    assert order[-1] is None  # the focus leaves the page
    assert [stop["name"] for stop in order[:-1] if not stop["ring"]] == []
    where = [stop["where"] for stop in order[:-1]]
    assert list(dict.fromkeys(where)) == ["bar", "scene", "panel"]
    page.evaluate("cockpit.select('rx90', 'tool')")
    page.keyboard.press("w")  # the arrow keys are the scene's
    assert page.evaluate(FOCUSED)["where"] == "scene"
    start = mechanism.placement(mechanism.q_home, "tool")
    for _ in range(4):
        page.keyboard.press("Control+ArrowUp")
    page.keyboard.press("ArrowLeft")

    def has_come():
        end = mechanism.placement(np.array(page.evaluate("cockpit.report.robots.rx90.q")), "tool")
        turn, way = pin.log3(end.rotation @ start.rotation.T), end.translation - start.translation
        off = np.abs([turn - [0.0, np.radians(8.0), 0.0], way - [-0.005, 0.0, 0.0]]).max()
        return off < 1e-4 and page.evaluate("cockpit.state.tasks.length === 0")

    assert becomes(page, has_come)
    assert any("rotated by 8.0 degrees about y" in text for text in announced(page))
