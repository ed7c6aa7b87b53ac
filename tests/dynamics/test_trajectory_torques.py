"""Torques along a trajectory: peaks, means and powers in closed form, and trajectories that are none."""

import numpy as np
import pytest

from cinegen.dynamics import InverseDynamics, Payload
from cinegen.dynamics.trajectory import torques_along
from cinegen.errors import ClosureError, ConfigurationError


@pytest.fixture(scope="module")
def swing(robot):
    """An arm that rotates stretched, by 1 - cos(t) rad: 2 kg at 0.9 m; times and configurations."""
    arm = robot("planar_3r")
    times = np.linspace(0.0, 2.0 * np.pi, 2001)
    q = np.zeros((len(times), 3))
    q[:, arm.q_index("joint1")] = 1.0 - np.cos(times)
    dynamics = InverseDynamics(arm, [Payload(arm.end, 2.0)], gravity=(0, 0, 0), massless=True)
    return dynamics, times, q


def test_a_swing_in_closed_form(swing):
    dynamics, times, q = swing
    found, inertia = torques_along(dynamics, times, q), 2.0 * 0.9**2
    assert found.torques[:, 0] == pytest.approx(inertia * np.cos(times), abs=1e-5)
    assert found.speeds[:, 0] == pytest.approx(np.sin(times), abs=1e-5)
    assert found.peak[0] == pytest.approx(inertia, rel=1e-5)
    assert found.rms[0] == pytest.approx(inertia / np.sqrt(2.0), rel=1e-3)
    assert found.peak_power[0] == pytest.approx(inertia / 2.0, rel=1e-5)
    assert found.peak_time[0] == pytest.approx(0.0, abs=1e-9) or found.peak_time[0] == pytest.approx(np.pi, abs=1e-2)
    assert len(found.not_held) == 0


def test_trajectories_that_are_none(swing, robot):
    dynamics, times, q = swing
    with pytest.raises(ConfigurationError, match="evenly spaced"):
        torques_along(dynamics, times**2, q)
    with pytest.raises(ConfigurationError, match="three times at least"):
        torques_along(dynamics, times[:2], q[:2])
    five_bar = robot("five_bar")
    still = np.tile(five_bar.q_home, (4, 1))
    held = InverseDynamics(five_bar, massless=True)
    assert torques_along(held, np.arange(4.0), still).peak == pytest.approx([0.0, 0.0])
    still[2, 0] += 0.1
    with pytest.raises(ClosureError, match=r"at 2 s loops are open by 0\.\d+"):
        torques_along(held, np.arange(4.0), still)
