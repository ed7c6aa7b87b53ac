"""A session that runs at its rate: how it is scheduled."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cinegen.session import Loop, arrange


@pytest.mark.parametrize(("priority", "scheduling"), [(0, "ordinary scheduling"), (7, "SCHED_FIFO 7")])
def test_a_session_has_the_priority_that_its_setup_asks_for(robot, monkeypatch, priority, scheduling):
    monkeypatch.setattr("os.sched_setscheduler", lambda *_: None)
    setup = replace(arrange({"arm": robot("planar_3r")}), priority=priority)
    with Loop(setup, own_process=False) as loop:
        while loop.state is None:
            pass
    assert loop.report().scheduling == scheduling
