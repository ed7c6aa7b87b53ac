"""A chromium, and what people do at the page of a cockpit."""

import os
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

CHROMIUM = shutil.which("chromium")
FLAGS = [
    *("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run"),
    *("--disable-gpu-rasterization", "--disable-gpu-compositing"),  # the software renderer draws scenes, not texts
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
IN_BROWSER = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="NO CHROMIUM: pages are not tested in a real browser"),
]
SIZE = {"width": 900, "height": 560}
PICTURES = os.environ.get("CINEGEN_PICTURES")
"""Folder for pictures of pages, for people to look at; none are taken, and few pages draw, unless it is given."""
READY = "document.documentElement.dataset.view === 'ready' && Boolean(window.cockpit?.report)"
# The software renderer takes half of all time: scenes are as always, but for their pixels.
UNDRAWN = """
for (const { prototype } of [WebGLRenderingContext, WebGL2RenderingContext]) {
  prototype.drawArrays = prototype.drawElements = () => {};
}
"""
# Where on the screen (pixels) a node can be touched, and what is touched there in the world's metres.
WHERE = """([robot, node]) => {
  const box = cockpit.viewer.renderer.domElement.getBoundingClientRect();
  const at = (x, y) => cockpit.pick.touched({ clientX: box.left + x, clientY: box.top + y });
  const is = (hit) => hit !== null && hit.robot === robot && hit.node === node;
  const { Box3, Vector3 } = MeshCat.THREE;
  const { min, max } = new Box3().setFromObject(cockpit.view.group(robot, node));
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) =>
    new Vector3(i & 1 ? min.x : max.x, i & 2 ? min.y : max.y, i & 4 ? min.z : max.z).project(cockpit.viewer.camera));
  const across = corners.map(({ x }) => (x + 1) / 2 * box.width);
  const down = corners.map(({ y }) => (1 - y) / 2 * box.height);
  const left = Math.max(12, Math.ceil(Math.min(...across))), right = Math.min(box.width, Math.max(...across));
  const top = Math.max(12, Math.ceil(Math.min(...down))), bottom = Math.min(box.height, Math.max(...down));
  for (const [room, step] of [[9, 6], [5, 6], [2, 2], [0, 1]]) { // a part may be seen between others only
    for (let y = top; y < bottom; y += step) for (let x = left; x < right; x += step) {
      const hit = at(x, y);
      if (is(hit) && [[-1, 0], [1, 0], [0, -1], [0, 1]].every(([a, b]) => is(at(x + room * a, y + room * b)))) {
        return [box.left + x, box.top + y, ...cockpit.root.worldToLocal(hit.point.clone()).toArray()];
      }
    }
  }
  return null;
}"""
# The pixels of two points of the world.
PIXELS = """([from, to]) => [from, to].map((point) => {
  const seen = cockpit.root.localToWorld(new MeshCat.THREE.Vector3(...point)).project(cockpit.viewer.camera);
  const box = cockpit.viewer.renderer.domElement.getBoundingClientRect();
  return [(seen.x + 1) / 2 * box.width, (1 - seen.y) / 2 * box.height];
})"""


def becomes(page, condition, seconds=60.0):
    """Whether it comes true in time: a function, or JavaScript, asked from outside since the page refuses `eval`."""
    last = time.monotonic() + seconds
    while not (page.evaluate(condition) if isinstance(condition, str) else condition()):
        if time.monotonic() > last:
            return False
        page.wait_for_timeout(30)
    return True


def tools(page, tab):
    """Open the drawer on a tab, as a person does."""
    if page.evaluate("document.body.classList.contains('folded')"):
        page.click("#fold")
    page.click(f"#tab-{tab}")


def place(cockpit, name, node, point=(0.0, 0.0, 0.0)):
    if name in cockpit.state.obstacles:
        return cockpit.state.obstacles[name].pose.act(np.array(point))
    robot = cockpit.state.robots[name]
    return (robot.base * cockpit.setup.robots[name].placement(robot.q, node)).act(np.array(point))


def held(cockpit, name, who="pointer"):
    state = cockpit.state
    owner = state.obstacles[name] if name in state.obstacles else state.robots[name]
    return [task for task in owner.tasks if task.source == who]


def picture(page, name):
    """Kept for people to look at, if they want to."""
    if PICTURES:
        page.screenshot(path=Path(PICTURES, f"{name}.png"))


def find(page, name, node):
    """Where a part that stands still can be touched, as `WHERE` says, once it is drawn there."""
    spots = [None]

    def stays():
        spots.append(page.evaluate(WHERE, [name, node]))
        return spots[-1] is not None and spots[-1] == spots[-2]

    assert becomes(page, stays), f"{node} of {name} can't be seen"
    return spots[-1]


def grab(page, cockpit, name, node):
    """Presses on a part and draws it a little; where it was touched, in pixels and as the task has it."""
    x, y, *point = find(page, name, node)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 6, y + 4)
    assert becomes(page, lambda: held(cockpit, name))
    return x, y, np.array(point)


def rests(page, cockpit, accuracy=1e-6):
    """Wait until no robot moves."""

    def same():
        before = {name: robot.q for name, robot in cockpit.state.robots.items()}
        page.wait_for_timeout(150)
        return all(np.abs(robot.q - before[name]).max() <= accuracy for name, robot in cockpit.state.robots.items())

    assert becomes(page, same)
