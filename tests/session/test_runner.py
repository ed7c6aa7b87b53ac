"""A session that runs at its rate: how it is scheduled, while its kernels are compiled, and at rest."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from functools import partial

import browsers
import numpy as np
import psutil
import pytest
from leading import run

from cinegen.collision import load_scene
from cinegen.errors import CinegenError
from cinegen.jit.starting import COMPILATION
from cinegen.session import Session, SessionRunner, arrange, scene_setup
from cinegen.session import commands as c
from cinegen.session.runner import AT_REST, INTERPRETED_RATE, _next_period


def test_what_ended_a_session_is_raised_also_where_the_system_says_so(robot, monkeypatch):
    """An OSError of the session is none of the pipe to it."""
    ticks = threading.Event()

    def broken(self):
        ticks.set()
        raise OSError("in a tick")

    monkeypatch.setattr(Session, "tick", broken)
    runner = SessionRunner(arrange({"arm": robot("planar_3r")}), own_process=False)
    assert ticks.wait(60.0)
    with pytest.raises(OSError, match="in a tick"):
        runner.stop()


def test_a_session_that_cant_begin_closes_its_sensors(robot, tmp_path):
    """The thread of the sensor, and its port; `nothing_is_left` looks for it."""
    (tmp_path / "run.jsonl").write_text("notes")
    setup = arrange({"arm": robot("planar_3r")}, sensors=["tool=tcp://127.0.0.1:0"], record=str(tmp_path / "run.jsonl"))
    with pytest.raises(CinegenError, match="exists"):
        SessionRunner(setup, own_process=False)


START = """
import cinegen
from cinegen.session import SessionRunner, arrange
if __name__ == "__main__":
    setup = arrange({"arm": cinegen.load("planar_3r")})
    print("begin", flush=True)
    runner = SessionRunner(setup)
    print("runs", flush=True)
    while True:
        runner.state
