"""What the cockpit costs at rest and in motion, with one page and with four: a Gough platform at 1 kHz, 60 states a
second; and how long a user waits for the robot.

    python benchmarks/cockpit.py [--seconds 10] [--rounds 3] [--robot robots/gough.raff]

`page_frames.py` measures what the page itself costs.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import multiprocessing
import statistics
import time
import warnings
from typing import Any, NamedTuple

import psutil
import tornado.websocket

import cinegen
from cinegen.cockpit import Cockpit
from cinegen.session import arrange

CLIENTS = 4


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
        looking = [asyncio.ensure_future(look(url, received)) for received in sizes]
        await asyncio.sleep(2.0)
        for received in sizes:
            received.clear()
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
    spent, begin = sum(sum(process.cpu_times()[:2]) for process in processes), time.perf_counter()
    sizes = receiver.recv()
    passed = time.perf_counter() - begin
    core = sum(sum(process.cpu_times()[:2]) for process in processes) - spent
    pages.join()
    every = [size for received in sizes for size in received]
    rates = (amount / count / passed for amount in (len(every), sum(every) / 1e3))
    return Cost(count, *rates, statistics.median(every or [0]), core / passed)


def compare(cockpit: Cockpit, seconds: float, rounds: int) -> None:
    """Print what one page and several cost in turn, and the ratio of the medians, each for as many states."""
    costs: dict[int, list[Cost]] = {1: [], CLIENTS: []}
    for _ in range(rounds):
        for count, measured in costs.items():
            measured.append(cost(cockpit, count, seconds))
            print(f"in motion, {measured[-1]}", flush=True)
    few, many = (statistics.median(sample.core / sample.messages for sample in measured) for measured in costs.values())
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
    options = parser.parse_args()
    warnings.simplefilter("ignore", cinegen.CinegenWarning)
    mechanism = cinegen.load(options.robot)
    with Cockpit(arrange({"robot": mechanism}), port=7900) as cockpit:
        for count in (1, CLIENTS):
            print(f"at rest, {cost(cockpit, count, options.seconds)}")
    with Cockpit(arrange({"robot": mechanism}, follow="circle"), port=7900) as cockpit:
        compare(cockpit, options.seconds, options.rounds)
        print(f"the solver meanwhile:\n{cockpit.runner.report()}")
        print(f"a user waits: {summary(asyncio.run(drag(cockpit.session_url, 'robot', mechanism.end, 200)))}")


if __name__ == "__main__":
    main()
