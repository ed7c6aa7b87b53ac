"""A newcomer without docs: each task takes three clicks at most, and hints come when they help."""

import numpy as np
from tabs import READY, becomes, find, grab, held, picture

MOST = 3


def done(page):
    """Return how many presses of the mouse a task took, and begin the next from the first screen."""
    presses = page.evaluate("presses")
    page.evaluate("cockpit.select(null, null)")
    if not page.evaluate("document.body.classList.contains('folded')"):
        page.click("#fold")
    page.evaluate("presses = 0")
    return presses


def test_each_task_takes_three_clicks_at_most(opened, tmp_path, monkeypatch):
    """Those that take one click, or open a tab and press one button, are in tests of their own."""
    monkeypatch.chdir(tmp_path)
    session, page = opened("delta4", follow=None)
    page.evaluate("window.presses = 0; addEventListener('pointerdown', () => { presses += 1; }, true)")
    presses = {}

    page.mouse.click(*find(page, "delta4", "link5")[:2])
    page.click("#pin")
    assert becomes(page, lambda: held(session, "delta4", "pin"))
    grab(page, session, "delta4", "link8")
    page.mouse.up()
    presses["pin a part and drag another"] = done(page)

    page.mouse.click(*find(page, "delta4", "link5")[:2])
    page.click("#turn")
    assert page.evaluate("cockpit.gizmo.mode") == "rotate"
    presses["rotate"] = done(page)

    page.click("#measure-mode")
    for node in ("link5", "link8"):
        page.mouse.click(*find(page, "delta4", node)[:2])
    assert becomes(page, lambda: page.inner_text("#measure-text").startswith("From"))
    presses["measure"] = done(page)
    page.keyboard.press("Escape")

    for button in ("#fold", "#tab-record", "#record"):
        page.click(button)
    assert becomes(page, lambda: session.state.recording is not None)
    assert becomes(page, "document.getElementById('record').ariaPressed === 'true'")
    presses["record"] = done(page)
    for task, button, condition in (
        ("end the recording", "#record", lambda: session.state.recording is None),
        ("save a waypoint", "#save-waypoint", lambda: len(session.state.waypoints) == 1),
        ("save another", "#save-waypoint", lambda: len(session.state.waypoints) == 2),
        ("replay", "#play-waypoints", lambda: session.state.waypoint is not None),
    ):
        page.click("#fold")  # the tab is remembered
        page.click(button)
        assert becomes(page, condition)
        presses[task] = done(page)
    assert {task: count for task, count in presses.items() if not 2 <= count <= MOST} == {}


VISIBLE = "[...document.querySelectorAll('.label:not([hidden])')].map((one) => one.textContent)"
COLOURS = """() => {
  const found = {};
  for (const { name } of cockpit.hello.robots[0].nodes) cockpit.view.group(cockpit.hello.robots[0].name, name).traverse(
    ({ material, uuid }) => { if (material?.color) found[uuid] = material.color.getHex(); });
  return found;
}"""


def test_one_label_says_why_it_stops_an_arc_shows_the_limit_and_no_part_is_repainted(opened):
    session, page = opened("delta4", follow=None)
    before = page.evaluate(COLOURS)
    assert page.evaluate(VISIBLE) == ["Drag any part"]
    x, y, *_ = grab(page, session, "delta4", "link5")
    page.mouse.move(x + 250, y - 200, steps=8)
    assert becomes(page, lambda: session.state.robots["delta4"].status.name == "AT_LIMIT")
    words = "at the limit of "
    assert becomes(page, lambda: page.inner_text("#status").startswith(words))
    assert becomes(page, lambda: [text.startswith(words) for text in page.evaluate(VISIBLE)] == [True])
    saturated = session.state.robots["delta4"].saturated
    shown = """cockpit.view.stage.children.filter((one) => one.visible && one.name.startsWith('limits '))
      .map((one) => one.name)"""
    assert becomes(page, lambda: {f"limits {joint}" for joint in saturated} <= set(page.evaluate(shown)))
    assert page.evaluate(COLOURS) == before
    picture(page, "limits")
    page.mouse.up()
    assert becomes(page, lambda: page.evaluate(shown) == [])
    assert becomes(page, lambda: page.inner_text("#hint").startswith("Undo takes it back"))


def test_the_base_is_fixed_and_says_so(opened):
    session, page = opened("delta4", follow=None)
    x, y, *_ = find(page, "delta4", "base")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y + 20, steps=4)
    assert becomes(page, lambda: "fixed" in page.evaluate(VISIBLE))
    assert not session.state.robots["delta4"].tasks
    page.mouse.up()
    assert becomes(page, lambda: "fixed" not in page.evaluate(VISIBLE))
    page.evaluate("cockpit.select('delta4', 'base')")
    page.focus("#scene canvas")
    page.keyboard.press("ArrowRight")
    assert becomes(page, lambda: "base is fixed" in page.inner_text("#toasts"))
    assert not session.state.robots["delta4"].tasks


def clock(page):
    """Give it a clock that runs as others do, and can be put forward."""
    page.clock.install()