"""


def _of_family(mark):
    """The processes whose environment has a mark."""
    alive = (proc for proc in psutil.process_iter(["environ", "status"]) if proc.info["status"] != psutil.STATUS_ZOMBIE)
    return [proc for proc in alive if (proc.info["environ"] or {}).get("MARK") == mark]


@pytest.mark.parametrize(("end", "delay"), [(signal.SIGKILL, None), (signal.SIGINT, 0.1)])
def test_the_process_of_a_session_ends_with_its_parent_at_any_moment(tmp_path, end, delay):
    program, mark = tmp_path / "program.py", f"{os.getpid()} {time.time()}"
    program.write_text(START)
    parent = subprocess.Popen(
        [sys.executable, program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env={**os.environ, "MARK": mark},
    )  # fmt: skip
    assert parent.stdout.readline() == "begin\n"
    if delay is None:
        assert parent.stdout.readline() == "runs\n"
    else:
        time.sleep(delay)
    os.killpg(parent.pid, end) if end == signal.SIGINT else parent.kill()
    _, output = parent.communicate(timeout=120)  # its children hold the stream until they end
    assert becomes(lambda: not _of_family(mark))
    # Python prints this in a process whose parent ends before it has sent the process what to run.
    too_early = output.count("EOFError: Ran out of input")
    assert too_early <= (delay is not None and delay <= 0.1)
    assert output.count("Traceback") == (end == signal.SIGINT) + too_early  # of this program itself
    assert "cinegen" not in output or end == signal.SIGINT


# --- its rate --------------------------------------------------------------------------------------------------------


becomes = partial(browsers.becomes, seconds=60.0)


def test_a_session_has_its_rate_as_soon_as_its_kernels_are_compiled(robot, monkeypatch):
    monkeypatch.setattr(COMPILATION, "_waiting", [object()])
    setup = arrange({"arm": robot("planar_3r")}, follow="circle", rate=500.0)
    with SessionRunner(setup, own_process=False) as runner:
        assert becomes(lambda: runner.report().period == 1.0 / INTERPRETED_RATE)
        before = runner.state.time
        COMPILATION._waiting.clear()
        assert becomes(lambda: runner.report().period == 1.0 / 500.0)
        assert becomes(lambda: runner.state.time > before + 0.5)


@pytest.mark.parametrize("name", ["planar_3r", "delta4"])
def test_velocities_do_not_jump_when_the_rate_changes(session, robot, name):
    """A drag at a constant speed. If the rate changed at once, the speed would be twice as high for a while."""
    session = session(name)
    session.dt, end = 1.0 / INTERPRETED_RATE, robot(name).end
    begin = before = session.robots[name].placement(end).translation
    speed, speeds = 0.02 * robot(name).length, []
    session.obey(c.StartDrag(name, end, (0.0, 0.0, 0.0)))
    while session.time < 3.0:
        aside = [-speed * session.time, 0.0, 0.0]
        session.obey(c.MoveDrag(tuple(begin + aside)))
        session.tick()
        after = session.robots[name].placement(end).translation
        if session.time > 0.5:
            speeds.append(float(np.linalg.norm(after - before)) / session.dt)
        before = after
        if session.time > 1.0:
            session.dt = _next_period(1000.0, session.dt)
    assert session.dt == 1e-3
    assert np.array(speeds) == pytest.approx(speed, rel=0.035)


# --- at rest ----------------------------------------------------------------------------------------------------------
# A session at rest: few ticks, which cost next to nothing, until something is to be done.


@pytest.mark.parametrize("name", ["arm7", "delta4", "hybrid"])
def test_every_robot_comes_to_rest_with_and_without_a_pin(robot, name):
    session = Session(arrange({name: robot(name)}, rate=100.0))
    run(session, 0.5)
    assert not session.at_rest
    run(session, 1.0)
    assert session.at_rest
    session.obey(c.Pin(name, session.robots[name].mechanism.end))
    assert not session.at_rest
    run(session, 1.5)
    assert session.at_rest


def test_what_moves_is_not_at_rest(robot):
    session = Session(arrange({"arm": robot("planar_3r")}, rate=100.0))
    run(session, 1.5)
    begin = session.robots["arm"].placement("tool").translation
    session.obey(c.StartDrag("arm", "tool", (0.0, 0.0, 0.0)))
    for k in range(300):
        session.obey(c.MoveDrag(tuple(begin - np.array([1e-4 * k, 0.0, 0.0]))))
        session.tick()
        assert not session.at_rest
    run(session, 1.5)
    assert session.at_rest  # though a part is held
    session.obey(c.MoveHome())
    while session.robots["arm"].motion is not None:
        session.tick()
        assert not session.at_rest
    run(session, 1.5, c.SetRecording(False))
    assert session.at_rest


def test_a_script_or_a_recording_is_not_at_rest_until_the_session_is_paused_or_it_ends(robot, tmp_path):
    session = Session(arrange({"arm": robot("planar_3r")}, rate=100.0, follow="circle"))
    run(session, 2.0)
    assert not session.at_rest
    run(session, 1.5, c.Pause(True))
    assert session.at_rest
    session.close()
    session = Session(arrange({"arm": robot("planar_3r")}, rate=100.0, record=str(tmp_path / "run.jsonl")))
    run(session, 2.0)
    assert not session.at_rest
    session.close()


def test_a_command_is_carried_out_before_the_next_tick_at_rest(robot, monkeypatch):
    monkeypatch.setattr("cinegen.session.runner.AT_REST", 1e-3)  # the next one would come after a quarter of an hour
    with SessionRunner(arrange({"arm": robot("planar_3r")}), own_process=False) as runner:
        assert becomes(lambda: runner.state is not None and runner.state.at_rest)
        q, answered = runner.state.robots["arm"].q, runner.state.answered
        runner.send(c.MoveJoint("arm", "joint1", 0.3))
        assert becomes(lambda: runner.state.answered > answered)
        assert becomes(lambda: np.abs(runner.state.robots["arm"].q - q).max() > 0.1)


@pytest.mark.parametrize("own_process", [False, True])
def test_who_waits_at_rest_is_woken_when_the_state_has_the_answer(robot, own_process):
    """To a command that moves nothing, and by the first state of a motion; once for many."""
    with SessionRunner(arrange({"arm": robot("planar_3r")}), own_process) as runner:
        for command in (c.LockJoint("arm", "joint2", True), c.MoveJoint("arm", "joint1", 0.3)):
            assert becomes(lambda: runner.state is not None and runner.state.at_rest)
            while runner.wait(0.0):
                pass
            answered = runner.state.answered
            runner.send(command)
            assert runner.wait(60.0)
            assert runner.state.answered > answered
        assert not runner.state.at_rest
        runner.wake()
        runner.wake()
        assert runner.wait(0.0)


def test_ticks_are_few_at_rest_and_time_goes_on(robot):
    with SessionRunner(arrange({"arm": robot("planar_3r")}), own_process=False) as runner:
        assert becomes(lambda: runner.state is not None and runner.state.at_rest)
        before, time_before, begin = runner.report(), runner.state.time, time.monotonic()
        assert becomes(lambda: runner.state.time - time_before > 0.5)
        after, passed = runner.report(), time.monotonic() - begin
        assert after.ticks - before.ticks <= AT_REST * passed + 1
        assert after.skipped == before.skipped
        assert after.pending == 0


def test_a_reading_of_a_sensor_wakes_the_session(robot):
    setup = arrange({"arm": robot("planar_3r")}, sensors=["tool=tcp://127.0.0.1:0?no-token"])
    with SessionRunner(setup, own_process=False) as runner:
        assert becomes(lambda: runner.state is not None and runner.state.at_rest)
        message = next(sensor.message for sensor in runner.state.sensors if sensor.id == "tool")
        port = int(re.search(r"on port (\d+)", message)[1])
        with socket.create_connection(("127.0.0.1", port)) as program:
            time.sleep(0.1)
            ticks_before = runner.report().ticks
            program.sendall(json.dumps({"twist": [-1, 0, 0, 0, 0, 0]}).encode() + b"\n")
            assert becomes(lambda: not runner.state.at_rest)
            assert becomes(lambda: runner.report().ticks - ticks_before > 100)


def test_an_obstacle_that_is_dragged_wakes_the_session(root):
    session = Session(scene_setup(load_scene(root / "robots/scenes/disc.toml"), rate=100.0))
    run(session, 1.5)
    assert session.at_rest
    name, obstacle = next((name, body) for name, body in session.obstacles.items() if body.mechanism.mobility)
    begin = obstacle.pose.translation
    session.obey(c.StartDrag(name, name, (0.0, 0.0, 0.0)))
    session.obey(c.MoveDrag(tuple(begin + np.array([0.05, 0.0, 0.0]))))
    session.tick()
    assert not session.at_rest
    assert np.linalg.norm(obstacle.pose.translation - begin) > 1e-4
