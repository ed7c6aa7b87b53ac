"""Rotors and friction in torques: closed forms, and MuJoCo's inverse dynamics."""

import json

import mujoco
import numpy as np
import pytest
import scipy.linalg
from small_robots import parallelogram

import cinegen
from cinegen.dynamics import InverseDynamics, Payload
from cinegen.dynamics.node_wrench import node_wrench

MASS, ARM, DAMPING, DRY, ROTOR, G = 2.0, 0.4, 0.3, 0.7, 0.05, 9.81
PENDULUM = f"""<mujoco><worldbody><body name="rod">
  <joint name="pin" axis="0 1 0" damping="{DAMPING}" frictionloss="{DRY}" armature="{ROTOR}"/>
  <inertial pos="{ARM} 0 0" mass="{MASS}" diaginertia="1e-6 1e-6 1e-6"/></body></worldbody></mujoco>"""


def pendulum_torque(q: float, v: float, a: float) -> float:
    """Return the torque of a rod that hangs at q = 90 degrees, from textbooks."""
    return (MASS * ARM**2 + 1e-6 + ROTOR) * a - MASS * G * ARM * np.cos(q) + DAMPING * v + DRY * np.sign(v)


def test_a_pendulum_needs_what_textbooks_have():
    dynamics = InverseDynamics(cinegen.load(PENDULUM))
    for q, v, a in [(0.3, 1.2, -2.0), (-1.0, -0.4, 3.0), (2.0, 1e-6, 0.0), (2.0, 0.0, 5.0), (0.7, -1e-300, 0.0)]:
        expected = pendulum_torque(q, v, a)
        assert dynamics.torques([q], [v], [a]) == pytest.approx([expected], rel=1e-12)
        assert dynamics.torques_of([[q]], [[v]], [[a]])[0] == pytest.approx([expected], rel=1e-12)
        assert dynamics.balance(*np.array([[q], [v], [a]])).efforts[0] == pytest.approx(expected, rel=1e-12)
    smooth = InverseDynamics(cinegen.load(PENDULUM), friction=False).torques([0.3], [1.2], [-2.0])
    assert smooth == pytest.approx([pendulum_torque(0.3, 1.2, -2.0) - DAMPING * 1.2 - DRY], rel=1e-12)


def test_at_rest_coulomb_friction_is_a_band(text_file, typed):
    mechanism = cinegen.load(PENDULUM)
    still, moving = (cinegen.forces(mechanism, [0.3], [v], [0.0]) for v in (0.0, 0.1))
    assert still.torques == pytest.approx([pendulum_torque(0.3, 0.0, 0.0)])
    assert (still.resting, still.band.tolist()) == (("pin",), [DRY])
    assert "pin is at rest: its Coulomb friction is undetermined and left out" in still.message
    assert (moving.resting, moving.band.tolist()) == ((), [0.0])
    assert "rest" not in moving.message
    path = text_file("pendulum.xml", PENDULUM)
    assert f"{-MASS * G * ARM:.4g} ± 0.7 N m" in typed("forces", path).out
    report = json.loads(typed("forces", path, "--json").out)
    assert (report["resting"], report["torques"][0]["band"], report["notes"]) == (["pin"], DRY, [])


SMOOTH = """<mujoco><worldbody>
  <body name="crank"><joint name="drive" axis="0 1 0" armature="0.3" damping="0.5"/>
    <inertial pos="0.1 0.02 0" mass="1.2" diaginertia="0.01 0.02 0.01"/>
    <body name="coupler" pos="0.2 0 0"><joint name="pin" axis="0 1 0" armature="0.05" damping="0.4"/>
      <inertial pos="0.25 0 0.1" mass="0.8" diaginertia="0.01 0.02 0.015"/></body></body>
  <body name="rocker" pos="0.6 0 0"><joint name="swing" axis="0 1 0" armature="0.2" damping="0.6"/>
    <inertial pos="0 0 0.2" mass="0.9" diaginertia="0.01 0.02 0.01"/></body></worldbody>
  <equality><connect name="far" body1="coupler" body2="rocker" anchor="0.4 0 0.4"/></equality>
  <actuator><motor joint="drive"/></actuator></mujoco>"""


def mujoco_motions(model: mujoco.MjModel, q: np.ndarray) -> np.ndarray:
    """Return MuJoCo's own basis (nv, k) of the motions that keep its equalities."""
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    rows = data.efc_J.reshape(data.nefc, model.nv)
    return scipy.linalg.null_space(rows[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY], rcond=1e-9)


