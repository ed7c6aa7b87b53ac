"""What is handed on reads back as the motion that was recorded; what must not be sent is not written."""

import csv
import io
import re
import sys

import numpy as np
import pytest
import yaml
from recorded import record, swung

from cinegen.collision import load_scene, scene_of
from cinegen.errors import UnknownNameError
from cinegen.mission import MissionError, MissionRecorder, Recording, RobotSample, check, export, report_text, resampled
from cinegen.mission.results import record_plan
from cinegen.planning import plan


@pytest.fixture
def recording(robot, tmp_path):
    """`recording("delta4")`: the path of one, `run.jsonl`."""

    def make(name: str, seconds: float = 0.5):
        mechanism = robot(name)
        record(tmp_path / "run.jsonl", mechanism, *swung(mechanism, seconds), name=name)
        return tmp_path / "run.jsonl"

    return make


def _table(path):
    names, *rows = csv.reader(io.StringIO(path.read_text()))
    return names, np.array(rows, dtype=float)


@pytest.mark.parametrize(("name", "all_joints"), [("planar_3r", False), ("four_bar", True)])
def test_a_table(robot, recording, name, all_joints):
    path, mechanism = recording(name), robot(name)
    report = export(path, "csv", all_joints=all_joints)
    assert report.path == path.with_suffix(".csv")
    names, rows = _table(report.path)
    joints = mechanism.joints if all_joints else mechanism.actuated
    assert names == ["time", *joints]
    motion = resampled(Recording.load(path))
    assert (rows[:, 0] == motion.times).all()
    assert (rows[:, 1:] == motion.positions(joints)).all()  # bit for bit
    if all_joints:
        q = np.array([mechanism.configuration(dict(zip(joints, row, strict=True))) for row in rows[:, 1:]])
        assert max(map(mechanism.closure, q)) <= 1e-10


def test_arrays(recording, tmp_path):
    path = recording("delta4")
    export(path, "npz", tmp_path / "out" / "motion.npz", rate=50.0)
    motion = resampled(Recording.load(path), rate=50.0)
    with np.load(tmp_path / "out" / "motion.npz") as archive:
        assert archive["joints"].tolist() == list(motion.mechanism.actuated)
        assert (archive["times"] == motion.times).all()
        assert (archive["q"] == motion.positions(motion.mechanism.actuated)).all()
        assert (archive["v"] == motion.velocities(motion.mechanism.actuated)).all()
        assert (float(archive["rate"]), str(archive["robot"])) == (50.0, "delta4")


def test_a_goal_of_ros_2(recording):
    path = recording("four_bar", 1.5)
    report = export(path, "ros2", rate=60.0)
    motion = report.trajectory
    assert report.path.name == "run.yaml"
    assert not re.search(r"[ \[]-?\d+e", report.path.read_text())  # YAML takes such numbers for text
    (key, goal), *more = yaml.safe_load(report.path.read_text()).items()
    assert (key, more) == ("trajectory", [])
    assert goal["joint_names"] == list(motion.mechanism.actuated)
    points = goal["points"]
    assert [sorted(point) for point in points] == [["positions", "time_from_start", "velocities"]] * len(motion.times)
    times = [(point["time_from_start"]["sec"], point["time_from_start"]["nanosec"]) for point in points]
    assert all(type(part) is int and 0 <= part < 10**9 for time in times for part in time)
    assert [sec + nano / 1e9 for sec, nano in times] == pytest.approx(motion.times, abs=1e-9)
    assert times == sorted(set(times))
    for key, exact in (("positions", motion.positions), ("velocities", motion.velocities)):
        rows = [point[key] for point in points]
        assert all(type(value) is float for row in rows for value in row)
        assert np.array(rows) == pytest.approx(exact(motion.mechanism.actuated), abs=1e-9)
    assert set(points[0]["velocities"]) == set(points[-1]["velocities"]) == {0.0}
    assert report.notes == ()


SERVO = re.compile(r"  servoj\(\[([-\d., ]+)\], 0, 0, ([\d.]+), 0\.1, 300\)")


