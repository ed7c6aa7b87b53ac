"""The first pictures of a page, and what it shows where there is nothing to show."""

import numpy as np
import pytest
import umsgpack
from tabs import becomes, find, grab, picture

from cinegen.cockpit import Cockpit
from cinegen.session import arrange

# The server's drawing commands come a few at a time, as over a slow line. Kept of each picture that is visible: its
# pixels, made small, and its labels with their places.
SLOW_LINE = """
window.pictures = [];
let cockpit;
const waiting = [];
let commands = 0;
Object.defineProperty(window, "cockpit", {
  get: () => cockpit,
  set(value) {
    cockpit = value;
    const { view } = cockpit;
    const { viewer } = view;
    view.resolution.constant = true; // all are drawn alike
    const take = viewer.handle_command_message.bind(viewer);
    viewer.handle_command_message = (message) => waiting.push(message);
    const pass = () => {
      for (const message of waiting.splice(0, 5)) take(message);
      requestAnimationFrame(pass);
    };
    pass();
    const render = viewer.render.bind(viewer);
    viewer.render = () => {
      commands = viewer.num_messages_received;
      render();
      if (getComputedStyle(view.pane).visibility !== "visible") return;
      const copy = Object.assign(document.createElement("canvas"), { width: 45, height: 28 }).getContext("2d");
      copy.imageSmoothingQuality = "high";
      copy.drawImage(view.canvas, 0, 0, 45, 28);
      const { data } = copy.getImageData(0, 0, 45, 28);
      const shown = [...document.querySelectorAll(".labels:not([hidden]) .label:not([hidden])")];
      const labels = shown.map(({ textContent, style }) => [textContent, style.transform]);
      window.pictures.push({ data: [...data], labels });
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

# Whether nothing was drawn in thirty frames.
RESTS = """() => new Promise((done) => {
  const before = pictures.length;
  let frames = 30;
  const next = () => (frames-- ? requestAnimationFrame(next) : done(before > 0 && pictures.length === before));
  next();
})"""

FAR = 20.0
"""Difference of a pixel that is made of 400, of 255: a small part that is missing."""


@pytest.fixture(scope="module")
def demo(robot):
    """The session of `cinegen demo`."""
    with Cockpit(arrange({"delta4": robot("delta4")}, follow="circle"), port=0, own_process=False) as cockpit:
        yield cockpit


def assert_pictures_are_settled(page):
    """Every picture that was seen is the last one, when nothing moves any more."""
    assert becomes(page, RESTS)
    pictures = page.evaluate("pictures")
    assert [frame["labels"] for frame in pictures] == [pictures[-1]["labels"]] * len(pictures)
    assert all(place for _, place in pictures[-1]["labels"])
    settled = np.array(pictures[-1]["data"], dtype=float)
    assert np.ptp(settled) > 100.0
    for frame in pictures:
        assert np.abs(np.array(frame["data"]) - settled).max() < FAR


def test_every_picture_that_is_seen_has_all_of_the_robot_where_it_stays(cockpit, tab):
    page = tab(cockpit("delta4"), SLOW_LINE, drawn=True, reduced_motion="reduce")
    assert_pictures_are_settled(page)
    picture(page, "first_picture")


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
    moves = ((path, message) for (path, kind, _), message in demo.page.scene().items() if kind == "set_transform")
    sent = [umsgpack.unpackb(message) for path, message in moves if path.startswith(above)]
    for command in sent:
        demo.page.send(Sent({**command, "matrix": [3.0 * x for x in command["matrix"][:12]] + command["matrix"][12:]}))
    try:
        assert becomes(page, lambda: page.evaluate(SCALES) == pytest.approx([3.0 * part, 3.0 * part]))
    finally:
        for command in sent:
            demo.page.send(Sent(command))


def test_a_lost_connection_is_the_status_until_the_session_is_found_again(robot, tab):
    with Cockpit(arrange({"five_bar": robot("five_bar")}), port=0, own_process=False) as cockpit:
        page = tab(cockpit, strict=False)
        assert becomes(page, "document.getElementById('status').dataset.tone === 'none'")
        where = find(page, "five_bar", "link4")
        page.evaluate("""() => {
          const chip = document.getElementById("status");
          window.shown = [];
          const note = () => shown.push([chip.textContent, chip.dataset.tone]);
          new MutationObserver(note).observe(chip, { attributes: true });
        }""")
        cockpit.title = "another robot"
        cockpit.server.call(lambda: [client.connection.close(1001, "cut") for client in cockpit.hub.clients.values()])
        assert becomes(page, "document.title === 'another robot'")
        assert page.inner_text("#title") == page.get_attribute("#title", "title") == "another robot"
        assert becomes(page, "document.getElementById('status').dataset.tone === 'none'")
        assert ["connection lost", "bad"] in page.evaluate("shown")
        assert find(page, "five_bar", "link4") == where  # all is drawn again
        grab(page, cockpit, "five_bar", "link4")  # it can be driven as before
        page.mouse.up()
    assert becomes(page, "document.getElementById('status').dataset.status === 'LOST'")  # it stays so
    picture(page, "connection_lost")


def test_a_browser_without_webgl_is_told_what_is_missing_and_what_helps(demo, tab):
    page = tab(demo, WITHOUT_WEBGL, "!document.getElementById('cover').hidden", strict=False)
    picture(page, "without_webgl")
    assert "WebGL" in page.inner_text("#cover")
    assert "hardware acceleration" in page.inner_text("#cover")
    assert page.locator("button:visible, select:visible").count() == 0  # none would do anything
