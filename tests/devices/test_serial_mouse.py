"""Serial 3D mice on a real pseudo-terminal, with all that happens to them."""

import random

import pytest
from browsers import becomes
from mouse_streams import magellan_motion, magellan_twist, spaceball_twist
from played import Device, PlayedMagellan, PlayedSpaceball

from cinegen.devices import SensorState
from cinegen.devices.serial_mouse import SerialMouse

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
