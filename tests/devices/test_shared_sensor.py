"""One device for several nodes: every tap says everything once, in whatever order they are asked."""

from __future__ import annotations

from itertools import permutations

import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cinegen.devices import Reading, Sensor, SensorState, SensorStatus, SharedSensor, Teleoperation
from cinegen.ik import FrameTask

DT = 0.001
UP = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


class Played:
    """A sensor that says what a test wants."""

    url, timeout = "played", 0.25

    def __init__(self) -> None:
        self.next: Reading | None = None
        self.state = SensorState.LIVE
        self.time = 0.0
        self.reads = 0

    def say(self, twist=None, pressed=(), target=None) -> None:
        self.time += 0.01
        self.next = Reading(self.time, twist, target, frozenset(), pressed)

    def start(self) -> None:
        self.state = SensorState.OPENING

    def close(self) -> None:
        self.state = SensorState.CLOSED

    def read(self) -> Reading | None:
        self.reads += 1
        reading, self.next = self.next, None
        return reading

    @property
    def status(self) -> SensorStatus:
        return SensorStatus(self.state, "played")


events = st.lists(st.tuples(st.booleans(), st.lists(st.integers(0, 5), max_size=3)), max_size=20)


@given(events, st.randoms(use_true_random=False))
def test_each_tap_says_everything_once_whatever_the_order(said, random):
    sensor = Played()
    taps = SharedSensor(sensor)
    three = [taps.reader() for _ in range(3)]
    for new, pressed in said:
        if new:
            sensor.say(UP, tuple(pressed))
        given_ = taps.read()
        order = random.sample(three, 3)
        assert [tap.read() for tap in order] == [given_] * 3
        assert [tap.read() for tap in order] == [None] * 3
    assert sensor.reads == len(said)


@given(events, st.lists(st.booleans(), min_size=20, max_size=20))
def test_a_tap_that_is_not_always_read_misses_no_press(said, asked):
    sensor = Played()
    taps = SharedSensor(sensor)
    tap = taps.reader()
    heard: list[int] = []
    for (new, pressed), ask in zip(said, asked, strict=False):
        if new:
            sensor.say(UP, tuple(pressed))
        taps.read()
        reading = tap.read() if ask else None
        if reading is not None:
            assert reading.time == sensor.time  # of motion only the newest counts
            heard += reading.pressed
    last = tap.read()
    heard += last.pressed if last is not None else ()
    assert heard == [button for new, pressed in said for button in pressed if new]


def test_only_the_last_64_presses_are_kept():
    sensor = Played()
    taps = SharedSensor(sensor)
    tap = taps.reader()
    for number in range(100):
        sensor.say(UP, (number,))
        taps.read()
    assert tap.read().pressed == tuple(range(36, 100))


def test_a_tap_says_nothing_of_what_was_before_it():
    """A node that is switched to a device must not go on with what that said to another."""
    sensor = Played()
    taps = SharedSensor(sensor)
    sensor.say(UP, (1, 2))
    taps.read()
    late = taps.reader()
    assert late.read() is None
    sensor.say(UP, (3,))
    taps.read()
    assert late.read().pressed == (3,)


def test_who_has_the_sensor_starts_and_closes_it():
    sensor = Played()
    tap: Sensor = SharedSensor(sensor).reader()
    for state, do in ((SensorState.LIVE, tap.close), (SensorState.CLOSED, tap.start)):
        sensor.state = state
        do()
        assert sensor.state is tap.status.state is state
    assert (tap.url, tap.timeout) == ("played", 0.25)


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_three_nodes_held_by_one_device_move_alike(order):
    sensor = Played()
    taps = SharedSensor(sensor)
    holds = [Teleoperation(taps.reader(), FrameTask("tool", pin.SE3.Identity())) for _ in range(3)]
    alone = Teleoperation(lone := Played(), FrameTask("tool", pin.SE3.Identity()))
    for tick in range(420):
        if tick < 50 and tick % 10 == 0:
            sensor.say(UP)
            lone.say(UP)
        taps.read()
        for number in order:
            holds[number].advance(DT)
        alone.advance(DT)
        if tick == 300:  # the device has sent nothing for a while
            assert [hold.status.state for hold in (*holds, alone)] == [SensorState.SILENT] * 4
    assert [hold.task.target for hold in holds] == [alone.task.target] * 3
    assert alone.task.target.translation[2] > 0.02


def test_a_device_that_is_lost_brings_all_to_rest_at_once():
    sensor = Played()
    taps = SharedSensor(sensor)
    holds = [Teleoperation(taps.reader(), FrameTask("tool", pin.SE3.Identity())) for _ in range(2)]
    sensor.say(UP)
    for tick in range(112):
        if tick == 10:
            sensor.state = SensorState.LOST
        taps.read()
        for hold in holds:
            hold.advance(DT)
    rest = [hold.task.target.copy() for hold in holds]
    assert 0.001 < rest[0].translation[2] < 0.011
    for _ in range(100):
        taps.read()
        for hold in holds:
            hold.advance(DT)
    assert [hold.task.target for hold in holds] == rest
