"""The fastest motion along a recorded path within limits of torque: closed forms, and Pinocchio's dynamics."""

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
from cinegen.dynamics.trajectory import torques_along
from cinegen.errors import CinegenError, UnknownNameError
from cinegen.mission import Recording, resampled
from cinegen.planning.torque_limits import TorqueLimits

MASS, FORCE, GRAVITY = 2.0, 30.0, 9.81
NEVER = 1e4  # a limit of acceleration that is not reached


@pytest.fixture
def slid(tmp_path: Path):
    """`slid("0 0 1", 30.0)`: a cart on a rail, and a recording in which it moves by 1 m."""

    def make(axis: str, effort: float = FORCE, friction: str = "") -> tuple[cinegen.Mechanism, Recording]:
        path = tmp_path / "slider.urdf"
        path.write_text(f"""<robot name="slider"><link name="rail"/>
          <link name="cart"><inertial><mass value="{MASS}"/>
            <inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
          <joint name="x" type="prismatic"><parent link="rail"/><child link="cart"/><axis xyz="{axis}"/>
            <limit lower="-5" upper="5" effort="{effort}" velocity="100"/>{friction}</joint></robot>""")
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


@pytest.mark.parametrize(("damping", "dry"), [(0.0, 6.0), (12.0, 0.0), (40.0, 6.0)])
def test_a_cart_with_friction_moves_as_fast_as_its_equation_has_it(slid, damping, dry):
    """Full force until it must brake, and then full force back: m a = F - d v - f, and m a = -F - d v - f."""
    mechanism, recording = slid("1 0 0", friction=f'<dynamics damping="{damping}" friction="{dry}"/>')
    torques = TorqueLimits(mechanism)
    motion = resampled(recording, rate=1000.0, speed=math.inf, acceleration=NEVER, torques=lambda _: torques)
    rate = 1e6
    distance, speed, back, braking = 0.0, 0.0, 0.0, 0
    speeds = [0.0]
    while speeds[-1] < FORCE and len(speeds) < 10 * rate:  # Euler: forwards from the beginning ...
        speeds.append(speeds[-1] + (FORCE - dry - damping * speeds[-1]) / MASS / rate)
        distance += speeds[-1] / rate
        while back < speeds[-1]:  # ... and backwards from the end, always at the same speed
            back += (FORCE + dry + damping * back) / MASS / rate
            speed += back / rate
            braking += 1
        if distance + speed >= 1.0:
            break
    wanted = (len(speeds) + braking) / rate
    assert wanted - 0.002 <= motion.seconds <= 1.03 * wanted + 0.003
    v, a = np.gradient(motion.q[:, 0], 1e-3), np.diff(np.pad(motion.q[:, 0], 1, mode="edge"), 2) * 1e6
    forces = MASS * a + damping * v + dry * np.sign(v)
    assert np.abs(forces).max() <= FORCE * 1.001
    assert np.median(np.abs(forces)) > 0.95 * FORCE


def test_friction_of_passive_joints_slows_a_closed_mechanism(tmp_path):
    """Torques along the samples, computed by inverse dynamics with friction, keep the limits; without they are far."""
    text = """<mujoco><option><flag gravity="disable"/></option><worldbody>
      <body name="left"><joint name="drive" axis="0 0 1" range="-200 200"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
        <body name="coupler" pos="1 0 0"><joint name="pin" axis="0 0 1" damping="3"/>
          <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body>
      <body name="right" pos="0 2 0"><joint name="swing" axis="0 0 1" damping="1" frictionloss="2"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
      <equality><connect name="far" body1="coupler" body2="right" anchor="0 2 0"/></equality>
      <actuator><motor joint="drive" ctrlrange="-10 10" ctrllimited="true"/></actuator></mujoco>"""
    path = tmp_path / "parallelogram.xml"
    path.write_text(text)
    mechanism = cinegen.load(path)
    assert mechanism.limits["drive"].effort == 10.0
    turned = mechanism.q_home.copy()
    turned[mechanism.q_index("drive")] += 1.5
    turned = mechanism.close(turned, ["drive"])
    recording = record(tmp_path / "run.jsonl", mechanism, [0.0, 9.0], [mechanism.q_home, turned])
    torques = TorqueLimits(mechanism)
    motion = resampled(recording, rate=500.0, speed=math.inf, acceleration=NEVER, torques=lambda _: torques)
    found = torques_along(cinegen.InverseDynamics(mechanism), motion.times, motion.q)
    assert 9.0 < found.peak[0] <= 10.0
    assert motion.used == pytest.approx(found.peak / 10.0, rel=1e-6)
    smooth = torques_along(cinegen.InverseDynamics(mechanism, friction=False), motion.times, motion.q)
    assert smooth.peak[0] > 10.0  # friction helps to brake


def test_what_torques_leave_out_is_in_the_report(slid):
    mechanism, _ = slid("1 0 0", friction='<dynamics damping="1" spring_stiffness="3"/>')
    assert TorqueLimits(mechanism).notes == ("forces leave out the springs of x",)
    crossing = TorqueLimits(mechanism, crosses=True).notes
    assert crossing[0] == "forces leave out the springs of x"
    assert "leave out the friction of joints" in crossing[1]