def test_a_program_in_urscript(recording):
    rate = 125.0
    path = recording("rx90")
    report = export(path, "urscript", rate=rate)
    motion = report.trajectory
    assert report.path.name == "run.script"
    assert "-0.000000" not in report.path.read_text()
    lines = report.path.read_text().splitlines()
    begin = lines.index("def cinegen_motion():")
    assert all(line.startswith("# ") for line in lines[:begin])
    assert f"# rx90: {len(motion.times)} positions in" in lines[0]
    move, *servos, stop, end = lines[begin + 1 :]
    start = re.fullmatch(r"  movej\(\[([-\d., ]+)\], a=1\.0, v=0\.5\)", move)
    matches = [SERVO.fullmatch(line) for line in servos]
    assert all(matches)
    q = np.array([[float(word) for word in match[1].split(",")] for match in (start, *matches)])
    assert q == pytest.approx(motion.positions(motion.mechanism.actuated), abs=5.1e-7)
    assert all(len(word.rpartition(".")[2]) == 6 for match in matches for word in match[1].split(","))
    assert {float(match[2]) for match in matches} == {1.0 / rate}
    assert (stop, end) == ("  stopj(2.0)", "end")


@pytest.mark.parametrize(("name", "has"), [("delta4", "has 3$"), ("gough", "has 0, and 6 other joints")])
def test_urscript_is_for_six_motors_that_turn(recording, name, has):
    path = recording(name)
    with pytest.raises(MissionError, match=f"six actuated revolute joints: {name} {has}"):
        export(path, "urscript")
    assert [file.name for file in path.parent.iterdir()] == ["run.jsonl"]


# --- findings --------------------------------------------------------------------------------------------------------


@pytest.fixture
def forbidden(robot, tmp_path):
    """A recording in which joint1 of the planar arm passes its limit."""
    arm = robot("planar_3r")
    high = arm.model.upperPositionLimit[0]
    times = np.arange(101) / 100
    q = np.column_stack([high - 0.5 + times, 0.5 + 0.0 * times, 0.2 * times])
    record(tmp_path / "run.jsonl", arm, times, q)
    return tmp_path / "run.jsonl"


def test_what_must_not_be_sent_is_not_written_unless_that_is_asked_for(forbidden):
    with pytest.raises(MissionError) as refused:
        export(forbidden, "csv")
    words = str(refused.value)
    assert re.search(r"at 0\.\d+ s \(0\.\d+ s of the recording\) joint1 is 28\.6 deg beyond its upper limit", words)
    assert "record another motion" in words
    assert "--unsafe" in words
    assert [file.name for file in forbidden.parent.iterdir()] == ["run.jsonl"]
    report = export(forbidden, "csv", unsafe=True)
    assert report.path.exists()
    assert "DO NOT SEND THIS TO A ROBOT: at 0.5" in report_text(report)
    assert "checked" not in report_text(report)
    assert len(report.findings.serious) == 1


def test_what_is_told(robot, tmp_path, recording):
    text = report_text(export(recording("delta4", 1.5), "csv"))
    assert re.search(r"run\.csv: 3 joints of delta4, \d+ samples in 1\.\d+ s, 125 a second\n", text)
    assert "assumed: acceleration limit of joint1, joint12, joint6: 10 rad/s^2, 2.5 m/s^2\n" in text
    assert re.search(r"checked: loops closed to \d+e-\d+, joints within their limits, no type 2 singularity", text)
    arm = robot("planar_3r")
    record(tmp_path / "leap.jsonl", arm, [0.0, 0.01], [[0.0, 0.5, 0.0], [1.0, 0.5, 0.0]])
    text = report_text(export(tmp_path / "leap.jsonl", "csv", all_joints=True))
    slower = float(re.search(r"slowed down by ([\d.]+) s, for limits of velocity and acceleration", text)[1])
    fastest = arm.model.upperVelocityLimit[0]
    assert slower == pytest.approx(1.0 / fastest + fastest / 10.0 - 0.01, rel=0.05)  # ramps of 10 rad/s^2
    assert "loops" not in text


# --- files -----------------------------------------------------------------------------------------------------------


