"""3D mice on a real pseudo-terminal, or behind the spacenav daemon, with all that happens to them."""

from __future__ import annotations

import contextlib
import random
import socket
import struct
from pathlib import Path

import pytest
from browsers import becomes
from mouse_streams import magellan_motion, magellan_twist, spaceball_twist
from played import Device, PlayedMagellan, PlayedSpaceball

from cinegen.devices import SensorState
from cinegen.devices.serial_mouse import SerialMouse
from cinegen.devices.spacenav import SOCKET, Spacenav, socket_path

KINDS = {"Magellan SpaceMouse": (PlayedMagellan, magellan_twist), "Spaceball 2003": (PlayedSpaceball, spaceball_twist)}
COMPLAINTS = {
    "Magellan SpaceMouse": (b"eA0\r", "the Magellan reports an unknown command"),
    "Spaceball 2003": (b"E7\r", "the Spaceball reports error"),
}


@pytest.fixture(params=KINDS)
def played(request, tmp_path):
    """A device, its port, what its counts mean, and its name."""
    kind, twist = KINDS[request.param]
    device = kind(tmp_path / "port").plug()
    mouse = SerialMouse(str(device.path), patience=0.3)
    mouse.longest = 0.1
    mouse.start()
    assert becomes(device.started.is_set)
    yield device, mouse, twist, request.param
    mouse.close()
    device.unplug()


@pytest.mark.parametrize(
    ("url", "state"), [("://x", SensorState.LOST), ("hwgrep://(", SensorState.LOST), ("loop://", SensorState.REFUSED)]
)
def test_a_malformed_url_and_a_port_that_hears_itself_are_a_status_and_no_defect(url, state):
    mouse = SerialMouse(url, patience=0.1)
    mouse.start()
    assert becomes(lambda: mouse.status.state is state)
    mouse.close()
    assert not mouse.exception_log.messages


def reads(mouse: SerialMouse, twist: tuple[float, ...], device: Device, counts: tuple[int, ...]) -> None:
    """Waits until a movement is read; a device goes on sending while it is deflected."""

    def is_read() -> bool:
        device.move(counts)
        reading = mouse.read()
        return reading is not None and reading.twist == twist

    assert becomes(is_read)


def test_it_is_found_started_and_read(played):
    device, mouse, twist, name = played
    assert becomes(lambda: mouse.status.state is SensorState.LIVE and name in mouse.status.message)
    for counts in [(20, -30, 40, 50, -60, 70), (0, 0, 0, 0, 0, 0), (1, 2, 3, 4, 5, 6)]:
        reads(mouse, twist(counts), device, counts)
    assert mouse.status.state is SensorState.LIVE
    complaint, why = COMPLAINTS[name]
    device.send(complaint)
    assert becomes(lambda: why in mouse.status.message)
    mouse.close()
    assert mouse.status.state is SensorState.CLOSED


def test_unplugged_and_plugged_in_again(played):
    device, mouse, twist, _ = played
    counts = (20, -30, 40, 50, -60, 70)
    for _ in range(2):
        assert becomes(device.started.is_set)
        reads(mouse, twist(counts), device, counts)
        device.unplug()
        assert becomes(lambda: mouse.status.state is SensorState.LOST)
        for _ in range(100):
            mouse.read()
        device.plug()
    assert becomes(lambda: mouse.status.state is SensorState.LIVE)
    reads(mouse, twist(counts), device, counts)


def test_a_cable_that_is_pulled_is_noticed_by_its_silence(played):
    """The port stays; the device behind it, plugged in anew, says nothing before it is started."""
    device, mouse, twist, _ = played
    reads(mouse, twist((1, 1, 1, 1, 1, 1)), device, (1, 1, 1, 1, 1, 1))
    device.deaf = True
    assert becomes(lambda: mouse.status.state not in (SensorState.LIVE, SensorState.SILENT))
    device.started.clear()
    device.deaf = False
    assert becomes(device.started.is_set)
    assert becomes(lambda: mouse.status.state is SensorState.LIVE)


def test_a_device_at_rest_is_asked_again_and_again_and_stays_live(played):
    device, mouse, twist, name = played
    reads(mouse, twist((1, 1, 1, 1, 1, 1)), device, (1, 1, 1, 1, 1, 1))
    reads(mouse, twist((0,) * 6), device, (0,) * 6)
    question = b"kQ\r" if name.startswith("Magellan") else b"k\r"
    before, states = device.heard.count(question), set()

    def asked_thrice() -> bool:
        states.add(mouse.status.state)
        return device.heard.count(question) >= before + 3

    assert becomes(asked_thrice)
    assert states <= {SensorState.LIVE, SensorState.SILENT}


def test_garbage_and_halves_do_no_harm(played):
    device, mouse, twist, _ = played
    assert becomes(lambda: mouse.status.state is SensorState.LIVE)
    chance = random.Random(0)
    for _ in range(20):
        device.send(bytes(chance.randrange(256) for _ in range(100)) + b"\r")
    device.send(magellan_motion((1, 2, 3, 4, 5, 6))[:13] + b"\r")
    counts = (9, 8, 7, 6, 5, 4)
    reads(mouse, twist(counts), device, counts)
    assert mouse.status.damaged > 0
    assert mouse.status.state is SensorState.LIVE


@pytest.mark.parametrize("played", ["Magellan SpaceMouse"], indirect=True)
def test_presses_are_kept_for_a_slow_reader_and_of_motion_the_newest(played):
    device, mouse, _, _ = played
    assert becomes(lambda: device.heard.endswith(b"kQ\r"))
    for keys in (1, 0, 2, 3, 0):
        device.press(keys)
        device.move((keys,) * 6)
    for i in range(500):
        device.move((i % 400,) * 6)
    device.move((111,) * 6)
    assert becomes(lambda: mouse.newest.last.twist == magellan_twist((111,) * 6))
    reading = mouse.read()
    assert reading.twist == magellan_twist((111,) * 6)
    assert reading.buttons == frozenset()
    assert reading.pressed == (0, 1, 0)
    assert mouse.read() is None


def test_nobody_answers(played):
    device, mouse, _, _ = played
    mouse.close()
    device.deaf = True
    mouse.start()
    assert becomes(lambda: mouse.status.state is SensorState.REFUSED)
    assert "no 3D mouse answers" in mouse.status.message
    device.deaf = False
    assert becomes(lambda: mouse.status.state is SensorState.LIVE)


def test_no_port_and_closing_at_once(tmp_path):
    mouse = SerialMouse(str(tmp_path / "none"))
    assert mouse.status.state is SensorState.CLOSED
    assert mouse.read() is None
    mouse.start()
    assert becomes(lambda: mouse.status.state is SensorState.LOST)
    assert "none" in mouse.status.message
    mouse.close()
    mouse.start()  # and again
    mouse.close()
    mouse.close()
    assert mouse.status.state is SensorState.CLOSED


# --- the spacenav daemon ----------------------------------------------------------------------------------------------
# Played over a real unix socket.


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
