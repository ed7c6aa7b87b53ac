"""The fastest motion along a recorded path within limits of torque: closed forms, and Pinocchio's dynamics."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import scipy.linalg
from random_masses import free_motions, massive
from recorded import record, swung

import cinegen
from cinegen.dynamics import Payload
from cinegen.dynamics.errors import MassError
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.mission import Recording, resampled
from cinegen.planning.torque_limits import TorqueLimits

MASS, FORCE, GRAVITY = 2.0, 30.0, 9.81
NEVER = 1e4  # a limit of acceleration that is not reached


@pytest.fixture
def slid(tmp_path: Path):
    """`slid("0 0 1", 30.0)`: a cart on a rail, and a recording in which it moves by 1 m."""

    def make(axis: str, effort: float = FORCE) -> tuple[cinegen.Mechanism, Recording]:
        path = tmp_path / "slider.urdf"
        path.write_text(f"""<robot name="slider"><link name="rail"/>
          <link name="cart"><inertial><mass value="{MASS}"/>
            <inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
          <joint name="x" type="prismatic"><parent link="rail"/><child link="cart"/><axis xyz="{axis}"/>
            <limit lower="-5" upper="5" effort="{effort}" velocity="100"/></joint></robot>""")
        mechanism = cinegen.load(path)
        return mechanism, record(tmp_path / "run.jsonl", mechanism, [0.0, 9.0], [[0.0], [1.0]])

    return make


def shortest(up: float, down: float, distance: float = 1.0) -> float:
    """The time from rest to rest with limits of acceleration and deceleration."""
    speed = math.sqrt(2.0 * distance * up * down / (up + down))
    return speed / up + speed / down


@pytest.mark.parametrize(("axis", "pull", "load"), [("1 0 0", 0.0, 0.0), ("0 0 1", GRAVITY, 0.5)])
def test_a_mass_on_a_rail_moves_as_fast_as_the_textbook_has_it(slid, axis, pull, load):
    mechanism, recording = slid(axis)
    torques = TorqueLimits(mechanism, [Payload("cart", load)])
    motion = resampled(recording, rate=1000.0, speed=math.inf, acceleration=NEVER, torques=lambda _: torques)
    strength = FORCE / (MASS + load)
    wanted = shortest(strength - pull, strength + pull)
    assert wanted <= motion.seconds <= 1.02 * wanted + 0.002
    forces = (MASS + load) * (np.diff(np.pad(motion.q[:, 0], 1, mode="edge"), 2) * 1e6 + pull)
    assert np.abs(forces).max() <= FORCE
    assert np.median(np.abs(forces)) > 0.97 * FORCE  # one limit or the other is reached nearly always


def test_what_cannot_be_held_is_refused(slid):
    _, recording = slid("0 0 1", 10.0)
    with pytest.raises(CinegenError, match=r"x needs 19\.62 N to hold the mechanism at rest .* its limit is 10 N"):
        resampled(recording, torques=TorqueLimits)
    assert resampled(recording, torques=partial(TorqueLimits, efforts={"x": 20.0})).seconds >= 9.0


def required(mechanism: cinegen.Mechanism, q: np.ndarray, rate: float) -> np.ndarray:
    """The torques (n - 2, actuated) of actuated joints at inner samples, by Pinocchio and finite differences of all
    joints."""
    data, columns = mechanism.model.createData(), [mechanism.v_index(name) for name in mechanism.actuated]
    found = []
    for before, now, after in zip(q[:-2], q[1:-1], q[2:], strict=True):
        ahead, behind = mechanism.difference(now, after), mechanism.difference(now, before)
        v, a = 0.5 * rate * (ahead - behind), rate**2 * (ahead + behind)
        free = free_motions(mechanism, now)
        tree = pin.rnea(mechanism.model, data, now, v, a)
        found.append(scipy.linalg.lstsq(free[columns].T, free.T @ tree)[0])
    return np.array(found)


@pytest.mark.parametrize("name", ["planar_3r", "delta4"])
def test_robots_move_as_fast_as_their_torques_allow(robot, tmp_path, name):
    mechanism = massive(robot(name))
    recording = record(tmp_path / "run.jsonl", mechanism, *swung(mechanism, 1.0, 25.0), name=name)
    q, rate = recording.q[name], 400.0
    hold = np.abs(required(mechanism, q, 0.0)).max(axis=0)
    efforts = dict(zip(mechanism.actuated, (1.5 * hold + 3.0).tolist(), strict=True))
    torques = TorqueLimits(mechanism, efforts=efforts)
    motion = resampled(recording, rate=rate, speed=math.inf, acceleration=NEVER, torques=lambda _: torques)
    used = np.abs(required(mechanism, motion.q, rate)) / list(efforts.values())
    assert used.max() <= 1.0 + 1e-3
    assert np.median(used.max(axis=1)) > 0.75  # one of them is near its limit most of the time
    slower = resampled(recording, rate=rate, speed=math.inf, acceleration=0.05, torques=lambda _: torques)
    assert slower.seconds > motion.seconds


def test_limits_that_are_missing_or_wrong(robot, slid):
    massless, heavy = robot("planar_3r"), robot("delta4")
    with pytest.raises(MassError, match="have no mass"):
        TorqueLimits(massless, efforts=10.0)
    with pytest.raises(CinegenError, match=r"no actuated joint has a limit of torque or force: .* \('effort'\)"):
        TorqueLimits(heavy)
    with pytest.raises(CinegenError, match="of joint6 must be positive, not 0"):
        TorqueLimits(heavy, efforts={"joint1": 3.0, "joint6": 0.0})
    with pytest.raises(UnknownNameError, match="joint2"):
        TorqueLimits(heavy, efforts={"joint2": 3.0})
    assert TorqueLimits(heavy, efforts={"joint6": 3.0}).joints == ("joint6",)
