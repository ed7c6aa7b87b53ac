"""A person at the real page: a mouse and keys in a real browser drive real sessions."""

import math

import numpy as np
import pinocchio as pin
import pytest
import two_armed
from tabs import PIXELS, becomes, find, grab, held, picture, place, rests, tools

import cinegen
from cinegen.mission.results import record_modes
from cinegen.session import arrange, replay_setup


def easiest(cockpit, name, node, at):
    """The way that a point of a node moves most easily, in the world (all joints by finite differences)."""
    mechanism, q = cockpit.setup.robots[name], cockpit.state.robots[name].q
    motions = np.eye(mechanism.model.nv)
    if mechanism.loops:
        motions = np.linalg.svd(mechanism.structure.system.evaluate(q)[1])[2][mechanism.loop_rank :].T
    step = 1e-6
    moved = [pin.integrate(mechanism.model, q, step * motion * mechanism.scale) for motion in motions.T]
    at_start = mechanism.placement(q, node).act(at)
    rates = np.array([(mechanism.placement(q_moved, node).act(at) - at_start) / step for q_moved in moved])
    return np.linalg.svd(rates)[2][0]


def test_a_part_is_named_follows_the_mouse_and_is_undone_the_gizmo_moves_a_pin_holds_and_escape_lets_go(opened):
    name, node = "delta4", "link5"  # the platform
    session, page = opened(name, "five_bar")
    before = {other: robot.q for other, robot in session.state.robots.items()}
    page.mouse.move(*find(page, name, node)[:2])
    assert becomes(page, lambda: "platform" in page.inner_text(".labels"))
    x, y, touched = grab(page, session, name, node)
    (task,) = held(session, name)
    assert task.node == node
    start = place(session, name, node, task.offset.translation)
    assert np.linalg.norm(touched - start) < 0.3 * session.setup.robots[name].length
    way = easiest(session, name, node, task.offset.translation)
    near, far = np.array(page.evaluate(PIXELS, [start.tolist(), (start + way * 1e-2).tolist()]))
    way_seen = (far - near) / np.linalg.norm(far - near)
    for i in range(1, 6):
        page.mouse.move(x + 6 + 5 * i * way_seen[0], y + 4 + 5 * i * way_seen[1])
    assert becomes(
        page, lambda: np.abs(held(session, name)[0].target.translation - task.target.translation).max() > 0.0
    )
    rests(page, session)
    (task,) = held(session, name)
    wanted = task.target.translation - start
    moved = place(session, name, node, task.offset.translation) - start
    assert moved @ wanted > 0.1 * wanted @ wanted  # the right way
    assert np.linalg.norm(wanted - moved) < np.linalg.norm(wanted)
    assert session.state.robots[name].closure < 1e-10
    picture(page, f"drag_{name}_{node}")
    page.mouse.up()
    assert becomes(page, lambda: not session.state.robots[name].tasks)
    assert np.array_equal(session.state.robots["five_bar"].q, before["five_bar"])
    # and what has happened is undone
    page.keyboard.press("Control+z")
    assert becomes(page, lambda: np.abs(session.state.robots[name].q - before[name]).max() < 1e-9)
    page.keyboard.press("Control+Shift+z")
    assert becomes(page, lambda: session.state.undo == 1 and session.state.moving is None)
    page.keyboard.press("Control+z")
    assert becomes(page, lambda: session.state.undo == 0 and session.state.moving is None)
    # a click selects: a gizmo is there
    x, y, *_ = find(page, "delta4", "link5")
    page.mouse.click(x, y)
    assert becomes(page, lambda: page.is_visible("#selection") and "platform" in page.inner_text("#selection"))
    picture(page, "gizmo")
    start = place(session, "delta4", "link5")
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
    assert becomes(page, lambda: held(session, "delta4"))
    assert becomes(page, lambda: place(session, "delta4", "link5")[2] < start[2] - 0.02)
    page.keyboard.press("p")
    assert becomes(page, lambda: held(session, "delta4", "pin"))
    page.mouse.up()
    moved = place(session, "delta4", "link5") - start
    assert np.abs(moved[:2]).max() < 0.1 * abs(moved[2])
    number = held(session, "delta4", "pin")[0].id
    tools(page, "tasks")
    page.click(f"[data-task='{number}'] button")
    page.click("#fold")
    assert becomes(page, lambda: not session.state.robots["delta4"].tasks)
    page.keyboard.press("Escape")  # selects nothing: no arrow is before the part
    grab(page, session, "delta4", "link5")
    page.keyboard.press("Escape")
    assert becomes(page, lambda: not session.state.robots["delta4"].tasks)
    page.mouse.up()
    before = page.evaluate("cockpit.viewer.camera.matrixWorld.toArray()")
    box = page.locator("canvas").first.bounding_box()
    page.mouse.move(box["x"] + 8, box["y"] + box["height"] - 8)
    page.mouse.down()
    page.mouse.move(box["x"] + 60, box["y"] + box["height"] - 30, steps=4)
    page.mouse.up()
    assert becomes(page, lambda: page.evaluate("cockpit.viewer.camera.matrixWorld.toArray()") != before)
    assert not session.state.robots["delta4"].tasks


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


