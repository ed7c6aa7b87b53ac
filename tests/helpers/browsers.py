"""Browsers that draw nothing: what they say and are told, in one thread."""

import asyncio
import contextlib
import http.client
import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from urllib.parse import urlsplit

import tornado.websocket
from leftovers import SHARED
from tornado.httpclient import HTTPRequest

PLAIN = {"undo", "redo", "end_drag"}
"""Types of messages without fields that tests send."""


@cache
def _loop():
    """The event loop of all browsers, in a thread that never ends."""
    loop = asyncio.new_event_loop()
    loop.set_default_executor(ThreadPoolExecutor(thread_name_prefix=SHARED))
    threading.Thread(target=loop.run_forever, name=f"{SHARED}: browsers", daemon=True).start()
    return loop


class Browser:
    """One on a session. Acknowledges frames at once unless it is `lazy`."""

    def __init__(self, url, lazy=False, path="session", **headers):
        self.lazy, self.told, self.state, self.report, self.closed = lazy, [], None, None, None
        self.frames, self.users, self.received = 0, [], 0  # states, users, bytes of messages
        self.loop = _loop()
        address = urlsplit(url)
        query = f"?{address.query}" if address.query else ""
        request = HTTPRequest(f"ws://{address.netloc}/{path}{query}", headers=headers)
        self.connection = self._now(tornado.websocket.websocket_connect, request)
        asyncio.run_coroutine_threadsafe(self._listen(), self.loop)

    def _now(self, function, *arguments):
        async def wait():
            return await function(*arguments)

        return asyncio.run_coroutine_threadsafe(wait(), self.loop).result(20)

    async def _listen(self):
        while (message := await self.connection.read_message()) is not None:
            if isinstance(message, bytes) and message[0] != 0:  # it is drawn
                self.told.append(message)
                continue
            self.received += len(message)
            if isinstance(message, bytes):
                message = message[8 : 8 + int.from_bytes(message[4:8], "little")]
            said = json.loads(message)
            if said["type"] == "state":
                self.state, self.frames = said, self.frames + 1
                self.report = said.get("report", self.report)
                self.users = said.get("users", self.users)
                if not self.lazy:
                    with contextlib.suppress(tornado.websocket.WebSocketClosedError):
                        await self.connection.write_message(json.dumps({"type": "ack", "frame": said["frame"]}))
            else:
                self.told.append(said)
        self.closed = self.connection.close_code, self.connection.close_reason
        self.connection.close()  # else it warns when it is collected, in the middle of another test

    def say(self, said, **fields):
        """Send a message by its type and fields, or any text or bytes."""
        message = json.dumps({"type": said, **fields}) if fields or said in PLAIN else said
        binary = isinstance(message, bytes)
        with contextlib.suppress(tornado.websocket.WebSocketClosedError):
            self._now(self.connection.write_message, message, binary)

    def leave(self):
        self.loop.call_soon_threadsafe(self.connection.close)


def becomes(condition, seconds=60.0):
    """Whether it comes true in time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.01)
    return False


def get(url, path="", host=None):
    """Status and body of a page."""
    address = urlsplit(url)
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=60)
    query = f"?{address.query}" if address.query else ""
    connection.request("GET", f"/{path}{query}", headers={"Host": host} if host else {})
    answer = connection.getresponse()
    return answer.status, answer.read()