def test_a_hand_shows_once_how_to_drag_and_moves_nothing(cockpit, tab):
    session = cockpit("delta4", follow=None)
    page, home = tab(session, prepare=clock, reduced_motion="no-preference"), session.state.robots["delta4"].q
    page.clock.pause_at(page.evaluate("Date.now() / 1000 + 3"))
    hand = "document.getElementById('hand') !== null"
    assert becomes(page, lambda: page.evaluate(hand) or page.clock.fast_forward(3000))
    page.clock.resume()
    page.clock.fast_forward(2600)
    assert becomes(page, "document.getElementById('hand') === null")
    assert (session.state.robots["delta4"].q == home).all()
    assert page.evaluate("document.documentElement.dataset.control") == "free"
    assert session.state.undo == 0
    assert page.evaluate("localStorage.getItem('cinegen.hints')") == '["hand"]'
    still = tab(session, prepare=clock, reduced_motion="reduce", viewport={"width": 500, "height": 400})
    still.clock.fast_forward(4000)
    assert still.evaluate("localStorage.getItem('cinegen.hints')") is None
    still.emulate_media(reduced_motion="no-preference")
    still.goto(f"{session.url}&camera=1")  # frames of a film
    assert becomes(still, READY)
    still.clock.fast_forward(4000)
    assert still.evaluate("localStorage.getItem('cinegen.hints')") is None


def test_the_toolbar_stands_beside_its_part_hides_it_and_looks_at_it(opened):
    _, page = opened("arm7")
    where = find(page, "arm7", "link4")
    page.mouse.click(*where[:2])
    assert becomes(page, lambda: page.is_visible("#selection"))
    box, pane = page.locator("#selection").bounding_box(), page.locator("#pane").bounding_box()
    assert abs(box["x"] + box["width"] / 2 - where[0]) < 0.4 * pane["width"]
    for side, size in (("x", "width"), ("y", "height")):
        assert pane[side] <= box[side] <= box[side] + box[size] <= pane[side] + pane[size]
    page.click("#look")
    middle = page.evaluate("""() => {
      const { Box3, Vector3 } = MeshCat.THREE;
      const box = new Box3().setFromObject(cockpit.view.group("arm7", "link4"));
      return box.getCenter(new Vector3()).project(cockpit.viewer.camera).toArray();
    }""")
    assert np.abs(middle[:2]).max() < 0.1  # of half the view
    page.click("#hide")
    assert not page.is_visible("#selection")
    seen = "cockpit.view.group('arm7', 'link4').visible"
    assert page.evaluate(seen) is False
    x, y, *_ = where
    assert page.evaluate("([x, y]) => cockpit.pick.touched({ clientX: x, clientY: y })?.node", [x, y]) != "link4"
    page.click(".toast button")
    assert page.evaluate(seen) is True


def test_a_slider_lights_its_part_and_a_part_its_slider(opened):
    _, page = opened("arm7")
    lit = """() => {
      let most = 0;
      cockpit.view.group("arm7", "link3").traverse(({ material }) => {
        if (material?.emissive) most = Math.max(most, material.emissive.b);
      });
      return most;
    }"""
    dark = page.evaluate(lit)
    page.click("#fold")
    row = page.locator("[data-joint='arm7/joint3']")
    row.hover()
    assert becomes(page, lambda: page.evaluate(lit) > dark)
    x, y, *_ = find(page, "arm7", "link3")
    page.mouse.move(x, y)
    assert becomes(page, lambda: "lit" in row.get_attribute("class"))


def touch(line, kind, *points):
    line.send(
        "Input.dispatchTouchEvent",
        {"type": kind, "touchPoints": [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)]},
    )


def test_fingers_two_rotate_the_view_or_beside_the_robot_shift_it_one_that_rests_selects_and_one_drags(cockpit, tab):
    session = cockpit("delta4", follow=None)
    page = tab(session, viewport={"width": 390, "height": 844}, has_touch=True)
    x, y, *_ = find(page, "delta4", "link5")
    line = page.context.new_cdp_session(page)

    def seen():
        *eye, a, b, c = page.evaluate("cockpit.view.cameraNumbers()")
        return np.array(eye) - [a, b, c], np.array([a, b, c])

    for left, top, shifts in ((x, y, False), (20.0, 300.0, True)):
        offset, middle = seen()
        touch(line, "touchStart", (left, top))
        for step in range(6):
            kind = "touchMove" if step else "touchStart"
            touch(line, kind, (left + 8 * step, top), (left + 60 + 8 * step, top - 80))
        touch(line, "touchEnd")
        assert (np.linalg.norm(seen()[1] - middle) > 1e-3) == shifts
        assert (np.linalg.norm(seen()[0] - offset) > 1e-3) != shifts
    assert not session.state.robots["delta4"].tasks
    assert not page.is_visible("#selection")
    x, y, *_ = find(page, "delta4", "link5")
    touch(line, "touchStart", (x, y))
    assert becomes(page, lambda: page.is_visible("#selection"))
    touch(line, "touchEnd")
    assert page.is_visible("#selection")
    touch(line, "touchStart", (x, y))
    for step in range(1, 8):
        touch(line, "touchMove", (x + 3 * step, y + 3 * step))
    assert becomes(page, lambda: held(session, "delta4"))
    touch(line, "touchEnd")
    assert becomes(page, lambda: not session.state.robots["delta4"].tasks)
    sizes = page.evaluate("""() => [...document.querySelectorAll("button")].filter((one) => one.checkVisibility())
      .map((one) => [one.id, one.offsetWidth, one.offsetHeight]).filter(([, wide, high]) => wide < 44 || high < 44)""")
    assert sizes == []
    picture(page, "phone_toolbar")
