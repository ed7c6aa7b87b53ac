"""A mission in a file: what was handed over is read back bit for bit, whatever happens to program, disk and file."""

import errno
import json
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from browsers import becomes
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from recorded import record, swung

import cinegen
import cinegen.mission.recorder as module
from cinegen.errors import UnknownNameError
from cinegen.mission import BasePose, MissionError, MissionRecorder, Player, RecordedTask, Recording, RobotSample
from cinegen.model.build import build

finite = st.floats(allow_nan=False, allow_infinity=False)
doubles = st.lists(finite, min_size=3, max_size=3)


def _task(x=0.0, source="pointer"):
    turned = pin.SE3(pin.exp3(np.array([0.1, x, -0.3])), np.array([x, 0.2, 0.3]))
    return RecordedTask("tool", source, pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1])), turned, 3, 0, 2.5)


def _same(task: RecordedTask, other: RecordedTask):
    for name in ("node", "source", "translation", "rotation", "weight"):
        assert getattr(task, name) == getattr(other, name)
    assert task.offset.isApprox(other.offset, 1e-14)
    assert (task.target is None) == (other.target is None)
    assert task.target is None or task.target.isApprox(other.target, 1e-14)


# --- what was handed over is read ------------------------------------------------------------------------------------


@settings(max_examples=30)
@given(st.lists(doubles, max_size=8), st.floats(-1e6, 1e6))
def test_what_was_recorded_is_read_bit_for_bit(robot, tmp_path_factory, configurations, begin):
    arm, path = robot("planar_3r"), tmp_path_factory.mktemp("mission") / "run.jsonl"
    with MissionRecorder(path, {"arm": arm}) as recorder:
        for i, q in enumerate(configurations):
            recorder.write(begin + i / 64, {"arm": RobotSample(np.array(q), "IDLE")})
    recording = Recording.load(path)
    assert recorder.lost == 0
    assert recorder.seconds == pytest.approx(recording.seconds, abs=1e-9)
    assert recording.q["arm"].tobytes() == np.array(configurations).tobytes()
    assert recording.times == pytest.approx([i / 64 for i in range(len(configurations))], abs=1e-9)


def test_tasks_statuses_and_base_poses_are_read(robot, tmp_path):
    arm, delta = robot("planar_3r"), robot("delta4")
    place = BasePose("arm", "tool", pin.SE3(pin.exp3(np.array([0.0, 0.0, 1.0])), np.array([0.1, 0.0, 0.5])))
    tasks = [(), (_task(),), (_task(),), (_task(1.0), _task(0.0, "pin")), (replace(_task(), target=None),), ()]
    with MissionRecorder(tmp_path / "run.jsonl", {"arm": arm, "delta": delta}, {"delta": place}) as recorder:
        for i, now in enumerate(tasks):
            q = np.array([0.1, 0.2, 0.01 * i])
            robots = {"arm": RobotSample(q, "FOLLOWING" if now else "IDLE", now)}
            if i == 3:
                robots["delta"] = RobotSample(delta.q_home, "AT_LIMIT", ())
            recorder.write(i / 100, robots)
            q[:] = np.nan  # it may be used again
    recording = Recording.load(tmp_path / "run.jsonl")
    assert recording.robots == ("arm", "delta")
    for said, read in zip(tasks, recording.tasks["arm"], strict=True):
        assert len(said) == len(read)
        for task, other in zip(said, read, strict=True):
            _same(task, other)
    assert recording.statuses["arm"] == ["IDLE", *["FOLLOWING"] * 4, "IDLE"]
    assert recording.q["arm"][:, 2] == pytest.approx([0.01 * i for i in range(6)])
    assert recording.statuses["delta"] == ["IDLE"] * 3 + ["AT_LIMIT"] * 3  # unsaid: at home, then as it was
    assert (recording.q["delta"] == delta.q_home).all()
    base = recording.bases["delta"]
    assert (base.robot, base.node) == ("arm", "tool")
    assert base.placement.isApprox(place.placement, 1e-14)
    assert recording.bases["arm"] == BasePose()


