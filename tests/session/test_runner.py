"""A session that runs at its rate: how it is scheduled."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cinegen.session import Session, SessionRunner, arrange


@pytest.mark.parametrize(("priority", "scheduling"), [(0, "ordinary scheduling"), (7, "SCHED_FIFO 7")])
def test_a_session_has_the_priority_that_its_setup_asks_for(robot, monkeypatch, priority, scheduling):
    monkeypatch.setattr("os.sched_setscheduler", lambda *_: None)
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
