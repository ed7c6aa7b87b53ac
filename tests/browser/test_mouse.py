"""A mouse drags a part of a robot, in a real browser that shows the real page."""

from __future__ import annotations

import shutil
import threading

import numpy as np
import pytest
from playwright.sync_api import sync_playwright

from cinegen.show import Driven, Page, Scene, drive

CHROMIUM = shutil.which("chromium")
FLAGS = [
    *("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
SIZE = {"width": 500, "height": 350}
READY = "window.viewer && viewer.hand && viewer.hand.root.children.length > 0"
# Where on the screen (pixels) a node can be touched, and what is touched there in the robots' own metres.
WHERE = """([robot, node]) => {
  const THREE = MeshCat.THREE, hand = viewer.hand, box = viewer.renderer.domElement.getBoundingClientRect();
  let found = null;
  hand.root.getObjectByName(robot).getObjectByName(node).traverse((object) => {
    if (!object.isMesh || found !== null) return;
    object.geometry.computeBoundingBox();
    const { min, max } = object.geometry.boundingBox;
    for (const part of [0.5, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9]) { // along its diagonal, until it is not hidden
      const seen = object.localToWorld(min.clone().lerp(max, part)).project(viewer.camera);
      const clientX = Math.round(box.left + (seen.x + 1) / 2 * box.width);
      const clientY = Math.round(box.top + (1 - seen.y) / 2 * box.height);
      const hit = hand.touched({ clientX, clientY });
      if (hit !== null && hit.robot === robot && hit.node === node) {
        found = [clientX, clientY, ...hand.root.worldToLocal(hit.point.clone()).toArray()];
        return;
      }
    }
  });
  return found;
}"""

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(CHROMIUM is None, reason="NO CHROMIUM: the hand is not tested in a real browser"),
]


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)


@pytest.fixture
def opened(browser, robot):
    """`opened("delta4", "hybrid")`: a tab that shows these robots, and what drives each; they stand still."""
    over, threads = threading.Event(), []

    def open_page(*names):
        mechanisms = {name: robot(name) for name in names}
        page = Page()
        scene = Scene(page, mechanisms)
        driven = {name: Driven.still(mechanism) for name, mechanism in mechanisms.items()}

        def report(*_):
            if over.is_set():
                raise KeyboardInterrupt  # what ends a drive

        url = page.serve(port=8300)
        threads.append(threading.Thread(target=drive, args=(scene, driven, 300.0, report), daemon=True))
        threads[-1].start()
        tab = browser.new_page(viewport=SIZE)
        tab.goto(url)
        tab.wait_for_function(READY, polling=100, timeout=60_000)
        return tab, driven

    yield open_page
    over.set()
    for thread in threads:
        thread.join(20)


def becomes(tab, condition):
    """Whether it comes true within 30 s."""
    return any(condition() or tab.wait_for_timeout(50) for _ in range(600))


@pytest.mark.parametrize(
    ("names", "name", "node"),
    [
        (("delta4",), "delta4", "link5"),  # the platform
        (("delta4",), "delta4", "link8"),  # a forearm
        (("hybrid",), "hybrid", "link11"),
        (("five_bar", "four_bar"), "four_bar", "link2"),
    ],
)
def test_a_part_follows_the_mouse(opened, names, name, node):
    tab, driven = opened(*names)
    one = driven[name]
    x, y, *before = tab.evaluate(WHERE, [name, node])
    tab.mouse.move(x, y)
    assert becomes(tab, lambda: tab.inner_text("#hand") == node)  # it says what would be taken
    tab.mouse.down()
    assert becomes(tab, lambda: one.hand is not None)
    assert (one.hand.robot, one.hand.node) == (name, node)
    grabbed = np.array(one.hand.point)
    at = one.mechanism.placement(one.solver.q, node).act(grabbed)
    assert np.linalg.norm(at - before) < 0.5 * one.mechanism.length  # on its surface
    for i in range(1, 6):
        tab.mouse.move(x + 3 * i, y + 2 * i)
    assert becomes(tab, lambda: one.hand.target is not None)
    tab.wait_for_timeout(500)
    wanted = np.array(one.hand.target) - at
    assert becomes(tab, lambda: one.step is not None and np.abs(one.step.v).max() < 1e-3)  # as near as it can be
    moved = one.mechanism.placement(one.solver.q, node).act(grabbed) - at
    assert moved @ wanted > 0.1 * (wanted @ wanted)  # the right way
    assert one.step.closure <= 1e-10
    tab.mouse.up()
    assert becomes(tab, lambda: one.pull is None)
    for other in set(driven) - {name}:
        assert np.array_equal(driven[other].solver.q, driven[other].mechanism.q_home)


def test_escape_lets_go_and_beside_the_robot_the_view_turns(opened):
    tab, driven = opened("delta4")
    one = driven["delta4"]
    x, y, *_ = tab.evaluate(WHERE, ["delta4", "link5"])
    tab.mouse.move(x, y)
    tab.mouse.down()
    assert becomes(tab, lambda: one.hand is not None)
    tab.keyboard.press("Escape")
    assert becomes(tab, lambda: one.hand is None)
    tab.mouse.up()
    before = tab.evaluate("viewer.camera.matrixWorld.toArray()")
    tab.mouse.move(10, SIZE["height"] - 60)
    tab.mouse.down()
    tab.mouse.move(60, SIZE["height"] - 80, steps=4)
    tab.mouse.up()
    assert becomes(tab, lambda: tab.evaluate("viewer.camera.matrixWorld.toArray()") != before)
    assert one.hand is None