def test_what_does_not_change_is_not_written_again(robot, tmp_path):
    arm, path = robot("planar_3r"), tmp_path / "run.jsonl"
    with MissionRecorder(path, {"arm": arm}) as recorder:
        for i in range(4):
            recorder.write(i, {"arm": RobotSample(np.array([0.0, 0.0, 1.0 * (i > 1)]), "IDLE", (_task(),))})
        recorder.write(4, {"arm": RobotSample(np.array([-0.0, 0.0, 1.0]), "IDLE", (_task(),))})
    lines = [json.loads(line)["robots"] for line in path.read_text().splitlines()[1:]]
    assert [sorted(line.get("arm", "")) for line in lines] == [
        ["q", "status", "tasks"], [], ["q", "status"], [], ["q", "status"]
    ]  # fmt: skip
    assert np.signbit(Recording.load(path).q["arm"][-1, 0])


@pytest.mark.parametrize("name", ["planar_3r", "hybrid"])
def test_the_robot_is_built_again_from_the_file_alone(robot, tmp_path, name):
    mechanism = robot(name)
    times, q = swung(mechanism, 0.2)
    recording = record(tmp_path / "run.jsonl", mechanism, times, q)
    again = recording.mechanism("robot")
    assert again is recording.mechanism("robot")
    for attribute in ("name", "joints", "actuated", "nodes"):
        assert getattr(again, attribute) == getattr(mechanism, attribute)
    said = json.loads((tmp_path / "run.jsonl").read_text().splitlines()[0])["robots"]["robot"]
    assert dict(zip(said["joints"], q[-1][said["index"]], strict=True)) == mechanism.values(q[-1])
    assert again.q_home.tobytes() == mechanism.q_home.tobytes()
    assert max(map(again.closure, recording.q["robot"])) <= 1e-12
    assert again.placement(q[-1], again.end) == mechanism.placement(q[-1], mechanism.end)


@pytest.mark.parametrize("is_absolute", [False, True])
def test_a_recording_has_no_meshes_shown_that_are_far_from_it_unless_the_user_allows_it(
    tmp_path, monkeypatch, is_absolute
):
    """Its author may be anybody, and states the folder; or none, and names the mesh absolutely."""
    runs, folder = tmp_path / "my/runs", tmp_path / "there/robots/arm"
    runs.mkdir(parents=True)
    folder.mkdir(parents=True)
    trimesh.creation.box((0.1, 0.2, 0.3)).export(folder / "part.stl")
    mesh = '<visual><geometry><mesh filename="part.stl"/></geometry></visual>'
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>'
    (folder / "one.urdf").write_text(f'<robot name="one"><link name="a">{mesh}</link><link name="b"/>{joint}</robot>')
    mechanism = cinegen.load(folder / "one.urdf")
    if is_absolute:
        source = mechanism.source
        mechanism = build(source.urdf.replace("part.stl", str(folder / "part.stl")), source.constraints)
    near = record(folder / "run.jsonl", mechanism, [0.0], [mechanism.q_home])
    assert near.mechanism("robot").visual.geometryObjects[0].meshPath == str(folder / "part.stl")
    (folder / "run.jsonl").rename(runs / "run.jsonl")
    with pytest.warns(cinegen.CinegenWarning, match=f"leads out of .*RAFF2URDF_MESH_PATH={folder}; sticks are drawn"):
        shapes = Recording.load(runs / "run.jsonl").mechanism("robot").visual.geometryObjects
    assert not any(str(folder) in shape.meshPath for shape in shapes)
    monkeypatch.setenv("RAFF2URDF_MESH_PATH", str(folder))
    (shape,) = Recording.load(runs / "run.jsonl").mechanism("robot").visual.geometryObjects
    assert shape.meshPath == str(folder / "part.stl")


# --- programs, disks -------------------------------------------------------------------------------------------------


def test_a_process_that_is_killed_leaves_all_but_the_last_line(tmp_path, root):
    path = tmp_path / "run.jsonl"
    program = f"""
import itertools, time
import numpy as np
import cinegen
from cinegen.mission import RobotSample, MissionRecorder
arm = cinegen.load({str(root / "robots" / "planar_3r.raff")!r})
recorder = MissionRecorder({str(path)!r}, {{"arm": arm}})
for i in itertools.count():
    recorder.write(i / 100, {{"arm": RobotSample(np.full(3, float(i)), "IDLE")}})
    print(i, flush=True)
    time.sleep(0.001)
"""
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        said = [process.stdout.readline() for _ in range(100)]
        assert becomes(lambda: path.read_bytes().count(b"\n") > 101, 60.0)
        process.send_signal(signal.SIGKILL)
    assert said[-1] == "99\n"
    recording = Recording.load(path)
    count = len(recording.times)
    assert count >= 100
    assert (recording.q["arm"] == np.arange(float(count))[:, None]).all()


