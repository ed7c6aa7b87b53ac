"""Clients that are not honest: messages, frames and requests that nobody would send, to a page that a process serves.

Messages are made from the schema of the protocol, and mutated. A case is one connection, with up to some hundred
messages, of which one is malformed, mostly the last: it ends the connection. The server must live, print nothing, and
serve an honest client all along.

A message is counted if the server has certainly handled it: a ping that was sent after it is answered, or it is the one
that ended the connection.
"""

import contextlib
import json
import math
import re
import socket
from random import Random
from typing import Any

import msgspec

from campaign import mutation as m
from campaign.judge import Finding
from campaign.served import Honest, Peer, Served, framed
from campaign.workers import Campaign
from cinegen.cockpit.messages import ClientMessage

BURST = 390
"""Messages of a connection, at most; a client may send 400 at once."""

CARELESS = 0.02
"""Part of the names in every fourth connection that need not exist; in the others, all do."""

_GROUP = 10  # messages between two pings
_SHORT = 0.3  # s for the answer to a malformed message; there may be none

PATIENCE = 20.0
"""Seconds in which the server must have worked through a connection's messages."""

GAP = 3.0
"""Seconds without a state that an honest client must not see."""

GROWTH = 200.0
"""MB that the server may grow."""

_SCHEMA = msgspec.json.schema(ClientMessage)
_KINDS = [ref["$ref"].rpartition("/")[2] for ref in _SCHEMA["anyOf"]]
_WITHOUT_SENSORS = [kind for kind in _KINDS if kind != "SelectSensor"]
_PATHS = (
    *("", "session", "scene", "viewer.js", "snapshot.html", "static/cockpit.js", "static/index.html"),
    *("map/about.json", "map/cell/1", "robots.txt"),
)
_STRANGE = (
    *("../" * 9 + "etc/hostname", "static/../../x", "%2e%2e/", "%00", "a" * 9000, "\u00e9", "session?token=%ff"),
    *("scene#", "//", "*", "session/"),
)
_METHODS = ("GET", "POST", "HEAD", "PUT", "DELETE", "OPTIONS", "CONNECT", "PATCH", "get", "GET GET", "\0")
_HEADERS = (
    *("Host: example.com", "Host: [::1", "Origin: http://example.com", "Origin: null", "Cookie: " + "a" * 3000),
    *("Content-Length: 99999999999", "Content-Length: -1", "Content-Length: 5", "Transfer-Encoding: chunked"),
    *("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 99", "X: \x00", ": "),
    "Expect: 100-continue",
    *("Sec-WebSocket-Extensions: permessage-deflate", "Range: bytes=0-0,1-1,2-2", "Range: bytes=-99999999999"),
    "If-Modified-Since: yesterday",
)


