"""Processor time of the scripts of a page without a server in a frame, while a part is dragged in Chromium.

    python benchmarks/page_frames.py [SECONDS] [ROBOT ...]

The page is opened from a file, and the last part of the robot that is seen is dragged along circles. Chromium traces
how much processor time its scripts take in each frame: ticks, kinematics and calls of WebGL, without what draws the
picture. The window is small, since software rendering is slow: the scripts' time does not depend on its size. At fewer
than 60 frames a second a frame has more than 4 ticks.

Needs Chromium and playwright.
"""

from __future__ import annotations

import json
import math
import shutil
import statistics
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, sync_playwright

import cinegen
from cinegen.page import build_page
from cinegen.page.build import RATE
from cinegen.session import Setup

ROOT = Path(__file__).resolve().parents[1]
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-rasterization"]
SIZE = {"width": 480, "height": 360}
READY = "document.documentElement.dataset.view === 'ready' && Boolean(window.cockpit?.report)"
SCRIPTS = ("FireAnimationFrame", "FunctionCall", "TimerFire", "EventDispatch", "MinorGC", "MajorGC")
WHERE = """([robot, node]) => {
  const box = cockpit.viewer.renderer.domElement.getBoundingClientRect();
  for (let y = 4; y < box.height; y += 2) for (let x = 4; x < box.width; x += 2) {
    const hit = cockpit.pick.touched({ clientX: box.left + x, clientY: box.top + y });
    if (hit?.robot === robot && hit.node === node) return [box.left + x, box.top + y];
  }
}"""


def main(seconds: float = 10.0, *names: str) -> None:
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        print("CPU ms of scripts in a frame\n\nrobot       frames a second   median   90 %   ticks")
        for name in names or ("gough", "delta4"):
            mechanism = cinegen.load(ROOT / "robots" / f"{name}.raff")
            path = Path(folder, f"{name}.html")
            path.write_text(build_page(Setup({name: mechanism})))
            page = browser.new_page(viewport=SIZE, bypass_csp=True)
            page.goto(path.as_uri())
            page.wait_for_function(READY, polling=100)
            frames = traced(browser, page, name, list(mechanism.nodes), seconds)
            rate = len(frames) / seconds
            ninth = sorted(frames)[int(0.9 * len(frames))]
            print(f"{name:12}{rate:15.0f}{statistics.median(frames):9.2f}{ninth:7.2f}{RATE / rate:8.1f}", flush=True)
            page.close()


def traced(browser: Browser, page: Page, robot: str, nodes: list[str], seconds: float) -> list[float]:
    """Return the processor time of each frame's scripts, ms, while the last node that is seen is dragged."""
    x, y = next(position for node in reversed(nodes) if (position := page.evaluate(WHERE, [robot, node])))
    page.mouse.move(x, y)
    page.mouse.down()
    drag(page, x, y, 3.0)  # until its code is optimized
    browser.start_tracing(page=page, categories=["devtools.timeline"])
    drag(page, x, y, seconds)
    events = json.loads(browser.stop_tracing())["traceEvents"]
    page.mouse.up()
    return frame_times(events)


def drag(page: Page, x: float, y: float, seconds: float) -> None:
    """Move the pointer along circles, 60 times a second."""
    begin = time.monotonic()
    while (now := time.monotonic() - begin) < seconds:
        page.mouse.move(x + 40.0 * math.sin(4.0 * now), y + 20.0 * (1.0 - math.cos(4.0 * now)))
        page.wait_for_timeout(14)


def frame_times(events: list[dict[str, Any]]) -> list[float]:
    """Return the processor time of all scripts from one frame to the next, ms."""
    threads = Counter((event["pid"], event["tid"]) for event in events if event["name"] == "FireAnimationFrame")
    thread = threads.most_common(1)[0][0]
    timed = [event for event in events if (event["pid"], event["tid"]) == thread and "tdur" in event]
    times, end = list[float](), 0.0
    for event in sorted(timed, key=lambda event: event["ts"]):
        if event["name"] == "FireAnimationFrame":
            times.append(0.0)
        if event["name"] in SCRIPTS and event["ts"] >= end and times:  # what is inside another one is counted there
            times[-1] += event["tdur"] / 1000.0
            end = event["ts"] + event["dur"]
    return times


if __name__ == "__main__":
    main(*(float(word) if word.replace(".", "").isdigit() else word for word in sys.argv[1:]))
