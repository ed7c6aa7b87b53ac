"""The trace of a undo step: which configurations are kept, however long it lasts."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from cinegen.session.undo import MotionTrace

PERIOD = 0.02


@pytest.mark.parametrize("count", [1, 2, 600, 601, 602, 603, 1201, 1202, 1203, 5000])
def test_a_trace_of_any_length_begins_at_the_beginning_and_is_evenly_sampled(count):
    """The robot's one coordinate is the time since the undo step began, so that the trace says when each was taken."""
    robot, trace = SimpleNamespace(q=np.zeros(1)), MotionTrace(PERIOD)
    for tick in range(count):
        robot.q = np.array([tick * PERIOD])
        trace.note({"robot": robot})
    times = np.concatenate(trace.configurations["robot"])
    assert times == pytest.approx(trace.period * np.arange(len(times)), abs=1e-9)
    assert 0.0 <= robot.q[0] - times[-1] < trace.period - 1e-9
    assert min(count, 300) <= len(times) <= 600
