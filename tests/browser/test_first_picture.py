"""The first pictures of a page, and what it shows where there is nothing to show."""

from __future__ import annotations

import pytest
import umsgpack
from playwright.sync_api import sync_playwright
from test_cockpit_page import CHROMIUM, FLAGS, READY, SIZE, becomes, picture

from cinegen.cockpit import Cockpit
from cinegen.page import build_page
from cinegen.session import Setup, arrange

# The server's drawing commands come a few at a time, as over a slow line. Kept of each picture: the extent of what is
# visible of the robot and the aids, and the labels that have no place yet.
SLOW_LINE = """
window.pictures = [];
const Fast = window.WebSocket;
window.WebSocket = class extends Fast {
  constructor(url) {
    super(url);
    if (!new URL(url).pathname.startsWith("/scene")) return;
    const waiting = [];
    this.addEventListener("message", (event) => waiting.push(event));
    const pass = () => {
      for (const event of waiting.splice(0, 5)) this.take(event);
      requestAnimationFrame(pass);
    };
    pass();
  }
  set onmessage(take) {
    this.take = take;
  }
};
let cockpit;
Object.defineProperty(window, "cockpit", {
  get: () => cockpit,
  set(value) {
    cockpit = value;
    const { view } = cockpit;
    const { viewer } = view;
    const render = viewer.render.bind(viewer);
    viewer.render = () => {
      render();
      const box = new MeshCat.THREE.Box3();
      for (const top of [view.root, view.stage]) {
        top.traverseVisible((object) => object.geometry && top.visible && box.expandByObject(object));
      }
      const size = box.isEmpty() ? 0 : box.getSize(new MeshCat.THREE.Vector3()).length();
      const labels = [...document.querySelectorAll(".labels:not([hidden]) .label:not([hidden])")];
      const unplaced = labels.filter(({ style }) => style.transform === "").map(({ textContent }) => textContent);
      window.pictures.push({ size, unplaced, commands: viewer.num_messages_received });
    };
  },
});
"""
WITHOUT_WEBGL = """
const context = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  return kind.includes("webgl") ? null : context.call(this, kind, ...rest);
};
"""
# Lengths in the scene of a metre of a mesh: of the driven part's, and of its copy at the target.
SCALES = """() => {
  const [{ robot, node }] = cockpit.state.tasks;
  const found = {};
  const look = (top, name) => top.traverse(({ geometry, matrixWorld }) => {
    if (geometry) (found[geometry.uuid] ??= {})[name] = new MeshCat.THREE.Vector3().setFromMatrixScale(matrixWorld).x;
  });
  look(cockpit.view.group(robot, node), "part");
  look(cockpit.view.stage, "copy");
  const { part = 0, copy = 0 } = Object.values(found).find(({ part, copy }) => part && copy) ?? {};
  return [part, copy];
}"""

pytestmark = [
    pytest.mark.browser,
    pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning"),
    pytest.mark.skipif(CHROMIUM is None, reason="NO CHROMIUM: the page is not tested in a real browser"),
]


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)


@pytest.fixture(scope="module")
def demo(robot):
    """The session of `cinegen demo`."""
    with Cockpit(arrange({"delta4": robot("delta4")}, follow="circle"), port=0, own_process=False) as cockpit:
        yield cockpit


@pytest.fixture
def tab(browser):
    """`tab(address, script)`: a page. What goes wrong in the page is an error here."""
    opened, wrong = [], []

    def open_tab(address, script="", ready=READY):
        page = browser.new_page(viewport=SIZE, bypass_csp=True)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.add_init_script(script)
        page.goto(address, timeout=60_000)
        page.wait_for_function(ready, polling=100, timeout=60_000)
        opened.append(page)
        return page

    yield open_tab
    for page in opened:
        page.close()
    assert wrong == []


@pytest.fixture(scope="module")
def pictures(demo, browser):
    """The first pictures of a page, of which one has a label."""
    page = browser.new_page(viewport=SIZE, bypass_csp=True)
    page.add_init_script(SLOW_LINE)
    page.goto(demo.url, timeout=60_000)
    page.wait_for_function(f"{READY} && cockpit.labels.all.size > 0", polling=100, timeout=60_000)
    picture(page, "first_picture")
    yield page.evaluate("pictures")
    page.close()


