"""The gamepad of a browser: what is put is said, what makes no sense is not; a browser that is gone moves nothing."""

import math
from types import SimpleNamespace

import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cinegen.devices import Gamepad, SensorState, Teleoperation, open_sensor
from cinegen.ik import FrameTask
from cinegen.sensor import NO_TWIST

UP = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


@pytest.fixture
def clock(monkeypatch):
    """`clock[0]`: what time it is, s."""
    now = [100.0]
    monkeypatch.setattr("cinegen.devices.latest_reading.time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


@pytest.fixture
def gamepad():
    sensor = open_sensor("gamepad:")
    assert type(sensor) is Gamepad
    assert sensor.status.state is SensorState.CLOSED
    sensor.start()
    return sensor


def test_what_is_put_is_read_once(gamepad, clock):
    assert gamepad.status == (SensorState.OPENING, "no browser has sent a gamepad's reading yet", 0, 0)
    assert gamepad.read() is None
    gamepad.put((0.5, -2.0, 0, 0, 0, math.tau), [3, 0])
    clock[0] += 0.01
    gamepad.put(UP, [0])
    reading = gamepad.read()
    assert (reading.time, reading.twist) == (100.01, UP)
    assert (reading.buttons, reading.pressed) == (frozenset({0}), (0, 3))
    assert gamepad.read() is None
    assert gamepad.status.state is SensorState.LIVE
    assert gamepad.status.packets == 2


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=6, max_size=6))
def test_deflections_are_cut(twist):
    sensor = Gamepad()
    sensor.start()
    sensor.put(twist)
    assert sensor.read().twist == tuple(min(1.0, max(-1.0, value)) for value in twist)


@pytest.mark.parametrize(
    ("twist", "buttons"),
    [
        *((twist, ()) for twist in ((0, 0, 0), None, 10**400)),
        *(((first, 0, 0, 0, 0, 0), ()) for first in (math.inf, math.nan, "1", 10**400)),
        *((UP, buttons) for buttons in ((64,), (-1,), (True,), (0.5,), ([],), None)),
    ],
)
def test_what_makes_no_sense_moves_nothing(gamepad, twist, buttons):
    gamepad.put(twist, buttons)
    assert gamepad.read() is None
    assert gamepad.status == (SensorState.OPENING, "no browser has sent a gamepad's reading yet", 0, 1)


def test_it_falls_silent_only_when_it_was_not_at_rest(gamepad, clock):
    gamepad.put(UP)
    clock[0] += 0.24
    assert gamepad.status.state is SensorState.LIVE
    clock[0] += 0.06
    assert gamepad.status.state is SensorState.SILENT
    assert gamepad.status.message == "gamepad: has sent nothing for 0.3 s"
    gamepad.put(NO_TWIST)
    clock[0] += 100.0
    assert gamepad.status.state is SensorState.LIVE


def test_who_serves_the_page_may_say_that_the_browser_is_gone(gamepad, clock):
    gamepad.gone()
    assert gamepad.status.state is SensorState.OPENING
    hold = Teleoperation(gamepad, FrameTask("tool", pin.SE3.Identity()))
    gamepad.put(UP, [1])
    hold.advance(0.001)
    clock[0] += 0.001
    gamepad.gone()
    assert gamepad.status.state is SensorState.LOST
    rest = hold.task.target.copy()
    assert hold.advance(0.001).buttons == frozenset()
    hold.advance(0.001)
    assert hold.task.target == rest
    gamepad.put(UP)
    assert gamepad.status.state is SensorState.LIVE


def test_what_is_put_while_it_is_closed_is_nothing(gamepad):
    gamepad.put(UP)
    gamepad.start()  # is started already
    assert gamepad.read() is not None
    gamepad.put(UP, [1])
    gamepad.close()
    assert gamepad.status.state is SensorState.CLOSED
    gamepad.put(UP)
    gamepad.start()
    assert gamepad.read() is None
    assert gamepad.status[::2] == (SensorState.OPENING, 0)