def test_a_file_is_written_whole_or_not_at_all(recording, tmp_path, monkeypatch):
    path = recording("planar_3r")
    out = tmp_path / "out.csv"
    out.write_text("the one before")
    with pytest.raises(MissionError, match="is the recording itself"):
        export(path, "csv", path)
    (tmp_path / "link").symlink_to(path)
    with pytest.raises(MissionError, match="is the recording itself"):
        export(path, "csv", tmp_path / "link")

    def full(contents):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(sys.modules[export.__module__], "write_all", full)
    with pytest.raises(MissionError, match=r"out\.csv: can't be written: no space left"):
        export(path, "csv", out)
    assert out.read_text() == "the one before"
    monkeypatch.undo()
    export(path, "csv", out)
    assert out.read_text().startswith("time,joint1")
    with pytest.raises(MissionError, match="can't be written"):
        export(path, "csv", tmp_path)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["link", "out.csv", "run.jsonl"]


def test_one_of_several_robots(robot, tmp_path):
    arm, delta = robot("planar_3r"), robot("delta4")
    path = tmp_path / "run.jsonl"
    with MissionRecorder(path, {"arm": arm, "delta": delta}) as recorder:
        for i in range(20):
            arms = {"arm": RobotSample(np.full(3, 0.5 + i / 40), "IDLE"), "delta": RobotSample(delta.q_home, "IDLE")}
            recorder.write(i / 20, arms)
    with pytest.raises(MissionError, match="several robots: name one of arm, delta"):
        export(path, "csv")
    with pytest.raises(UnknownNameError, match="no robot 'amr'"):
        export(path, "csv", robot="amr")
    with pytest.raises(UnknownNameError, match="no format 'cvs'"):
        export(path, "cvs", robot="arm")
    assert export(path, "csv", robot="arm").joints == arm.joints
    assert _table(tmp_path / "run.csv")[0] == ["time", *arm.joints]


# --- results ----------------------------------------------------------------------------------------------------------
# Planned ways as recordings.


@pytest.fixture(scope="module")
def rod(root):
    """A way of a planar arm."""
    return plan(load_scene(root / "robots/scenes/rod.toml"), seconds=600.0)


@pytest.fixture(scope="module")
def disc():
    """A way of a mobile robot, which has no limits of speed."""
    values = {"mobile": {"radius": 0.1}, "goal": {"point": [2, 0]}}
    return plan(scene_of(values | {"obstacle": [{"kind": "disc", "radius": 0.3, "point": [1, 0.05]}]}), seconds=600.0)


def test_a_recording_holds_the_motion(rod, tmp_path):
    motion = record_plan(rod, tmp_path / "rod.jsonl")
    recording = Recording.load(tmp_path / "rod.jsonl")
    name = rod.scene.mechanism.name
    assert recording.robots == (name,)
    assert (recording.q[name] == motion.q).all()
    assert recording.times == pytest.approx(motion.times, abs=2e-9)
    assert recording.seconds == pytest.approx(motion.times[-1])
    (task,) = recording.tasks[name][0]
    assert (task.node, task.translation, task.rotation) == ("tool", 2, 0)
    assert task.target.isApprox(rod.scene.goal, 1e-12)
    with pytest.raises(MissionError, match="exists, and is a mission"):
        record_plan(rod, tmp_path / "rod.jsonl")


@pytest.mark.parametrize("name", ["rod", "disc"])
def test_it_can_be_handed_on_to_a_robot(request, tmp_path, name):
    way = request.getfixturevalue(name)
    record_plan(way, tmp_path / "way.jsonl")
    trajectory = resampled(Recording.load(tmp_path / "way.jsonl"))
    assert trajectory.q[-1] == pytest.approx(way.path[-1], abs=1e-9)
    assert not check(trajectory).serious
    # as smooth as that is, it is still clear
    assert min(way._clearance.least(q) for q in trajectory.q) >= way.scene.safety


def test_what_does_not_move_is_refused(tmp_path):
    way = plan(scene_of({"mobile": {"radius": 0.1}, "goal": {"point": [0, 0]}}))
    with pytest.raises(MissionError, match="there is no path to record: reached"):
        record_plan(way, tmp_path / "way.jsonl")
    assert not list(tmp_path.iterdir())