@pytest.mark.parametrize("keep", [0.3, 0.9999])
def test_a_line_that_was_cut_is_left_out(robot, tmp_path, keep):
    path = tmp_path / "run.jsonl"
    arm = robot("planar_3r")
    whole = record(path, arm, np.arange(5) / 10, np.arange(15.0).reshape(5, 3))
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-1]) + lines[-1][: int(keep * len(lines[-1]))])
    cut = Recording.load(path)
    assert cut.times.tolist() == whole.times[:-1].tolist()
    assert (cut.q["robot"] == whole.q["robot"][:-1]).all()


def test_a_full_disk_is_said_and_ends_nothing(robot, tmp_path, monkeypatch):
    arm, path = robot("planar_3r"), tmp_path / "run.jsonl"
    recorder, write = MissionRecorder(path, {"arm": arm}), os.write
    room = [2500]

    def nearly_full(file, data):
        if room[0] <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        room[0], data = room[0] - len(data), data[: room[0]]
        return write(file, data)

    monkeypatch.setattr(os, "write", nearly_full)
    for i in range(100):
        recorder.write(i / 10, {"arm": RobotSample(np.full(3, float(i)), "IDLE")})
    assert becomes(lambda: recorder.error, 60.0)
    assert recorder.error == "the disk is full"
    recorder.write(100.0, {"arm": RobotSample(np.zeros(3), "IDLE")})
    recorder.close()
    recorder.close()
    assert recorder.error == "the disk is full"
    assert 10 < len(Recording.load(path).times) < 60


def test_a_line_that_the_system_takes_in_parts(robot, tmp_path, monkeypatch):
    arm, write = robot("planar_3r"), os.write
    q = np.random.default_rng(0).normal(size=(20, 3))
    monkeypatch.setattr(os, "write", lambda file, data: write(file, data[:7]))
    assert (record(tmp_path / "run.jsonl", arm, np.arange(20), q).q["robot"] == q).all()


def test_a_disk_that_is_full_from_the_beginning(robot, device):
    full = device("full")
    with pytest.raises(MissionError, match=f"{full}: can't be written: the disk is full"):
        MissionRecorder(full, {"arm": robot("planar_3r")})
    assert full.is_char_device()


def test_a_disk_that_is_stuck_does_not_eat_memory(robot, tmp_path, monkeypatch):
    arm, path = robot("planar_3r"), tmp_path / "run.jsonl"
    monkeypatch.setattr(module, "MOST", 20)
    monkeypatch.setattr(module, "_PATIENCE", 0.05)
    recorder, write, stuck = MissionRecorder(path, {"arm": arm}), os.write, [True]

    def waits(file, data):
        while stuck[0]:
            time.sleep(0.002)
        return write(file, data)

    monkeypatch.setattr(os, "write", waits)
    for i in range(200):
        recorder.write(i / 10, {"arm": RobotSample(np.full(3, float(i)), "IDLE")})
        time.sleep(0.0005)
    assert 150 < recorder.lost < 181
    assert len(recorder._queue) == 20
    taken = 200 - recorder.lost
    recorder.close()
    assert recorder.error == "the disk does not answer"
    stuck[0] = False
    assert becomes(lambda: not recorder._thread.is_alive(), 60.0)
    assert len(Recording.load(path).times) == taken


def test_what_makes_no_sense_is_left_out(robot, tmp_path):
    arm, path = robot("planar_3r"), tmp_path / "run.jsonl"
    good = np.zeros(3)
    with MissionRecorder(path, {"arm": arm}) as recorder:
        for time_ in (float("nan"), float("inf"), None):
            recorder.write(time_, {"arm": RobotSample(good, "IDLE")})
        recorder.write(0.5, {"arm": RobotSample(good[:2], "IDLE")})
        recorder.write(1.0, {"arm": RobotSample(good, "IDLE")})
        recorder.write(1.0 + 1e-12, {"arm": RobotSample(good, "IDLE")})  # the file tells ns
        for robots in (
            {"arm": RobotSample(np.array([0.0, np.nan, 0.0]), "IDLE")},
            {"arm": RobotSample(np.zeros(4), "IDLE")},
            {"leg": RobotSample(good, "IDLE")},
            {"arm": RobotSample(good, "IDLE", (None,))},
            {"arm": RobotSample(good, "IDLE", (replace(_task(), weight=float("nan")),))},
            {"arm": None},
            None,
        ):
            lost = recorder.lost
            recorder.write(2.0 + lost, robots)
            assert becomes(lambda lost=lost: recorder.lost > lost, 60.0)
        recorder.write(0.5, {"arm": RobotSample(good, "IDLE")})  # earlier
        recorder.write(float("nan"), {"arm": RobotSample(good, "IDLE")})
        task = replace(_task(), target="somewhere")
        recorder.write(40.0, {"arm": RobotSample(good + 1.0, "IDLE", (task,))})
    assert recorder.lost == 14
    recording = Recording.load(path)
    assert recording.times.tolist() == [0.0, 39.0]
    assert recording.tasks["arm"][1][0].target is None


