"""Where robots start that follow a path: not in a singularity."""

from __future__ import annotations

import sysconfig
from pathlib import Path

import numpy as np
import pytest

from cinegen import load
from cinegen.devices import fit_path
from cinegen.session import Session, arrange
from cinegen.session.regular_start import _singular_values, regular_start

DATA = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/share/example-robot-data/robots"
UR5 = DATA / "ur_description/urdf/ur5_robot.urdf"


@pytest.fixture(scope="module")
def ur5():
    return load(UR5)


@pytest.mark.parametrize("name", ["rx90", "planar_3r", "arm7", "delta4", "gough", "four_bar", "two_arms"])
def test_robots_that_are_regular_at_home_or_have_loops_start_there(robot, name):
    mechanism = robot(name)
    assert regular_start(mechanism) is mechanism.q_home


def test_a_stretched_arm_starts_bent_and_follows_a_large_circle(ur5):
    assert _singular_values(ur5, ur5.q_home)[-1] < 0.01
    q = regular_start(ur5)
    assert _singular_values(ur5, q)[-1] > 0.2
    assert ((ur5.limits.lower <= q) & (q <= ur5.limits.upper)).all()
    assert fit_path(ur5, ur5.end, q=q).size > 5.0 * fit_path(ur5, ur5.end).size
    assert fit_path(ur5, ur5.end, q=q).size > 0.1  # m


def test_a_session_begins_there_and_home_is_there(ur5):
    setup = arrange({"ur5": ur5}, follow="circle")
    session = Session(setup)
    np.testing.assert_array_equal(session.robots["ur5"].q, setup.start("ur5"))
    assert not np.array_equal(setup.start("ur5"), ur5.q_home)
    session.close()


def test_without_a_path_robots_start_at_home(ur5):
    np.testing.assert_array_equal(arrange({"ur5": ur5}).start("ur5"), ur5.q_home)
