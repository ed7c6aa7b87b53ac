"""A person at a page without a server, from a file, with the network off: a real browser, a mouse and keys."""

import io
import re

import numpy as np
import pytest
from hostile_names import JOINTS, LINKS, urdf
from PIL import Image
from tabs import PIXELS, WHERE, becomes, picture, tools

import cinegen
from cinegen.page import build_page
from cinegen.session import Setup


@pytest.fixture(scope="module")
def file(page_of):
    return page_of("rx90")


def configuration(page):
    return np.array(page.evaluate("cockpit.report.robots.rx90.q"))


def at_rest(page):
    return becomes(page, "cockpit.report.rate.at_rest")


def drag(page, node, by, release=True):
    x, y, *_ = page.evaluate(WHERE, ["rx90", node])
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + by[0], y + by[1], steps=8)
    if release:
        assert becomes(page, "cockpit.state.tasks.length === 1")
        page.wait_for_timeout(300)
        page.mouse.up()


def test_a_drag_is_undone_and_its_end_is_a_link(file, tab):
    page = tab(file)
    home = configuration(page)
    assert not page.evaluate("location.hash")
    drag(page, "tool", (-60, -40), release=False)
    assert becomes(page, "cockpit.state.tasks.some(({ source }) => source === 'pointer')")
    picture(page, "local_page")
    page.mouse.up()
    assert at_rest(page)
    dragged = configuration(page)
    assert np.abs(dragged - home).max() > 0.02
    link = page.evaluate("location.hash")
    page.keyboard.press("Control+z")
    assert becomes(page, "cockpit.report.redo === 1 && cockpit.report.moving === null")
    assert at_rest(page)
    assert configuration(page) == pytest.approx(home, abs=1e-12)
    page.evaluate("link => { location.hash = link; }", link)
    assert becomes(page, f"Math.abs(cockpit.report.robots.rx90.q[1] - {dragged[1]}) < 1e-12")
    other = tab(f"{file.as_uri()}{link}")
    assert configuration(other) == pytest.approx(dragged, abs=0.0)


def test_a_soft_shadow_darkens_the_floor_alone_and_what_only_a_server_does_is_hidden(file, tab):
    page = tab(file, "try { localStorage.setItem('cinegen.hints', '[\"drag\"]') } catch {}", drawn=True)  # no hand
    shadow = "cockpit.viewer.scene_tree.find(['Grid']).object.children[0].children[0]"
    seen = []
    for opacity in (0.5, 0.0):
        page.evaluate(f"{shadow}.material.opacity = {opacity}; cockpit.view.resolution.constant = true")
        page.evaluate("cockpit.view.changed()")
        page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        box = page.evaluate("(({ x, y, width, height }) => ({ x, y, width, height }))(scene.getBoundingClientRect())")
        with Image.open(io.BytesIO(page.screenshot(clip=box))) as image:
            seen.append(np.asarray(image.convert("L"), dtype=int))
    lighter = seen[1] - seen[0]
    assert lighter.min() >= -2
    assert lighter.max() > 20
    assert 0.002 < np.mean(lighter > 4) < 0.3
    page.evaluate("cockpit.select('rx90', 'tool')")
    page.click("#info")
    assert page.is_visible("#axes")
    hidden = ("#section-sensors", "#section-record", "#section-forces", "#section-users", "[data-aid=forecast]")
    hidden += ("#stay-upright", "#look-at", "#pin-to")
    for name, seen in {"pose": "#section-joints", "tasks": "#section-tasks", "view": "[data-aid=trail]"}.items():
        tools(page, name)
        assert page.is_visible(seen), seen
        assert [selector for selector in hidden if page.is_visible(selector)] == []
    page.evaluate("cockpit.send({ type: 'set_recording', on: true })")
    assert becomes(page, "document.querySelector('#toasts .toast')?.textContent.includes('cinegen drive')")
    page.evaluate("cockpit.send({ type: 'add_task', robot: 'rx90', description: { kind: 'damping' } })")
    assert becomes(page, "document.getElementById('toasts').textContent.includes(\"can't do 'add_task'\")")


def test_a_link_that_is_none_leaves_the_robot_at_home(file, tab, robot):
    page = tab(f"{file.as_uri()}#<img%20src=x%20onerror=alert(1)>=1")
    assert page.locator("#toasts .toast").first.is_visible()
    assert page.evaluate("document.querySelectorAll('#toasts img, #toasts script').length") == 0
    assert configuration(page) == pytest.approx(robot("rx90").q_home, abs=1e-12)


