"""Programs as sensors, good ones and bad ones."""

from __future__ import annotations

import contextlib
import json
import math
import socket

import numpy as np
import pinocchio as pin
import pytest
from browsers import becomes
from hypothesis import given
from hypothesis import strategies as st

from cinegen.devices import SensorState, open_sensor
from cinegen.devices.json_socket import CLIENTS, MISTAKES, SILENT
from cinegen.devices.reading_json import ReadingError, decode_reading, decode_recorded, encode_recorded
from cinegen.sensor import Reading


def opened(url):
    sensor = open_sensor(url)
    sensor.start()
    assert becomes(lambda: sensor.status.state is SensorState.LIVE)
    yield sensor
    sensor.close()
    assert sensor.status.state is SensorState.CLOSED


@pytest.fixture
def sensor():
    yield from opened("tcp://127.0.0.1:0")


@pytest.fixture
def open_port():
    """A sensor whose programs need no token."""
    yield from opened("tcp://127.0.0.1:0?no-token")


class Program:
    def __init__(self, sensor, *first) -> None:
        self.socket = socket.create_connection(("127.0.0.1", sensor.port), timeout=15)
        self.lines = self.socket.makefile("rb")
        self.send(*(first or [{"token": sensor.token}]))

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *_) -> None:
        self.lines.close()
        self.socket.close()

    def send(self, *values) -> None:
        for value in values:
            self.socket.sendall(value if isinstance(value, bytes) else json.dumps(value).encode() + b"\n")

    def answer(self) -> str:
        """What is said; nothing if it was dropped."""
        try:
            line = self.lines.readline()
        except ConnectionError:
            return ""
        return json.loads(line)["error"] if line else ""


def comes(sensor, condition) -> Reading:
    readings = []

    def is_met() -> bool:
        readings.append(sensor.read())
        return readings[-1] is not None and condition(readings[-1])

    assert becomes(is_met)
    return readings[-1]


def drives(sensor, program, *twist) -> None:
    program.send({"twist": twist})
    comes(sensor, lambda r: r.twist == twist)


def test_what_a_program_can_say(sensor):
    with Program(sensor) as program:
        program.send({"twist": [0, 0, 0.5, 0, 0, -3]})
        assert comes(sensor, lambda r: True).twist == (0, 0, 0.5, 0, 0, -1.0)
        program.send({"buttons": [1]}, {"buttons": []}, {"buttons": [2, 2]})
        assert becomes(lambda: sensor.newest.last.buttons == {2})
        reading = sensor.read()
        assert (reading.pressed, reading.twist) == ((1, 2), (0, 0, 0.5, 0, 0, -1.0))
        placement = pin.SE3.Random()
        program.send({"placement": placement.homogeneous.tolist(), "buttons": []})
        assert comes(sensor, lambda r: r.target is not None).target.isApprox(placement, 1e-12)
        quaternion = (2.0 * pin.Quaternion(placement.rotation).coeffs()).tolist()  # only its direction counts
        program.send({"translation": [1, 2, 3], "quaternion": quaternion})
        target = comes(sensor, lambda r: True).target
        assert target.isApprox(pin.SE3(placement.rotation, np.array([1.0, 2.0, 3.0])), 1e-9)
    assert becomes(lambda: "no programs" in sensor.status.message)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b"hello", "malformed"),
        (b'{"twist": [0, 0, NaN, 0, 0, 0]}', "malformed"),
        (b'{"twist": [0, 0, 1e999, 0, 0, 0]}', "Number out of range - at `$.twist[2]`"),
        (b'{"twist": [0, 0, 1]}', "of length 6, got 3 - at `$.twist`"),
        (b'{"twist": [0, 0, 1, 0, 0, "1"]}', "Expected `float`, got `str` - at `$.twist[5]`"),
        (b"[" * 4000, "Expected `object`"),
        (b'{"quaternion": [' + b"[" * 4000, "at `$.quaternion[0]`"),
        (b'{"twits": [0, 0, 0, 0, 0, 0]}', "unknown field `twits`"),
        (b'{"placement": [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}', "reflection"),
        (b'{"translation": [0, 0, 0], "quaternion": [0, 0, 0, 0]}', "quaternion"),
        (b'{"buttons": [64]}', "<= 63 - at `$.buttons[0]`"),
    ],
)
def test_invalid_lines_are_answered(sensor, line, why):
    with Program(sensor) as program:
        program.send(line + b"\n")
        assert why in program.answer()
        assert sensor.read() is None
        drives(sensor, program, 1, 0, 0, 0, 0, 0)
    assert sensor.status.damaged == 1


