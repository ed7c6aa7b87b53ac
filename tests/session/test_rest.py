"""A session at rest: few ticks, which cost next to nothing, until something is to be done."""

import json
import re
import socket
import time

import numpy as np
import pytest
from browsers import becomes
from leading import run
from variants import FEWER

from cinegen.collision import load_scene
from cinegen.session import Session, SessionRunner, arrange, scene_setup
from cinegen.session import commands as c
from cinegen.session.runner import AT_REST


@pytest.mark.parametrize("name", sorted(FEWER))
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
    session.obey(c.SetRecording(False))
    run(session, 1.5)
    assert session.at_rest


def test_a_script_or_a_recording_is_not_at_rest_until_the_session_is_paused_or_it_ends(robot, tmp_path):
    session = Session(arrange({"arm": robot("planar_3r")}, rate=100.0, follow="circle"))
    run(session, 2.0)
    assert not session.at_rest
    session.obey(c.Pause(True))
    run(session, 1.5)
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
    with SessionRunner(arrange({"arm": robot("planar_3r")})) as runner:
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