def test_names_that_objects_of_javascript_have(tab, text_file):
    """A robot, links and joints called `constructor`, `__proto__` and so on are drawn, and driven; none is code."""
    setup = Setup({"constructor": cinegen.load(urdf("__proto__"))})
    file = text_file("constructor.html", build_page(setup, "</title><script>window.owned = 1</script>"))
    page = tab(file)
    shown = """(name) => {
        const { view } = cockpit;
        return view.group("constructor", name).getWorldPosition(view.root.position.clone()).toArray();
    }"""
    places = np.array([page.evaluate(shown, name) for name in LINKS])
    apart = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert apart == pytest.approx(np.full(len(LINKS) - 1, apart[0]), rel=1e-6)  # each where the one before carries it
    assert apart[0] > 0.0
    move = "{ type: 'move_joint', robot: 'constructor', joint: '__proto__', value: 0.5 }"
    page.evaluate(f"cockpit.pick.session.send({move})")
    moved = JOINTS.index("__proto__")
    assert becomes(page, f"Math.abs(Object.entries(cockpit.report.robots)[0][1].q[{moved}] - 0.5) < 1e-6")
    assert page.evaluate("window.owned === undefined")


# --- measuring --------------------------------------------------------------------------------------------------------
# A person who measures: points of parts by keys and by the pointer.


NUMBERS = re.compile(r"(distance|dx|dy|dz|at) (-?[\d.]+)")


def shown(page):
    """Return the numbers that are shown, mm and degrees."""
    return {name: float(number) for name, number in NUMBERS.findall(page.inner_text("#measure-text"))}


def expected(mechanism, q, nodes):
    """Return the same for the origins and z axes of two nodes."""
    first, second = (mechanism.placement(q, node) for node in nodes)
    x, y, z = 1000 * (second.translation - first.translation)
    angle = np.degrees(np.arccos(min(1.0, abs(first.rotation[:, 2] @ second.rotation[:, 2]))))
    return {"distance": np.linalg.norm([x, y, z]), "dx": x, "dy": y, "dz": z, "at": angle}


def test_points_by_keys_follow_the_robot_and_points_by_the_pointer(robot, tab, page_of):
    mechanism, nodes = robot("delta4"), ("link7", "platform")
    page = tab(page_of("delta4"))
    page.keyboard.press("m")
    assert page.get_attribute("#measure-mode", "aria-pressed") == "true"
    for node in nodes:
        page.evaluate("(node) => cockpit.select('delta4', node)", node)
        page.focus("#measure-add")
        page.keyboard.press("Enter")
    q = mechanism.q_home
    assert shown(page) == pytest.approx(expected(mechanism, q, nodes), abs=0.06)  # one digit after the point
    assert any("millimetres" in text for text in page.locator("#announcer p").all_inner_texts())
    page.evaluate("cockpit.send({ type: 'move_joint', robot: 'delta4', joint: 'joint1', value: 0.15 })")
    assert becomes(page, "Math.abs(cockpit.report.robots.delta4.q[0] - 0.15) < 1e-9")
    page.evaluate("cockpit.send({ type: 'end_joint_motion' })")
    q = np.array(page.evaluate("cockpit.report.robots.delta4.q"))
    wanted = expected(mechanism, q, nodes)
    assert abs(wanted["distance"] - expected(mechanism, mechanism.q_home, nodes)["distance"]) > 5.0  # mm
    assert becomes(page, lambda: shown(page) == pytest.approx(wanted, abs=0.06))
    picture(page, "measure")
    # a point of a surface, under the pointer, after a third point begins anew
    box = page.locator("#scene canvas").bounding_box()
    for node in ("link8", "link2", "link6", "link13", "link7"):
        x, y, *point = page.evaluate(WHERE, ["delta4", node]) or (0.0, 0.0)
        origin = page.evaluate(PIXELS, [mechanism.placement(q, node).translation.tolist()] * 2)[0]
        if point and np.hypot(x - box["x"] - origin[0], y - box["y"] - origin[1]) > 20:  # else the origin is taken
            break
    else:
        pytest.fail("no part can be seen beside its origin")
    page.mouse.click(x, y)
    page.evaluate("cockpit.select('delta4', 'base')")
    page.click("#measure-add")
    assert page.inner_text("#measure-text").startswith(f"From {node} to origin of base: ")
    distance = 1000 * np.linalg.norm(mechanism.placement(q, "base").translation - point)
    assert shown(page)["distance"] == pytest.approx(distance, abs=0.06)
    assert page.evaluate("cockpit.state.tasks.length") == 0  # nothing was dragged
    page.keyboard.press("Escape")
    assert not page.is_visible("#measure")
