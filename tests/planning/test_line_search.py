"""The line search of the descent."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cinegen.planning.descent import line_search


@given(st.floats(0.1, 10.0), st.floats(-10.0, -0.1), st.floats(1.05, 50.0))
def test_the_search_finds_the_minimum_of_a_parabola(bend, slope, times):
    lowest = -slope / bend
    step = line_search(lambda t: slope * t + 0.5 * bend * t * t, slope, times * lowest)
    assert step == pytest.approx(lowest, rel=2e-4)


def test_the_search_goes_as_far_as_it_may_where_all_falls():
    assert line_search(lambda t: -t, -1.0, 0.3) == 0.3


def test_the_search_stays_out_of_where_nothing_is_defined():
    for wall in (math.inf, math.nan):
        step = line_search(lambda t, wall=wall: wall if t >= 0.2 else -t, -1.0, 1.0)
        assert 0.0 < step < 0.2


@pytest.mark.parametrize("slope", [0.0, 1.0, math.nan])
def test_uphill_there_is_no_step(slope):
    assert line_search(lambda t: slope * t, slope, 1.0) == 0.0


def test_no_step_leads_down_where_the_slope_lies():
    assert line_search(lambda t: abs(t), -1.0, 1.0) == 0.0
