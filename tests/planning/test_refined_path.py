"""Paths with more configurations between those that they have."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin
from hypothesis import given, settings
from hypothesis import strategies as st

from cinegen.planning.planner import refined


@settings(max_examples=20)
@given(name=st.sampled_from(["planar_3r", "arm7", "delta4"]), seed=st.integers(0, 1000), step=st.floats(0.01, 0.5))
def test_no_step_is_longer_and_nothing_is_lost(robot, name, seed, step):
    mechanism = robot(name)
    # little ways about home: loops can be closed all along
    ends = mechanism.random_closed(1, seed)[0]
    way = 0.1 * pin.difference(mechanism.model, mechanism.q_home, ends) / np.linalg.norm(ends)
    other = mechanism.close(pin.integrate(mechanism.model, mechanism.q_home, way))
    path = np.array([mechanism.q_home, other, mechanism.q_home])
    found = refined(mechanism, path, step)
    for q in path:
        assert (found == q).all(axis=1).any()
    assert (found[0] == path[0]).all()
    assert (found[-1] == path[-1]).all()
    steps = [np.abs(pin.difference(mechanism.model, a, b) / mechanism.scale).max() for a, b in pairwise(found)]
    slack = 1.2 if mechanism.is_constrained else 1.0 + 1e-9  # loops bend the way
    assert max(steps) <= slack * step
    assert max(map(mechanism.closure, found)) < 1e-9