def test_all_problems_of_a_line_are_answered_at_once(sensor):
    line = {"twist": [0, "1", 0, 0, None, 0], "buttons": [64, 1, "a"], "twits": 1, "translation": [0, 0]}
    far = {"placement": [[2, 0, 0, 1e9], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]]}
    both = {"placement": np.eye(4).tolist(), "translation": [0, 0, 0]}
    many = dict.fromkeys(map(str, range(400)), 1)
    with Program(sensor) as program:
        program.send(line, far, both, many)
        fields = [problem.rpartition("`$")[2] for problem in program.answer().split("\n")]
        assert fields[1:] == [".twist[1]`", ".twist[4]`", ".translation`", ".buttons[0]`", ".buttons[2]`"]
        wanted = ["[0, 0, 0, 1]", "a rotation, with orthonormal columns", "a position within 1e+06 m"]
        answers = program.answer().split("\n")
        assert [answer.partition(" - ")[0] for answer in answers] == [f"Expected {text}" for text in wanted]
        assert answers[0].endswith("at `$.placement[3]`")
        assert program.answer() == "Expected `placement`, or both `translation` and `quaternion`"
        assert program.answer().endswith(" more")


def test_20_invalid_lines_in_succession_are_forgiven_and_the_next_is_not(sensor):
    """As MISTAKES says. A valid line in between forgives all before it."""
    with Program(sensor) as program:
        for twist in ([0, 1, 0, 0, 0, 0], [0, 0.5, 0, 0, 0, 0]):
            program.send(b"nonsense\n" * MISTAKES, {"twist": twist})
            comes(sensor, lambda r, twist=twist: r.twist == tuple(twist))
            assert not any("disconnected" in program.answer() for _ in range(MISTAKES))
        program.send(b"nonsense\n" * (MISTAKES + 1))
        assert not any("disconnected" in program.answer() for _ in range(MISTAKES + 1))
        assert program.answer() == f"{MISTAKES + 1} invalid lines in succession: disconnected"
        assert program.answer() == ""
    assert MISTAKES == 20


def test_a_line_without_end_is_dropped(sensor):
    with Program(sensor) as program:
        try:
            for _ in range(100):
                program.send(b"x" * 200_000)
        except OSError:
            pass
        else:
            pytest.fail("it was read to the end")
    with Program(sensor) as program:
        drives(sensor, program, 1, 0, 0, 0, 0, 0)


def test_a_hundred_programs(sensor):
    programs = [Program(sensor) for _ in range(100)]
    assert all("already" in program.answer() for program in programs[CLIENTS:])
    drives(sensor, programs[3], 1, 0, 0, 0, 0, 0)
    for program in programs:
        program.__exit__()
    assert becomes(lambda: "no programs" in sensor.status.message)


@pytest.mark.parametrize("port", ["sensor", "open_port"])
def test_connections_that_say_nothing_keep_no_program_out(port, request):
    sensor = request.getfixturevalue(port)
    silent = [socket.create_connection(("127.0.0.1", sensor.port), timeout=15) for _ in range(2 * SILENT)]
    with Program(sensor) as program:
        drives(sensor, program, 1, 0, 0, 0, 0, 0)
    assert b"later connections have not sent their first line" in silent[0].recv(1000)
    for peer in silent:
        peer.close()
    assert becomes(lambda: "no programs" in sensor.status.message)


def test_the_newest_speaks(sensor):
    with Program(sensor) as first:
        drives(sensor, first, 1, 0, 0, 0, 0, 0)
        with Program(sensor) as second:
            second.send({"twist": [0, 1, 0, 0, 0, 0], "buttons": [7]})
            comes(sensor, lambda r: r.twist == (0, 1, 0, 0, 0, 0))
            first.send({"twist": [0.5, 0, 0, 0, 0, 0]})
            assert "connected later" in first.answer()
            assert sensor.newest.last.twist == (0, 1, 0, 0, 0, 0)
        reading = comes(sensor, lambda r: r.twist == (0,) * 6)  # at rest, and let go, when it goes
        assert reading.buttons == frozenset()
        drives(sensor, first, 0.25, 0, 0, 0, 0, 0)


TWIST = b'{"twist": [1, 0, 0, 0, 0, 0]}\n'
HEADERS = (
    b"Host: 127.0.0.1:7070\r\nConnection: keep-alive\r\nContent-Length: 600\r\n"
    b"Content-Type: text/plain;charset=UTF-8\r\nOrigin: http://evil.example\r\nSec-Fetch-Mode: no-cors\r\n\r\n"
)
REQUESTS = {
    "fetch": b"POST / HTTP/1.1\r\n" + HEADERS + 20 * TWIST,
    "form": b"POST / HTTP/1.1\r\n" + HEADERS + b'{"twist": [1, 0, 0, 0, 0, 0], "buttons": [=]}\r\n' + 20 * TWIST,
    "path": b"GET /\n" + TWIST,
    "websocket": b"GET / HTTP/1.1\r\nUpgrade: websocket\r\n\r\n" + TWIST,
    "tls": b"\x16\x03\x01\x02\x00\x01\n" + TWIST,
}
"""Bytes that a browser sends for a page of anybody: `fetch(address, {method: "POST", mode: "no-cors", body})`, ..."""


def drained(program) -> list[str]:
    """All answers until the connection ends."""
    return list(iter(program.answer, ""))


