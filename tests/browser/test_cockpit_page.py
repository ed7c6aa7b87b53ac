"""A person at the real page: a mouse and keys in a real browser drive real sessions."""

from __future__ import annotations

import math
import os
import shutil
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from playwright.sync_api import sync_playwright
from variants import slow

import cinegen
from cinegen.cockpit import Cockpit
from cinegen.collision import scene_of
from cinegen.dynamics import Payload
from cinegen.mission.results import record_modes
from cinegen.session import arrange, replay_setup, scene_setup
from cinegen.session.state import CarriedMass

CHROMIUM = shutil.which("chromium")
FLAGS = [
    *("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run"),
    *("--disable-gpu-rasterization", "--disable-gpu-compositing"),  # the software renderer draws scenes, not texts
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
SIZE = {"width": 900, "height": 560}
PICTURES = Path(os.environ.get("CINEGEN_PICTURES", "build/pictures"))
READY = "document.documentElement.dataset.view === 'ready' && window.cockpit.report"
# Where on the screen (pixels) a node can be touched, and what is touched there in the world's metres.
WHERE = """([robot, node]) => {
  const box = cockpit.viewer.renderer.domElement.getBoundingClientRect();
  const at = (x, y) => cockpit.pick.touched({ clientX: box.left + x, clientY: box.top + y });
  const is = (hit) => hit !== null && hit.robot === robot && hit.node === node;
  for (const [room, step] of [[9, 6], [5, 6], [2, 2], [0, 1]]) { // a part may be seen between others only
    for (let y = 12; y < box.height; y += step) for (let x = 12; x < box.width; x += step) {
      const hit = at(x, y);
      if (is(hit) && [[-1, 0], [1, 0], [0, -1], [0, 1]].every(([a, b]) => is(at(x + room * a, y + room * b)))) {
        return [box.left + x, box.top + y, ...cockpit.root.worldToLocal(hit.point.clone()).toArray()];
      }
    }
  }
  return null;
}"""

pytestmark = [
    pytest.mark.browser,
    pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning"),
    pytest.mark.skipif(CHROMIUM is None, reason="NO CHROMIUM: the cockpit is not tested in a real browser"),
]


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)


@pytest.fixture
def cockpit(robot):
    """`cockpit("delta4")`: its session runs in a thread; a process of its own takes two seconds of CPU to start."""
    opened = []

    def open_cockpit(*names, **options):
        setup = arrange({name: robot(name) for name in names}, **options)
        opened.append(Cockpit(setup, port=8300, own_process=False))
        return opened[-1]

    yield open_cockpit
    for one in opened:
        one.close()


@pytest.fixture
def tab(browser):
    """`tab(cockpit)`: a page that shows it. What goes wrong in the page is an error here."""
    opened, wrong = [], []

    def open_tab(cockpit, script=""):
        page = browser.new_page(viewport=SIZE, bypass_csp=True)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.add_init_script(script)
        page.goto(cockpit.url, timeout=60_000)
        page.wait_for_function(READY, polling=100, timeout=60_000)
        opened.append(page)
        return page

    yield open_tab
    for page in opened:
        page.close()
    assert wrong == []


def becomes(tab, condition, seconds=30.0):
    """Whether it comes true in time."""
    last = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > last:
            return False
        tab.wait_for_timeout(50)
    return True


def place(cockpit, name, node, point=(0.0, 0.0, 0.0)):
    if name in cockpit.state.obstacles:
        return cockpit.state.obstacles[name].pose.act(np.array(point))
    robot = cockpit.state.robots[name]
    return (robot.base * cockpit.setup.robots[name].placement(robot.q, node)).act(np.array(point))


def held(cockpit, name, who="pointer"):
    state = cockpit.state
    owner = state.obstacles[name] if name in state.obstacles else state.robots[name]
    return [task for task in owner.tasks if task.source == who]


