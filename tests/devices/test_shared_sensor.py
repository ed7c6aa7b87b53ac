"""One device for several nodes: each of them gets every reading, in whatever order they are advanced."""

from __future__ import annotations

from itertools import permutations

import pinocchio as pin
import pytest

from cinegen.devices import Reading, SensorState, SensorStatus, Teleoperation
from cinegen.ik import FrameTask

DT = 0.001
UP = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


class Played:
    """A sensor with the readings of a test."""

    url, timeout = "played", 0.25

    def __init__(self) -> None:
        self.next: Reading | None = None
        self.state = SensorState.LIVE
        self.time = 0.0

    def say(self, twist=None) -> None:
        self.time += 0.01
        self.next = Reading(self.time, twist)

    def read(self) -> Reading | None:
        reading, self.next = self.next, None
        return reading

    @property
    def status(self) -> SensorStatus:
        return SensorStatus(self.state, "played")


def teleoperation(sensor) -> Teleoperation:
    return Teleoperation(sensor, FrameTask("tool", pin.SE3.Identity()))


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_three_nodes_that_follow_one_device_move_alike(order):
    sensor, lone = Played(), Played()
    several, alone = [teleoperation(sensor) for _ in range(3)], teleoperation(lone)
    for tick in range(420):
        if tick < 50 and tick % 10 == 0:
            sensor.say(UP)
            lone.say(UP)
        reading = sensor.read()
        for number in order:
            several[number].advance_by(reading, DT)
        assert alone.advance(DT) == reading
        if tick == 300:  # the device has sent nothing for a while
            assert [one.status.state for one in (*several, alone)] == [SensorState.SILENT] * 4
    assert [one.task.target for one in several] == [alone.task.target] * 3
    assert alone.task.target.translation[2] > 0.02


def test_a_device_that_is_lost_brings_all_to_rest_at_once():
    sensor = Played()
    several = [teleoperation(sensor) for _ in range(2)]
    sensor.say(UP)
    for tick in range(112):
        if tick == 10:
            sensor.state = SensorState.LOST
        reading = sensor.read()
        for one in several:
            one.advance_by(reading, DT)
    rest = [one.task.target.copy() for one in several]
    assert 0.001 < rest[0].translation[2] < 0.011
    for _ in range(100):
        for one in several:
            one.advance_by(sensor.read(), DT)
    assert [one.task.target for one in several] == rest
