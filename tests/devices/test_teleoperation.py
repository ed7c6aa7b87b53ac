"""What a sensor says becomes a target's motion, the same in every frame; and what the gamepad of a browser says."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cinegen.devices import Gamepad, Reading, SensorState, SensorStatus, Teleoperation, TwistMapping, open_sensor
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.ik import FrameTask
from cinegen.sensor import NO_TWIST

DT = 0.001


class Played:
    """A sensor that says what a test wants."""

    url = "played"
    timeout = 0.25

    def __init__(self) -> None:
        self.next: Reading | None = None
        self.state = SensorState.LIVE
        self.time = 0.0

    def say(self, twist=None, target=None, **others) -> Played:
        self.time += 0.01
        self.next = Reading(self.time, twist, target, **others)
        return self

    def start(self) -> None: ...
    def close(self) -> None: ...

    def read(self) -> Reading | None:
        reading, self.next = self.next, None
        return reading

    @property
    def status(self) -> SensorStatus:
        return SensorStatus(self.state, "played")


def held(
    target: pin.SE3 | None = None, grip: TwistMapping | None = None, frame: str = "world"
) -> tuple[Played, Teleoperation]:
    sensor = Played()
    return sensor, Teleoperation(sensor, FrameTask("tool", target or pin.SE3.Identity()), grip, frame)


deflections = st.tuples(*[st.floats(-1, 1)] * 6)


def placements(seed: int) -> pin.SE3:
    pin.seed(seed)
    return pin.SE3.Random()


def test_full_deflection_is_the_grips_speed():
    sensor, hold = held(grip=TwistMapping(speed=0.2, turning=0.7))
    sensor.say((0, 0, 1, 0, 0, -1))
    for _ in range(100):
        hold.advance(DT)
    assert hold.task.target.translation == pytest.approx([0, 0, 0.02])
    assert pin.log3(hold.task.target.rotation) == pytest.approx([0, 0, -0.07])


@given(deflections, st.integers(0, 1000))
def test_silence_brings_rest_within_a_tenth_of_a_second_and_nothing_drifts(twist, seed):
    sensor, hold = held(placements(seed))
    sensor.say(twist)
    speeds, before = [], hold.task.target.translation.copy()
    for tick in range(420):
        hold.advance(DT)
        speeds.append(np.linalg.norm(hold.task.target.translation - before) / DT)
        before = hold.task.target.translation.copy()
        if tick == 300 and np.any(hold.mapping.velocity(twist)):
            assert hold.status.state is SensorState.SILENT
    assert np.ptp(speeds[:240]) < 1e-9  # as it was told, until the time-out
    assert np.abs(np.diff(speeds[240:])).max() <= 0.02 * speeds[0] + 1e-9  # without a jerk
    rest = hold.task.target.copy()
    for _ in range(1000):
        hold.advance(DT)
    assert np.array_equal(hold.task.target.homogeneous, rest.homogeneous)
    assert hold.status.state is SensorState.LIVE
    sensor.say((1, 0, 0, 0, 0, 0))
    hold.advance(DT)
    assert not np.array_equal(hold.task.target.homogeneous, rest.homogeneous)


@pytest.mark.parametrize("state", [SensorState.LOST, SensorState.CLOSED, SensorState.REFUSED, SensorState.OPENING])
def test_a_sensor_that_is_lost_comes_to_rest_at_once(state):
    sensor, hold = held()
    sensor.say((1, 0, 0, 0, 0, 0))
    for _ in range(10):
        hold.advance(DT)
    sensor.state = state
    for _ in range(102):
        hold.advance(DT)
    rest = hold.task.target.copy()
    assert 0.001 < rest.translation[0] < 0.011
    for _ in range(100):
        hold.advance(DT)
    assert hold.task.target == rest


def test_buttons_alone_keep_no_motion_alive():
    sensor, hold = held()
    sensor.say((1, 0, 0, 0, 0, 0))
    hold.advance(DT)
    for _ in range(500):
        sensor.next = Reading(sensor.time, (1, 0, 0, 0, 0, 0), None, frozenset({1}), (1,))
        assert hold.advance(DT).pressed == (1,)
    assert hold.task.target.translation[0] < 0.1 * 0.36


@given(deflections, st.integers(0, 1000))
def test_the_frame_of_command_turns_the_motion_with_it(twist, seed):
    """In a frame that is turned, everything happens as in the world, turned."""
    frame, start = placements(seed).rotation, placements(seed + 5000)
    turned, plain = held(start, frame="base"), held(start)
    turned[1].axes["base"] = frame
    turned[0].say(twist)
    x, y, z = frame @ np.array(plain[1].mapping.velocity(twist)[:3])
    turn = frame @ plain[1].mapping.velocity(twist)[3:]
    for _ in range(20):
        turned[1].advance(DT)
    moved = turned[1].task.target
    assert moved.translation - start.translation == pytest.approx(0.02 * np.array([x, y, z]), abs=1e-12)
    assert pin.log3(moved.rotation @ start.rotation.T) == pytest.approx(0.02 * turn, abs=1e-9)


@given(deflections, st.integers(0, 1000))
def test_the_nodes_own_axes_go_with_it(twist, seed):
    """What a tool does in its own axes does not depend on where it stands."""
    start = placements(seed)
    (sensor, hold), (other, other_hold) = held(frame="node"), held(start, frame="node")
    sensor.say(twist)
    other.say(twist)
    for _ in range(200):
        hold.advance(DT)
        other_hold.advance(DT)
    assert other_hold.task.target.isApprox(start * hold.task.target, 1e-9)


@given(st.floats(0, 0.9), st.floats(-1, 1), st.floats(0, 1e-6))
def test_the_dead_zone_is_continuous(dead, value, step):
    def speed(deflection: float) -> float:
        return float(TwistMapping(speed=1.0, dead=dead).velocity((deflection, 0, 0, 0, 0, 0))[0])

    assert abs(speed(min(1.0, value + step)) - speed(value)) <= step / (1.0 - dead) + 1e-12
    assert speed(-value) == -speed(value)
    assert speed(1.0) == 1.0
    if abs(value) <= dead:
        assert speed(value) == 0.0


@pytest.mark.parametrize(
    ("translation", "rotation", "free"),
    [
        (3, 3, (1, 1, 1, 1, 1, 1)),
        (2, 0, (1, 1, 0, 0, 0, 0)),
        (1, 1, (1, 0, 0, 0, 0, 1)),
        (0, 2, (0, 0, 0, 1, 1, 0)),
        (3, 0, (1, 1, 1, 0, 0, 0)),
    ],
)
def test_raffs_freedoms(translation, rotation, free):
    grip = TwistMapping(speed=1.0, turning=1.0, dead=0.0, translation=translation, rotation=rotation)
    assert grip.commanded == free
    assert grip.velocity((0.5,) * 6) == pytest.approx([0.5 * flag for flag in free])
    sensor, hold = held(grip=grip)
    given_ = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([1.0, 2.0, 3.0]))
    sensor.say(target=given_)
    hold.advance(DT)
    moved = np.concatenate([hold.task.target.translation, pin.log3(hold.task.target.rotation)])
    assert moved == pytest.approx(np.array([1, 2, 3, 0.1, 0.2, 0.3]) * free)


def test_what_makes_no_sense():
    for wrong in ({"dead": 1.0}, {"speed": math.nan}, {"turning": -1.0}, {"rotation": 4}, {"translation": -1}):
        with pytest.raises(CinegenError):
            TwistMapping(**wrong)
    _, hold = held()
    with pytest.raises(UnknownNameError, match="node"):
        hold.frame = "tool"
    hold.axes["view"] = np.eye(3)
    hold.frame = "view"
    hold.task.target = "somewhere"
    sensor = hold.sensor
    sensor.say((1, 0, 0, 0, 0, 0))
    hold.advance(DT)  # a target that is none stays what it is, and the solver says so
    sensor.say(target=pin.SE3.Identity())
    hold.advance(DT)
    assert hold.task.is_valid()


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_nodes_that_follow_one_device_move_alike(order):
    """Each of them gets every reading, in whatever order they are advanced."""
    sensor, several = Played(), [held()[1] for _ in range(3)]
    lone, alone = held()
    for tick in range(420):
        if tick < 50 and tick % 10 == 0:
            sensor.say((0, 0, 1, 0, 0, 0))
            lone.say((0, 0, 1, 0, 0, 0))
        reading = sensor.read()
        for number in order:
            several[number].advance_by(reading, DT)
        assert alone.advance(DT) == reading
    assert [hold.task.target for hold in several] == [alone.task.target] * 3
    assert alone.task.target.translation[2] > 0.02


def test_a_rotation_stays_one_for_hours():
    sensor, hold = held(grip=TwistMapping(turning=3.0))
    for tick in range(4_000):
        if tick % 100 == 0:
            sensor.say((0, 0, 0, 1.0, 0.5, -0.7))
        hold.advance(DT)
    rotation = hold.task.target.rotation
    assert np.abs(rotation.T @ rotation - np.eye(3)).max() < 1e-14


# --- the gamepad of a browser -----------------------------------------------------------------------------------------
# What is put is said, what makes no sense is not; a browser that is gone moves nothing.


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
