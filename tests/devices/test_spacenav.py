"""The spacenav daemon, played over a real unix socket."""

from __future__ import annotations

import contextlib
import random
import socket
import struct
from pathlib import Path

import pytest
from browsers import becomes

from cinegen.devices import SensorState
from cinegen.devices.spacenav import SOCKET, Spacenav, socket_path


def event(*values: int) -> bytes:
    return struct.pack("=8i", *values, *[0] * (8 - len(values)))


class Daemon:
    def __init__(self, path: Path) -> None:
        self.path = path

    def start(self) -> Daemon:
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.listener.bind(str(self.path))
        self.listener.listen()
        return self

    def accept(self) -> socket.socket:
        self.listener.settimeout(15)
        return self.listener.accept()[0]


@pytest.fixture
def daemon(tmp_path):
    return Daemon(tmp_path / "spnav.sock").start()


@pytest.fixture
def sensor(daemon):
    sensor = Spacenav(f"spnav:{daemon.path}")
    sensor.longest = 0.1
    sensor.start()
    yield sensor
    sensor.close()


def test_motion_and_buttons(daemon, sensor):
    with daemon.accept() as client:
        client.sendall(event(0, 35, 70, 105, -35, -70, -350, 16))
        assert becomes(lambda: sensor.status.packets == 1)
        reading = sensor.read()
        assert reading.twist == pytest.approx((0.1, 0.3, 0.2, -0.1, -1.0, -0.2))  # its y is up, its z away
        assert sensor.read() is None
        client.sendall(event(1, 3, 1) + event(2, 3, 0) + event(1, 5, 1))
        assert becomes(lambda: sensor.status.packets == 4)
        pressed = sensor.read()
        assert pressed.pressed == (3, 5)
        assert pressed.buttons == {5}
        assert (pressed.twist, pressed.time) == (reading.twist, reading.time)  # no newer for that
        assert becomes(lambda: sensor.status.state is SensorState.SILENT)


def test_events_cut_anywhere(daemon, sensor):
    stream = b"".join(event(0, i, -i, i, 0, 0, 0, 16) + event(1 + i % 2, 1) for i in range(60))
    chance = random.Random(1)
    with daemon.accept() as client:
        while stream:
            size = chance.randrange(1, 90)
            client.sendall(stream[:size])
            stream = stream[size:]
        assert becomes(lambda: sensor.newest.last.twist == pytest.approx((59 / 350, 59 / 350, -59 / 350, 0, 0, 0)))
    assert sensor.damaged == 0


def test_the_daemon_ends_and_comes_back(daemon, sensor):
    client = daemon.accept()
    client.sendall(event(1, 2))
    assert becomes(lambda: sensor.newest.last.buttons == {2})
    client.close()
    daemon.listener.close()
    assert becomes(lambda: sensor.status.state is SensorState.LOST)
    assert becomes(lambda: "no spacenav daemon" in sensor.status.message)
    assert sensor.newest.last.buttons == frozenset()
    daemon.start()
    with daemon.accept() as client:
        assert becomes(lambda: sensor.status.state is SensorState.LIVE)
        client.sendall(event(0, 350))
        assert becomes(lambda: sensor.newest.last.twist == (1, 0, 0, 0, 0, 0))


def test_what_it_does_not_know_is_counted(daemon, sensor):
    with daemon.accept() as client:
        client.sendall(event(77, 1) + event(1, -1) + event(1, 256) + event(1, 255) + event(0, 350))
        assert becomes(lambda: sensor.newest.last.twist is not None)
        assert sensor.read().pressed == (255,)
    assert sensor.damaged == 3


def test_where_it_listens(monkeypatch):
    monkeypatch.delenv("SPNAV_SOCKET", raising=False)
    assert socket_path() == SOCKET
    assert socket_path("spnav:/tmp/x") == socket_path("spnav:///tmp/x") == "/tmp/x"
    monkeypatch.setenv("SPNAV_SOCKET", "/run/y")
    assert socket_path("spnav:") == "/run/y"