@pytest.mark.parametrize("request_", REQUESTS.values(), ids=REQUESTS)
def test_a_web_page_drives_nothing(open_port, request_):
    sensor = open_port
    with Program(sensor, request_) as page:
        (why,) = drained(page)
    assert "disconnected" in why
    assert becomes(lambda: "no programs" in sensor.status.message)
    assert sensor.status.packets == 0
    assert sensor.status.damaged == 1
    assert sensor.read() is None


@pytest.mark.parametrize("first", [TWIST, b'{"token": "wrong"}\n', b'{"token": null}\n', b'{"token": "\\ud800"}\n'])
def test_a_program_without_the_token_is_dropped(sensor, first):
    with Program(sensor, first + TWIST) as program:
        assert drained(program)[0].startswith('the first line must be {"token": "..."}')
    assert becomes(lambda: "no programs" in sensor.status.message)
    assert sensor.status.packets == 0


def test_a_program_that_sends_no_token_is_dropped(sensor, monkeypatch):
    monkeypatch.setattr("cinegen.devices.json_socket._PATIENCE", 0.05)
    with Program(sensor, b"") as program:
        assert drained(program) == ["no token within 0.05 s: disconnected"]


def test_blank_lines_gain_no_time(sensor):
    with Program(sensor, b"\n", {"token": sensor.token}) as program:
        assert drained(program)[0].startswith("the first line must be")


def test_a_port_without_a_token_takes_programs_that_have_one_too(open_port):
    assert open_port.token == ""
    for first in (TWIST, b'{"token": "any"}\n' + TWIST):
        with Program(open_port, first):
            comes(open_port, lambda r: r.twist == (1, 0, 0, 0, 0, 0))
        assert becomes(lambda: "no programs" in open_port.status.message)


def test_tokens_are_random_unless_they_are_given(monkeypatch):
    monkeypatch.delenv("CINEGEN_TOKEN", raising=False)
    url = "tcp://127.0.0.1:0"
    random = {open_sensor(url).token for _ in range(3)}
    assert len(random) == 3
    assert min(map(len, random)) >= 20
    with_token = open_sensor(f"{url}?token=my%20own")
    assert (with_token.token, with_token.url) == ("my own", url)
    monkeypatch.setenv("CINEGEN_TOKEN", "lasting")
    assert open_sensor(url).token == "lasting"
    assert open_sensor(f"{url}?no-token").token == ""


def test_a_sensor_is_closed_in_silence_while_programs_are_connected(sensor, capfd, caplog):
    """Before, asyncio printed a traceback."""
    with Program(sensor) as program:
        drives(sensor, program, 1, 0, 0, 0, 0, 0)
        sensor.close()
        assert program.answer() == ""
    assert capfd.readouterr().err == ""
    assert caplog.text == ""


def test_two_on_one_port():
    first = open_sensor("tcp://127.0.0.1:0")
    first.start()
    assert becomes(lambda: first.status.state is SensorState.LIVE)
    second = open_sensor(f"tcp://127.0.0.1:{first.port}")
    second.start()
    assert becomes(lambda: second.status.state is SensorState.LOST)
    assert "listen" in second.status.message
    first.close()
    assert becomes(lambda: second.status.state is SensorState.LIVE)
    second.close()


scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
json_values = st.recursive(scalars, lambda values: st.lists(values, max_size=6))
names = st.sampled_from(["twist", "placement", "translation", "quaternion", "buttons"])


@given(st.dictionaries(names, json_values).map(json.dumps) | st.binary(max_size=300))
def test_no_line_raises_anything_else(line):
    try:
        said = decode_reading(line)
    except ReadingError as error:
        assert str(error)  # noqa: PT017
    else:
        assert said.twist is None or all(map(math.isfinite, said.twist))


twists = st.none() | st.tuples(*[st.floats(-1, 1)] * 6)


@given(twists, st.booleans(), st.frozensets(st.integers(0, 63)), st.integers(0, 1000))
def test_what_is_written_is_read(twist, placed, buttons, seed):
    pin.seed(seed)
    target = pin.SE3.Random() if placed else None
    said = decode_recorded(encode_recorded(Reading(0.0, twist, target, buttons), 0.0))
    assert said.twist == twist
    assert said.buttons == buttons
    assert said.target is target is None or said.target.isApprox(target, 1e-12)


def test_http_ends_a_connection_later_too(sensor):
    with Program(sensor) as program:
        drives(sensor, program, 1, 0, 0, 0, 0, 0)
        program.send(b"Host: 127.0.0.1\r\n" + TWIST)
        assert drained(program) == ["this port takes lines of JSON, not HTTP: disconnected"]


def test_a_flood_is_dropped(sensor):
    with Program(sensor) as program, contextlib.suppress(OSError):  # it is cut off in the middle of a word
        for _ in range(1000):
            program.send(500 * TWIST)
    assert becomes(lambda: sensor.status.damaged >= 1)
    assert sensor.status.packets < 10_000
    with Program(sensor) as program:
        drives(sensor, program, 0, 0, 1, 0, 0, 0)