def test_nothing_is_ever_larger_than_the_robot_while_its_scene_comes(pictures):
    assert len({one["commands"] for one in pictures}) > 10
    assert max(one["size"] for one in pictures) < 2 * pictures[-1]["size"]


def test_no_label_is_shown_before_it_has_its_place(pictures):
    assert [one["unplaced"] for one in pictures if one["unplaced"]] == []


class Sent(dict):
    """A command that was sent, for another time."""

    def lower(self):
        return self


def test_the_copy_at_the_target_is_as_large_as_its_part_when_that_is_drawn_anew(demo, tab):
    page = tab(demo.url)
    assert becomes(page, lambda: page.evaluate(SCALES)[1] > 0.0)
    part, copy = page.evaluate(SCALES)
    assert copy == pytest.approx(part)
    above = "/meshcat/cinegen/:delta4/:platform/"
    sent = {
        path: umsgpack.unpackb(message)
        for (path, kind, _), message in demo.page.scene().items()
        if kind == "set_transform" and path.startswith(above)
    }
    for command in sent.values():
        demo.page.send(Sent({**command, "matrix": [3.0 * x for x in command["matrix"][:12]] + command["matrix"][12:]}))
    try:
        assert becomes(page, lambda: page.evaluate(SCALES) == pytest.approx([3.0 * part, 3.0 * part]))
    finally:
        for command in sent.values():
            demo.page.send(Sent(command))


def test_who_only_watches_is_told_how_to_drive(demo, tab):
    driver, watcher = tab(demo.url), tab(demo.url)
    driver.evaluate("cockpit.send({ type: 'request_control', on: true })")
    watcher.wait_for_function("document.documentElement.dataset.control === 'other'")
    watcher.press("body", "h")
    said = watcher.locator("#toasts .toast").first.inner_text()
    button = watcher.locator("#take-control")
    assert said == f"Another browser has control. {button.inner_text()} to drag and switch."
    button.click()  # what the message says
    watcher.wait_for_function("document.documentElement.dataset.control === 'mine'")


def test_a_lost_connection_is_the_status_and_the_title_is_that_of_the_session_that_is_found_again(robot, tab):
    setup = arrange({"planar_3r": robot("planar_3r")})
    with Cockpit(setup, port=0, own_process=False) as cockpit:
        page = tab(cockpit.url)
        page.wait_for_function("document.getElementById('status').dataset.tone === 'none'")
        page.evaluate("""() => {
          const chip = document.getElementById("status");
          window.shown = [];
          const note = () => shown.push([chip.textContent, chip.dataset.tone]);
          new MutationObserver(note).observe(chip, { attributes: true });
        }""")
        cockpit.title = "another robot"
        cockpit.server.call(lambda: [one.connection.close(1001, "cut") for one in cockpit.hub.clients.values()])
        page.wait_for_function("document.title === 'another robot'")
        assert page.inner_text("#title") == page.get_attribute("#title", "title") == "another robot"
        page.wait_for_function("document.getElementById('status').dataset.tone === 'none'")
        assert ["connection lost", "bad"] in page.evaluate("shown")
    page.wait_for_function("document.getElementById('status').dataset.status === 'LOST'")  # it stays so
    picture(page, "connection_lost")


@pytest.mark.parametrize("served", [True, False])
def test_a_browser_without_webgl_is_told_what_is_missing_and_what_helps(served, demo, robot, tab, tmp_path):
    if served:
        address = demo.url
    else:
        (tmp_path / "page.html").write_text(build_page(Setup({"planar_3r": robot("planar_3r")})))
        address = (tmp_path / "page.html").as_uri()
    page = tab(address, WITHOUT_WEBGL, "!document.getElementById('cover').hidden")
    picture(page, f"without_webgl_{'served' if served else 'file'}")
    assert "WebGL" in page.inner_text("#cover")
    assert "hardware acceleration" in page.inner_text("#cover")
    assert page.locator("button:visible, select:visible").count() == 0  # none would do anything
