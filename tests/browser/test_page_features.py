"""Plots, poses, links, films and other users in the real page, with a server and without one."""

from __future__ import annotations

import csv
import io
import json

import imageio_ffmpeg
import numpy as np
import pytest
from browsers import Browser
from pages import IN_BROWSER, READY, becomes, find, picture

from cinegen.mission import Recording

pytestmark = IN_BROWSER


@pytest.fixture
def five_bar(cockpit):
    return cockpit("five_bar")


def downloaded(page, press):
    """The content of the file that the page saves, and its name."""
    with page.expect_download() as saved:
        press()
    return saved.value.path().read_bytes(), saved.value.suggested_filename


def unfold(page, section):
    page.evaluate("id => { document.getElementById(`section-${id}`).open = true; }", section)


LINES = """([plot, variable]) => {
  const canvas = document.querySelector(`[data-plot="${plot}"] canvas`);
  canvas.scrollIntoView();
  const colour = getComputedStyle(canvas).getPropertyValue(variable);
  const wanted = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
  const { data, width } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const columns = new Set();
  for (let i = 0; i < data.length; i += 4) {
    const same = wanted.every((value, k) => Math.abs(data[i + k] - value) < 12);
    if (same && data[i + 3] > 120) columns.add((i / 4) % width);
  }
  return columns.size;
}"""
"""Number of columns of a plot in which a line of a colour is drawn."""


def test_joints_are_plotted_paused_and_exported(five_bar, page_of, tab):
    page = tab(five_bar)
    assert page.get_attribute("#section-plots", "open") is None
    unfold(page, "plots")
    mechanism = five_bar.setup.robots["five_bar"]
    first, *_ = mechanism.actuated
    before = five_bar.state.robots["five_bar"].q
    goal = before[mechanism.q_index(first)] + 0.2
    page.evaluate(
        "([joint, value]) => cockpit.send({ type: 'move_joint', robot: 'five_bar', joint, value })", [first, goal]
    )

    def arrived():
        return abs(five_bar.state.robots["five_bar"].q[mechanism.q_index(first)] - goal) < 1e-9

    assert becomes(page, arrived)
    page.evaluate("cockpit.send({ type: 'end_joint_motion' })")
    assert becomes(page, lambda: page.evaluate(LINES, ["angles", "--blue"]) > 10)
    line = page.locator(f'[data-line="angles/five_bar/{first}"]')
    assert becomes(page, lambda: abs(float(line.locator("output").inner_text()) - np.degrees(goal)) < 0.051)
    picture(page, "plots")
    line.click()
    assert becomes(page, lambda: page.evaluate(LINES, ["angles", "--blue"]) == 0)
    assert page.evaluate(LINES, ["angles", "--vermilion"]) > 10  # the other actuated joint
    index = mechanism.q_index(first)
    assert becomes(page, f"Math.abs(cockpit.report.robots.five_bar.q[{index}] - {goal}) < 1e-9")
    page.click("#plots-pause")
    content, name = downloaded(page, lambda: page.click("#plots-csv"))
    assert name == "five_bar.csv"
    header, *rows = csv.reader(io.StringIO(content.decode(), newline=""))
    column = header.index(f"q of five_bar/{first} (rad)")
    reported = [(float(row[0]), float(row[column])) for row in rows if row[column]]
    assert reported[0][1] == pytest.approx(before[mechanism.q_index(first)], abs=1e-9)
    assert reported[-1][1] == pytest.approx(goal, abs=1e-9)
    assert np.all(np.diff([moment for moment, _ in reported]) > 0.05)
    kept = page.evaluate("cockpit.plots.quantities.reports.count")
    frame = int(page.get_attribute("html", "data-frame"))
    assert becomes(page, lambda: int(page.get_attribute("html", "data-frame")) > frame + 15)
    assert page.evaluate("cockpit.plots.quantities.reports.count") == kept
    local = tab(page_of("five_bar"))
    unfold(local, "plots")
    local.evaluate(
        "cockpit.send({ type: 'move_joint', robot: 'five_bar', joint: 'joint1', value: 1 })".replace("joint1", first)
    )
    assert becomes(local, lambda: local.evaluate(LINES, ["angles", "--blue"]) > 5)


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
        return [one.name for one in five_bar.state.waypoints] == list(names) == rows.all_inner_texts()

    unfold(page, "waypoints")
    rows = page.locator("#waypoints .go")
    home = value()
    page.fill("#waypoint-name", HOSTILE + "x" * 50)
    page.press("#waypoint-name", "Enter")
    assert becomes(page, lambda: listed((HOSTILE + "x" * 50)[:40]))
    assert page.locator("#waypoints img").count() == 0
    page.locator(f'[data-joint="five_bar/{first}"] input[type=number]').fill(str(np.degrees(home + 0.3)))
    page.keyboard.press("Enter")
    assert becomes(page, lambda: abs(value() - home - 0.3) < 1e-3 and five_bar.state.moving is None)
    moved = value()
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
    page.click("#snapshot")  # from now on the camera is the user's
    page.evaluate("camera => cockpit.view.setCamera(camera)", CAMERA)
    page.evaluate(
        "([joint, value]) => cockpit.send({ type: 'move_joint', robot: 'five_bar', joint, value })", [first, home + 0.2]
    )
    assert becomes(
        page, lambda: page.evaluate(f"Math.abs(cockpit.report.robots.five_bar.q[{index}] - {home + 0.2}) < 1e-9")
    )
    page.click("#copy-link")
    assert becomes(page, lambda: "token" in page.inner_text("#toasts"))
    link = page.evaluate("navigator.clipboard.readText()")
    assert link.startswith(five_bar.url + "#five_bar=")
    page.evaluate("cockpit.send({ type: 'move_home' })")
    page.evaluate("cockpit.frame()")
    assert becomes(page, lambda: page.evaluate(f"Math.abs(cockpit.report.robots.five_bar.q[{index}] - {home}) < 1e-9"))
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


