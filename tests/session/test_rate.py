"""The rate of a session whose kernels are compiled while it runs."""

from __future__ import annotations

import time

import numpy as np
import pytest

from cinegen.jit.starting import COMPILATION
from cinegen.session import Session, SessionRunner, arrange
from cinegen.session import commands as c
from cinegen.session.runner import INTERPRETED_RATE, _next_period

pytestmark = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")


def becomes(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def test_a_session_has_its_rate_as_soon_as_its_kernels_are_compiled(robot, monkeypatch):
    monkeypatch.setattr(COMPILATION, "_waiting", [object()])
    setup = arrange({"arm": robot("planar_3r")}, follow="circle", rate=500.0)
    with SessionRunner(setup, own_process=False) as runner:
        assert becomes(lambda: runner.report().period == 1.0 / INTERPRETED_RATE)
        time.sleep(0.5)
        assert runner.report().period == 1.0 / INTERPRETED_RATE
        before, begin = runner.state.time, time.monotonic()
        COMPILATION._waiting.clear()
        assert becomes(lambda: runner.report().period == 1.0 / 500.0)
        assert time.monotonic() - begin > 0.3  # not at once
        assert becomes(lambda: runner.state.time > before + 1.0)


def test_a_rate_below_that_of_interpreted_kernels_is_kept(monkeypatch):
    assert _next_period(20.0, 1.0 / 20.0) == 1.0 / 20.0
    monkeypatch.setattr(COMPILATION, "_waiting", [object()])
    assert _next_period(20.0, 1.0 / 20.0) == 1.0 / 20.0


@pytest.mark.parametrize("name", ["planar_3r", "delta4"])
def test_velocities_do_not_jump_when_the_rate_changes(robot, name):
    """A drag at a constant speed. If the rate changed at once, the speed would be twice as high for a while."""
    session = Session(arrange({name: robot(name)}))
    session.dt, end = 1.0 / INTERPRETED_RATE, robot(name).end
    begin = here = session.robots[name].placement(end).translation
    speed, speeds = 0.02 * robot(name).length, []
    session.obey(c.StartDrag(name, end, (0.0, 0.0, 0.0)))
    while session.time < 3.0:
        aside = [-speed * session.time, 0.0, 0.0]
        session.obey(c.MoveDrag(tuple(begin + aside)))
        session.tick()
        there = session.robots[name].placement(end).translation
        if session.time > 0.5:
            speeds.append(float(np.linalg.norm(there - here)) / session.dt)
        here = there
        if session.time > 1.0:
            session.dt = _next_period(1000.0, session.dt)
    assert session.dt == 1e-3
    assert np.array(speeds) == pytest.approx(speed, rel=0.035)
    session.close()