class Messages(Campaign):
    """Connections to a server; each worker has its own.

    Args:
        seed: of the campaign.
    """

    name = "messages"

    def __init__(self, seed: int = 0) -> None:
        self.seed = seed

    def begin(self, worker: int) -> None:
        """Start the server and the honest client."""
        self.watch(Served(("robots/planar_3r.raff", "robots/five_bar.raff"), "--port", str(8500 + 20 * worker)))

    def watch(self, server: Served) -> None:
        """Judge a server from now on, by an honest client too."""
        self.server, self.honest = server, Honest(server.url)
        self._first_memory, self._ended, self._states, self.gap = 0.0, 0, 0, 0.0
        self.names = names_of(server.url)

    def end(self) -> None:
        """Stop them."""
        self.honest.stop()
        self.server.stop()

    def run(self, number: int) -> tuple[dict[str, int], dict[str, Any], list[Finding]]:
        """Make a connection; return what is counted, what is measured, and the findings."""
        case, rng = f"messages:{number}", Random(f"{self.seed}/messages:{number}")
        counts = {"cases": 1, "messages": 0}
        sent = b""
        try:
            peer = Peer(self.server.url, 10.0, 4096 if rng.random() < 0.1 else None)
            if rng.random() < 0.15:
                sent = _request(rng)
                peer.socket.sendall(sent)
                counts[f"http {_http_status(peer)}"] = counts["messages"] = 1
            elif peer.upgrade("scene" if rng.random() < 0.05 else "session"):
                number_of_messages, sent = self._burst(rng)
                answer, counts["messages"] = _answer(peer, sent, number_of_messages, PATIENCE)
                if answer == "pong" and rng.random() < 0.8:
                    sent += (last := self._broken_frame(rng))
                    following = number_of_messages + 1
                    answer, handled = _answer(peer, last + _ping(following), following, _SHORT)
                    counts["messages"] += handled > 0
                    answer = "not to the last" if answer == "never" else answer  # it may take the ping for its own part
                counts[f"answered {answer}"] = 1
            else:
                counts["refused"] = 1
            peer.vanish() if rng.random() < 0.5 else peer.socket.close()
        except (ConnectionError, TimeoutError) as error:
            counts[f"failed {type(error).__name__}"] = 1
        broken = self.broken(counts)
        if self.server.process.poll() is not None:
            self.end()
            self.begin(number % 50)
        if counts.get("answered never"):
            broken.append(("no answer", "", f"none within {PATIENCE} s"))
        memory = self.server.memory() if number % 20 == 0 else 0.0
        self._first_memory = self._first_memory or memory
        if memory > self._first_memory + GROWTH:
            broken.append(("memory", "server", f"{self._first_memory:.0f} MB became {memory:.0f} MB"))
            self._first_memory = memory
        worst = {"server, MB": [memory, case]} if memory else {}
        return counts, worst, [Finding(case, *fault, {"sent": sent}) for fault in broken]

    def broken(self, counts: dict[str, int]) -> list[tuple[str, str, str]]:
        """Return the promises that the server has broken since the last call; count the states that it has sent."""
        broken = []
        output = self.server.output()
        if self.server.process.poll() is not None:
            broken.append(("server died", str(self.server.process.returncode), output))
        if "Traceback" in output or "Error" in output or "WARNING" in output:
            frames = re.findall(r'File "[^"]*/(cinegen/[^"]*)", line \d+, in (\w+)', output)
            place = ":".join(frames[-1]) if frames else output.strip().splitlines()[-1][:80]
            broken.append(("printed", place, output[-3000:]))
        self.gap = self.honest.gap
        if self.gap > GAP:
            broken.append(("honest client starved", "", f"no state for {self.gap:.1f} s"))
        if self.honest.ended > self._ended:
            broken.append(("honest client disconnected", "", ""))
            self._ended = self.honest.ended
        if self.honest.wrong:
            broken.append(("states not finite", "", f"{self.honest.wrong} of {self.honest.states}"))
        counts["honest states"] = self.honest.states - self._states
        self._states += counts["honest states"]
        return broken

    def _burst(self, rng: Random) -> tuple[int, bytes]:
        """Return a number of messages, and their frames with pings that number them."""
        careless = CARELESS if rng.random() < 0.25 else 0.0
        frames = [framed(b'{"type":"request_control","on":true}')]
        frames += [framed(json.dumps(self.message(rng, careless)).encode()) for _ in range(rng.randint(1, BURST))]
        number = len(frames)
        for i in (number, *range((number - 1) // _GROUP * _GROUP, 0, -_GROUP)):
            frames.insert(i, _ping(i))
        return number, b"".join(frames)

    def message(self, rng: Random, careless: float = CARELESS) -> Any:
        """Return a message that the schema allows; a part of its names need not exist."""
        names = rng.choice(self.names)
        message = value(rng, _SCHEMA["$defs"][rng.choice(_KINDS if "sensor" in names else _WITHOUT_SENSORS)])
        if message["type"] == "set_cursor":
            message.setdefault("robot", None)
            message["node"] = None if message["robot"] is None else ""  # a robot's cursor has a node
        description = message.get("description") or {}
        of_joints = {name: [{joint: 0.3} for joint in names["joint"]] for name in ("values", "coefficients")}
        described = dict.fromkeys(("node", "other", "on"), names["node"]) | of_joints
        for part in (message, description, description.get("task") or {}):
            choices = names if part is message else described
            for name in part:
                if part[name] is not None and name in choices and rng.random() >= careless:
                    part[name] = rng.choice(choices[name])
            if part.get("target") is not None:
                part["target"][3:] = [0.0, 0.0, 0.6, 0.8]
        if message.get("quaternion") is not None:
            axis = [rng.gauss(0.0, 1.0) for _ in range(4)]
            message["quaternion"] = [x / math.hypot(*axis) for x in axis]
        return message

    def _broken_frame(self, rng: Random) -> bytes:
        text = json.dumps(self.message(rng)).encode()
        kind = rng.random()
        if kind < 0.6:
            for _ in range(rng.randint(1, 3)):
                text = rng.choice(m.JSON)(rng, text, (*self.names[0]["node"], "type", "robot", "null"))
            return framed(text)
        if kind < 0.7:
            return framed(text * rng.choice((1, 20, 200, 5000)), rng.choice((1, 2)))
        if kind < 0.8:
            return framed(rng.randbytes(rng.randint(0, 130)), rng.choice((0, 3, 8, 9, 10, 11, 15)), rng.random() < 0.5)
        if kind < 0.9:
            rest = rng.choice((text[5:], b"\xff\xfe", b""))
            return framed(text[:5], 1, final=False) + framed(rest, rng.choice((0, 1)), final=rng.random() < 0.8)
        return m.change_bytes(rng, framed(text), ())


def _http_status(peer: Peer) -> str:
    peer.socket.settimeout(2.0)
    with contextlib.suppress(OSError):
        peer.socket.shutdown(socket.SHUT_WR)
        return peer.socket.recv(65536)[9:12].decode(errors="replace") or "nothing"
    return "nothing"


def _ping(number: int) -> bytes:
    return framed(b"%d" % number, opcode=9)


def _answer(peer: Peer, sent: bytes, last: int, seconds: float) -> tuple[str, int]:
    """Send frames; return how the server answers, and how many messages it has handled.

    It answers the last ping, unless it ends the connection before, with a code. What ended it is a message, too.
    """
    handled = 0
    with contextlib.suppress(ConnectionError):  # it may be disconnected before all is sent
        peer.socket.sendall(sent)
    peer.socket.settimeout(seconds)
    try:
        while handled < last:
            if (frame := peer.frame()) is None:
                return "by its end", handled
            if frame[0] == 10 and frame[1].isdigit():  # others answer pings that were made at random
                handled = int(frame[1])
            if frame[0] == 8:
                frame[1][2:].decode()
                return str(int.from_bytes(frame[1][:2], "big")), handled + 1
    except ConnectionError:
        return "by its end", handled
    except TimeoutError:
        return "never", handled
    return "pong", handled


def names_of(url: str) -> list[dict[str, list[Any]]]:
    """Return the names that commands to each robot may hold, from the first message."""
    peer = Peer(url, 60.0)
    peer.upgrade()
    frame = peer.frame()
    assert frame is not None
    hello = json.loads(frame[1])
    peer.socket.close()
    all_names = []
    for robot in hello["robots"]:
        names = {
            "robot": [robot["name"]],
            "node": [node["name"] for node in robot["nodes"]],
            "joint": [joint["name"] for joint in robot["joints"] if joint["actuated"]],
            "task": [0, 1, 2, 3, 10],
            "waypoint": [0, 1, 2, 3, 10],
        }
        all_names.append(names)
        for switch in hello["switches"]:
            if switch["robot"] == robot["name"]:
                all_names.append({**names, "node": [switch["node"]], "sensor": switch["choices"]})
    return all_names


def _request(rng: Random) -> bytes:
    path = rng.choice(_STRANGE if rng.random() < 0.4 else _PATHS)
    method, version = rng.choice(("GET", "GET", "GET", *_METHODS)), rng.choice(("1.1", "1.1", "1.0", "2", "9.9", ""))
    lines = [f"{method} /{path} HTTP/{version}"]
    lines += ["Host: 127.0.0.1"] if rng.random() < 0.9 else []
    lines += rng.choices(_HEADERS, k=rng.randint(0, 4))
    data = "\r\n".join([*lines, "", ""]).encode() + (b"hello" if rng.random() < 0.2 else b"")
    return m.change_bytes(rng, data, ()) if rng.random() < 0.3 else data


def value(rng: Random, schema: dict[str, Any]) -> Any:
    """Return a random value of a JSON schema, one at the ends of its range often."""
    if "$ref" in schema:
        return value(rng, _SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]])
    if "anyOf" in schema:
        return value(rng, rng.choice(schema["anyOf"]))
    if "enum" in schema:
        return rng.choice(schema["enum"])
    kind = schema.get("type")
    if kind == "object":
        required, fields = schema.get("required", ()), schema.get("properties", {})
        return {name: value(rng, field) for name, field in fields.items() if name in required or rng.random() < 0.6}
    if kind == "array":
        items = [value(rng, member) for member in schema.get("prefixItems", ())]
        count = rng.randint(schema.get("minItems", 0), schema.get("maxItems", 8))
        return items or [value(rng, schema["items"]) for _ in range(count)]
    if kind in ("number", "integer"):
        low, high = schema.get("minimum", -1e6), schema.get("maximum", schema.get("exclusiveMaximum", 1e6 + 1) - 1)
        number = rng.choice((low, high, 0.0, 1.0, rng.gauss(0.0, 1.0), rng.uniform(low, high)))
        number = min(high, max(low, number))
        return int(number) if kind == "integer" else number
    texts = [text for text in ("", "x", "tool", "é😀", "a" * 300) if len(text) >= schema.get("minLength", 0)]
    text = rng.choice(texts)[: schema.get("maxLength")]
    return {"boolean": rng.random() < 0.5, "string": text, "null": None}.get(str(kind))