def test_a_loop_closes_without_waiting(robot, tmp_path, monkeypatch):
    path, freed = tmp_path / "run.jsonl", threading.Event()
    recorder = MissionRecorder(path, {"arm": robot("planar_3r")})
    append = recorder._file.append
    monkeypatch.setattr(recorder._file, "append", lambda data: (freed.wait(60.0), append(data)))
    for i in range(100):
        recorder.write(i / 100, {"arm": RobotSample(np.full(3, float(i)), "IDLE")})
    recorder.close(wait=False)
    assert recorder.error == "closed"
    assert not recorder.finished  # the disk has not answered yet
    freed.set()
    recorder.write(9.0, {"arm": RobotSample(np.zeros(3), "IDLE")})
    recorder.close()
    assert (recorder.lost, len(Recording.load(path).times)) == (0, 100)


def test_it_leaves_no_file_and_no_thread(robot, tmp_path):
    files, threads = len(os.listdir("/proc/self/fd")), threading.active_count()
    for i in range(5):
        MissionRecorder(tmp_path / f"{i}", {"arm": robot("planar_3r")}).close()
    assert (len(os.listdir("/proc/self/fd")), threading.active_count()) == (files, threads)
    assert sorted(path.name for path in tmp_path.iterdir()) == list("01234")


def test_a_loop_neither_encodes_nor_writes(robot, tmp_path, monkeypatch):
    """It takes 5 us, of which this is why."""
    mechanism, threads = robot("gough"), set()

    def noted(function):
        return lambda *arguments: (threads.add(threading.current_thread()), function(*arguments))[1]

    with MissionRecorder(tmp_path / "run.jsonl", {"gough": mechanism}) as recorder:
        monkeypatch.setattr(module, "encode", noted(module.encode))
        monkeypatch.setattr(recorder._file, "append", noted(recorder._file.append))
        for i in range(100):
            recorder.write(i / 100, {"gough": RobotSample(mechanism.q_home + i, "IDLE", (_task(), _task()))})
    assert threads == {recorder._thread}


# --- files that are there --------------------------------------------------------------------------------------------


def test_nothing_that_is_there_is_lost(robot, tmp_path):
    arm, path = robot("planar_3r"), tmp_path / "run.jsonl"
    path.write_text("my notes\n")
    with pytest.raises(MissionError, match="exists, and is not a mission: name another"):
        MissionRecorder(path, {"arm": arm})
    assert path.read_text() == "my notes\n"
    for places, why in (
        ({"leg": BasePose()}, "no robot 'leg'"),
        ({"arm": BasePose("leg", "tool")}, "'tool' of 'leg'"),
        ({"arm": BasePose("arm", "hat")}, "'hat' of 'arm'"),
    ):
        with pytest.raises(MissionError, match=why):
            MissionRecorder(path, {"arm": arm}, places, overwrite=True)
    assert path.read_text() == "my notes\n"  # a recording that does not begin replaces nothing
    path.unlink()
    record(path, arm, [0.0, 1.0], np.zeros((2, 3)))
    before = path.read_bytes()
    with pytest.raises(MissionError, match="exists, and is a mission: name another"):
        MissionRecorder(path, {"arm": arm})
    assert path.read_bytes() == before
    MissionRecorder(path, {"arm": arm}, overwrite=True).close()
    assert len(Recording.load(path).times) == 0
    (tmp_path / "empty").touch()
    MissionRecorder(tmp_path / "empty", {"arm": arm}).close()
    with pytest.raises(MissionError, match="can't be written: is a directory"):
        MissionRecorder(tmp_path, {"arm": arm})


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda lines: [b"", *lines], "not a mission"),
        (lambda lines: [lines[0].replace(b'"created":"', b'"created":"\xff', 1)], "run.jsonl: line 1: .*utf-8"),
        (lambda lines: [b'{"cinegen":"readings","version":1}'], "It is a recording of sensor readings"),
        (lambda lines: [lines[0].replace(b'"version":3', b'"version":7', 1)], "version 7; only version 3"),
        (lambda lines: [*lines[:2], lines[2][:-5], *lines[3:]], ":3: (Input data was truncated|JSON is malformed)"),
        (
            lambda lines: [
                *lines,
                b'{"t":9,"robots":{"robot":{"q":[1,2,3],"status":"X","tasks":[{"node":"n","source":"pin","target":null,'
                b'"offset":[0,0,0,1e308,1e308,0,0]}]}}}',
            ],
            ":5: Expected a quaternion of length 1",
        ),
    ],
)
def test_a_file_that_is_damaged_or_something_else(robot, tmp_path, change, why):
    path = tmp_path / "run.jsonl"
    record(path, robot("planar_3r"), [0.0, 1.0, 2.0], np.arange(9.0).reshape(3, 3))
    path.write_bytes(b"\n".join(change(path.read_bytes().splitlines())) + b"\n")
    with pytest.raises(MissionError, match=why):
        Recording.load(path)


