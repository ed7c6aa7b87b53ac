"""A person who measures: points of parts by keys and by the pointer, in a page without a server."""

import re

import numpy as np
import pytest
from tabs import PIXELS, WHERE, becomes, picture

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