def test_a_padlock_locks_a_joint_a_ring_of_the_gizmo_rotates_and_many_labels_find_room(opened):
    session, page = opened("arm7")
    tools(page, "pose")
    lock = page.locator('[data-lock="arm7/joint2"]')
    slider, text = (page.locator(f'[data-joint="arm7/joint2"] input[type={kind}]') for kind in ("range", "number"))
    assert becomes(page, lambda: lock.is_visible() and lock.get_attribute("aria-pressed") == "false")
    lock.click()
    assert becomes(page, lambda: lock.get_attribute("aria-pressed") == "true" and slider.is_disabled())
    assert text.is_disabled()
    assert session.state.robots["arm7"].locked == ("joint2",)
    lock.click()
    assert becomes(page, lambda: lock.get_attribute("aria-pressed") == "false" and slider.is_enabled())
    assert session.state.robots["arm7"].locked == ()
    # as the pointer goes around it
    page.evaluate("cockpit.select('arm7', 'tool')")
    page.keyboard.press("e")
    assert becomes(page, lambda: page.evaluate("cockpit.gizmo.mode") == "rotate" and page.is_visible("#selection"))
    path = page.evaluate(RING, ["Z", -0.4, 0.6, 8])
    page.mouse.move(*path[0])
    page.mouse.down()
    for point in path[1:]:
        page.mouse.move(*point)
    x, y, z, w = page.evaluate("cockpit.gizmo.proxy.quaternion.toArray()")
    assert becomes(page, lambda: held(session, "arm7"))
    page.mouse.up()
    assert 2.0 * math.atan2(z, w) == pytest.approx(1.0, abs=0.02)
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-6)
    # where the words beside points overlapped by a rounding, the page hung
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


def test_panel_sliders_switches_frames_and_meters(opened):
    session, page = opened("five_bar", follow="circle")
    tools(page, "tasks")
    assert page.eval_on_selector("[data-switch='five_bar/tool'] select", "(box) => box.value") == "path"
    page.select_option("[data-switch='five_bar/tool'] select", "gamepad")
    assert becomes(page, lambda: session.state.switches["five_bar", "tool"] == "gamepad")
    page.select_option("[data-switch='five_bar/tool'] select", "")
    assert becomes(page, lambda: session.state.switches["five_bar", "tool"] is None)
    page.select_option("#frame", "tool")
    assert becomes(page, lambda: session.state.settings.frame == "tool")
    home = session.setup.robots["five_bar"].q_home
    page.click("#home")  # elsewhere on the circle the joint alone may meet a limit of the passive ones
    assert becomes(page, lambda: np.abs(session.state.robots["five_bar"].q - home).max() < 1e-9)
    tools(page, "pose")
    i = session.setup.robots["five_bar"].q_index("joint1")
    before = session.state.robots["five_bar"].q[i]
    slider = page.locator("[data-joint='five_bar/joint1'] input[type=range]")
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    page.mouse.move(box["x"] + box["width"] * 0.55, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.7, box["y"] + box["height"] / 2, steps=5)
    page.mouse.up()
    assert becomes(page, lambda: abs(session.state.robots["five_bar"].q[i] - before) > 0.05)
    assert becomes(page, lambda: session.state.moving is None)
    assert session.state.robots["five_bar"].closure < 1e-10
    assert becomes(page, lambda: session.hub.controller is not None)  # the page was not dropped
    tools(page, "analyse")
    for kind in ("type1", "type2"):
        meter = page.locator(f"[data-meter='five_bar/{kind}']")
        assert float(meter.get_attribute("aria-valuenow")) > 0.0
    assert "0.0" in page.inner_text("#gap")
    picture(page, "panel")