def test_a_description_that_was_changed_and_a_file_that_is_not_there(robot, tmp_path):
    with pytest.raises(MissionError, match="can't be read: No such file"):
        Recording.load(tmp_path / "none")
    path = tmp_path / "run.jsonl"
    recording = record(path, robot("planar_3r"), [0.0], np.zeros((1, 3)))
    with pytest.raises(UnknownNameError, match="no robot 'leg'"):
        recording.mechanism("leg")
    path.write_bytes(path.read_bytes().replace(b"<robot", b"<!-- --><robot", 1))
    with pytest.raises(MissionError, match=":1: the description of 'robot' was changed"):
        Recording.load(path).mechanism("robot")


# --- played ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["five_bar", "delta4"])
def test_between_two_moments_loops_are_closed(robot, tmp_path, name):
    mechanism = robot(name)
    times, q = swung(mechanism, 1.0, rate=25.0)
    recording = record(tmp_path / "run.jsonl", mechanism, times, q)
    for i in range(0, 25, 5):
        assert recording.at(times[i])["robot"].tobytes() == q[i].tobytes()
        for x in (0.1, 0.5, 0.9):
            at = recording.at(times[i] + x / 25.0)["robot"]
            assert mechanism.closure(at) <= 1e-12
            assert at == pytest.approx(q[i] + x * (q[i + 1] - q[i]), abs=2e-2)
    for time_, end in ((-1.0, q[0]), (99.0, q[-1]), (float("inf"), q[-1])):
        assert (recording.at(time_)["robot"] == end).all()


def test_a_player(robot, tmp_path):
    arm = robot("planar_3r")
    player = Player(record(tmp_path / "run.jsonl", arm, [0.0, 1.0, 2.0], [[0, 0, 0], [1, 1, 1], [2, 2, 3]]))
    assert (player.time, player.playing, player.seconds, player.speed) == (0.0, False, 2.0, 1.0)
    assert player.advance(0.5)["robot"].tolist() == [0, 0, 0]
    player.play()
    assert player.advance(0.5)["robot"].tolist() == [0.5, 0.5, 0.5]
    player.set_speed(2.0)
    assert player.advance(0.5)["robot"].tolist() == [1.5, 1.5, 2.0]
    assert player.index == 1
    player.pause()
    assert player.advance(0.5)["robot"].tolist() == [1.5, 1.5, 2.0]
    player.seek(0.25)
    assert player.advance(0.5)["robot"].tolist() == [0.25, 0.25, 0.25]
    player.play()
    player.set_speed(1000.0)
    assert player.speed == 100.0
    assert player.advance(1.0)["robot"].tolist() == [2, 2, 3]
    assert (player.time, player.playing) == (2.0, False)
    player.set_speed(float("nan"))
    player.seek(float("nan"))
    assert player.time == 2.0
    player = Player(record(tmp_path / "run.jsonl", arm, [], []))
    player.play()
    assert not player.playing
    assert (player.advance(0.1)["robot"] == arm.q_home).all()
    assert player.index == 0
