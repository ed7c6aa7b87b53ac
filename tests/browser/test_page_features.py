"""Waypoints, links and other users in the real page."""

import json

import numpy as np
import pytest
from browsers import Browser
from tabs import READY, becomes, find, picture, tools

from cinegen.mission import Recording


@pytest.fixture
def five_bar(cockpit):
    return cockpit("five_bar")


HOSTILE = '<img src=x onerror="alert(1)">'


def test_waypoints_are_saved_renamed_reordered_played_and_recorded(five_bar, tab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mechanism = five_bar.setup.robots["five_bar"]
    first, *_ = mechanism.actuated
    index = mechanism.q_index(first)
    page = tab(five_bar)

    def value():
        return five_bar.state.robots["five_bar"].q[index]

    def listed(*names):
        """The session and the page have the same waypoints."""
        return [waypoint.name for waypoint in five_bar.state.waypoints] == list(names) == rows.all_inner_texts()

    tools(page, "record")
    rows = page.locator("#waypoints .go")
    home = value()
    page.fill("#waypoint-name", HOSTILE + "x" * 50)
    page.press("#waypoint-name", "Enter")
    assert becomes(page, lambda: listed((HOSTILE + "x" * 50)[:40]))
    assert page.locator("#waypoints img").count() == 0
    page.click("#tab-pose")
    page.locator(f'[data-joint="five_bar/{first}"] input[type=number]').fill(str(np.degrees(home + 0.3)))
    page.keyboard.press("Enter")
    assert becomes(page, lambda: abs(value() - home - 0.3) < 1e-3 and five_bar.state.moving is None)
    moved = value()
    page.click("#tab-record")
    page.click("#save-waypoint")
    assert becomes(page, lambda: rows.all_inner_texts()[1:] == ["Waypoint 2"])
    page.locator("#waypoints [data-action=rename]").first.click()
    page.locator("#waypoints input").fill("start")
    page.keyboard.press("Enter")
    assert becomes(page, lambda: listed("start", "Waypoint 2"))
    rows.first.click()
    assert becomes(page, lambda: abs(value() - home) < 1e-9 and five_bar.state.moving is None)
    page.locator("#waypoints [data-action=up]").last.click()
    assert becomes(page, lambda: listed("Waypoint 2", "start"))
    page.click("#record-waypoints")
    assert becomes(page, lambda: five_bar.state.waypoint is not None)
    assert becomes(page, lambda: five_bar.state.waypoint is None and five_bar.state.recording is None)
    assert becomes(page, lambda: page.locator(".toast", has_text="recorded").count() == 1)
    (path,) = tmp_path.glob("mission-*.jsonl")

    def written():
        return path.read_bytes().endswith(b"\n") and Recording.load(path).q["five_bar"][-1][index] == value()

    assert becomes(page, written)
    recording = Recording.load(path)
    assert recording.q["five_bar"][0][index] == moved
    assert recording.q["five_bar"][-1][index] == pytest.approx(home, abs=1e-9)
    page.locator("#waypoints [data-action=remove]").first.click()
    assert becomes(page, lambda: listed("start"))


CAMERA = [1.5, -2.0, 1.25, 0.1, 0.2, 0.3]  # m: its position, and the point in its middle
NEAR = "camera => cockpit.view.cameraNumbers().every((value, i) => Math.abs(value - camera[i]) < 1e-4)"


def test_a_link_has_the_camera_and_offers_its_configuration(five_bar, tab):
    mechanism = five_bar.setup.robots["five_bar"]
    first, *_ = mechanism.actuated
    index = mechanism.q_index(first)
    home = five_bar.state.robots["five_bar"].q[index]

    def value():
        return five_bar.state.robots["five_bar"].q[index]

    page = tab(five_bar)
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    tools(page, "record")  # from now on the camera is the user's
    page.evaluate("camera => cockpit.view.setCamera(camera)", CAMERA)
    move = "([joint, value]) => cockpit.send({ type: 'move_joint', robot: 'five_bar', joint, value })"
    page.evaluate(move, [first, home + 0.2])
    is_at = f"Math.abs(cockpit.report.robots.five_bar.q[{index}] - {{}}) < 1e-9"
    assert becomes(page, is_at.format(home + 0.2))
    page.click("#copy-link")
    assert becomes(page, lambda: "token" in page.inner_text("#toasts"))
    link = page.evaluate("navigator.clipboard.readText()")
    assert link.startswith(five_bar.url + "#five_bar=")
    page.click("#copy-view-link")
    assert becomes(page, lambda: "only view" in page.inner_text("#toasts"))
    shared = page.evaluate("navigator.clipboard.readText()")
    assert shared == link.replace(five_bar.url, five_bar.view_url)
    page.evaluate("cockpit.send({ type: 'move_home' })")
    page.evaluate("cockpit.frame()")
    assert becomes(page, is_at.format(home))
    assert not page.evaluate(NEAR, CAMERA)
    page.goto("about:blank")
    page.goto(link, timeout=60_000)
    assert becomes(page, lambda: page.evaluate(f"Boolean({READY})"), 60)
    assert page.evaluate(NEAR, CAMERA)
    assert abs(value() - home) < 1e-9  # others may drive: nothing moves by itself
    page.click(".toast button")
    assert becomes(page, lambda: abs(value() - home - 0.2) < 1e-9)
    page.evaluate("location.hash = '#five_bar=<img src=x onerror=alert(1)>&@camera=1,2,3'")
    assert becomes(page, lambda: page.locator(".toast.warning").count() == 2)
    assert page.locator(".toast img").count() == 0
    assert page.evaluate(NEAR, CAMERA)


def test_users_see_who_points_at_a_part(five_bar, tab):
    """The other user is a program, which sends what its page would."""
    page = tab(five_bar.url, f"localStorage.setItem('cinegen.user.name', {json.dumps(json.dumps(HOSTILE))})")
    other = Browser(five_bar.url)
    other.say("set_user", name=HOSTILE[::-1], colour=3)
    other.say("set_cursor", robot="five_bar", node="link1", point=[0.0, 0.0, 0.1])
    label = page.locator(".label.user")
    assert becomes(page, lambda: label.all_inner_texts() == [HOSTILE[::-1]])
    assert page.locator(".label img").count() == 0
    assert label.get_attribute("data-colour") == "3"
    tools(page, "view")
    page.click("#section-users summary")
    listed = page.locator("#users li")
    assert becomes(page, lambda: set(listed.all_inner_texts()) == {f"{HOSTILE} (you)", HOSTILE[::-1]})
    picture(page, "users")
    other.say("set_cursor", robot="five_bar", node="link1", dragging=True)
    assert becomes(page, lambda: label.all_inner_texts() == [f"{HOSTILE[::-1]} drags"])

    def seen():
        """What the other user sees of the page's."""
        return next((user for user in other.users if user["client"] == page.evaluate("cockpit.hello.client")), {})

    assert becomes(page, lambda: page.evaluate("cockpit.report.clients === 2"))
    x, y, *point = find(page, "five_bar", "link4")
    page.mouse.move(x, y)
    assert becomes(page, lambda: seen().get("node") == "link4")
    assert (seen()["name"], seen()["robot"], seen()["dragging"]) == (HOSTILE, "five_bar", False)
    mechanism, q = five_bar.setup.robots["five_bar"], five_bar.state.robots["five_bar"].q
    assert mechanism.placement(q, "link4").act(np.array(seen()["point"])) == pytest.approx(np.array(point), abs=0.05)
    page.mouse.move(5, 500)
    assert becomes(page, lambda: seen().get("robot") is None)
    other.leave()
    assert becomes(page, lambda: label.count() == 0)
