"""What the sensors with a thread share: the newest reading without waiting, no press lost, and no end by an error."""

import threading

from browsers import becomes

from cinegen.devices import SensorState
from cinegen.devices import threaded_sensor as module
from cinegen.devices.latest_reading import LatestReading
from cinegen.devices.threaded_sensor import DeviceLostError, ThreadedSensor, WrongDeviceError


def test_the_newest_counts_and_every_press():
    newest = LatestReading()
    assert newest.take() is None
    newest.put((1.0,) * 6)
    newest.press(frozenset({2, 1}))
    newest.press(frozenset())
    newest.put((0.5,) * 6)
    reading = newest.take()
    assert reading.twist == (0.5,) * 6
    assert reading.pressed == (1, 2)
    assert newest.take() is None
    newest.press(frozenset({3}))
    assert newest.take().time == reading.time
    newest.put()
    assert newest.take().buttons == {3}


def test_many_presses_take_no_memory():
    newest = LatestReading()
    for _ in range(1000):
        newest.press(frozenset({1}))
        newest.press(frozenset())
    assert len(newest.take().pressed) == 64


class Wild(ThreadedSensor):
    """Fails in every way."""

    def __init__(self, errors) -> None:
        super().__init__("wild:")
        self.errors = list(errors)
        self.served = 0
        self.longest = 0.05

    def serve(self) -> None:
        self.served += 1
        if self.errors:
            raise self.errors.pop(0)
        self.live("at last")
        self.newest.put((1.0,) * 6, buttons=frozenset({1}))
        self.wait(60)


def test_no_error_ends_it_a_bug_is_logged_once_and_a_device_that_is_gone_is_not(caplog):
    gone = [OSError(5, "Input/output error"), DeviceLostError("unplugged"), WrongDeviceError("no mouse")]
    sensor = Wild([*gone, ValueError("x"), ValueError("y"), RecursionError("z"), MemoryError("w")])
    sensor.start()
    sensor.start()  # once is enough
    assert becomes(lambda: sensor.status.state is SensorState.LIVE)
    assert sensor.served == 8
    assert "live" in repr(sensor)
    assert becomes(lambda: sensor.status.state is SensorState.SILENT)
    sensor.close()
    assert sensor.status.state is SensorState.CLOSED
    bugs = ["ValueError: x", "RecursionError: z", "MemoryError: w"]
    assert sensor.exception_log.messages == [f"wild:: {bug}" for bug in bugs]
    records = [record for record in caplog.records if record.name == "cinegen"]
    assert [record.exc_info[0] for record in records] == [ValueError, RecursionError, MemoryError]
    assert caplog.text.count("in serve") == 3


def test_one_that_hangs_is_left_behind(monkeypatch):
    monkeypatch.setattr(module, "_PATIENCE", 0.05)
    release = threading.Event()

    class Hanging(ThreadedSensor):
        def __init__(self) -> None:
            super().__init__("hanging:")
            self.ended: list[bool] = []

        def serve(self) -> None:
            release.wait(15)
            self.ended.append(self.ending)
            self.live("late")
            self.wait(15)

    sensor = Hanging()
    sensor.start()
    sensor.close()
    assert sensor.status.state is SensorState.CLOSED
    sensor.start()
    release.set()
    assert becomes(lambda: len(sensor.ended) == 2)
    assert sorted(sensor.ended) == [False, True]
    assert becomes(lambda: sensor.status.state is SensorState.LIVE)
    sensor.close()
    assert sensor.status.state is SensorState.CLOSED
