"""A session that runs at its rate: how it is scheduled, and while its kernels are compiled."""

import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial

import browsers
import numpy as np
import psutil
import pytest

from cinegen.errors import CinegenError
from cinegen.jit.starting import COMPILATION
from cinegen.session import Session, SessionRunner, arrange
from cinegen.session import commands as c
from cinegen.session.runner import INTERPRETED_RATE, _next_period


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
