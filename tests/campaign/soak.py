"""A long session with clients and browsers that come and go: its memory stays flat, and an honest client is served."""

import contextlib
import json
import shutil
import socket
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from scipy.stats import theilslopes

from campaign.judge import Finding
from campaign.messages import Messages
from campaign.served import Peer, Served
from campaign.workers import Result

_EVERY = 5.0  # s between two looks at the memory
_WARM = 60.0  # s until the memory must be flat
_SLOPE = 20.0  # MB per hour that it may grow, besides
_NOISE = 10.0  # MB
_LONG = 600.0  # s of flat memory, without which growth is not judged
_CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def soak(folder: Path, seconds: float, seed: int, progress: Callable[[Result, float], None]) -> Result:
    """Run a session.

    Args:
        folder: of the browsers' profiles.
        seconds: time.
        seed: of what the clients do.
        progress: called every few seconds with what is done, and the fraction of it.
    """
    rng, result, began = Random(f"{seed}/soak"), Result(), time.monotonic()
    server = Served(("robots/planar_3r.raff", "robots/delta4.raff"), "--port", "8600")
    visitor = Messages(seed)
    visitor.watch(server)
    memory: list[tuple[float, float]] = []
    pages: list[subprocess.Popen[bytes]] = []
    looked = 0.0

    def look(now: float) -> None:
        counts = {"honest states": 0}
        findings = [Finding("soak:0", *fault) for fault in visitor.broken(counts)]
        memory.append((now, server.memory()))
        worst = {"longest gap of an honest client, s": [visitor.gap, f"at {now:.0f} s"], "memory, MB": [memory[-1][1]]}
        result.add(counts, worst, findings)
        result.counts["s"], result.seconds = int(now), now
        progress(result, now / seconds)

    try:
        while (now := time.monotonic() - began) < seconds and server.process.poll() is None:
            result.counts.update(_visit(rng, visitor, server.url))
            if _CHROMIUM and rng.random() < 0.01:
                pages.append(_page(server.url, int(result.counts["pages"]), folder))
                result.counts["pages"] += 1
            if pages and rng.random() < 0.05:
                _close(pages.pop(0))
            if now - looked > _EVERY:
                looked = now
                look(now)
        result.add({}, {}, list(_growth(memory, result)))
        look(time.monotonic() - began)
        result.worst["states of an honest client per second"] = visitor.honest.states / result.seconds
    finally:
        for page in pages:
            _close(page)
        visitor.honest.stop()
        code = server.stop()
    if code not in (0, 130):
        result.add({}, {}, [Finding("soak:0", "not stopped", str(code), server.output())])
    result.seconds = time.monotonic() - began
    return result


def _growth(memory: list[tuple[float, float]], result: Result) -> Any:
    """Yield a finding if the memory grows; note its slope (Theil and Sen: the median of all slopes)."""
    warm = [(at, size) for at, size in memory if at >= min(_WARM, memory[-1][0] / 3)]
    if len(warm) < 3:
        return
    at, size = np.array(warm[:: max(1, len(warm) // 400)]).T
    slope = float(theilslopes(size, at)[0]) * 3600.0
    result.worst["memory grows, MB/h"] = slope
    result.worst["memory at first, MB"] = float(size[0])
    if at[-1] - at[0] > _LONG and slope * (at[-1] - at[0]) / 3600.0 > _NOISE and slope > _SLOPE:
        yield Finding("soak:0", "memory grows", "", f"{slope:.1f} MB per hour, from {size[0]:.0f} to {size[-1]:.0f} MB")


def _visit(rng: Random, visitor: Messages, url: str) -> dict[str, int]:
    """Come as a browser, look a while, drag something, and go in some way."""
    messages = 0
    with contextlib.suppress(OSError):
        peer = Peer(url, 5.0, 4096 if rng.random() < 0.1 else None)
        if peer.upgrade("scene" if rng.random() < 0.3 else "session"):
            peer.socket.settimeout(0.5)
            for _ in range(rng.randint(0, 20)):
                with contextlib.suppress(TimeoutError):
                    frame = peer.frame()
                    if frame is None or frame[0] == 8:
                        break
                    if frame[0] == 1 and b'"state"' in frame[1][:40]:
                        peer.send(type="ack", frame=json.loads(frame[1])["frame"])
                if rng.random() < 0.5:
                    peer.send(**visitor.message(rng))
                    messages += 1
        if (how := rng.randrange(3)) == 0:
            peer.vanish()
        elif how == 1:
            peer.socket.shutdown(socket.SHUT_WR)
        peer.socket.close()
    time.sleep(rng.expovariate(10.0))
    return {"visits": 1, "messages": messages}


def _page(url: str, number: int, folder: Path) -> subprocess.Popen[bytes]:
    """Open the real page in a browser without a window."""
    command = [
        str(_CHROMIUM), "--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0",
        f"--user-data-dir={folder / str(number % 4)}", url,
    ]  # fmt: skip
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)


def _close(page: subprocess.Popen[bytes]) -> None:
    page.terminate()
    try:
        page.wait(10.0)
    except subprocess.TimeoutExpired:
        page.kill()
        page.wait()
