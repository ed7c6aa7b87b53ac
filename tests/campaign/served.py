"""A page that is served by a process of its own, and clients of it: one that is honest, and the sockets of those that
are not."""

import json
import math
import multiprocessing
import os
import re
import resource
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Self
from urllib.parse import urlsplit

import psutil

from campaign.readers import ROOT
from campaign.workers import die_with_parent

UPGRADE = (
    *("Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"),
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
)
"""Headers of who asks for a websocket."""

_STATES, _GAP, _LAST, _ENDED, _WRONG = range(5)


class Served:
    """`cinegen drive` of some robots, without a browser.

    Attributes:
        url: of the page.
        process: of the command.
    """

    def __init__(self, robots: Sequence[str], *options: str) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="served")
        self._output = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the process)
        self._read = 0
        command = [sys.executable, "-m", "cinegen", "drive", *(str(ROOT / robot) for robot in robots)]
        command += ["--no-browser", "--no-token", "--seconds", "1e6", *options]
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1", "COLUMNS": "200"}
        self.process = subprocess.Popen(
            command, cwd=self._folder.name, env=environment, start_new_session=True, preexec_fn=_unlimited,
            stdin=subprocess.DEVNULL, stdout=self._output, stderr=self._output,
        )  # fmt: skip
        self.url = self._address(120.0)

    def _address(self, seconds: float) -> str:
        end, text = time.monotonic() + seconds, ""
        while time.monotonic() < end and self.process.poll() is None:
            self._output.seek(0)
            text = self._output.read().decode(errors="replace")
            if match := re.search(r"http://[\w.]+:\d+/\S*", text):
                self._read = len(text.encode())
                return match[0]
            time.sleep(0.05)
        self.stop()
        raise RuntimeError(f"the page is not served: {text}")

    def output(self) -> str:
        """Return what it has printed since the last call."""
        self._output.seek(self._read)
        new = self._output.read()
        self._read += len(new)
        return new.decode(errors="replace")

    def memory(self) -> float:
        """Return the resident memory of all its processes, MB."""
        total = 0
        with suppress(psutil.NoSuchProcess):  # it has ended, or one of them just now
            whole = psutil.Process(self.process.pid)
            for process in (whole, *whole.children(recursive=True)):
                total += process.memory_info().rss
        return total / 1e6

    def stop(self) -> int | None:
        """Interrupt it; return its exit code, or None if it had to be killed."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            return self.process.wait(15.0)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
            return None


def _unlimited() -> None:
    """A server may work longer than a case, but not longer than its campaign."""
    resource.setrlimit(resource.RLIMIT_CPU, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    die_with_parent()


class Peer:
    """A client with its hands on the socket."""

    def __init__(self, url: str, seconds: float = 10.0, room: int | None = None) -> None:
        self.address = urlsplit(url)
        self.socket = socket.socket()
        self.socket.settimeout(seconds)
        if room is not None:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)
        self.socket.connect((self.address.hostname, self.address.port))
        self._pending = b""

    def request(self, path: str, *headers: str, host: str | None = None) -> Self:
        """Send a request, and return the client."""
        query = f"?{self.address.query}" if self.address.query else ""
        host = self.address.netloc if host is None else host
        lines = [f"GET /{path}{query} HTTP/1.1", f"Host: {host}", *headers, "", ""]
        self.socket.sendall("\r\n".join(lines).encode())
        return self

    def upgrade(self, path: str = "session") -> bool:
        """Open a websocket; return whether that is allowed."""
        self.request(path, *UPGRADE)
        while b"\r\n\r\n" not in self._pending:
            if not (new := self.socket.recv(4096)):
                return False
            self._pending += new
        head, _, self._pending = self._pending.partition(b"\r\n\r\n")
        return head.startswith(b"HTTP/1.1 101")

    def frame(self) -> tuple[int, bytes] | None:
        """Return the opcode and the payload of the next frame; None if the connection has ended."""
        head = self._take(2)
        if head is None:
            return None
        size = head[1] & 127
        if size > 125:
            more = self._take(2 if size == 126 else 8)
            size = int.from_bytes(more or b"\0", "big")
        payload = self._take(size)
        return None if payload is None else (head[0] & 15, payload)

    def _take(self, size: int) -> bytes | None:
        while len(self._pending) < size:
            if not (new := self.socket.recv(65536)):
                return None
            self._pending += new
        taken, self._pending = self._pending[:size], self._pending[size:]
        return taken

    def send(self, **message: Any) -> None:
        """Send a message."""
        self.socket.sendall(framed(json.dumps(message).encode()))

    def vanish(self) -> None:
        """Reset the connection."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()


def framed(payload: bytes, opcode: int = 1, final: bool = True, mask: bytes = b"\1\2\3\4") -> bytes:
    """Return a frame of a client."""
    size = len(payload)
    long = b"\xfe" + struct.pack(">H", size) if size < 65536 else b"\xff" + struct.pack(">Q", size)
    length = bytes([0x80 | size]) if size < 126 else long
    key = int.from_bytes((mask * (size // 4 + 1))[:size], "big")
    masked = (int.from_bytes(payload, "big") ^ key).to_bytes(size, "big")
    return bytes([(0x80 if final else 0) | opcode]) + length + mask + masked


class Honest:
    """A client that does what it should, in a process of its own: it must be served all along.

    Attributes:
        states: number of states that it got.
        gap: longest time between two states, s.
        ended: how often it was disconnected.
        wrong: number of states with numbers that are not finite.
    """

    def __init__(self, url: str) -> None:
        context = multiprocessing.get_context("fork")
        self._shared = context.Array("d", 5, lock=False)
        self._process = context.Process(target=_watch, args=(url, self._shared), daemon=True)
        self._process.start()

    states = property(lambda self: int(self._shared[_STATES]))
    ended = property(lambda self: int(self._shared[_ENDED]))
    wrong = property(lambda self: int(self._shared[_WRONG]))

    @property
    def gap(self) -> float:
        """Return the longest time between two states since the last call, s."""
        last = self._shared[_LAST]
        longest = max(self._shared[_GAP], time.monotonic() - last if last else 0.0)
        self._shared[_GAP] = 0.0
        return float(longest)

    def stop(self) -> None:
        """End it."""
        self._process.kill()
        self._process.join()


def _watch(url: str, shared: Any) -> None:
    while True:
        try:
            peer = Peer(url, 30.0)
            peer.upgrade()
            while (frame := peer.frame()) is not None:
                opcode, payload = frame
                if opcode == 9:
                    peer.socket.sendall(framed(payload, 10))
                if opcode == 8:
                    break
                message = json.loads(payload) if opcode == 1 else {}
                if message.get("type") == "state":
                    now = time.monotonic()
                    if shared[_LAST]:
                        shared[_GAP] = max(shared[_GAP], now - shared[_LAST])
                    shared[_LAST] = now
                    shared[_STATES] += 1
                    poses = [x for pose in message["poses"].values() for x in pose]
                    shared[_WRONG] += not all(x is not None and math.isfinite(x) for x in poses)
                    peer.send(type="ack", frame=message["frame"])
        except OSError:
            pass
        shared[_ENDED] += 1
        time.sleep(0.2)
