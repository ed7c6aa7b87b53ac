"""A newcomer without docs: each task takes three clicks at most, and hints come when they help."""

import numpy as np
from tabs import READY, becomes, find, grab, held, picture, rests

MOST = 3


class Hand:
    """A mouse that counts its clicks."""

    def __init__(self, page):
        self.page, self.clicks = page, 0

    def press(self, selector):
        self.page.click(selector)
        self.clicks += 1

    def point(self, name, node):
        self.page.mouse.click(*find(self.page, name, node)[:2])
        self.clicks += 1

    def done(self):
        """Return how many clicks the task took, and begin the next from the first screen."""
        clicks, self.clicks = self.clicks, 0
        self.page.evaluate("cockpit.select(null, null)")
        if not self.page.evaluate("document.body.classList.contains('folded')"):
            self.page.click("#fold")
        return clicks


def test_each_task_takes_three_clicks_at_most(opened, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    session, page = opened("delta4", follow=None)
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    hand, clicks = Hand(page), {}
    robot, home = session.state.robots["delta4"], session.state.robots["delta4"].q

    grab(page, session, "delta4", "link5")
    page.mouse.up()
    rests(page, session)
    clicks["drag"] = hand.done()
    hand.press("#undo")
    assert becomes(page, lambda: np.abs(session.state.robots["delta4"].q - home).max() < 1e-9)
    clicks["undo"] = hand.done()

    hand.point("delta4", "link5")
    hand.press("#pin")
    assert becomes(page, lambda: held(session, "delta4", "pin"))
    clicks["pin a part and drag another"] = hand.done()
    grab(page, session, "delta4", "link8")
    page.mouse.up()

    hand.point("delta4", "link5")
    hand.press("#turn")
    assert page.evaluate("cockpit.gizmo.mode") == "rotate"
    clicks["rotate"] = hand.done()

    hand.press("#fold")
    hand.press("[data-lock='delta4/joint1']")
    assert becomes(page, lambda: session.state.robots["delta4"].locked == ("joint1",))
    clicks["lock a joint"] = hand.done()

    hand.press("#measure-mode")
    hand.point("delta4", "link5")
    hand.point("delta4", "link8")
    assert becomes(page, lambda: page.inner_text("#measure-text").startswith("From"))
    clicks["measure"] = hand.done()
    page.keyboard.press("Escape")

    hand.press("#fold")
    hand.press("#tab-record")
    hand.press("#record")
    assert becomes(page, lambda: session.state.recording is not None)
    assert becomes(page, "document.getElementById('record').ariaPressed === 'true'")
    clicks["record"] = hand.done()
    hand.press("#fold")  # the tab is remembered
    hand.press("#record")
    assert becomes(page, lambda: session.state.recording is None)
    clicks["end the recording"] = hand.done()
    for saved in (1, 2):
        hand.press("#fold")
        hand.press("#save-waypoint")
        assert becomes(page, lambda saved=saved: len(session.state.waypoints) == saved)
        clicks[f"save waypoint {saved}"] = hand.done()
    hand.press("#fold")
    hand.press("#play-waypoints")
    assert becomes(page, lambda: session.state.waypoint is not None)
    clicks["replay"] = hand.done()

    hand.press("#fold")
    hand.press("#tab-record")
    hand.press("#copy-link")
    assert becomes(page, lambda: "copied" in page.inner_text("#toasts"))
    clicks["share"] = hand.done()
    assert {task: count for task, count in clicks.items() if count > MOST} == {}
    assert clicks["drag"] == 0
    assert robot.closure < 1e-9


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


def show_hand(page):
    """Put the clock forward until the hand is shown: it stays until time goes on."""
    page.clock.pause_at(page.evaluate("Date.now() / 1000 + 3"))
    hand = "document.getElementById('hand') !== null"
    assert becomes(page, lambda: page.evaluate(hand) or page.clock.fast_forward(3000))


def test_a_hand_shows_once_how_to_drag_and_moves_nothing(cockpit, tab):
    session = cockpit("delta4", follow=None)
    page, home = tab(session, prepare=clock, reduced_motion="no-preference"), session.state.robots["delta4"].q
    show_hand(page)
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


def test_the_hand_drags_a_ghost_of_what_is_at_the_end_while_the_robot_moves(cockpit, tab):
    """Not the whole screw of a SCARA; its place is the moving robot's, a bit aside."""
    page = tab(cockpit("scara", follow="circle"), prepare=clock, reduced_motion="no-preference")
    show_hand(page)
    height, away = page.evaluate("""() => {
      const { Box3, Vector3 } = MeshCat.THREE, { view, hello: { robots: [{ name, end, length }] } } = cockpit;
      const ghost = view.stage.children.find((one) => one.name === "hand");
      const local = ghost.clone();
      local.position.set(0, 0, 0);
      local.quaternion.identity();
      const away = view.pose(name, "link5").position.distanceTo(ghost.position);
      return [new Box3().setFromObject(local).getSize(new Vector3()).z / length, away / length];
    }""")
    assert height < 0.3
    assert away < 0.2


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
