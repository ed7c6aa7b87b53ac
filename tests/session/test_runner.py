"""A session that runs at its rate: how it is scheduled."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from variants import slow

from cinegen.errors import CinegenError
from cinegen.session import Session, SessionRunner, arrange


@pytest.mark.parametrize(("priority", "scheduling"), [(0, "ordinary scheduling"), (7, "SCHED_FIFO 7")])
def test_a_session_has_the_priority_that_its_setup_asks_for(robot, monkeypatch, priority, scheduling):
    monkeypatch.setattr("os.sched_setscheduler", lambda *_: None)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr("cinegen.realtime.scheduling._RESERVED", f"\0cinegen test {os.getpid()} ")
    setup = replace(arrange({"arm": robot("planar_3r")}), priority=priority)
    with SessionRunner(setup, own_process=False) as runner:
        while runner.state is None:
            pass
    assert runner.report().scheduling == scheduling


def test_what_ended_a_session_is_raised_also_where_the_system_says_so(robot, monkeypatch):
    """An OSError of the session is none of the pipe to it."""

    def broken(self):
        raise OSError("in a tick")

    monkeypatch.setattr(Session, "tick", broken)
    runner = SessionRunner(arrange({"arm": robot("planar_3r")}), own_process=False)
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
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if mark.encode() in (folder / "environ").read_bytes() and "Z" not in (folder / "stat").read_text().split():
                found.append(int(folder.name))
    return found


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="processes are looked for in /proc")
@pytest.mark.parametrize(
    ("end", "delay"),
    [
        (signal.SIGKILL, None),
        (signal.SIGINT, 0.1),
        *slow((signal.SIGKILL, 0.02), (signal.SIGKILL, 0.4), (signal.SIGINT, 1.0)),
    ],
)
def test_the_process_of_a_session_ends_with_its_parent_at_any_moment(tmp_path, end, delay):
    program, mark = tmp_path / "program.py", f"MARK={os.getpid()} {time.time()}"
    program.write_text(START)
    parent = subprocess.Popen(
        [sys.executable, program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env={**os.environ, "MARK": mark.removeprefix("MARK=")},
    )  # fmt: skip
    assert parent.stdout.readline() == "begin\n"
    if delay is None:
        assert parent.stdout.readline() == "runs\n"
    else:
        time.sleep(delay)
    os.killpg(parent.pid, end) if end == signal.SIGINT else parent.kill()
    _, output = parent.communicate(timeout=120)  # its children hold the stream until they end
    last = time.monotonic() + 60.0
    while (left := _of_family(mark)) and time.monotonic() < last:
        time.sleep(0.1)
    assert left == []
    # Python prints this in a process whose parent ends before it has sent the process what to run.
    too_early = output.count("EOFError: Ran out of input")
    assert too_early <= (delay is not None and delay <= 0.1)
    assert output.count("Traceback") == (end == signal.SIGINT) + too_early  # of this program itself
    assert "cinegen" not in output or end == signal.SIGINT
