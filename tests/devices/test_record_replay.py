"""Readings in a file: written as they come, read back as they were, whole lines whatever happens."""

import errno
import json
import math
import os
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from cinegen.devices import Reading, ReadingRecorder, RecordError, SensorState, open_sensor
from cinegen.devices.replay import Replay, load_readings

READINGS = [
    Reading(100.0, (0, 0, 0.5, 0, 0, 0)),
    Reading(100.05, (0, 0, 0.25, 0, 0, 0.125), None, frozenset({1}), (1,)),
    Reading(100.05, None, pin.SE3.Random(), frozenset(), (2, 3)),
    Reading(np.float64(100.10), tuple(np.eye(6)[0])),  # as numpy computes it
]


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "run.jsonl"
    with ReadingRecorder(path, 0.2) as recorder:
        for reading in READINGS:
            recorder.write(reading)
    assert recorder.error == "closed"
    return path


def test_what_was_written_is_read(recording):
    readings, timeout = load_readings(recording)
    assert timeout == 0.2
    assert [r.time for r in readings] == pytest.approx([0.0, 0.05, 0.05, 0.1])
    for said, written in zip(readings, READINGS, strict=True):
        assert said[1] == written[1]
        assert said[3:] == written[3:]
    assert readings[2].target.isApprox(READINGS[2].target, 1e-12)


def test_it_is_replayed_at_its_times(recording, monkeypatch):
    sensor = open_sensor(f"replay:{recording}")
    clock = [500.0]
    monkeypatch.setattr("cinegen.sensor.time", SimpleNamespace(monotonic=lambda: clock[0]))
    assert sensor.read() is None
    assert sensor.status.state is SensorState.CLOSED
    sensor.start()
    clock[0] += 0.001
    first = sensor.read()
    assert (first.time, first.twist) == (500.0, (0, 0, 0.5, 0, 0, 0))
    assert sensor.read() is None
    clock[0] = 500.06
    second = sensor.read()  # the newest of two, with the presses of both
    assert second.target is not None
    assert second.pressed == (1, 2, 3)
    assert sensor.status.state is SensorState.LIVE
    clock[0] = 501.0
    assert sensor.read().twist == (0,) * 6  # it ends at rest
    assert sensor.status.state is SensorState.CLOSED
    sensor.close()
    sensor.start()
    clock[0] += 0.01
    assert sensor.read().twist == (0, 0, 0.5, 0, 0, 0)  # and can be played again


@pytest.mark.parametrize(("timeout", "rests"), [(0.2, 100.3), (math.inf, 100.1)])
def test_a_recording_ends_at_rest_after_the_time_out_or_at_once_where_there_is_none(tmp_path, timeout, rests):
    with ReadingRecorder(tmp_path / "run.jsonl", timeout) as recorder:
        for reading in READINGS:
            recorder.write(reading)
    last = Replay(tmp_path / "run.jsonl").readings[-1]
    assert (last.time + READINGS[0].time, last.twist) == (pytest.approx(rests), (0,) * 6)


def test_a_line_that_was_cut_is_left_out(recording):
    whole = recording.read_bytes()
    for length in range(whole.index(b"\n") + 1, len(whole), 7):
        recording.write_bytes(whole[:length])
        assert len(load_readings(recording)[0]) == whole[:length].count(b"\n") - 1


def test_a_full_disk_does_not_raise_later_and_no_file_stays_open(tmp_path, monkeypatch):
    before = len(os.listdir("/proc/self/fd"))

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    recorder = ReadingRecorder(tmp_path / "some.jsonl")
    monkeypatch.setattr(os, "write", full)
    recorder.write(READINGS[0])
    assert recorder.error == "the disk is full"
    recorder.close()
    recorder.write(READINGS[0])
    assert recorder.error == "the disk is full"
    assert len(os.listdir("/proc/self/fd")) == before


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "not a recording"),
        ("[]\n", "not a recording"),
        ('{"cinegen": "readings", "version": 2}\n', "version 2; only version 1"),
        ('{"cinegen": "readings", "version": 1, "timeout": -1}\n', "time-out"),
        ('{"cinegen": "readings", "version": 1}\n{"time": 1}\n\n{"time": 0}\n', r":4: Expected a time not before"),
        ('{"cinegen": "readings", "version": 1}\n{"time": 0, "pressed": "x"}\n', r":2: .*`\$.pressed`"),
        ('{"cinegen": "readings", "version": 1}\n{"time": 0, "twist": [NaN]}\n', ":2: JSON is malformed"),
    ],
)
def test_what_is_no_recording(text_file, text, why):
    path = text_file("run.jsonl", text)
    with pytest.raises(RecordError, match=why):
        Replay(path)


def test_no_file(tmp_path):
    with pytest.raises(RecordError, match="No such file"):
        Replay(tmp_path / "none")
    with pytest.raises(RecordError, match="can't be written"):
        ReadingRecorder(tmp_path)


def test_an_empty_recording_and_one_without_time_out(tmp_path):
    path = tmp_path / "run.jsonl"
    with ReadingRecorder(path, math.inf):
        pass
    assert json.loads(path.read_text())["timeout"] is None
    sensor = Replay(path)
    sensor.start()
    assert sensor.read() is None
    assert sensor.timeout == math.inf
    assert sensor.status.state is SensorState.CLOSED
