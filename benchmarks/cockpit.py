"""What the cockpit keeps up with: a Gough platform at 1 kHz while four browsers take 60 states a second, and how long a
user waits for the robot.

    python benchmarks/cockpit.py [--seconds 10] [--robot robots/gough.raff] [--browser]

`--browser` also drags the part in a headless chromium and times it there: from the pointer's event to the robot's new
state applied in the page.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import multiprocessing
import shutil
import statistics
import time
import warnings
from typing import Any

import tornado.websocket

import cinegen
from cinegen.cockpit import Cockpit
from cinegen.session import arrange

CLIENTS = 4
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run")


async def look(url: str, seconds: float) -> int:
    """A browser that takes every state at once; how many it got."""
    socket = await tornado.websocket.websocket_connect(url)
    count, begin = 0, time.perf_counter()
    while time.perf_counter() < begin + seconds:
        said = json.loads(await socket.read_message())
        if said["type"] == "state":
            count += 1
            await socket.write_message(json.dumps({"type": "ack", "frame": said["frame"]}))
    return count


def watchers(url: str, seconds: float, answers: Any) -> None:
    """All of them, in a process of their own."""

    async def run() -> list[int]:
        return await asyncio.gather(*(look(url, seconds) for _ in range(CLIENTS)))

    answers.send(asyncio.run(run()))


async def drag(url: str, robot: str, node: str, count: int) -> list[float]:
    """Drags a node to and fro; s from each message to the first state in which the target is there."""
    socket = await tornado.websocket.websocket_connect(url)
    socket.protocol.set_nodelay(True)  # as browsers do

    async def state() -> dict[str, Any]:
        while True:
            said: dict[str, Any] = json.loads(await socket.read_message())
            if said["type"] == "state":
                await socket.write_message(json.dumps({"type": "ack", "frame": said["frame"]}))
                return said

    await socket.write_message(json.dumps({"type": "start_drag", "robot": robot, "node": node, "point": [0, 0, 0]}))
    while not (tasks := (await state())["tasks"]):
        pass
    home, waited = tasks[0]["target"][:3], []
    for number in range(count):
        to = [home[0], home[1], home[2] - 0.001 * (number % 7)]
        begin = time.perf_counter()
        await socket.write_message(json.dumps({"type": "move_drag", "position": to}))
        while abs((await state())["tasks"][0]["target"][2] - to[2]) > 1e-9:
            pass
        waited.append(time.perf_counter() - begin)
    await socket.write_message(json.dumps({"type": "request_control", "on": False}))
    socket.close()
    await asyncio.sleep(0.2)
    return waited


def in_a_browser(url: str, count: int) -> list[float]:
    """The same with a mouse in a real page."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        tab = chromium.new_page(viewport={"width": 700, "height": 450}, bypass_csp=True)
        tab.goto(url)
        tab.wait_for_function("document.documentElement.dataset.view === 'ready'", timeout=60_000)
        x, y = tab.evaluate(TOUCH)
        tab.mouse.move(x, y)
        tab.mouse.down()
        tab.mouse.move(x + 8, y)
        tab.wait_for_function("cockpit.state.tasks.some((task) => task.source === 'pointer')")
        tab.evaluate(TIME)
        for number in range(count):
            tab.mouse.move(x + 8 + 4 * (number % 5), y + 3 * (number % 4))
            tab.wait_for_timeout(30 + 7 * (number % 5))
        waited: list[float] = tab.evaluate("window.waited")
        chromium.close()
    return [ms / 1000.0 for ms in waited]


TOUCH = """() => {
  const box = cockpit.viewer.renderer.domElement.getBoundingClientRect();
  for (let y = 10; y < box.height; y += 5) for (let x = 10; x < box.width; x += 5) {
    const at = { clientX: box.left + x, clientY: box.top + y };
    if (cockpit.pick.touched(at) !== null) return [at.clientX, at.clientY];
  }
}"""
"""Where on the screen a robot can be touched."""

TIME = """() => {
  window.waited = [];
  let begun = null;
  const target = () => JSON.stringify(cockpit.state.tasks.find((task) => task.source === "pointer")?.target);
  window.addEventListener("pointerrawupdate", () => { begun ??= { at: performance.now(), target: target() }; }, true);
  new MutationObserver(() => {  // of the number of the last state applied
    if (begun !== null && target() !== begun.target) {
      window.waited.push(performance.now() - begun.at);
      begun = null;
    }
  }).observe(document.documentElement, { attributeFilter: ["data-frame"] });
}"""
"""Times each event of the pointer, from when the page hears of it until it has applied a state with another target."""


def told(waited: list[float]) -> str:
    ordered = sorted(waited)
    return (
        f"median {1e3 * statistics.median(waited):.1f} ms, 90 % within {1e3 * ordered[int(0.9 * len(ordered))]:.1f} ms"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="robots/gough.raff")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--browser", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore", cinegen.CinegenWarning)
    mechanism = cinegen.load(options.robot)
    context = multiprocessing.get_context("spawn")
    with Cockpit(arrange({"robot": mechanism}, follow="circle"), port=7900) as cockpit:
        receiver, sender = context.Pipe(duplex=False)
        process = context.Process(target=watchers, args=(cockpit.session_url, options.seconds, sender))
        process.start()
        counts = receiver.recv()
        process.join()
        print(f"{CLIENTS} browsers: {', '.join(f'{count / options.seconds:.1f}' for count in counts)} states a second")
        print(f"the solver meanwhile:\n{cockpit.runner.report()}")
        print(f"a user waits: {told(asyncio.run(drag(cockpit.session_url, 'robot', mechanism.end, 200)))}")
        if options.browser:
            waited = in_a_browser(cockpit.url, 30)
            print(f"in a browser, from the pointer's event to the state applied: {told(waited)}")


if __name__ == "__main__":
    main()
