"""The first pictures of a page, and what it shows where there is nothing to show."""

from __future__ import annotations

import pytest
import umsgpack
from tabs import IN_BROWSER, READY, becomes, find, grab, picture

from cinegen.cockpit import Cockpit
from cinegen.session import arrange

# The server's messages come a few at a time, as over a slow line. Kept of each picture: the extent of what is
# visible of the robot and the aids, and the labels that have no place yet.
SLOW_LINE = """
window.pictures = [];
const Fast = window.WebSocket;
window.WebSocket = class extends Fast {
  constructor(url) {
    super(url);
    const waiting = [];
    super.addEventListener("message", (event) => waiting.push(event));
    const pass = () => {
      for (const event of waiting.splice(0, 5)) this.take(event);
      requestAnimationFrame(pass);
    };
    pass();
  }
  addEventListener(type, take) {
    if (type === "message") this.take = take;
    else super.addEventListener(type, take);
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

pytestmark = IN_BROWSER


@pytest.fixture(scope="module")
def demo(robot):
    """The session of `cinegen demo`."""
    with Cockpit(arrange({"delta4": robot("delta4")}, follow="circle"), port=0, own_process=False) as cockpit:
        yield cockpit


def test_while_its_scene_comes_nothing_is_larger_than_the_robot_and_no_label_is_without_its_place(demo, tab):
    page = tab(demo, SLOW_LINE, f"{READY} && cockpit.labels.all.size > 0")
    picture(page, "first_picture")
    pictures = page.evaluate("pictures")
    assert len({one["commands"] for one in pictures}) > 10
    assert max(one["size"] for one in pictures) < 2 * pictures[-1]["size"]
    assert [one["unplaced"] for one in pictures if one["unplaced"]] == []


class Sent(dict):
    """A command that was sent, for another time."""

    def lower(self):
        return self


def test_the_copy_at_the_target_is_as_large_as_its_part_when_that_is_drawn_anew(demo, tab):
    page = tab(demo)
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


def test_a_lost_connection_is_the_status_until_the_session_is_found_again(robot, tab):
    with Cockpit(arrange({"five_bar": robot("five_bar")}), port=0, own_process=False) as cockpit:
        page = tab(cockpit, strict=False)
        assert becomes(page, "document.getElementById('status').dataset.tone === 'none'")
        where = find(page, "five_bar", "link2")
        page.evaluate("""() => {
          const chip = document.getElementById("status");
          window.shown = [];
          const note = () => shown.push([chip.textContent, chip.dataset.tone]);
          new MutationObserver(note).observe(chip, { attributes: true });
        }""")
        cockpit.title = "another robot"
        cockpit.server.call(lambda: [one.connection.close(1001, "cut") for one in cockpit.hub.clients.values()])
        assert becomes(page, "document.title === 'another robot'")
        assert page.inner_text("#title") == page.get_attribute("#title", "title") == "another robot"
        assert becomes(page, "document.getElementById('status').dataset.tone === 'none'")
        assert ["connection lost", "bad"] in page.evaluate("shown")
        assert find(page, "five_bar", "link2") == where  # all is drawn again
        grab(page, cockpit, "five_bar", "link2")  # it can be driven as before
        page.mouse.up()
    assert becomes(page, "document.getElementById('status').dataset.status === 'LOST'")  # it stays so
    picture(page, "connection_lost")


def test_a_browser_without_webgl_is_told_what_is_missing_and_what_helps(demo, tab):
    page = tab(demo, WITHOUT_WEBGL, "!document.getElementById('cover').hidden", strict=False)
    picture(page, "without_webgl")
    assert "WebGL" in page.inner_text("#cover")
    assert "hardware acceleration" in page.inner_text("#cover")
    assert page.locator("button:visible, select:visible").count() == 0  # none would do anything
