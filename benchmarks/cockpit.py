"""What the cockpit costs at rest and in motion, with one page and with four: a Gough platform at 1 kHz, 60 states a
second; and how long a user waits for the robot.

    python benchmarks/cockpit.py [--seconds 10] [--rounds 3] [--robot robots/gough.raff] [--browser] [--bodies 1000]

`--browser` also drags the part in a headless chromium and times it there: from the pointer's event to the robot's new
state applied in the page. `--bodies` only opens a page of a chain of so many links, and says what its picture costs.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import multiprocessing
import shutil
import statistics
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import psutil
import tornado.websocket

import cinegen
from cinegen.cockpit import Cockpit
from cinegen.session import arrange

CLIENTS = 4
FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run")


async def look(url: str, sizes: list[int]) -> None:
    """A page that takes every state at once; bytes of each message."""
    socket = await tornado.websocket.websocket_connect(url)
    while True:
        message = await socket.read_message()
        sizes.append(len(message))
        if isinstance(message, bytes) and message[0] == 0:  # a state
            frame = json.loads(message[8 : 8 + int.from_bytes(message[4:8], "little")])["frame"]
            await socket.write_message(json.dumps({"type": "ack", "frame": frame}))


def watchers(url: str, count: int, seconds: float, answers: Any) -> None:
    """Pages, in a process of their own: bytes of what each was sent after two seconds."""

    async def run() -> list[list[int]]:
        sizes: list[list[int]] = [[] for _ in range(count)]
        looking = [asyncio.ensure_future(look(url, one)) for one in sizes]
        await asyncio.sleep(2.0)
        for one in sizes:
            one.clear()
        answers.send(None)
        await asyncio.sleep(seconds)
        for task in looking:
            task.cancel()
        return sizes

    answers.send(asyncio.run(run()))


class Cost(NamedTuple):
    """What a number of pages cost: messages and kB a second to each, median bytes, and the share of a core."""

    pages: int
    messages: float
    kilobytes: float
    median: float
    core: float

    def __str__(self) -> str:
        sent = f"each is sent {self.messages:.1f} messages and {self.kilobytes:.1f} kB a second"
        return f"pages: {self.pages}; {sent}, median {self.median:.0f} bytes; {self.core:.3f} of a core"


def cost(cockpit: Cockpit, count: int, seconds: float) -> Cost:
    """Measure what a number of pages cost."""
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    url = cockpit.session_url.replace("/session", "/page")
    pages = context.Process(target=watchers, args=(url, count, seconds, sender))
    server = psutil.Process()
    processes = [server, *server.children(recursive=True)]
    pages.start()
    receiver.recv()
    spent, begin = sum(sum(one.cpu_times()[:2]) for one in processes), time.perf_counter()
    sizes = receiver.recv()
    passed = time.perf_counter() - begin
    core = sum(sum(one.cpu_times()[:2]) for one in processes) - spent
    pages.join()
    every = [size for one in sizes for size in one]
    rates = (amount / count / passed for amount in (len(every), sum(every) / 1e3))
    return Cost(count, *rates, statistics.median(every or [0]), core / passed)


def compare(cockpit: Cockpit, seconds: float, rounds: int) -> None:
    """Print what one page and several cost in turn, and the ratio of the medians, each for as many states."""
    costs: dict[int, list[Cost]] = {1: [], CLIENTS: []}
    for _ in range(rounds):
        for count, measured in costs.items():
            measured.append(cost(cockpit, count, seconds))
            print(f"in motion, {measured[-1]}", flush=True)
    few, many = (statistics.median(one.core / one.messages for one in measured) for measured in costs.values())
    print(f"{CLIENTS} pages cost {many / few:.2f} of one for a state, {rounds} rounds")


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


PICTURE = """async () => {
  const { view, viewer } = cockpit;
  const { info } = viewer.renderer;
  info.autoReset = false;
  info.reset();
  viewer.set_dirty();
  viewer.render();
  const { calls, triangles } = info.render;
  info.autoReset = true;
  const times = [];
  for (let frames = 0, last = performance.now(); frames < 20; frames += 1) {
    view.changed();
    await new Promise(requestAnimationFrame);
    times.push(performance.now() - last);
    last = performance.now();
  }
  return [calls, triangles, times.sort((a, b) => a - b)[10]];
}"""
"""Draw calls and triangles of a picture, and the median time of one in a motion, ms."""


def picture(bodies: int) -> None:
    """Print what a chain of links costs until it is seen, and then."""
    from playwright.sync_api import sync_playwright

    link = "link {} {{ parameters {{ theta 20 d {} r 5 }} type 2 pred {} }}"
    links = "\n".join(link.format(i, 100 * (i > 1), i - 1) for i in range(1, bodies + 1))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "chain.raff")
        path.write_text(f"RAFF Chain\nrobot chain {{\nbase {{ }}\n{links}\n}}\n")
        begin = time.perf_counter(), time.process_time()
        mechanism = cinegen.load(path)
        print(f"loaded in {time.perf_counter() - begin[0]:.1f} s, {time.process_time() - begin[1]:.1f} s of a core")
    begin = time.perf_counter(), time.process_time()
    with Cockpit(arrange({"robot": mechanism}), port=7900) as cockpit, sync_playwright() as playwright:
        print(f"served in {time.perf_counter() - begin[0]:.1f} s, {time.process_time() - begin[1]:.1f} s of a core")
        messages = cockpit.page.scene().values()
        print(f"{len(messages)} drawing commands, {sum(map(len, messages)) / 1e6:.1f} MB")
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        tab = chromium.new_page(viewport={"width": 1440, "height": 900}, bypass_csp=True)
        start = time.perf_counter()
        tab.goto(cockpit.url, wait_until="commit")
        tab.wait_for_function("document.documentElement.dataset.view === 'ready'", timeout=300_000)
        print(f"whole picture after {time.perf_counter() - start:.1f} s")
        calls, triangles, frame = tab.evaluate(PICTURE)
        print(f"{calls} draw calls and {triangles} triangles with the shadow; {frame:.0f} ms a frame in motion")
        chromium.close()


def summary(waited: list[float]) -> str:
    ordered = sorted(waited)
    return (
        f"median {1e3 * statistics.median(waited):.1f} ms, 90 % within {1e3 * ordered[int(0.9 * len(ordered))]:.1f} ms"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="robots/gough.raff")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--browser", action="store_true")
    parser.add_argument("--bodies", type=int)
    options = parser.parse_args()
    warnings.simplefilter("ignore", cinegen.CinegenWarning)
    if options.bodies:
        picture(options.bodies)
        return
    mechanism = cinegen.load(options.robot)
    with Cockpit(arrange({"robot": mechanism}), port=7900) as cockpit:
        for count in (1, CLIENTS):
            print(f"at rest, {cost(cockpit, count, options.seconds)}")
    with Cockpit(arrange({"robot": mechanism}, follow="circle"), port=7900) as cockpit:
        compare(cockpit, options.seconds, options.rounds)
        print(f"the solver meanwhile:\n{cockpit.runner.report()}")
        print(f"a user waits: {summary(asyncio.run(drag(cockpit.session_url, 'robot', mechanism.end, 200)))}")
        if options.browser:
            waited = in_a_browser(cockpit.url, 30)
            print(f"in a browser, from the pointer's event to the state applied: {summary(waited)}")


if __name__ == "__main__":
    main()
