"""Sensors by their URLs, and the command that lists and monitors them."""

import json
import re
import threading

import pytest
from played import PlayedMagellan

from cinegen import CinegenWarning
from cinegen.devices import Gamepad, SensorError, open_sensor, overrides
from cinegen.devices.json_socket import JsonSocket
from cinegen.devices.kinds import KINDS, scheme, what_is
from cinegen.devices.monitor import monitor
from cinegen.devices.scripted_path import ScriptedSensor
from cinegen.devices.serial_mouse import SerialMouse
from cinegen.devices.spacenav import Spacenav


@pytest.mark.parametrize(
    ("url", "kind", "name"),
    [
        ("COM3", SerialMouse, ""),
        (r"\\.\COM12", SerialMouse, ""),
        ("socket://h:1", SerialMouse, "socket"),
        ("spnav:/tmp/x", Spacenav, "spnav"),
        ("tcp://127.0.0.1:7070", JsonSocket, "tcp"),
        ("gamepad:", Gamepad, "gamepad"),
        ("tcp://[::1]:7070", JsonSocket, "tcp"),
    ],
)
def test_a_url_says_the_kind(url, kind, name):
    assert scheme(url) == name
    assert name in KINDS
    sensor = open_sensor(url)
    assert type(sensor) is kind
    assert sensor.url == url
    assert what_is(url)


@pytest.mark.parametrize("host", ["0.0.0.0", "[::]", "192.168.1.7"])
def test_a_port_that_other_machines_reach_is_warned_of_and_its_token_not_told(host):
    with pytest.warns(CinegenWarning, match="has the token, which is sent without encryption; with 127") as warned:
        assert open_sensor(f"tcp://{host}:7070?token=secret").token == "secret"
    assert "secret" not in str(warned[0].message)


def test_a_path_of_a_robot_has_one_of_its_shapes(robot):
    assert isinstance(open_sensor("path:line", mechanism=robot("five_bar")), ScriptedSensor)
    with pytest.raises(SensorError, match="did you mean"):
        open_sensor("path:circel", mechanism=robot("five_bar"))


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("spnaw:", "sensor 2, 'spnaw:': no kind of sensor 'spnaw:', did you mean 'spnav'"),
        ("${jndi:x://y", "no kind of sensor '${jndi:x:'"),
        ("gamepad:7", "write gamepad:"),
        ("path:circle", "needs a robot"),
        ("tcp://0.0.0.0:7070?no-token", "a port there needs a token; leave out ?no-token"),
        ("tcp://127.0.0.1", "write tcp://127.0.0.1:7070"),
        ("tcp://127.0.0.1:99999", "write tcp://127.0.0.1:7070"),
        ("tcp://127.0.0.1:7070?tokens=x", "?token=TEXT or ?no-token may follow"),
    ],
)
def test_what_there_can_not_be(url, why):
    with pytest.raises(SensorError, match=re.escape(why).replace(re.escape(", did"), ".*did")):
        open_sensor(url, 2)


def test_a_port_that_is_not_there_is_a_warning_with_a_hint():
    with pytest.warns(CinegenWarning, match=r"IRIX.*--sensor 3=/dev/ttyUSB0"):
        sensor = open_sensor("/dev/ttyd2", 3)
    assert isinstance(sensor, SerialMouse)
    with pytest.warns(CinegenWarning, match="there is no such port here; --sensor 1="):
        open_sensor("/dev/ttyNONE")


def test_overrides():
    assert overrides(["1=/dev/ttyUSB0", "2=tcp://127.0.0.1:7=0"]) == {1: "/dev/ttyUSB0", 2: "tcp://127.0.0.1:7=0"}
    for wrong in ("/dev/ttyUSB0", "x=/dev/ttyUSB0", "1="):
        with pytest.raises(SensorError, match="--sensor 1=/dev/ttyUSB0"):
            overrides([wrong])


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_command_lists(root, typed):
    said = typed("sensors", root / "robots" / "delta4.raff").out
    assert "1: /dev/ttyd2 (translation 3, rotation 3) for platform" in said
    assert "IRIX" in said
    assert "--sensor 1=/dev/ttyUSB0" in said
    assert "spacenav daemon:" in said
    assert all(what in said for _, what in KINDS.values())
    said = json.loads(typed("sensors", root / "robots" / "two_arms.raff", "--sensor", "1=spnav:", "--json").out)
    (sensors,) = said["files"].values()
    assert sensors[0]["port"] == "spnav:"
    assert sensors[0]["nodes"]
    assert set(said["here"]) == {"ports", "spacenav"}
    assert "no sensor '7'" in typed("sensors", root / "robots/delta4.raff", "--sensor", "7=spnav:", code=1).err


@pytest.mark.filterwarnings("default::cinegen.CinegenWarning")
def test_the_command_says_what_can_not_be_monitored(typed):
    assert "use cinegen drive" in typed("sensors", "--monitor", "path:circle", "--seconds", "0", code=1).err
    assert "IRIX" in typed("sensors", "--monitor", "/dev/ttyd2", "--seconds", "0.2").err


class Watched:
    """What a monitor says; presses Ctrl-C as soon as all that is expected was said."""

    def __init__(self, *expected: str) -> None:
        self.said, self.expected = "", expected

    def __call__(self, text: str) -> None:
        self.said += text
        if all(part in self.said for part in self.expected):
            raise KeyboardInterrupt


def test_a_device_is_monitored(tmp_path):
    device = PlayedMagellan(tmp_path / "port").plug()
    ended = threading.Event()

    def play() -> None:
        device.started.wait(10)
        while not ended.wait(0.02):
            device.move((200, 0, 0, 0, 0, -400))

    thread = threading.Thread(target=play)
    thread.start()
    lines = Watched(
        "live: a Magellan SpaceMouse with 11 buttons", "x +0.50 |     :##   |", "rz +0.00", "ry +1.00 |     :#####|"
    )
    one_line = Watched("\r\033[K", "ry +1.00")
    recorded = Watched('"cinegen":"readings"', '"twist"')
    try:
        for watched, options in ((lines, {}), (one_line, {"rewrite": True}), (recorded, {"as_json": True})):
            monitor(str(device.path), watched, 30.0, **options)
            assert all(part in watched.said for part in watched.expected)
    finally:
        ended.set()
        thread.join()
        device.unplug()
    assert json.loads(recorded.said.splitlines()[-1])["twist"] == [0.5, 0, 0, 0, 1, 0]


def test_the_command_monitors(typed):
    said = typed("sensors", "--monitor", "tcp://127.0.0.1:0", "--seconds", "0.3", "--json")
    assert json.loads(said.out) == {"cinegen": "readings", "version": 1, "timeout": 0.25}
    assert re.fullmatch(r'tcp://127.0.0.1:0: a program sends first: \{"token":"[\w-]{22}"\}\n', said.err)