SMALL = {"width": 800, "height": 300}  # drawn quickly
FRAMES = "Number(document.getElementById('film-stop').dataset.frames)"
ENDED = "document.getElementById('film-stop').hidden"


def has_moved(page, joint):
    """Move the five-bar while a film is made, until frames before and after the motion are in it."""
    assert becomes(page, lambda: page.evaluate(f"{FRAMES} > 2"))
    page.evaluate("joint => cockpit.send({ type: 'move_joint', robot: 'five_bar', joint, value: 2.6 })", joint)
    index = page.evaluate("joint => cockpit.hello.robots[0].joints.findIndex(({ name }) => name === joint)", joint)
    assert becomes(page, lambda: page.evaluate(f"Math.abs(cockpit.report.robots.five_bar.q[{index}] - 2.6) < 1e-6"))
    seen = page.evaluate(FRAMES)
    assert becomes(page, lambda: page.evaluate(f"{FRAMES} > {seen + 2} || {ENDED}"))


@pytest.mark.slow
def test_a_film_of_what_the_view_shows(five_bar, tab, tmp_path):
    page = tab(five_bar)
    first, *_ = five_bar.setup.robots["five_bar"].actuated
    page.set_viewport_size(SMALL)
    page.click("#snapshot")
    page.click("#film-video")
    assert page.is_visible("#film-stop")
    has_moved(page, first)
    assert page.inner_text("#film-stop").strip().endswith("/ 60 s")
    content, name = downloaded(page, lambda: page.click("#film-stop"))
    assert name == "five_bar.webm"
    assert not page.is_visible("#film-stop")
    path = tmp_path / name
    path.write_bytes(content)
    meta, *frames = imageio_ffmpeg.read_frames(str(path), pix_fmt="rgb24")
    width, height = meta["size"]
    assert (width, height) == tuple(page.evaluate("[cockpit.view.canvas.width, cockpit.view.canvas.height]"))
    ends = (frames[0], frames[-1])
    start, end = (np.frombuffer(frame, np.uint8).reshape(height, width, 3).astype(int) for frame in ends)
    assert (start.max(axis=2) - start.min(axis=2) > 60).mean() > 0.002  # a robot in colours
    assert np.abs(end - start).max() > 60  # that has moved


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
    unfold(page, "users")
    assert becomes(
        page, lambda: set(page.locator("#users li").all_inner_texts()) == {f"{HOSTILE} (you)", HOSTILE[::-1]}
    )
    picture(page, "users")
    other.say("set_cursor", robot="five_bar", node="link1", dragging=True)
    assert becomes(page, lambda: label.all_inner_texts() == [f"{HOSTILE[::-1]} drags"])

    def seen():
        """What the other user sees of the page's."""
        return next((one for one in other.users if one["client"] == page.evaluate("cockpit.hello.client")), {})

    assert becomes(page, lambda: page.evaluate("cockpit.report.clients === 2"))
    x, y, *point = find(page, "five_bar", "link2")
    page.mouse.move(x, y)
    assert becomes(page, lambda: seen().get("node") == "link2")
    assert (seen()["name"], seen()["robot"], seen()["dragging"]) == (HOSTILE, "five_bar", False)
    mechanism, q = five_bar.setup.robots["five_bar"], five_bar.state.robots["five_bar"].q
    assert mechanism.placement(q, "link2").act(np.array(seen()["point"])) == pytest.approx(np.array(point), abs=0.05)
    page.mouse.move(5, 500)
    assert becomes(page, lambda: seen().get("robot") is None)
    other.leave()
    assert becomes(page, lambda: label.count() == 0)