def tree_torques(model: mujoco.MjModel, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return MuJoCo's torques (nv,) of the tree, damping and armature included, loops open."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY
    mujoco.mj_inverse(model, data)
    return np.array(data.qfrc_inverse)


def test_passive_joints_resist_through_the_loops_as_in_mujoco():
    """d'Alembert's principle with MuJoCo's Jacobian of the loop, and its torques of the tree."""
    mechanism = cinegen.load(SMOOTH)
    dynamics, rng = InverseDynamics(mechanism), np.random.default_rng(3)
    order = [mechanism.v_index(name) for name in ("drive", "pin", "swing")]  # MuJoCo's
    for crank in (0.1, -0.3, 0.4):
        q = mechanism.q_home.copy()
        q[mechanism.q_index("drive")] = crank
        q = mechanism.close(q, ["drive"])
        speed, growth = rng.normal(size=2)
        v, a = dynamics.motion(q, {"drive": speed}, {"drive": growth})
        model = mujoco.MjModel.from_xml_string(SMOOTH)
        motions = mujoco_motions(model, q[order])
        assert motions.shape[1] == 1
        needed = tree_torques(model, q[order], v[order], a[order])
        expected = motions[:, 0] @ needed / motions[0, 0]
        for torque in (
            dynamics.torques(q, {"drive": speed}, {"drive": growth})[0],
            dynamics.torques_of(q[None], v[None], a[None])[0, 0],
            cinegen.forces(mechanism, q, v, a).torques[0],
        ):
            assert torque == pytest.approx(expected, rel=1e-7)
        smooth = InverseDynamics(mechanism, friction=False).torques(q, v, a)[0]
        assert abs(torque - smooth) > 0.05 * abs(speed)  # else friction would hardly be tested


def rubbed(**friction: float) -> str:
    """Joints with viscous friction, and some with Coulomb friction."""
    return parallelogram(**{
        joint: f'damping="0.2" frictionloss="{friction.get(joint, 0.0)}"' for joint in ("drive", "pin", "swing")
    })  # fmt: skip


@pytest.mark.parametrize("speed", [0.7, -2.0])
def test_coulomb_friction_of_passive_joints_is_seen_at_the_actuated_one(speed):
    mechanism = cinegen.load(rubbed(drive=1.0, pin=0.5, swing=0.25))
    result = cinegen.forces(mechanism, mechanism.q_home, {"drive": speed}, {"drive": 0.0})
    assert result.torques == pytest.approx([3 * 0.2 * speed + 1.75 * np.sign(speed)], rel=1e-6)
    assert result.power == pytest.approx(3 * 0.2 * speed**2 + 1.75 * abs(speed), rel=1e-6)
    assert result.reaction("swing").moment[2] == pytest.approx(-0.2 * speed - 0.25 * np.sign(speed), rel=1e-6)
    assert result.reaction("far").moment[2] == pytest.approx(0.0, abs=1e-9)
    still = cinegen.forces(mechanism, mechanism.q_home)
    assert (still.resting, still.band) == (("drive", "pin", "swing"), pytest.approx([1.75]))
    assert still.torques == pytest.approx([0.0], abs=1e-9)


def test_the_reaction_of_one_joint_along_a_motion_is_that_of_forces():
    mechanism = cinegen.load(rubbed(drive=1.0, pin=0.5, swing=0.25))
    q, rates = mechanism.q_home[None], np.array([[0.7]])
    dynamics = InverseDynamics(mechanism)
    for name in ("pin", "swing"):
        wrench = dynamics.reactions_of(name, q, rates, 0.0 * rates, actuated=True)[0]
        wanted = cinegen.forces(mechanism, q[0], {"drive": 0.7}, {"drive": 0.0}).reaction(name).wrench
        known = np.isfinite(wanted)
        assert wrench[known] == pytest.approx(wanted[known], abs=1e-9)


def test_a_joint_that_only_rounding_moves_is_at_rest():
    """A crank in its dead centre moves its slider by rounding errors: these have a sign, but friction has none."""
    text = """<mujoco><option><flag gravity="disable"/></option><worldbody>
      <body name="crank"><joint name="drive" axis="0 1 0" frictionloss="1"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
        <body name="rod" pos="0.2 0 0"><joint name="pin" axis="0 1 0"/>
          <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body>
      <body name="piston" pos="0.7 0 0"><joint name="slide" type="slide" axis="1 0 0" frictionloss="100"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
      <equality><connect name="far" body1="rod" body2="piston" anchor="0.5 0 0"/></equality>
      <actuator><motor joint="drive"/></actuator></mujoco>"""
    mechanism = cinegen.load(text)
    result = cinegen.forces(mechanism, mechanism.q_home, {"drive": 1.0}, {"drive": 0.0})
    assert "slide" in result.resting
    assert "drive" not in result.resting
    assert result.band == pytest.approx([0.0], abs=1e-6)  # in a dead centre the slider's friction has no lever
    dynamics = InverseDynamics(mechanism)
    many = dynamics.torques_of(mechanism.q_home[None], [[1.0]], [[0.0]], actuated=True)
    assert many[0] == pytest.approx(result.torques, abs=1e-9)


def test_a_wrench_of_a_moving_node_is_what_friction_leaves():
    mechanism = cinegen.load(PENDULUM)
    push = Payload("rod", wrench=(0.0, 0.0, 0.0, 0.0, 3.0, 0.0))
    torques = InverseDynamics(mechanism, [push]).torques([0.3], [1.0], [0.0])
    exerted = node_wrench(InverseDynamics(mechanism), [0.3], torques, "rod", [1.0], [0.0])
    assert exerted.imbalance == pytest.approx(0.0, abs=1e-12)
    assert exerted.wrench[4] == pytest.approx(-3.0)


def test_new_loads_keep_the_friction():
    for counts in (True, False):
        dynamics = InverseDynamics(cinegen.load(PENDULUM), friction=counts)
        before = dynamics.torques([0.3], [1.0], [0.0])
        dynamics.set_loads([Payload("rod", 1.0)])
        dynamics.set_loads()
        assert dynamics.torques([0.3], [1.0], [0.0]) == pytest.approx(before)