def picture(tab, name):
    """Kept for people to look at."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    tab.screenshot(path=PICTURES / f"{name}.png")


def find(tab, name, node):
    """Where a part that stands still can be touched, as `WHERE` says, once it is drawn there."""
    found = [None]

    def stays():
        found.append(tab.evaluate(WHERE, [name, node]))
        return found[-1] is not None and found[-1] == found[-2]

    assert becomes(tab, stays), f"{node} of {name} can't be seen"
    return found[-1]


def grab(tab, cockpit, name, node):
    """Presses on a part and draws it a little; where it was touched, in pixels and as the task has it."""
    x, y, *point = find(tab, name, node)
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(x + 6, y + 4)
    assert becomes(tab, lambda: held(cockpit, name))
    return x, y, np.array(point)


PIXELS = """([from, to]) => [from, to].map((point) => {
  const seen = cockpit.root.localToWorld(new MeshCat.THREE.Vector3(...point)).project(cockpit.viewer.camera);
  const box = cockpit.viewer.renderer.domElement.getBoundingClientRect();
  return [(seen.x + 1) / 2 * box.width, (1 - seen.y) / 2 * box.height];
})"""


def easiest(cockpit, name, node, at):
    """The way that a point of a node moves most easily, in the world (all joints by finite differences)."""
    mechanism, q = cockpit.setup.robots[name], cockpit.state.robots[name].q
    motions = np.eye(mechanism.model.nv)
    if mechanism.loops:
        motions = np.linalg.svd(mechanism.system.evaluate(q)[1])[2][mechanism.loop_rank :].T
    step = 1e-6
    moved = [pin.integrate(mechanism.model, q, step * motion * mechanism.scale) for motion in motions.T]
    here = mechanism.placement(q, node).act(at)
    rates = np.array([(mechanism.placement(there, node).act(at) - here) / step for there in moved])
    return np.linalg.svd(rates)[2][0]


@pytest.mark.parametrize(
    ("names", "name", "node"),
    [
        (("delta4",), "delta4", "link5"),  # the platform
        *slow(
            (("five_bar", "four_bar"), "four_bar", "link2"),
            (("delta4",), "delta4", "link8"),  # a forearm
            (("delta4",), "delta4", "link6"),  # an upper arm: its elbow
            (("hybrid",), "hybrid", "link11"),
        ),
    ],
)
def test_a_part_follows_the_mouse(cockpit, tab, names, name, node):
    one = cockpit(*names)
    page = tab(one)
    before = {other: robot.q for other, robot in one.state.robots.items()}
    x, y, touched = grab(page, one, name, node)
    (task,) = held(one, name)
    assert task.node == node
    start = place(one, name, node, task.offset.translation)
    assert np.linalg.norm(touched - start) < 0.3 * one.setup.robots[name].length
    way = easiest(one, name, node, task.offset.translation)
    near, far = np.array(page.evaluate(PIXELS, [start.tolist(), (start + way * 1e-2).tolist()]))
    way_seen = (far - near) / np.linalg.norm(far - near)
    for i in range(1, 6):
        page.mouse.move(x + 6 + 5 * i * way_seen[0], y + 4 + 5 * i * way_seen[1])
    page.wait_for_timeout(500)

    def rests():
        earlier = one.state.robots[name].q
        page.wait_for_timeout(100)
        return np.abs(one.state.robots[name].q - earlier).max() < 1e-6

    assert becomes(page, rests)
    (task,) = held(one, name)
    wanted = task.target.translation - start
    moved = place(one, name, node, task.offset.translation) - start
    assert moved @ wanted > 0.1 * wanted @ wanted  # the right way
    assert np.linalg.norm(wanted - moved) < np.linalg.norm(wanted)
    assert one.state.robots[name].closure < 1e-10
    picture(page, f"drag_{name}_{node}")
    page.mouse.up()
    assert becomes(page, lambda: not one.state.robots[name].tasks)
    for other in set(names) - {name}:
        assert np.array_equal(one.state.robots[other].q, before[other])
    # and what has happened is undone
    page.keyboard.press("Control+z")
    assert becomes(page, lambda: np.abs(one.state.robots[name].q - before[name]).max() < 1e-9)
    page.keyboard.press("Control+Shift+z")
    assert becomes(page, lambda: one.state.undo == 1 and one.state.moving is None)


def test_a_click_selects_the_gizmo_moves_it_and_a_pin_holds_it(cockpit, tab):
    one = cockpit("delta4")
    page = tab(one)
    x, y, *_ = find(page, "delta4", "link5")
    page.mouse.click(x, y)
    assert becomes(page, lambda: page.is_visible("#selection") and "link5" in page.inner_text("#selection"))
    picture(page, "gizmo")
    start = place(one, "delta4", "link5")
    # the arrow along z, where the gizmo draws it
    arrow = page.evaluate("""() => {
      const { viewer, gizmo: { handles } } = cockpit;
      const box = viewer.renderer.domElement.getBoundingClientRect();
      const arrows = [];
      handles.drawn.traverse((object) => {
        if (object.name === "Z" && object.visible && object.geometry.type === "ConeGeometry") arrows.push(object);
      });
      let best = null;
      for (const handle of arrows) {
        handle.geometry.computeBoundingSphere();
        const at = handle.localToWorld(handle.geometry.boundingSphere.center.clone()).project(viewer.camera);
        const pixel = [box.left + (at.x + 1) / 2 * box.width, box.top + (1 - at.y) / 2 * box.height];
        if (best === null || pixel[1] < best[1]) best = pixel;
      }
      return best;
    }""")
    assert arrow is not None
    page.mouse.move(*arrow)
    page.wait_for_timeout(300)
    page.mouse.down()
    page.mouse.move(arrow[0], arrow[1] + 12, steps=4)
    page.mouse.move(arrow[0], arrow[1] + 30, steps=6)
    assert becomes(page, lambda: held(one, "delta4"))
    assert becomes(page, lambda: place(one, "delta4", "link5")[2] < start[2] - 0.02)
    page.keyboard.press("p")
    assert becomes(page, lambda: held(one, "delta4", "pin"))
    page.mouse.up()
    moved = place(one, "delta4", "link5") - start
    assert np.abs(moved[:2]).max() < 0.1 * abs(moved[2])
    number = held(one, "delta4", "pin")[0].id
    page.click(f"[data-task='{number}'] button")
    assert becomes(page, lambda: not one.state.robots["delta4"].tasks)


RING = """([axis, from, to, steps]) => {
  const { viewer, gizmo: { handles } } = cockpit;
  const box = viewer.renderer.domElement.getBoundingClientRect();
  let ring = null;
  handles.drawn.traverse((object) => {
    if (object.isMesh && object.name === axis && object.geometry.type === "TorusGeometry") ring = object;
  });
  ring.updateWorldMatrix(true, false);
  return Array.from({ length: steps + 1 }, (_, i) => {
    const angle = from + ((to - from) * i) / steps;
    const at = ring.position.clone().set(0.85 * Math.cos(angle), 0.85 * Math.sin(angle), 0);
    at.applyMatrix4(ring.matrixWorld).project(viewer.camera);
    return [box.left + ((at.x + 1) / 2) * box.width, box.top + ((1 - at.y) / 2) * box.height];
  });
}"""


def test_a_ring_of_the_gizmo_rotates_by_the_angle_that_the_pointer_goes_around_it(cockpit, tab):
    one = cockpit("arm7")
    page = tab(one)
    page.evaluate("cockpit.select('arm7', 'tool')")
    page.keyboard.press("e")
    assert becomes(page, lambda: page.evaluate("cockpit.gizmo.mode") == "rotate" and page.is_visible("#selection"))
    path = page.evaluate(RING, ["Z", -0.4, 0.6, 8])
    page.mouse.move(*path[0])
    page.mouse.down()
    for point in path[1:]:
        page.mouse.move(*point)
    x, y, z, w = page.evaluate("cockpit.gizmo.proxy.quaternion.toArray()")
    assert becomes(page, lambda: held(one, "arm7"))
    page.mouse.up()
    assert 2.0 * math.atan2(z, w) == pytest.approx(1.0, abs=0.02)
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_escape_lets_go_and_beside_the_robot_the_view_turns(cockpit, tab):
    one = cockpit("delta4")
    page = tab(one)
    grab(page, one, "delta4", "link5")
    page.keyboard.press("Escape")
    assert becomes(page, lambda: not one.state.robots["delta4"].tasks)
    page.mouse.up()
    before = page.evaluate("cockpit.viewer.camera.matrixWorld.toArray()")
    box = page.locator("canvas").first.bounding_box()
    page.mouse.move(box["x"] + 8, box["y"] + box["height"] - 8)
    page.mouse.down()
    page.mouse.move(box["x"] + 60, box["y"] + box["height"] - 30, steps=4)
    page.mouse.up()
    assert becomes(page, lambda: page.evaluate("cockpit.viewer.camera.matrixWorld.toArray()") != before)
    assert not one.state.robots["delta4"].tasks


def test_panel_sliders_switches_frames_and_meters(cockpit, tab):
    one = cockpit("delta4", follow="circle")
    page = tab(one)
    assert page.eval_on_selector("[data-switch='delta4/platform'] select", "(box) => box.value") == "path"
    page.select_option("[data-switch='delta4/platform'] select", "gamepad")
    assert becomes(page, lambda: one.state.switches["delta4", "platform"] == "gamepad")
    page.select_option("[data-switch='delta4/platform'] select", "")
    assert becomes(page, lambda: one.state.switches["delta4", "platform"] is None)
    page.select_option("#frame", "tool")
    assert becomes(page, lambda: one.state.settings.frame == "tool")
    home = one.setup.robots["delta4"].q_home
    page.click("#home")  # elsewhere on the circle the joint alone may meet a limit of the passive ones
    assert becomes(page, lambda: np.abs(one.state.robots["delta4"].q - home).max() < 1e-9)
    i = one.setup.robots["delta4"].q_index("joint1")
    before = one.state.robots["delta4"].q[i]
    slider = page.locator("[data-joint='delta4/joint1'] input[type=range]")
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    page.mouse.move(box["x"] + box["width"] * 0.55, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.7, box["y"] + box["height"] / 2, steps=5)
    page.mouse.up()
    assert becomes(page, lambda: abs(one.state.robots["delta4"].q[i] - before) > 0.05)
    assert becomes(page, lambda: one.state.moving is None)
    assert one.state.robots["delta4"].closure < 1e-10
    assert becomes(page, lambda: one.hub.controller is not None)  # the page was not dropped
    for kind in ("type1", "type2"):
        meter = page.locator(f"[data-meter='delta4/{kind}']")
        assert float(meter.get_attribute("aria-valuenow")) > 0.0
    assert "0.0" in page.inner_text("#gap")
    page.click("#home")
    assert becomes(page, lambda: np.abs(one.state.robots["delta4"].q - home).max() < 1e-9)
    picture(page, "panel")


def test_payload_torques_and_reactions(cockpit, tab):
    one = cockpit("delta4", "tssm")
    page = tab(one)
    delta = one.setup.robots["delta4"]
    text = page.inner_text("[data-missing='tssm']")
    assert "no mass is given for " in text
    assert all(link in text for link in one.setup.robots["tssm"].massless)
    assert page.locator("[data-torque^='tssm/']").count() == 0

    def shown():
        return [page.inner_text(f"[data-torque='delta4/{joint}']") for joint in delta.actuated]

    def torques(mass):
        return cinegen.forces(delta, one.q["delta4"], payloads=[Payload("platform", mass)]).torques

    assert becomes(page, lambda: shown() == [f"{value:.3g} N m" for value in torques(0.0)])
    page.focus("[data-payload='delta4'] input[type=range]")
    for _ in range(3):
        page.keyboard.press("ArrowRight")  # 1 kg each
    assert becomes(page, lambda: one.state.robots["delta4"].carried == CarriedMass("platform", 3.0))
    assert becomes(page, lambda: shown() == [f"{value:.3g} N m" for value in torques(3.0)])
    assert page.evaluate("cockpit.report.robots.delta4.reactions") is None  # nobody has asked
    page.check("#reactions")
    assert becomes(page, lambda: page.inner_text("[data-reactions='delta4']") != "")
    forces = cinegen.forces(delta, one.q["delta4"], payloads=[Payload("platform", 3.0)])
    largest = max(np.linalg.norm(reaction.force) for reaction in forces.reactions)
    assert becomes(page, lambda: page.locator(".label.force").all_inner_texts() == [f"{largest:.3g} N"])
    page.evaluate("document.querySelectorAll('.fold').forEach((fold) => { fold.open = true; })")
    texts = page.locator(".row.reaction").all_inner_texts()
    assert [line.split()[1] for line in texts] == [f"{np.linalg.norm(one.force):.3g}" for one in forces.reactions]
    picture(page, "forces")
    page.uncheck("#reactions")
    assert becomes(page, lambda: page.evaluate("cockpit.report.robots.delta4.reactions") is None)
    assert page.locator(".label.force").count() == 0


PAD = """() => {
  window.axes = [0, 0, 0, 0];
  const pad = { connected: true, index: 0, id: "pad", mapping: "standard", buttons: [...Array(17)].map(() => (
    { pressed: false, touched: false, value: 0 })) };
  navigator.getGamepads = () => [{ ...pad, axes: window.axes, timestamp: performance.now() }];
}"""
"""Plays a gamepad, as browsers show them."""


def test_the_browsers_gamepad_moves_what_it_is_switched_to_and_comes_to_rest(cockpit, tab):
    one = cockpit("delta4")
    page = tab(one, f"({PAD})()")
    page.evaluate("window.dispatchEvent(new Event('gamepadconnected'))")
    page.select_option("[data-switch='delta4/platform'] select", "gamepad")
    assert becomes(page, lambda: held(one, "delta4", "sensor"))
    begin = place(one, "delta4", "platform")
    page.evaluate("window.axes = [1, 0, 0, 0]")  # the left stick to the right
    assert becomes(page, lambda: place(one, "delta4", "platform")[0] > begin[0] + 0.05)
    page.evaluate("window.axes = [0, 0, 0, 0]")
    moved = place(one, "delta4", "platform") - begin
    assert np.abs(moved[1:]).max() < 0.05 * moved[0]

    def rests():
        earlier = one.state.robots["delta4"].q
        page.wait_for_timeout(300)
        return np.array_equal(one.state.robots["delta4"].q, earlier)

    assert becomes(page, rests)


def test_hovering_names_a_part(cockpit, tab):
    page = tab(cockpit("delta4"))
    x, y, *_ = find(page, "delta4", "link8")
    page.mouse.move(x, y)
    assert becomes(page, lambda: "link8" in page.inner_text(".labels"))


def test_a_second_browser_sees_it_and_takes_control(cockpit, tab):
    one = cockpit("five_bar")
    first, second = tab(one), tab(one)
    grab(first, one, "five_bar", "link2")
    assert becomes(second, lambda: second.evaluate("document.documentElement.dataset.control") == "other")
    assert becomes(second, lambda: second.evaluate("cockpit.state.tasks.length") == 1)
    assert second.is_visible("#take-control")
    picture(second, "another_hand")
    second.click("#take-control")
    assert becomes(second, lambda: second.evaluate("document.documentElement.dataset.control") == "mine")
    assert becomes(first, lambda: not one.state.robots["five_bar"].tasks)
    first.mouse.up()


def test_a_line_that_is_cut_comes_back(cockpit, tab):
    one = cockpit("delta4")
    page = tab(one)
    where = find(page, "delta4", "link5")
    number = int(page.evaluate("document.documentElement.dataset.frame"))
    one.server.call(lambda: [client.connection.close(1001, "cut") for client in tuple(one.hub.clients.values())])
    assert becomes(page, lambda: page.evaluate("document.documentElement.dataset.connected") == "no")
    assert becomes(page, lambda: page.evaluate("document.documentElement.dataset.connected") == "yes")
    assert becomes(page, lambda: int(page.evaluate("document.documentElement.dataset.frame")) > number + 10)
    assert becomes(page, lambda: page.evaluate(WHERE, ["delta4", "link5"]) == where)  # all is drawn again
    grab(page, one, "delta4", "link5")  # it can be driven as before
    page.mouse.up()


def test_many_labels_that_meet_find_their_places(cockpit, tab):
    """Where the words beside points overlapped by a rounding, the page hung."""
    one = cockpit("planar_3r")
    page = tab(one)
    page.evaluate("""async () => {
      const { Vector3 } = MeshCat.THREE;
      for (let round = 0; round < 12; round += 1) {
        for (let k = 0; k < 80; k += 1) { // all over the picture, two in each place
          const pair = k >> 1, across = (pair % 4) / 2 - 0.9, down = 0.9 - 0.17 * (pair >> 2) - 0.004 * round;
          const point = new Vector3(across, down - 0.0007 * pair, 0.5).unproject(cockpit.viewer.camera);
          cockpit.labels.put(`k${k}`, "label", cockpit.root.worldToLocal(point));
        }
        await new Promise(requestAnimationFrame);
      }
    }""")
    number = int(page.evaluate("document.documentElement.dataset.frame"))
    assert becomes(page, lambda: int(page.evaluate("document.documentElement.dataset.frame")) > number + 5)


@pytest.mark.slow
def test_every_control_has_a_label_and_a_hint(cockpit, tab):
    page = tab(cockpit("delta4", follow="circle"))
    bare = page.evaluate("""() => [...document.querySelectorAll("button, input, select, [role=button]")]
      .filter((control) => {
        const label = control.getAttribute("aria-label") || control.innerText?.trim() || control.labels?.[0]?.innerText
          || control.title;
        const hint = control.title || control.closest("[title]")?.title || control.labels?.[0]?.title;
        return !label || !hint;
      }).map((control) => control.outerHTML.slice(0, 120))""")
    assert bare == []


@pytest.mark.slow
def test_a_finger_drags_too(cockpit, browser):
    one = cockpit("delta4")
    context = browser.new_context(viewport={"width": 420, "height": 760}, has_touch=True, bypass_csp=True)
    page = context.new_page()
    page.goto(one.url)
    page.wait_for_function(READY, polling=100, timeout=60_000)
    x, y, *_ = find(page, "delta4", "link5")
    line = context.new_cdp_session(page)
    line.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    for step in range(1, 8):
        points = [{"x": x + 3 * step, "y": y + 3 * step}]
        line.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": points})
    assert becomes(page, lambda: held(one, "delta4"))
    line.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    assert becomes(page, lambda: not one.state.robots["delta4"].tasks)
    picture(page, "phone")
    context.close()


def test_the_buttons_lead_from_mode_to_mode(robot, tab, tmp_path):
    modes = cinegen.assembly_modes(robot("tssm"))
    record_modes(modes, tmp_path / "modes.jsonl", "tssm")
    stops = [(0.0 if k == 0 else k + 1.0, f"mode {k + 1} of 16") for k in range(16)]
    cockpit = Cockpit(replay_setup(tmp_path / "modes.jsonl", stops=stops), port=8300, own_process=False)
    try:
        page = tab(cockpit)
        for wanted in (2, 3, 4, 3):
            page.click("#after" if wanted != 3 or page.text_content("#stop") != "mode 4 of 16" else "#before")
            assert becomes(page, lambda n=wanted: page.text_content("#stop") == f"mode {n} of 16")
            shown = becomes(page, lambda n=wanted: np.abs(cockpit.state.robots["tssm"].q - modes[n - 1]).max() < 1e-9)
            assert shown
        assert page.is_hidden("#hint")  # nothing can be dragged
        picture(page, "modes")
    finally:
        cockpit.close()


@pytest.mark.slow
def test_obstacles_are_seen_and_dragged_and_push_the_robot(robot, tab):
    said = {
        "robot": "arm7.raff",
        "safety": 0.02,
        "goal": {"point": [0.5, -0.3, 0.5]},
        "obstacle": [
            {"name": "pole", "kind": "capsule", "radius": 0.03, "length": 1.0, "point": [0.45, 0.25, 0.5]},
            {"name": "wedge", "kind": "polygon", "points": [[0, 0], [0.2, 0], [0, 0.2]], "height": 0.2,
             "point": [0.5, -0.6, 0.1]},
            {"name": "floor", "kind": "half_space", "normal": [0, 0, 1], "point": [0, 0, -0.05]},
        ],
    }  # fmt: skip
    cockpit = Cockpit(scene_setup(scene_of(said, mechanism=robot("arm7"))), port=8300)
    try:
        page = tab(cockpit)
        picture(page, "obstacles")
        for name in ("pole", "wedge"):
            x, y, *_ = find(page, name, name)
            box = page.locator("canvas").first.bounding_box()
            drawn = page.evaluate(COLOUR, [x - box["x"], y - box["y"]])
            assert drawn[0] > drawn[1] > drawn[2] > 20  # brown
        assert page.evaluate(WHERE, ["floor", "floor"]) is None  # beside the others, the view is turned
        assert page.locator("[data-meter^='pole']").count() == 0
        assert page.locator("[data-node='wedge/wedge']").count() == 1
        x, y, *_ = find(page, "pole", "pole")
        page.mouse.move(x, y)
        assert becomes(page, lambda: page.inner_text(".labels .over") == "pole")
        begin, rest = place(cockpit, "pole", "pole"), cockpit.state.robots["arm7"].q
        grab(page, cockpit, "pole", "pole")
        to = begin + np.array([-0.1, -0.25, 0.0])
        near, far = np.array(page.evaluate(PIXELS, [begin.tolist(), to.tolist()]))
        statuses = set()
        for part in np.linspace(0.0, 1.0, 30):
            page.mouse.move(*(np.array([x, y]) + part * (far - near)))
            page.wait_for_timeout(20)
            statuses.add(page.text_content("#status"))
        picture(page, "obstacle_dragged")
        assert becomes(page, lambda: np.linalg.norm(place(cockpit, "pole", "pole") - begin) > 0.1)
        assert becomes(page, lambda: np.abs(cockpit.state.robots["arm7"].q - rest).max() > 0.01)
        assert "arm7: pushed by 'pole'" in statuses
        page.mouse.up()
        assert becomes(page, lambda: not cockpit.state.obstacles["pole"].tasks)
        page.keyboard.press("Control+z")
        assert becomes(page, lambda: np.linalg.norm(place(cockpit, "pole", "pole") - begin) < 1e-9)
    finally:
        cockpit.close()


MARKED = """() => {
  const shown = cockpit.state.obstructions.arm7;
  if (shown === undefined) return null;
  const near = (point) => (object) => object.isMesh && object.visible && object.material.opacity === 0.9
    && object.position.distanceTo(new MeshCat.THREE.Vector3(...point)) < 1e-6;
  const balls = shown.points.map((point) => {
    let found = false;
    cockpit.viewer.scene.traverse((object) => { found ||= near(point)(object); });
    return found;
  });
  return { label: shown.label, points: shown.points, balls, words: document.querySelector(".labels").innerText };
}"""
"""What the page has of the obstruction of the arm: its state, balls at its points, and the labels."""


@pytest.mark.slow
def test_the_place_where_an_obstacle_stops_a_robot_is_marked_and_named(robot, tab):
    wall = {"name": "wall", "kind": "box", "size": [0.04, 2.0, 2.0], "point": [0.75, 0.0, 0.5]}
    bar = {"name": "bar", "kind": "box", "size": [0.03, 0.03, 0.2], "point": [0.0, 0.0, 0.1]}
    said = {"robot": "arm7.raff", "safety": 0.02, "goal": {"point": [0.5, -0.3, 0.5]}, "obstacle": [wall]}
    cockpit = Cockpit(scene_setup(scene_of({**said, "attached": [bar]}, mechanism=robot("arm7"))), port=8300)
    try:
        page = tab(cockpit)
        assert page.evaluate(MARKED) is None
        page.evaluate("cockpit.send({ type: 'start_drag', robot: 'arm7', node: 'tool', point: [0, 0, 0] })")
        assert becomes(page, lambda: held(cockpit, "arm7"))
        to = (place(cockpit, "arm7", "tool") + np.array([0.6, 0.0, 0.0])).tolist()
        page.evaluate("(to) => cockpit.send({ type: 'move_drag', position: to })", to)
        assert becomes(page, lambda: cockpit.state.robots["arm7"].status.name == "BARRED")
        marked = [None]

        def is_marked():
            marked[0] = page.evaluate(MARKED)
            return marked[0] is not None and all(marked[0]["balls"]) and marked[0]["label"] in marked[0]["words"]

        assert becomes(page, is_marked)
        assert marked[0]["label"].endswith("wall")
        assert marked[0]["points"][1][0] == pytest.approx(0.73, abs=1e-3)  # on the face of the wall
        assert 0.015 < 0.73 - marked[0]["points"][0][0] < 0.06
        picture(page, "obstruction")
        page.evaluate("cockpit.send({ type: 'end_drag' })")
        page.click("#home")
        assert becomes(page, lambda: page.evaluate(MARKED) is None)
        assert becomes(page, lambda: "wall" not in page.inner_text(".labels"))
    finally:
        cockpit.close()


COLOUR = """([x, y]) => {
  const canvas = cockpit.viewer.renderer.domElement, box = canvas.getBoundingClientRect();
  cockpit.viewer.render();
  const copy = document.createElement("canvas");
  [copy.width, copy.height] = [canvas.width, canvas.height];
  const pen = copy.getContext("2d");
  pen.drawImage(canvas, 0, 0);
  return [...pen.getImageData(x * canvas.width / box.width, y * canvas.height / box.height, 1, 1).data];
}"""
"""The colour of a pixel of the canvas."""