def test_a_second_browser_sees_it_is_told_how_to_drive_and_takes_control(cockpit, tab):
    session = cockpit("five_bar")
    first, second = tab(session), tab(session)
    grab(first, session, "five_bar", "link4")
    assert becomes(second, lambda: second.evaluate("document.documentElement.dataset.control") == "other")
    assert becomes(second, lambda: second.evaluate("cockpit.state.tasks.length") == 1)
    second.press("body", "h")
    said, button = second.locator("#toasts .toast").first.inner_text(), second.locator("#take-control")
    assert said == f"Another browser has control. {button.inner_text()} to drag and switch."
    picture(second, "another_hand")
    button.click()  # what the message says
    assert becomes(second, lambda: second.evaluate("document.documentElement.dataset.control") == "mine")
    assert becomes(first, lambda: not session.state.robots["five_bar"].tasks)
    first.mouse.up()


def test_the_view_only_address_shows_the_robots_and_drives_nothing(cockpit, tab):
    session = cockpit("five_bar")
    page, home = tab(session.view_url), session.state.robots["five_bar"].q
    assert becomes(page, lambda: page.evaluate("document.documentElement.dataset.control") == "other")
    assert page.locator("#crowd").inner_text().strip() == "This page only shows the robots."
    assert not page.locator("#take-control").is_visible()
    assert becomes(page, lambda: page.inner_text("#control").startswith("View only"))
    page.press("body", "h")
    assert page.locator("#toasts .toast").first.inner_text().startswith("This page only shows the robots: ask for")
    picture(page, "view_only")
    assert page.get_attribute("#copy-view-link", "hidden") is not None
    move = "{ type: 'move_joint', robot: 'five_bar', joint: 'joint1', value: 1.0 }"
    page.evaluate(f"cockpit.presentation.session.send({move})")
    refused = "this address only shows the robots: ask for the one with which to drive them"
    assert becomes(page, lambda: refused in page.locator("#toasts").inner_text())
    assert (session.state.robots["five_bar"].q == home).all()
    assert page.get_attribute("#page-copy", "href") == session.view_url.replace("?", "snapshot.html?")


def test_the_buttons_lead_from_mode_to_mode(robot, opened, tmp_path):
    modes = cinegen.assembly_modes(robot("five_bar"))
    record_modes(modes, tmp_path / "modes.jsonl", "five_bar")
    stops = [(0.0 if k == 0 else k + 1.0, f"mode {k + 1} of {len(modes)}") for k in range(len(modes))]
    session, page = opened(setup=replay_setup(tmp_path / "modes.jsonl", stops=stops))
    for button, wanted in (("#after", 2), ("#before", 1)):
        page.click(button)
        assert becomes(page, lambda n=wanted: page.text_content("#stop") == f"mode {n} of {len(modes)}")
        assert becomes(page, lambda n=wanted: np.abs(session.state.robots["five_bar"].q - modes[n - 1]).max() < 1e-9)
    assert page.is_hidden("#hint")  # nothing can be dragged
    picture(page, "modes")


# --- tasks of parts ---------------------------------------------------------------------------------------------------
# Tasks that a hand gives: a part stays upright, looks at another, or is pinned to another.


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
